use super::*;

#[derive(Debug, Default)]
struct Numbered {
    number: u64,
    lost_before: u64,
    payload: Vec<u64>,
}

impl Item for Numbered {
    fn lost_before(&self) -> u64 {
        self.lost_before
    }

    fn lose(&mut self, count: u64) {
        self.lost_before += count;
    }
}

impl Copied for Numbered {
    fn copy_from(&mut self, other: &Self) {
        (self.number, self.lost_before) = (other.number, other.lost_before);
        self.payload.clone_from(&other.payload);
    }

    fn sequence(&self) -> Option<u64> {
        Some(self.number)
    }
}

fn send(sender: &mut Sender<Numbered>, number: u64) -> Result<(), Closed> {
    let mut item = sender.take()?;
    (item.number, item.lost_before) = (number, 0);
    item.payload.resize(1000, number);
    sender.send(item)
}

#[test]
fn latest_gives_the_newest_and_says_what_it_overwrote() {
    let (mut sender, mut receiver) = latest(&Shutdown::new(), Numbered::default);
    for number in 0..5 {
        send(&mut sender, number).unwrap();
    }
    let item = receiver.receive().unwrap();
    assert_eq!((item.number, item.lost_before, item.overwritten()), (4, 4, 4));
    send(&mut sender, 5).unwrap();
    drop(item);
    let item = receiver.receive().unwrap();
    assert_eq!((item.number, item.lost_before, item.overwritten()), (5, 0, 0));
}

#[test]
fn what_an_overwritten_item_had_lost_is_not_forgotten() {
    let (mut sender, mut receiver) = latest(&Shutdown::new(), Numbered::default);
    let mut item = sender.take().unwrap();
    item.lost_before = 3;
    sender.send(item).unwrap();
    send(&mut sender, 9).unwrap();
    let item = receiver.receive().unwrap();
    assert_eq!((item.lost_before, item.overwritten()), (4, 1));
}

#[test]
fn latest_between_threads_accounts_for_every_item() {
    const COUNT: u64 = 20_000;
    let (mut sender, mut receiver) = latest(&Shutdown::new(), Numbered::default);
    std::thread::scope(|scope| {
        scope.spawn(move || (0..COUNT).try_for_each(|number| send(&mut sender, number)));
        let (mut received, mut overwritten, mut next) = (0, 0, 0);
        while let Some(item) = receiver.receive() {
            assert_eq!(item.number, next + item.lost_before, "numbers rise and gaps are told");
            (received, overwritten, next) = (received + 1, overwritten + item.overwritten(), item.number + 1);
        }
        assert_eq!((received + overwritten, next), (COUNT, COUNT), "the last item always arrives");
    });
}

#[test]
fn bounded_between_threads_loses_nothing_and_reuses_its_buffers() {
    const COUNT: u64 = 5000;
    let (mut sender, mut receiver) = bounded(2, &Shutdown::new(), Numbered::default);
    std::thread::scope(|scope| {
        scope.spawn(move || (0..COUNT).try_for_each(|number| send(&mut sender, number)));
        let (mut next, mut buffers) = (0, std::collections::BTreeSet::new());
        while let Some(item) = receiver.receive() {
            assert_eq!((item.number, item.lost_before, item.overwritten()), (next, 0, 0));
            buffers.insert(item.payload.as_ptr() as usize);
            next += 1;
        }
        assert_eq!(next, COUNT);
        assert!(buffers.len() <= 4, "{} buffers", buffers.len());
    });
}

#[test]
fn a_lossy_link_never_waits_and_tells_what_found_no_room() {
    let dropped = Counter::default();
    let (mut sender, mut receiver) = lossy(2, dropped.clone(), &Shutdown::new(), Numbered::default);
    let item = |number| Numbered { number, ..Numbered::default() };
    (0..4).for_each(|number| sender.send_copy(&item(number)).unwrap());
    // Sent without a copy, the item does not fit either.
    send(&mut sender, 4).unwrap();
    assert_eq!(dropped.get(), 3);
    let seen = |receiver: &mut Receiver<Numbered>| {
        let item = receiver.receive().unwrap();
        (item.number, item.lost_before, item.overwritten())
    };
    assert_eq!([seen(&mut receiver), seen(&mut receiver)], [(0, 0, 0), (1, 0, 0)]);
    sender.send_copy(&Numbered { lost_before: 2, ..item(7) }).unwrap();
    sender.send_copy(&item(8)).unwrap();
    assert_eq!([seen(&mut receiver), seen(&mut receiver)], [(7, 5, 0), (8, 0, 0)]);
    assert_eq!(dropped.get(), 3, "counted once, by the counter");
    (9..12).for_each(|number| sender.send_copy(&item(number)).unwrap());
    drop(receiver);
    assert_eq!(sender.send_copy(&item(12)), Err(Closed));
}

#[test]
fn a_writer_that_waits_ends_when_the_reader_goes() {
    let (mut sender, receiver) = bounded(1, &Shutdown::new(), Numbered::default);
    std::thread::scope(|scope| {
        let writer = scope.spawn(move || (0..).find_map(|number| send(&mut sender, number).err()));
        drop(receiver);
        assert_eq!(writer.join().unwrap(), Some(Closed));
    });
    let (mut sender, receiver) = latest(&Shutdown::new(), Numbered::default);
    drop(receiver);
    assert_eq!(send(&mut sender, 0), Err(Closed));
}

#[test]
fn a_reader_gets_what_is_left_and_ends_when_the_writer_goes() {
    for (mut sender, mut receiver) in
        [bounded(3, &Shutdown::new(), Numbered::default), latest(&Shutdown::new(), Numbered::default)]
    {
        send(&mut sender, 7).unwrap();
        drop(sender);
        assert_eq!(receiver.receive().unwrap().number, 7);
        assert!(receiver.receive().is_none());
    }
}

#[test]
fn abort_ends_every_wait() {
    let shutdown = Shutdown::new();
    let (mut full, _reader) = bounded(1, &shutdown, Numbered::default);
    let (_writer, mut empty) = bounded::<Numbered>(1, &shutdown, Numbered::default);
    let (_live_writer, mut live) = latest::<Numbered>(&shutdown, Numbered::default);
    std::thread::scope(|scope| {
        let writer = scope.spawn(move || (0..).find_map(|number| send(&mut full, number).err()));
        let reader = scope.spawn(move || empty.receive().is_none());
        let live_reader = scope.spawn(move || live.receive().is_none());
        shutdown.abort();
        assert_eq!(writer.join().unwrap(), Some(Closed));
        assert!(reader.join().unwrap() && live_reader.join().unwrap());
    });
}

#[test]
fn a_request_leaves_the_links_open() {
    let shutdown = Shutdown::new();
    let (mut sender, mut receiver) = bounded(1, &shutdown, Numbered::default);
    shutdown.request();
    send(&mut sender, 1).unwrap();
    assert_eq!(receiver.receive().unwrap().number, 1);
}
