//! The command line: one file per subcommand.

mod calibrate;
#[cfg(feature = "camera")]
mod devices;
mod input;
mod lights;
mod messages;
mod panorama;
mod progress;
mod record;
#[cfg(feature = "render")]
mod render;
mod report;
#[cfg(feature = "render")]
mod report_pictures;
#[cfg(feature = "render")]
mod report_speed;
mod resolution;
mod run;
mod signals;
mod standard_input;
mod standard_output;
mod synthesize;
mod watch;

use crate::error::{Error, Kind};
use clap::{Parser, Subcommand};
use messages::LogFormat;
use std::process::ExitCode;

/// Live light capture: turns HDR pictures of the surroundings into short lists of directional lights.
///
/// Results (JSON) go to standard output, messages to standard error. Exit codes: 0 done, 1 failed, 2 wrong
/// usage or configuration; 128 + n when a second signal n ended a run at once.
#[derive(Debug, Parser)]
#[command(name = "lightcast", version, propagate_version = true, max_term_width = 110)]
struct Arguments {
    #[command(subcommand)]
    command: Command,

    /// How messages on standard error are written; RUST_LOG says which.
    #[arg(long, global = true, value_enum, value_name = "FORMAT", default_value_t = LogFormat::Text)]
    log_format: LogFormat,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Arguments),
    Record(record::Arguments),
    #[cfg(feature = "camera")]
    Devices(devices::Arguments),
    Watch(watch::Arguments),
    Lights(lights::Arguments),
    Calibrate(calibrate::Arguments),
    #[cfg(feature = "render")]
    Render(Box<render::Arguments>),
    Synthesize(synthesize::Arguments),
    Report(report::Arguments),
    #[cfg(feature = "render")]
    ReportPictures(report_pictures::Arguments),
    #[cfg(feature = "render")]
    ReportSpeed(report_speed::Arguments),
}

/// Runs the program; the exit code is 0 for done, 1 for failed, 2 for wrong usage or configuration.
pub fn main() -> ExitCode {
    let Arguments { command, log_format } = Arguments::parse();
    let _messages = match messages::start(log_format) {
        Ok(messages) => messages,
        Err(error) => {
            messages::print(&format!("{error}\n"));
            return exit_code(&error);
        }
    };
    let outcome = match &command {
        Command::Run(arguments) => run::run(arguments),
        Command::Record(arguments) => record::run(arguments),
        #[cfg(feature = "camera")]
        Command::Devices(arguments) => devices::run(arguments),
        Command::Watch(arguments) => watch::run(arguments),
        Command::Lights(arguments) => lights::run(arguments),
        Command::Calibrate(arguments) => calibrate::run(arguments),
        #[cfg(feature = "render")]
        Command::Render(arguments) => render::run(arguments),
        Command::Synthesize(arguments) => synthesize::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        #[cfg(feature = "render")]
        Command::ReportPictures(arguments) => report_pictures::run(arguments),
        #[cfg(feature = "render")]
        Command::ReportSpeed(arguments) => report_speed::run(arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error}");
            exit_code(&error)
        }
    }
}

fn exit_code(error: &Error) -> ExitCode {
    ExitCode::from(if error.kind() == Kind::Usage { 2 } else { 1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_of_the_command_line_is_sound() {
        Arguments::command().debug_assert();
    }
}
