//! The program on recorded sequences: identical output on every run, bad files, wrong configurations,
//! signals; reports.
#![expect(clippy::unwrap_used, reason = "in a test a panic is the report")]

mod bad_frames;
mod bundled;
mod configuration;
mod fisheye;
mod killed;
mod lights;
mod recording;
#[cfg(feature = "render")]
mod render;
mod repeatable;
#[cfg(feature = "render")]
mod report;
mod report_page;
mod signals;
