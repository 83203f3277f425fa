//! Messages on their way to standard error, whose reader may have stopped reading.

use crate::rt::Metrics;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, bounded, select};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::convert::Infallible;
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Messages that wait; more are dropped.
const QUEUE: usize = 4096;
/// A pipe that has room at all takes this many bytes at once (`PIPE_BUF`), so that such a write never waits.
const BYTES_AT_ONCE: usize = 4096;
/// How often a writer that waits for room checks whether it is to end.
const GLANCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
/// How long a reader that has stopped is waited for in the end.
const PATIENCE: Duration = Duration::from_secs(1);

/// A queue of messages and the thread that writes them. Who sends one never waits; what finds no room is
/// dropped and counted, and told once there is room again.
pub(super) struct MessageQueue {
    messages: Sender<Vec<u8>>,
    metrics: Arc<Metrics>,
    /// Dropping it ends the thread.
    ending: Option<Sender<Infallible>>,
    /// Disconnected when the thread has ended.
    ended: Receiver<Infallible>,
    thread: Option<JoinHandle<()>>,
}

/// Sends messages; clones send to the same queue.
#[derive(Clone)]
pub(super) struct MessageSender {
    messages: Sender<Vec<u8>>,
    metrics: Arc<Metrics>,
}

impl MessageQueue {
    /// Starts the thread, which writes to `target` and counts in `metrics`.
    ///
    /// # Errors
    /// When the system cannot start another thread.
    pub fn start(target: impl Write + AsFd + Send + 'static, metrics: &Arc<Metrics>) -> io::Result<Self> {
        let (messages, waiting) = bounded(QUEUE);
        let (ending, is_ending) = bounded(1);
        let (alive, ended) = bounded(1);
        let writer = Writer { target, waiting, is_ending, metrics: metrics.clone(), told: 0, ends_at: None };
        let thread = Builder::new().name("messages".to_owned()).spawn(move || {
            let _alive: Sender<Infallible> = alive;
            writer.run();
        })?;
        Ok(Self { messages, metrics: metrics.clone(), ending: Some(ending), ended, thread: Some(thread) })
    }

    pub fn sender(&self) -> MessageSender {
        MessageSender { messages: self.messages.clone(), metrics: self.metrics.clone() }
    }
}

impl Drop for MessageQueue {
    /// Writes what waits, for as long as somebody reads it.
    fn drop(&mut self) {
        self.ending = None;
        // A terminal that is held (Ctrl-S) may keep the thread for good.
        let is_over = self.ended.recv_timeout(2 * PATIENCE) == Err(RecvTimeoutError::Disconnected);
        if let Some(thread) = self.thread.take().filter(|_| is_over) {
            // It cannot panic, and at the end of the program nothing could be done about it.
            let _ = thread.join();
        }
    }
}

impl Write for MessageSender {
    fn write(&mut self, message: &[u8]) -> io::Result<usize> {
        if self.messages.try_send(message.to_vec()).is_err() {
            self.metrics.drops.add(1);
        }
        Ok(message.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

struct Writer<T> {
    target: T,
    waiting: Receiver<Vec<u8>>,
    is_ending: Receiver<Infallible>,
    metrics: Arc<Metrics>,
    /// Drops that were told.
    told: u64,
    /// When a reader that takes nothing is given up.
    ends_at: Option<Instant>,
}

impl<T: Write + AsFd> Writer<T> {
    fn run(mut self) {
        loop {
            let message = select! {
                recv(self.waiting) -> message => message.ok(),
                recv(self.is_ending) -> _ => self.waiting.try_recv().ok(),
            };
            let Some(message) = message else { return };
            match self.write(&message) {
                Ok(()) => self.metrics.frames.add(1),
                Err(error) if error.kind() == ErrorKind::TimedOut => return,
                // Nobody can receive it (closed pipe, full disk).
                Err(_) => self.metrics.drops.add(1),
            }
            self.tell_drops();
        }
    }

    fn write(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            let events = poll(&mut [PollFd::new(&self.target, PollFlags::OUT)], Some(&GLANCE));
            if self.is_ending.try_recv() == Err(TryRecvError::Disconnected)
                && Instant::now() >= *self.ends_at.get_or_insert_with(|| Instant::now() + PATIENCE)
            {
                return Err(ErrorKind::TimedOut.into());
            }
            if events == Ok(0) {
                continue;
            }
            match self.target.write(&bytes[..bytes.len().min(BYTES_AT_ONCE)]) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => bytes = &bytes[count..],
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Says how many messages were dropped, once the queue has room again.
    fn tell_drops(&mut self) {
        let dropped = self.metrics.drops.get();
        if dropped > self.told && self.waiting.len() < QUEUE / 2 {
            let count = dropped - self.told;
            self.told = dropped;
            tracing::warn!("{count} messages were dropped here: nobody took them");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn messages_arrive_in_order_and_whole() {
        let (mut reader, writer) = io::pipe().unwrap();
        let metrics = Metrics::new("messages");
        let queue = MessageQueue::start(writer, &metrics).unwrap();
        let long = "x".repeat(100_000);
        let reading = Builder::new()
            .name("reader".to_owned())
            .spawn(move || {
                let mut text = String::new();
                reader.read_to_string(&mut text).unwrap();
                text
            })
            .unwrap();
        for message in ["first\n", &long, "\nlast\n"] {
            queue.sender().write_all(message.as_bytes()).unwrap();
        }
        drop(queue);
        assert_eq!(reading.join().unwrap(), format!("first\n{long}\nlast\n"));
        assert_eq!((metrics.frames.get(), metrics.drops.get()), (3, 0));
    }

    #[test]
    fn who_sends_never_waits_for_a_reader_that_has_stopped() {
        let (reader, writer) = io::pipe().unwrap();
        let metrics = Metrics::new("messages");
        let queue = MessageQueue::start(writer, &metrics).unwrap();
        let started = Instant::now();
        for _ in 0..2 * QUEUE {
            queue.sender().write_all(&[b'm'; 100]).unwrap();
        }
        assert!(metrics.drops.get() > 0 && started.elapsed() < PATIENCE);
        drop(queue);
        assert!(started.elapsed() < 4 * PATIENCE, "it ends all the same");
        drop(reader);
    }
}
