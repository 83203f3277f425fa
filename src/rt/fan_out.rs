//! The one way from a stage to several readers.

use super::link::{Closed, Copied, PartOf, Sender};
use super::stage::Outlet;

/// Outlet of a stage with any number of readers. The next stage of the chain, if there is one, gets the
/// buffer that was filled; every other reader, an *end*, gets a copy in a buffer of its own link, and the
/// kind of its link decides what happens when it is full: a reader that has stopped blocks nobody behind a
/// `latest` or `lossy` link.
///
/// An end that has gone gets no more items. When the next stage has gone, or no reader is left, the outlet is
/// closed.
pub struct FanOut<T> {
    next: Option<Sender<T>>,
    /// The buffer that is filled where there is no next stage.
    own: Option<T>,
    ends: Vec<End<T>>,
}

struct End<T> {
    items: Box<dyn Copies<T>>,
    every: Every,
}

/// The link to an end, for whatever part of the items it carries.
trait Copies<T>: Send {
    fn send_copy(&mut self, item: &T) -> Result<(), Closed>;
}

impl<T: Copied, P: PartOf<T>> Copies<T> for Sender<P> {
    fn send_copy(&mut self, item: &T) -> Result<(), Closed> {
        Self::send_copy(self, item)
    }
}

impl<T: Copied> FanOut<T> {
    /// No readers yet; `buffer` is filled where no next stage brings buffers of its own.
    pub fn new(buffer: T) -> Self {
        Self { next: None, own: Some(buffer), ends: Vec::new() }
    }

    /// Buffers come from `next` and go there.
    pub fn set_next(&mut self, next: Sender<T>) {
        self.next = Some(next);
    }

    /// Copies of the first item in every block of `every` sequence numbers, or of a part of it, go to
    /// `items`.
    pub fn add<P: PartOf<T> + 'static>(&mut self, items: Sender<P>, every: u64) {
        self.ends.push(End { items: Box::new(items), every: Every::new(every) });
    }
}

impl<T: Copied> Outlet for FanOut<T> {
    type Item = T;

    fn take(&mut self) -> Result<T, Closed> {
        match &mut self.next {
            Some(next) => next.take(),
            None => self.own.take().ok_or(Closed),
        }
    }

    fn send(&mut self, item: T) -> Result<(), Closed> {
        self.ends.retain_mut(|end| !end.every.is_due(item.sequence()) || end.items.send_copy(&item).is_ok());
        match &mut self.next {
            Some(next) => next.send(item),
            None if self.ends.is_empty() => Err(Closed),
            None => {
                self.own = Some(item);
                Ok(())
            }
        }
    }
}

/// Finds the first item of every block of `count` sequence numbers. It does not look for the multiples
/// themselves: where one was lost, the next item takes its place.
#[derive(Clone, Debug)]
pub struct Every {
    count: u64,
    last_block: Option<u64>,
}

impl Every {
    /// One item in `count` sequence numbers; at least 1, which is all of them.
    pub fn new(count: u64) -> Self {
        Self { count: count.max(1), last_block: None }
    }

    /// Whether the item of this sequence number is the first of its block; an item without a number is due
    /// only where all items are.
    pub fn is_due(&mut self, sequence: Option<u64>) -> bool {
        if self.count == 1 {
            return true;
        }
        let block = sequence.map(|sequence| sequence / self.count);
        let is_due = block.is_some() && self.last_block != block;
        self.last_block = block.or(self.last_block);
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::super::link::{Item, Receiver, bounded, latest, lossy};
    use super::super::{Counter, Shutdown};
    use super::*;

    #[derive(Debug, Default)]
    struct Numbered(u64);

    impl Item for Numbered {
        fn lost_before(&self) -> u64 {
            0
        }

        fn lose(&mut self, _: u64) {}
    }

    impl Copied for Numbered {
        fn copy_from(&mut self, other: &Self) {
            self.0 = other.0;
        }

        fn sequence(&self) -> Option<u64> {
            Some(self.0)
        }
    }

    fn send(outlet: &mut FanOut<Numbered>, numbers: std::ops::Range<u64>) -> Result<(), Closed> {
        numbers.into_iter().try_for_each(|number| {
            let mut item = outlet.take()?;
            item.0 = number;
            outlet.send(item)
        })
    }

    fn received(receiver: &mut Receiver<Numbered>) -> Vec<u64> {
        std::iter::from_fn(|| receiver.try_receive().ok().flatten().map(|item| item.0)).collect()
    }

    #[test]
    fn every_reader_gets_what_its_link_lets_through_and_nobody_waits_for_one_that_has_stopped() {
        let shutdown = Shutdown::new();
        let dropped = Counter::default();
        let (next_in, mut next) = bounded(30, &shutdown, Numbered::default);
        let (newest_in, mut newest) = latest(&shutdown, Numbered::default);
        let (stopped_in, mut stopped) = lossy(4, dropped.clone(), &shutdown, Numbered::default);
        let (tenth_in, mut tenth) = bounded(3, &shutdown, Numbered::default);
        let mut outlet = FanOut::new(Numbered::default());
        outlet.set_next(next_in);
        outlet.add(newest_in, 1);
        outlet.add(stopped_in, 1);
        outlet.add(tenth_in, 10);
        send(&mut outlet, 3..30).unwrap();
        assert_eq!(received(&mut next), (3..30).collect::<Vec<_>>());
        assert_eq!(received(&mut newest), [29]);
        assert_eq!((received(&mut stopped), dropped.get()), (vec![3, 4, 5, 6], 23));
        assert_eq!(received(&mut tenth), [3, 10, 20]);
    }

    #[test]
    fn an_end_that_has_gone_is_passed_over_and_the_last_one_closes_the_outlet() {
        let shutdown = Shutdown::new();
        let (first_in, first) = bounded(9, &shutdown, Numbered::default);
        let (second_in, mut second) = bounded(9, &shutdown, Numbered::default);
        let mut outlet = FanOut::new(Numbered::default());
        outlet.add(first_in, 1);
        outlet.add(second_in, 1);
        drop(first);
        send(&mut outlet, 0..3).unwrap();
        assert_eq!(received(&mut second), [0, 1, 2]);
        drop(second);
        assert_eq!(send(&mut outlet, 3..5), Err(Closed));
    }

    #[test]
    fn without_its_next_stage_a_chain_is_at_its_end_whoever_else_reads() {
        let shutdown = Shutdown::new();
        let (next_in, next) = bounded(1, &shutdown, Numbered::default);
        let (end_in, _end) = bounded(9, &shutdown, Numbered::default);
        let mut outlet = FanOut::new(Numbered::default());
        outlet.set_next(next_in);
        outlet.add(end_in, 1);
        drop(next);
        assert_eq!(send(&mut outlet, 0..9), Err(Closed));
    }

    #[test]
    fn the_first_of_every_block_is_due() {
        let mut every = Every::new(10);
        let mut due = |numbers: &[u64]| -> Vec<u64> {
            numbers.iter().copied().filter(|&number| every.is_due(Some(number))).collect()
        };
        assert_eq!(due(&[3, 4, 9, 12, 19, 20, 21, 45, 50]), [3, 12, 20, 45, 50]);
        assert!(!every.is_due(None) && Every::new(1).is_due(None));
    }
}
