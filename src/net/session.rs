//! One client to which lists are streamed.

use super::board::Post;
use super::places::Visit;
use super::shared::{Phase, Shared};
use super::turn::Turn;
use super::upgrade::Socket;
use crate::rt::{monotonic_ns, utc_from_monotonic_ns};
use crate::wire::{Delivery, Subscription, binary, json};
use axum::body::Bytes;
use futures_util::{SinkExt, StreamExt};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tokio_tungstenite::tungstenite::error::{Error, ProtocolError};
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};
use tokio_tungstenite::tungstenite::protocol::frame::{CloseFrame, Frame};
use tokio_tungstenite::tungstenite::{Message, Utf8Bytes};

/// A send that takes this long has waited for the client to take earlier data.
const WAITED: Duration = Duration::from_millis(100);
/// Longest wait for a client to take the closing message.
const FAREWELL: Duration = Duration::from_millis(500);
/// A longer list goes out in frames of this size, which is all that its client's connection holds of it:
/// those who do not take theirs share one copy.
const FRAME_BYTES: usize = 1 << 16;

/// A connected client.
pub(super) struct Session {
    socket: Socket,
    shared: Arc<Shared>,
    visit: Arc<Visit>,
    phase: watch::Receiver<Phase>,
    turn: Turn,
    is_binary: bool,
    patience: Duration,
    /// Time of the client's last activity: a message, at least a pong, or taking data that had waited for it.
    last_activity: Instant,
    /// Lists sent so far.
    sent: u64,
    lost: u64,
}

/// Why a session ends.
enum End {
    /// The client has gone, or the connection broke.
    Gone,
    /// It neither takes nor sends anything.
    Silent,
    /// It is disconnected.
    Close(CloseCode, &'static str),
}

impl End {
    fn reason(&self) -> &'static str {
        match self {
            Self::Gone => "the connection ended",
            Self::Silent => "silent for too long",
            Self::Close(_, reason) => reason,
        }
    }
}

impl Session {
    /// `phase` was read before the rules by which the client was admitted.
    pub fn new(
        socket: Socket,
        shared: &Arc<Shared>,
        visit: Arc<Visit>,
        phase: watch::Receiver<Phase>,
        subscription: Subscription,
        is_binary: bool,
        patience: Duration,
    ) -> Self {
        // The newest list is sent immediately, and not only when the next one comes.
        let first = shared.board.newest().map_or(0, |(post, _)| post.number);
        Self {
            socket,
            shared: shared.clone(),
            visit,
            phase,
            turn: Turn::new(subscription, first),
            is_binary,
            patience,
            last_activity: Instant::now(),
            sent: 0,
            lost: 0,
        }
    }

    /// Streams to the client at `peer` until one of the two ends the session.
    pub async fn run(mut self, peer: SocketAddr) {
        let Subscription { lights, rate_hz, error, queue } = *self.turn.subscription();
        let error = error.map(f64::from);
        tracing::info!(%peer, is_binary = self.is_binary, lights, rate_hz, error, queue, "a client has come");
        let Err(end) = self.stream().await;
        let (sent, lost) = (self.sent, self.lost);
        tracing::info!(%peer, lists_sent = sent, lists_lost = lost, reason = end.reason(), "a client has left");
        if let End::Close(code, reason) = end {
            let close = CloseFrame { code, reason: Utf8Bytes::from_static(reason) };
            let _ = timeout(FAREWELL, self.socket.send(Message::Close(Some(close)))).await;
            // Waits until the client has closed its end: data that it has not taken when the connection
            // closes would be lost. After an invalid frame nothing can be read, and a distant client may see
            // the connection break without a reason.
            let _ = timeout(FAREWELL, async { while let Some(Ok(_)) = self.socket.next().await {} }).await;
        }
    }

    async fn stream(&mut self) -> Result<std::convert::Infallible, End> {
        let mut posts = self.shared.board.posts();
        posts.mark_changed();
        if *self.phase.borrow() == Phase::Ending {
            return Err(End::Close(CloseCode::Away, "the server ends"));
        }
        let mut glance = interval(self.patience / 4);
        glance.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                biased;
                received = self.socket.next() => {
                    match received {
                        Some(Ok(message)) => self.receive(message).await?,
                        Some(Err(error)) => return Err(end_of(&error)),
                        None => return Err(End::Gone),
                    }
                }
                () = self.visit.flood.notified() => {
                    self.shared.counters.floods.add(1);
                    return Err(End::Close(CloseCode::Policy, "too many messages"));
                }
                _ = self.phase.changed() => {
                    let is_ending = *self.phase.borrow_and_update() == Phase::Ending;
                    if is_ending {
                        // The lists on the board are the remaining ones.
                        while self.send_next().await? {}
                        return Err(End::Close(CloseCode::Away, "the server ends"));
                    }
                    return Err(End::Close(CloseCode::Away, "the server has new rules; connect again"));
                }
                _ = glance.tick() => self.ask().await?,
                _ = posts.changed() => {
                    // One at a time, so that messages of the client are received between two.
                    if self.send_next().await? {
                        posts.mark_changed();
                    }
                }
            }
        }
    }

    /// Sends what is due next; returns whether there was anything.
    async fn send_next(&mut self) -> Result<bool, End> {
        let started = Instant::now();
        let Some((post, lost)) = self.shared.board.look(|posts| self.turn.next(posts)) else {
            return Ok(false);
        };
        let Some(body) = self.shared.board.body(&post, self.turn.subscription(), self.is_binary) else {
            return Ok(true);
        };
        let delivery = delivery(&post, lost);
        let bytes = match timeout(self.patience, self.send_list(body, &delivery)).await {
            Ok(sent) => sent?,
            Err(_) => return Err(self.silent()),
        };
        self.sent += 1;
        self.lost += lost;
        let counters = &self.shared.counters;
        counters.lists_sent.add(1);
        counters.lists_lost.add(lost);
        counters.bytes_sent.add(bytes);
        let time_ns = u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.shared.metrics.time_ns.record(time_ns);
        Ok(true)
    }

    /// Sends a list, a short one in one frame; returns the bytes of the message.
    async fn send_list(&mut self, body: Bytes, delivery: &Delivery) -> Result<u64, End> {
        let kind = if self.is_binary { Data::Binary } else { Data::Text };
        let frame =
            |bytes: Bytes, kind, is_last| Message::Frame(Frame::message(bytes, OpCode::Data(kind), is_last));
        if body.len() <= FRAME_BYTES {
            let mut bytes = Vec::new();
            let encode = if self.is_binary { binary::encode } else { json::encode };
            encode(&body, delivery, &mut bytes);
            let length = bytes.len() as u64;
            return self.send(frame(bytes.into(), kind, true)).await.map(|()| length);
        }
        let (head, mut rest, tail) = if self.is_binary {
            (Bytes::copy_from_slice(&binary::head(delivery)), body, Bytes::new())
        } else {
            (Bytes::new(), body.slice(..json::open_length(&body)), json::tail(delivery).into())
        };
        let length = (head.len() + rest.len() + tail.len()) as u64;
        self.send(frame(head, kind, false)).await?;
        while !rest.is_empty() {
            let next = rest.split_to(rest.len().min(FRAME_BYTES));
            self.send(frame(next, Data::Continue, false)).await?;
        }
        self.send(frame(tail, Data::Continue, true)).await.map(|()| length)
    }

    async fn send(&mut self, message: Message) -> Result<(), End> {
        let started = Instant::now();
        match timeout(self.patience, self.socket.send(message)).await {
            Ok(Ok(())) => {
                // A shorter time may be spent in the kernel's buffers alone.
                if started.elapsed() >= WAITED {
                    self.last_activity = Instant::now();
                }
                Ok(())
            }
            Ok(Err(_)) => Err(End::Gone),
            Err(_) => Err(self.silent()),
        }
    }

    fn silent(&self) -> End {
        self.shared.counters.silent.add(1);
        End::Silent
    }

    async fn answer(&mut self, answer: serde_json::Value) -> Result<(), End> {
        self.send(Message::Text(answer.to_string().into())).await
    }

    async fn receive(&mut self, message: Message) -> Result<(), End> {
        self.last_activity = Instant::now();
        match message {
            Message::Text(text) => match Subscription::from_message(text.as_bytes()) {
                Ok(subscription) => {
                    self.turn.subscribe(subscription);
                    self.answer(serde_json::json!({ "subscribed": subscription })).await
                }
                Err(error) => {
                    self.shared.counters.bad_messages.add(1);
                    self.answer(serde_json::json!({ "error": error.to_string() })).await
                }
            },
            Message::Binary(_) => {
                self.shared.counters.bad_messages.add(1);
                Err(End::Close(CloseCode::Unsupported, "clients send text"))
            }
            Message::Ping(_) | Message::Pong(_) | Message::Frame(_) => Ok(()),
            Message::Close(_) => Err(End::Gone),
        }
    }

    /// Pings a silent client; gives up a client that has been silent for too long.
    async fn ask(&mut self) -> Result<(), End> {
        let silence = self.last_activity.elapsed();
        if silence >= self.patience {
            return Err(self.silent());
        }
        if silence >= self.patience / 2 {
            self.send(Message::Ping(Bytes::new())).await?;
        }
        Ok(())
    }
}

/// The times of a message that is being sent now.
fn delivery(post: &Post, lost: u64) -> Delivery {
    let (now_ns, utc_from_monotonic_ns) = (monotonic_ns(), utc_from_monotonic_ns());
    let utc = |monotonic_ns: i64| monotonic_ns.saturating_add(utc_from_monotonic_ns);
    Delivery {
        lost,
        capture_monotonic_ns: post.capture_monotonic_ns,
        capture_utc_ns: post.capture_monotonic_ns.map(utc),
        sent_monotonic_ns: now_ns,
        sent_utc_ns: utc(now_ns),
    }
}

/// What an error of the connection means.
fn end_of(error: &Error) -> End {
    match error {
        Error::Capacity(_) => End::Close(CloseCode::Size, "the message is too long"),
        Error::Utf8(_) => End::Close(CloseCode::Invalid, "text is UTF-8"),
        Error::Protocol(ProtocolError::ResetWithoutClosingHandshake) => End::Gone,
        Error::Protocol(_) => End::Close(CloseCode::Protocol, "this is no WebSocket frame"),
        _ => End::Gone,
    }
}
