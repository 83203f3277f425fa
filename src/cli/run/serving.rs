//! `run --listen`: a service whose configuration can be reloaded (SIGHUP) while its clients stay connected.

use super::output_file::OutputFile;
use super::reload::Aside;
use super::systemd::Watchdog;
use super::{Arguments, ends, watch};
use crate::cli::signals::SignalWatch;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::net::{Board, Server, ServerOptions};
use crate::rt::{BackOff, Shutdown};
use crate::service::{Named, Prepared, Service, Summary};
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
        let first = config.clone();
        let Some(prepared) = self.wait_for(Aside::start(move || Prepared::new(&first))?) else {
            return Ok(());
        };
        let prepared = prepared?;
        let mut named = prepared.named().clone();
        let mut service = self.start(&config, prepared, self.arguments.record.clone())?;
        while let Some(next) = self.run(service, (&config, &named))? {
            named = next.prepared.named().clone();
            let before = std::mem::replace(&mut config, next.config);
            let record = self.arguments.record.as_deref().map(next_folder);
            service = match self.start(&config, next.prepared, record.clone()) {
                Ok(service) => {
                    self.server.set_options(next.options);
                    service
                }
                Err(error) => {
                    tracing::error!("the new configuration does not work, back to the one before: {error}");
                    config = before;
                    // What that one names is not looked at again: the next reload is taken in any case.
                    named = Named::default();
                    let Some(service) = self.start_as_before(&mut config, record.as_deref()) else { break };
                    service
                }
            };
        }
        self.watchdog.stopping();
        Ok(())
    }

    fn start(
        &self,
        config: &Config,
        prepared: Prepared,
        record: Option<PathBuf>,
    ) -> Result<(Service, Shutdown)> {
        let ending = Shutdown::new();
        let ends = ends(self.arguments, record, self.output.output(&ending), Some(self.board));
        Ok((Service::start_prepared(config, prepared, ends, &ending)?, ending))
    }

    /// Starts with a configuration that has worked before: if it fails now, a device is missing, and is
    /// waited for; SIGHUP can load another configuration. `None`: the program should end.
    fn start_as_before(&mut self, config: &mut Config, record: Option<&Path>) -> Option<(Service, Shutdown)> {
        let mut attempts = BackOff::new(FIRST_WAIT, LONGEST_WAIT);
        loop {
            attempts.attempt();
            let again = config.clone();
            let prepared = self.wait_for(Aside::start(move || Prepared::new(&again)).ok()?)?;
            let started =
                prepared.and_then(|prepared| self.start(config, prepared, record.map(Path::to_owned)));
            match started {
                Ok(started) => return Some(started),
                Err(error) => tracing::warn!("{error}; trying again in {} s", attempts.wait().as_secs_f64()),
            }
            if self.shutdown.wait(attempts.wait()) {
                return None;
            }
            if self.signals.take_hangup() {
                match self.reload().and_then(|reload| self.wait_for(reload).transpose()) {
                    Ok(Some(next)) => {
                        *config = next.config;
                        self.server.set_options(next.options);
                    }
                    Ok(None) => return None,
                    Err(error) => tracing::error!("the configuration is not taken: {error}"),
                }
            }
        }
    }

    /// Waits for work that is done aside while no service runs; `None`: the program should end.
    fn wait_for<T: Send + 'static>(&self, mut aside: Aside<T>) -> Option<Result<T>> {
        loop {
            if let Some(outcome) = aside.poll() {
                return Some(outcome);
            }
            if self.shutdown.wait(GLANCE) {
                return None;
            }
        }
    }

    /// Runs one service, of this configuration and what it names, until its end; returns what to continue
    /// with, if there is anything.
    fn run(&mut self, (service, ending): (Service, Shutdown), of: (&Config, &Named)) -> Result<Option<Next>> {
        let mut next = None;
        let mut reload = None;
        let summary = service.summary().with(self.server.metrics().clone());
        let outcome = watch(service, &summary, "lists", Summary::lists_made, |summary| {
            if next.is_none() {
                self.watchdog.see(summary);
            }
            if self.shutdown.is_aborted() {
                ending.abort();
            } else if self.shutdown.is_requested() {
                ending.request();
            } else if next.is_none() {
                next = self.look_for_reload(&mut reload, of);
                if next.is_some() {
                    ending.request();
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

    /// Starts to reload where SIGHUP came, and looks what has come of it; returns a configuration with which
    /// the service is to start anew. One that is as before is no reason for that: logs are rotated by the
    /// same signal, and a camera would miss frames.
    fn look_for_reload(
        &mut self,
        reload: &mut Option<Aside<Next>>,
        (config, named): (&Config, &Named),
    ) -> Option<Next> {
        // A signal that comes meanwhile waits.
        let is_busy = reload.as_ref().is_some_and(Aside::is_waited_for);
        if !is_busy && self.signals.take_hangup() {
            self.output.rotate();
            self.watchdog.reloading();
            let hangs = reload.as_ref().is_some_and(Aside::hangs);
            let started = match hangs {
                true => Err(Error::failed("the one before is still being prepared")),
                false => self.reload(),
            };
            match started {
                Ok(started) => *reload = Some(started),
                Err(error) => self.stay(&error),
            }
        }
        match reload.as_mut()?.poll()? {
            Ok(next) if next.config == *config && next.prepared.named() == named => {
                tracing::info!("{}: is as before", self.arguments.config.path().display());
                self.server.set_options(next.options);
                self.watchdog.stays();
                None
            }
            Ok(next) => {
                tracing::info!("{}: taken anew", self.arguments.config.path().display());
                self.watchdog.starts_anew();
                Some(next)
            }
            Err(error) => {
                self.stay(&error);
                None
            }
        }
    }

    fn stay(&self, error: &Error) {
        tracing::error!("the configuration is not taken, the old one stays: {error}");
        self.watchdog.stays();
    }

    /// Begins to read the configuration as its file is now, and to make of it what a service needs.
    fn reload(&self) -> Result<Aside<Next>> {
        let path = self.arguments.config.path().to_owned();
        Aside::start(move || {
            let config = Config::load(&path)?;
            let options = config.server_options()?;
            let prepared = Prepared::new(&config)?;
            Ok(Next { config, options, prepared })
        })
    }
}

/// What a service is restarted with.
struct Next {
    config: Config,
    options: ServerOptions,
    prepared: Prepared,
}

/// How often work aside is looked at while no service runs.
const GLANCE: Duration = Duration::from_millis(20);

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
