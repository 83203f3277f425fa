//! `lightcast calibrate`: one file per thing that is calibrated.

mod lens;
mod orientation;
mod photographs;
mod residual_plot;
mod response;

use crate::error::{Error, Result};
use crate::files::replace_file;
use clap::Subcommand;
use std::io::Write as _;
use std::path::Path;

/// Calibrate a camera: its lens, its response, its orientation.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Lens(lens::Arguments),
    Orientation(orientation::Arguments),
    Response(response::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::Lens(arguments) => lens::run(arguments),
        What::Orientation(arguments) => orientation::run(arguments),
        What::Response(arguments) => response::run(arguments),
    }
}

/// Writes a file, whole or not at all.
fn write(path: &Path, text: &str) -> Result<()> {
    replace_file(path, |writer| {
        writer.write_all(text.as_bytes()).map_err(|error| Error::failed("cannot be written").because(error))
    })
}
