//! Links between two threads, with recycled buffers. The name of a link says what it does when the reader is
//! slow: [`latest`] overwrites and counts (live), [`bounded`] makes the writer wait and loses nothing
//! (replay), and [`lossy`] drops items that do not fit and counts them (recordings and files beside a live
//! service).
//!
//! All buffers are made with the link: one held by the writer, one held by the reader, and those in between.
//! The writer takes an empty one with [`Sender::take`], fills it and [`send`](Sender::send)s it, or has an
//! item copied into one with [`Sender::send_copy`]; it goes back when the reader drops its [`Received`]. So
//! nothing is allocated once every buffer has grown to its size.

use super::{Counter, Shutdown};
use crossbeam_channel as channel;
use crossbeam_channel::{TryRecvError, TrySendError, select};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// An item that knows how many items were lost between the previous one and itself.
pub trait Item: Send {
    /// The number lost.
    fn lost_before(&self) -> u64;
    /// Adds to the number lost.
    fn lose(&mut self, count: u64);
}

/// An item that several links may carry: each has a copy in a buffer of its own.
pub trait Copied: Item {
    /// Copies `other` into this buffer, without an allocation once it has grown to its size.
    fn copy_from(&mut self, other: &Self);
    /// Sequence number of the frame that it describes; `None` where it describes none.
    fn sequence(&self) -> Option<u64>;
}

/// The part that an end takes of items of another kind; of its own kind it takes all.
pub trait PartOf<T>: Item {
    /// Copies the part of `whole` into this buffer, without an allocation once it has grown to its size.
    fn copy_part_of(&mut self, whole: &T);
}

impl<T: Copied> PartOf<T> for T {
    fn copy_part_of(&mut self, whole: &T) {
        self.copy_from(whole);
    }
}

/// The other side of the link has gone, or the service was aborted: the stage has nothing left to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Closed;

/// A link of one slot: a newer item overwrites the waiting one, which is counted, together with the losses
/// before it, in the newer one's `lost_before`.
pub fn latest<T: Item>(shutdown: &Shutdown, make: impl FnMut() -> T) -> (Sender<T>, Receiver<T>) {
    let (mut sender, receiver) = bounded(1, shutdown, make);
    sender.when_full = Full::Overwrites { slot: receiver.full.clone() };
    (sender, receiver)
}

/// A link of `capacity` (at least one) items that makes the writer wait when it is full.
pub fn bounded<T: Item>(
    capacity: usize,
    shutdown: &Shutdown,
    mut make: impl FnMut() -> T,
) -> (Sender<T>, Receiver<T>) {
    let capacity = capacity.max(1);
    let (full_in, full_out) = channel::bounded(capacity);
    let (empty_in, empty_out) = channel::bounded(capacity + 2);
    for _ in 0..capacity + 2 {
        empty_in.send(make()).expect("both ends of the channel are here and it has room");
    }
    let is_reader_gone = Arc::new(AtomicBool::new(false));
    let sender = Sender {
        full: full_in,
        when_full: Full::Waits,
        empty: empty_out,
        spare: None,
        is_reader_gone: is_reader_gone.clone(),
        shutdown: shutdown.clone(),
    };
    let receiver = Receiver { full: full_out, empty: empty_in, is_reader_gone, shutdown: shutdown.clone() };
    (sender, receiver)
}

/// A link of `capacity` (at least one) items whose writer never waits: items that do not fit are dropped, and
/// counted by `dropped` and in the `lost_before` of the next item that fits.
pub fn lossy<T: Item>(
    capacity: usize,
    dropped: Counter,
    shutdown: &Shutdown,
    make: impl FnMut() -> T,
) -> (Sender<T>, Receiver<T>) {
    let (mut sender, receiver) = bounded(capacity, shutdown, make);
    sender.when_full = Full::Drops { dropped, lost: 0 };
    (sender, receiver)
}

/// What a writer does when the link is full.
enum Full<T> {
    Overwrites {
        /// The reader's end, to take back the item that is overwritten.
        slot: channel::Receiver<Envelope<T>>,
    },
    Waits,
    Drops {
        dropped: Counter,
        /// Lost since the last item that fitted.
        lost: u64,
    },
}

/// The contents of a slot: the item, and how many were overwritten since the reader took the last one.
struct Envelope<T> {
    item: T,
    overwritten: u64,
}

/// The writer's end. Dropping it closes the link; the reader still gets what is in it.
pub struct Sender<T> {
    full: channel::Sender<Envelope<T>>,
    when_full: Full<T>,
    empty: channel::Receiver<T>,
    spare: Option<T>,
    /// Needed because the slot of a `latest` link keeps `full` open when the reader goes.
    is_reader_gone: Arc<AtomicBool>,
    shutdown: Shutdown,
}

impl<T: Item> Sender<T> {
    /// An empty buffer (it holds what it held when it was last used). Waits only if the reader holds more
    /// than one.
    ///
    /// # Errors
    /// [`Closed`].
    pub fn take(&mut self) -> Result<T, Closed> {
        if let Some(item) = self.spare.take() {
            return Ok(item);
        }
        if let Ok(item) = self.empty.try_recv() {
            return Ok(item);
        }
        select! {
            recv(self.empty) -> item => item.map_err(|_| Closed),
            recv(self.shutdown.aborted()) -> _ => Err(Closed),
        }
    }

    /// Sends a filled buffer.
    ///
    /// # Errors
    /// [`Closed`]; the item is then gone.
    pub fn send(&mut self, item: T) -> Result<(), Closed> {
        if self.is_reader_gone.load(Ordering::Acquire) {
            return Err(Closed);
        }
        let envelope = Envelope { item, overwritten: 0 };
        match &mut self.when_full {
            Full::Overwrites { slot } => overwrite(&self.full, slot, envelope, &mut self.spare),
            Full::Waits => select! {
                send(self.full, envelope) -> sent => sent.map_err(|_| Closed),
                recv(self.shutdown.aborted()) -> _ => Err(Closed),
            },
            Full::Drops { dropped, lost } => {
                let mut envelope = envelope;
                envelope.item.lose(std::mem::take(lost));
                match self.full.try_send(envelope) {
                    Ok(()) => Ok(()),
                    Err(TrySendError::Full(Envelope { item, .. })) => {
                        dropped.add(1);
                        *lost = item.lost_before() + 1;
                        self.spare = Some(item);
                        Ok(())
                    }
                    Err(TrySendError::Disconnected(_)) => Err(Closed),
                }
            }
        }
    }
}

/// Sends immediately, in place of the item that waits in `slot`, whose buffer becomes `spare`.
fn overwrite<T: Item>(
    full: &channel::Sender<Envelope<T>>,
    slot: &channel::Receiver<Envelope<T>>,
    mut envelope: Envelope<T>,
    spare: &mut Option<T>,
) -> Result<(), Closed> {
    loop {
        envelope = match full.try_send(envelope) {
            Ok(()) => return Ok(()),
            Err(TrySendError::Disconnected(_)) => return Err(Closed),
            Err(TrySendError::Full(envelope)) => envelope,
        };
        // The reader may have been quicker; then there is room now.
        if let Ok(old) = slot.try_recv() {
            envelope.item.lose(old.item.lost_before() + 1);
            envelope.overwritten += old.overwritten + 1;
            *spare = Some(old.item);
        }
    }
}

impl<T: Item> Sender<T> {
    /// Sends a copy of `item`, or of the part of it that the link carries; a full lossy link makes no copy.
    ///
    /// # Errors
    /// [`Closed`].
    pub fn send_copy<W: Item>(&mut self, item: &W) -> Result<(), Closed>
    where
        T: PartOf<W>,
    {
        if let Full::Drops { dropped, lost } = &mut self.when_full
            && self.full.is_full()
            && !self.is_reader_gone.load(Ordering::Acquire)
        {
            dropped.add(1);
            *lost += item.lost_before() + 1;
            return Ok(());
        }
        let mut copy = self.take()?;
        copy.copy_part_of(item);
        self.send(copy)
    }
}

/// The reader's end. Dropping it closes the link.
pub struct Receiver<T> {
    full: channel::Receiver<Envelope<T>>,
    empty: channel::Sender<T>,
    is_reader_gone: Arc<AtomicBool>,
    shutdown: Shutdown,
}

impl<T: Item> Receiver<T> {
    /// Waits for the next item. `None`: the writer has gone and everything was read, or the service was
    /// aborted.
    pub fn receive(&mut self) -> Option<Received<'_, T>> {
        let envelope = match self.full.try_recv() {
            Ok(envelope) => envelope,
            Err(_) => select! {
                recv(self.full) -> envelope => envelope.ok()?,
                recv(self.shutdown.aborted()) -> _ => return None,
            },
        };
        Some(self.received(envelope))
    }

    /// The next item if there is one, without waiting.
    ///
    /// # Errors
    /// [`Closed`] when the writer has gone and everything was read.
    pub fn try_receive(&mut self) -> Result<Option<Received<'_, T>>, Closed> {
        match self.full.try_recv() {
            Ok(envelope) => Ok(Some(self.received(envelope))),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(Closed),
        }
    }

    fn received(&self, Envelope { item, overwritten }: Envelope<T>) -> Received<'_, T> {
        Received { item: Some(item), overwritten, home: Some(&self.empty) }
    }
}

impl<T> Drop for Receiver<T> {
    fn drop(&mut self) {
        self.is_reader_gone.store(true, Ordering::Release);
    }
}

/// An item held by the reader; its buffer goes back to the writer when this is dropped.
pub struct Received<'a, T> {
    item: Option<T>,
    overwritten: u64,
    home: Option<&'a channel::Sender<T>>,
}

impl<T> Received<'_, T> {
    /// An item that came through no link and goes nowhere.
    pub(super) fn own(item: T) -> Self {
        Self { item: Some(item), overwritten: 0, home: None }
    }

    /// Items that were overwritten in the link since the last one was received.
    pub fn overwritten(&self) -> u64 {
        self.overwritten
    }
}

impl<T> Deref for Received<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.item.as_ref().expect("the item leaves only in drop")
    }
}

impl<T> DerefMut for Received<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        self.item.as_mut().expect("the item leaves only in drop")
    }
}

impl<T> Drop for Received<'_, T> {
    fn drop(&mut self) {
        if let (Some(home), Some(item)) = (self.home, self.item.take()) {
            // There is room for every buffer; it fails only when the writer has gone, which then needs none.
            let _ = home.try_send(item);
        }
    }
}

#[cfg(test)]
mod tests;
