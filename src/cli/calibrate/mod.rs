mod orientation;

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
    Orientation(orientation::Arguments),
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    match &arguments.what {
        What::Orientation(arguments) => orientation::run(arguments),
    }
}
