//! `run --listen`: a service whose configuration can be reloaded (SIGHUP) while its clients stay connected.

use super::output_file::OutputFile;
use super::systemd::Watchdog;
use super::{Arguments, ends, watch};
use crate::cli::signals::SignalWatch;
use crate::config::Config;
use crate::error::Result;
use crate::net::{Board, Server, ServerOptions};
use crate::rt::{BackOff, Shutdown};
use crate::service::{Service, Summary};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A service with a server, whose configuration can be reloaded.
pub(super) struct Serving<'a> {
    pub arguments: &'a Arguments,
    pub signals: &'a SignalWatch,
    pub shutdown: &'a Shutdown,
    pub board: &'a Arc<Board>,
    pub server: &'a Server,
    pub output: OutputFile,
    pub watchdog: Watchdog,
}

impl Serving<'_> {
    /// Runs services until one ends by itself or the program should end.
    ///
    /// # Errors
    /// When the first cannot start, and when one fails.
    pub fn serve(mut self, mut config: Config) -> Result<()> {
        let mut service = self.start(&config, self.arguments.record.clone())?;
        while let Some(next) = self.run(service)? {
            let before = std::mem::replace(&mut config, next.config);
            let record = self.arguments.record.as_deref().map(next_folder);
            service = match self.start(&config, record.clone()) {
                Ok(service) => {
                    self.server.set_options(next.options);
                    service
                }
                Err(error) => {
                    tracing::error!("the new configuration does not work, back to the one before: {error}");
                    config = before;
                    let Some(service) = self.start_as_before(&mut config, record.as_deref()) else { break };
                    service
                }
            };
        }
        self.watchdog.stopping();
        Ok(())
    }

    fn start(&self, config: &Config, record: Option<PathBuf>) -> Result<(Service, Shutdown)> {
        let ending = Shutdown::new();
        let ends = ends(self.arguments, record, self.output.output(&ending), Some(self.board));
        Ok((Service::start(config, ends, &ending)?, ending))
    }

    /// Starts with a configuration that has worked before: if it fails now, a device is missing, and is
    /// waited for; SIGHUP can load another configuration. `None`: the program should end.
    fn start_as_before(&mut self, config: &mut Config, record: Option<&Path>) -> Option<(Service, Shutdown)> {
        let mut attempts = BackOff::new(FIRST_WAIT, LONGEST_WAIT);
        loop {
            attempts.attempt();
            match self.start(config, record.map(Path::to_owned)) {
                Ok(started) => return Some(started),
                Err(error) => tracing::warn!("{error}; trying again in {} s", attempts.wait().as_secs_f64()),
            }
            if self.shutdown.wait(attempts.wait()) {
                return None;
            }
            if self.signals.take_hangup() {
                match self.reload() {
                    Ok(next) => {
                        *config = next.config;
                        self.server.set_options(next.options);
                    }
                    Err(error) => tracing::error!("the configuration is not taken: {error}"),
                }
            }
        }
    }

    /// Runs one service until its end; returns what to continue with, if there is anything.
    fn run(&mut self, (service, ending): (Service, Shutdown)) -> Result<Option<Next>> {
        let mut next = None;
        let summary = service.summary().with(self.server.metrics().clone());
        let outcome = watch(service, &summary, "lists", Summary::lists_made, |summary| {
            if next.is_none() {
                self.watchdog.see(summary);
            }
            if self.shutdown.is_aborted() {
                ending.abort();
            } else if self.shutdown.is_requested() {
                ending.request();
            } else if next.is_none() && self.signals.take_hangup() {
                self.output.rotate();
                self.watchdog.reloading();
                match self.reload() {
                    Ok(reloaded) => {
                        tracing::info!("{}: taken anew", self.arguments.config.path().display());
                        next = Some(reloaded);
                        self.watchdog.starts_anew();
                        ending.request();
                    }
                    Err(error) => {
                        tracing::error!("the configuration is not taken, the old one stays: {error}");
                        self.watchdog.stays();
                    }
                }
            }
        });
        match (outcome, next) {
            (outcome, None) => outcome.map(|()| None),
            (Ok(()), next) => Ok(next.filter(|_| !self.shutdown.is_requested())),
            // An earlier error ends with the service in which it occurred.
            (Err(error), next) => {
                tracing::error!("the service before has ended with an error: {error}");
                Ok(next.filter(|_| !self.shutdown.is_requested()))
            }
        }
    }

    /// The configuration as its file is now, if a service could run with it.
    fn reload(&self) -> Result<Next> {
        let config = Config::load(self.arguments.config.path())?;
        let options = config.server_options()?;
        Service::check(&config)?;
        Ok(Next { config, options })
    }
}

/// What a service is restarted with.
struct Next {
    config: Config,
    options: ServerOptions,
}

/// Waits between attempts to start with a configuration that has worked: the first, which is doubled after
/// every attempt, and the longest.
const FIRST_WAIT: Duration = Duration::from_millis(250);
const LONGEST_WAIT: Duration = Duration::from_secs(8);

/// Where a restarted service records: FOLDER-2, FOLDER-3, ..., the first that is free.
fn next_folder(folder: &Path) -> PathBuf {
    let numbered = |number: u64| {
        let mut name = folder.as_os_str().to_owned();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    };
    (2..).map(numbered).find(|folder| !folder.exists()).expect("numbers do not end before folders do")
}
