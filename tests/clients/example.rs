//! An example of a client that runs, as its users see it.

use super::server::Guard;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// A list, or an end, that takes longer does not come; the machine may be busy with other work.
const PATIENCE: Duration = Duration::from_secs(60);

pub struct Example {
    guard: Guard,
    lines: Receiver<String>,
    reader: JoinHandle<()>,
    /// What it wrote on standard error, at its end.
    errors: Receiver<String>,
}

impl Example {
    pub fn start(command: &mut Command) -> Self {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut guard = Guard(command.spawn().unwrap());
        let lines = BufReader::new(guard.0.stdout.take().unwrap()).lines();
        let mut errors = guard.0.stderr.take().unwrap();
        let (sender, receiver) = sync_channel(1);
        let reader = std::thread::Builder::new().spawn(move || {
            for line in lines {
                if sender.send(line.unwrap()).is_err() {
                    break;
                }
            }
        });
        let (end_sender, end) = sync_channel(1);
        let watcher = std::thread::Builder::new().spawn(move || {
            let mut said = String::new();
            errors.read_to_string(&mut said).unwrap();
            let _ = end_sender.send(said);
        });
        // It ends with the example, of which the guard makes sure.
        drop(watcher.unwrap());
        Self { guard, lines: receiver, reader: reader.unwrap(), errors: end }
    }

    /// The next line that it prints.
    pub fn line(&self) -> String {
        self.lines.recv_timeout(PATIENCE).unwrap()
    }

    /// Reads no more, as `| head` does; its status and its errors.
    pub fn stop_reading(self) -> (ExitStatus, String) {
        drop(self.lines);
        Self::end(self.guard, self.reader, self.errors)
    }

    /// Ctrl-C; its status and its errors.
    pub fn interrupt(self) -> (ExitStatus, String) {
        kill_process(Pid::from_child(&self.guard.0), Signal::INT).unwrap();
        // What it still prints is read until its end.
        for _ in &self.lines {}
        Self::end(self.guard, self.reader, self.errors)
    }

    fn end(mut guard: Guard, reader: JoinHandle<()>, errors: Receiver<String>) -> (ExitStatus, String) {
        let said = errors.recv_timeout(PATIENCE).expect("it ends");
        let status = guard.0.wait().unwrap();
        reader.join().unwrap();
        (status, said)
    }
}
