//! The clients: tasks of one thread, each with its own connection.

use futures_util::StreamExt as _;
use lightcast::rt::{Shutdown, Threads, monotonic_ns};
use lightcast::wire::{BINARY, JSON, Message, binary, json};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio_tungstenite::tungstenite::Message as SocketMessage;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;

pub struct Clients {
    shared: Arc<Shared>,
    count: usize,
    shutdown: Shutdown,
    threads: Threads,
}

#[derive(Default)]
struct Shared {
    connected: AtomicUsize,
    is_stalled: AtomicBool,
    figures: Mutex<Figures>,
}

/// Figures of the clients since they were last read.
#[derive(Clone, Default)]
pub struct Figures {
    /// Ages, when decoded, of the lists of clients that never stall.
    pub ages_ns: Vec<i64>,
    /// Lists that these clients were told they had lost.
    pub lost: u64,
    /// Lists of clients that stall now and then.
    pub stalled_lists: usize,
    /// Lists that these clients were told they had lost.
    pub stalled_lost: u64,
    pub message_bytes: usize,
}

impl Clients {
    /// Starts `count` clients, of which the first `stalling` can be told to stop reading.
    pub fn start(address: SocketAddr, count: usize, stalling: usize, is_binary: bool) -> Self {
        let (shared, shutdown) = (Arc::new(Shared::default()), Shutdown::new());
        let mut threads = Threads::new(&shutdown);
        let (seen, ending) = (shared.clone(), shutdown.clone());
        threads
            .spawn("clients", move || {
                let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
                runtime.block_on(async {
                    for number in 0..count {
                        tokio::spawn(client(address, seen.clone(), number < stalling, is_binary));
                        // A hundred at a time is more than any page causes.
                        if number % 100 == 99 {
                            tokio::time::sleep(Duration::from_millis(20)).await;
                        }
                    }
                    while !ending.is_requested() {
                        tokio::time::sleep(Duration::from_millis(50)).await;
                    }
                });
                Ok(())
            })
            .unwrap();
        Self { shared, count, shutdown, threads }
    }

    pub fn wait_for_all(&self) {
        while self.shared.connected.load(Ordering::Acquire) < self.count {
            self.pause(Duration::from_millis(20));
        }
    }

    pub fn pause(&self, time: Duration) {
        self.shutdown.wait(time);
    }

    pub fn stall(&self, is_stalled: bool) {
        self.shared.is_stalled.store(is_stalled, Ordering::Release);
    }

    pub fn take_figures(&self) -> Figures {
        std::mem::take(&mut *self.shared.figures.lock().unwrap())
    }

    pub fn stop(self) {
        self.shutdown.request();
        self.threads.join(Duration::from_millis(100), || ()).unwrap();
    }
}

async fn client(address: SocketAddr, shared: Arc<Shared>, can_stall: bool, is_binary: bool) {
    let mut request = format!("ws://{address}/ws").into_client_request().unwrap();
    let protocol = if is_binary { BINARY } else { JSON };
    request.headers_mut().insert("sec-websocket-protocol", protocol.parse().unwrap());
    // The program's own client uses the same size.
    let config = WebSocketConfig::default().read_buffer_size(1 << 14);
    let connecting = tokio_tungstenite::connect_async_with_config(request, Some(config), true);
    let (mut socket, _) = connecting.await.expect("a place for every client");
    shared.connected.fetch_add(1, Ordering::AcqRel);
    let mut message = Message::default();
    loop {
        while can_stall && shared.is_stalled.load(Ordering::Acquire) {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        let received = socket.next().await.expect("the server goes on").expect("the connection holds");
        let bytes = match &received {
            SocketMessage::Binary(bytes) => {
                binary::decode(bytes, &mut message).unwrap();
                bytes.len()
            }
            SocketMessage::Text(text) => {
                json::decode(text.as_bytes(), &mut message).unwrap();
                text.len()
            }
            _ => continue,
        };
        let age_ns = monotonic_ns() - message.delivery.capture_monotonic_ns.unwrap();
        let mut figures = shared.figures.lock().unwrap();
        figures.message_bytes = bytes;
        if can_stall {
            figures.stalled_lists += 1;
            figures.stalled_lost += message.delivery.lost;
        } else {
            figures.ages_ns.push(age_ns);
            figures.lost += message.delivery.lost;
        }
    }
}
