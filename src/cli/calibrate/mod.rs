//! `lightcast calibrate`: one file per thing that is calibrated.

mod lens;
mod orientation;
#[cfg(feature = "april-grid")]
mod photographs;
mod residual_plot;

use crate::error::Result;
use clap::Subcommand;

/// Find out what a camera is like.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Lens(lens::Arguments),
    Orientation(orientation::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::Lens(arguments) => lens::run(arguments),
        What::Orientation(arguments) => orientation::run(arguments),
    }
}
