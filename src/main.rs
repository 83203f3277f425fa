//! The program `lightcast`: see `lightcast --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    lightcast::cli::main()
}
