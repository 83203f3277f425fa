//! `lightcast calibrate`: one file per thing that is calibrated.

mod response;

use crate::error::Result;
use clap::Subcommand;

/// Calibrate a camera.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Response(response::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::Response(arguments) => response::run(arguments),
    }
}
