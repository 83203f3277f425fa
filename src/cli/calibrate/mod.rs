//! `lightcast calibrate`: one file per thing that is calibrated.

mod lens;
#[cfg(feature = "april-grid")]
mod photographs;
mod residual_plot;

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
    Lens(lens::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::Lens(arguments) => lens::run(arguments),
    }
}
