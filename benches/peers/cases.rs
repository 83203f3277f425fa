//! The pieces of work.

use crate::arrays::{numbers, save};
use crate::camera::Camera;
use crate::distribution::{Distribution, Inversion, Part, sampling};
use crate::stream::read as read_words;
use crate::work::{Result, Work, repeated};
use lightcast::design::{FilterOptions, low_pass};
use lightcast::files::{read, write_exr};
use lightcast_core::image::{Frame, Pixels, PolarShape};
use lightcast_core::sampling::halton;
use serde::Deserialize;
use std::hint::black_box;
use std::path::PathBuf;

/// The cases that can be requested. Files are read unless they are marked `Written`.
#[derive(Deserialize)]
#[serde(tag = "case", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Case {
    /// Raw frames (u16) of one lens to hemispherical maps. The first is timed; all are converted once.
    FrameToPolar {
        calibration: PathBuf,
        frames: Vec<PathBuf>,
        columns: usize,
        rows: usize,
        /// Written: radiance by code, 65,536 of f32.
        table: PathBuf,
        /// Written: the first channel of every map, f32.
        maps: PathBuf,
    },
    /// A raw frame to samples: polar map, luminance, CDFs, one sample for each of the first Halton points.
    Chain {
        calibration: PathBuf,
        frame: PathBuf,
        columns: usize,
        rows: usize,
        count: u64,
        /// Written: z and phi of every sample, f64.
        samples: PathBuf,
    },
    /// CDFs of a hemisphere (f32), or samples from it for given points (pairs of f64).
    Sampling {
        inversion: Inversion,
        part: Part,
        values: PathBuf,
        columns: usize,
        rows: usize,
        points: PathBuf,
        /// Written: z, phi and the density per solid angle of every sample, f64.
        samples: PathBuf,
    },
    /// Halton points of bases 2 and 3 from index 1 on. Written: pairs of f64.
    Halton { count: u64, points: PathBuf },
    /// Taps of the filter at a frame rate. Written: f64.
    Taps { frame_rate_hz: f64, taps: PathBuf },
    /// Reads pictures one after another. Written: their samples, f32.
    Read { files: Vec<PathBuf>, samples: PathBuf },
    /// Writes a picture (RGB, f32) as OpenEXR in half floats.
    Write { samples: PathBuf, width: usize, height: usize, file: PathBuf },
    /// Reads this many bytes of memory once.
    Stream { bytes: usize },
}

/// A piece of work that is ready, its results written, and the bytes that a step streams, where they are
/// known.
pub fn prepare(case: Case) -> Result<(Option<usize>, Work)> {
    let work: Work = match case {
        Case::FrameToPolar { calibration, frames, columns, rows, table, maps } => {
            let camera = Camera::load(&calibration, PolarShape::hemisphere(columns, rows))?;
            return camera.frame_to_polar(&frames, &table, &maps);
        }
        Case::Chain { calibration, frame, columns, rows, count, samples } => {
            let camera = Camera::load(&calibration, PolarShape::hemisphere(columns, rows))?;
            camera.chain(&frame, count, &samples)?
        }
        Case::Sampling { inversion, part, values, columns, rows, points, samples } => {
            let shape = PolarShape::hemisphere(columns, rows);
            let distribution = Distribution::new(inversion, shape);
            sampling(distribution, part, numbers(&values, f32::from_le_bytes)?, &points, &samples)?
        }
        Case::Halton { count, points } => {
            let mut values = Vec::with_capacity(count as usize);
            let mut step = move || {
                values.clear();
                values.extend((1..=count).map(|index| [halton(index, 2), halton(index, 3)]));
                values.clone()
            };
            save(&points, step().as_flattened().iter().map(|value| value.to_le_bytes()))?;
            repeated(move || Ok(step()))
        }
        Case::Taps { frame_rate_hz, taps } => {
            let step = move || Ok(low_pass(frame_rate_hz, &FilterOptions::default())?);
            save(&taps, step()?.as_slice().iter().map(|tap| tap.to_le_bytes()))?;
            repeated(step)
        }
        Case::Read { files, samples } => {
            let mut frame = Frame::default();
            let mut values = Vec::new();
            for file in &files {
                read(file, &mut frame)?;
                match &frame.pixels {
                    Pixels::Radiance(radiance) => {
                        values.extend(radiance.iter().map(|value| value.to_le_bytes()))
                    }
                    Pixels::Codes(codes) => {
                        values.extend(codes.iter().map(|&code| f32::from(code).to_le_bytes()))
                    }
                }
            }
            save(&samples, values)?;
            repeated(move || Ok(files.iter().try_for_each(|file| read(file, &mut frame).map(drop))?))
        }
        Case::Write { samples, width, height, file } => {
            let pixels = Pixels::Radiance(numbers(&samples, f32::from_le_bytes)?);
            let frame = Frame { width, height, channels: 3, pixels, ..Frame::default() };
            write_exr(&file, &frame, Some(25.0), true)?;
            repeated(move || Ok(write_exr(&file, &frame, Some(25.0), true)?))
        }
        Case::Stream { bytes } => {
            let words = vec![1u64; bytes / 8];
            repeated(move || Ok(read_words(black_box(&words))))
        }
    };
    Ok((None, work))
}
