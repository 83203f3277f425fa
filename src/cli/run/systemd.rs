//! Notifications from a service to systemd (Type=notify): that it is ready, that it makes progress, that it
//! ends. Without systemd nothing is sent.

use crate::service::Summary;
use sd_notify::NotifyState;
use std::ffi::OsStr;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// Tells systemd how a run progresses. The watchdog gets a keep-alive only on progress, never by time alone,
/// so it fires when a stage on the way to the clients hangs.
pub(super) struct Watchdog {
    /// How often it needs a keep-alive; `None`: there is no watchdog.
    hunger: Option<Duration>,
    is_ready: bool,
    progress: u64,
    fed: Option<Instant>,
}

impl Watchdog {
    pub fn new() -> Self {
        Self { hunger: sd_notify::watchdog_enabled(), is_ready: false, progress: 0, fed: None }
    }

    /// Looks at what the stages have done, several times a second. The first list makes the service ready.
    pub fn see(&mut self, summary: &Summary) {
        let lists = summary.lists_made();
        if !self.is_ready && lists > 0 {
            self.is_ready = true;
            tell(&[NotifyState::Ready, NotifyState::Status("lists flow")]);
        }
        let Some(hunger) = self.hunger else { return };
        let progress = summary.progress();
        let is_due = self.fed.is_none_or(|fed| fed.elapsed() >= hunger / 4);
        if progress != self.progress && is_due {
            (self.progress, self.fed) = (progress, Some(Instant::now()));
            tell(&[NotifyState::Watchdog]);
        }
    }

    /// Called before a configuration is reloaded.
    pub fn reloading(&self) {
        if self.is_ready
            && let Ok(now) = NotifyState::monotonic_usec_now()
        {
            tell(&[NotifyState::Reloading, now]);
        }
    }

    /// Called after a configuration was refused.
    pub fn stays(&self) {
        if self.is_ready {
            tell(&[NotifyState::Ready]);
        }
    }

    /// Called after a configuration was accepted: the next list makes the service ready again.
    pub fn starts_anew(&mut self) {
        (self.is_ready, self.progress) = (false, 0);
    }

    /// Called at the end.
    pub fn stopping(&self) {
        tell(&[NotifyState::Stopping]);
    }
}

/// The variable with the name of systemd's socket: a path, or `@` and an abstract name.
const SOCKET: &str = "NOTIFY_SOCKET";

fn tell(state: &[NotifyState]) {
    let Some(name) = std::env::var_os(SOCKET) else { return };
    let text: String = state.iter().map(|state| format!("{state}\n")).collect();
    if let Err(error) = send(&name, &text) {
        tracing::warn!("systemd cannot be told {state:?}: {error}");
    }
}

/// Sends a text to a socket; does not wait for one that takes nothing.
fn send(name: &OsStr, text: &str) -> io::Result<()> {
    let address = match name.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
        _ => SocketAddr::from_pathname(name)?,
    };
    let socket = UnixDatagram::unbound()?;
    socket.set_nonblocking(true)?;
    socket.send_to_addr(text.as_bytes(), &address).map(|_| ())
}
