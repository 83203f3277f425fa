//! The command line: one file per subcommand.

use std::process::ExitCode;

/// Runs the program; the exit code is 0 for done, 1 for failed, 2 for wrong usage or configuration.
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
