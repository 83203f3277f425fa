//! The pieces of work.

use lightcast::camera::{Calibration, FrameToPolar, LOOKING_UP, Projection};
use lightcast::image::{Frame, Pixels, PolarMap, PolarShape, luminance, read, write_exr};
use lightcast::sampling::{Bicontinuous, Standard, halton};
use lightcast::temporal::{FilterOptions, design};
use serde::Deserialize;
use std::error::Error;
use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// One step of a piece of work.
pub type Work = Box<dyn FnMut() -> Result<()>>;

/// What can be asked for. Files are read unless it says `Written`.
#[derive(Deserialize)]
#[serde(tag = "case", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Case {
    /// Raw frames (u16) of one lens to hemispherical maps. The first is timed; all are done once.
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
    /// Reads so many bytes of memory once.
    Stream { bytes: usize },
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inversion {
    Standard,
    Bicontinuous,
}

/// What of [`Case::Sampling`] is timed.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    Cdf,
    Samples,
}

/// A piece of work that is ready, its results written, and the bytes that a step streams, where they are known.
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
            let step = move || Ok(design(frame_rate_hz, &FilterOptions::default())?);
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
            repeated(move || Ok(stream(black_box(&words))))
        }
    };
    Ok((None, work))
}

fn repeated<T: 'static>(mut step: impl FnMut() -> Result<T> + 'static) -> Work {
    Box::new(move || step().map(|result| drop(black_box(result))))
}

/// A calibrated camera that looks up at a hemisphere.
struct Camera {
    calibration: Calibration,
    matrix: FrameToPolar,
    map: PolarMap,
}

impl Camera {
    fn load(calibration: &Path, shape: PolarShape) -> Result<Self> {
        let calibration = Calibration::load(calibration, None)?;
        let matrix = FrameToPolar::new(&Projection::Fisheye(calibration.lens), LOOKING_UP, shape)?;
        Ok(Self { calibration, matrix, map: PolarMap::black(shape) })
    }

    fn read(&self, frame: &Path) -> Result<Frame> {
        let pixels = Pixels::Codes(numbers(frame, u16::from_le_bytes)?);
        let lens = self.calibration.lens.parameters();
        Ok(Frame { width: lens.width, height: lens.height, pixels, ..Frame::default() })
    }

    fn apply(&mut self, frame: &Frame) -> Result<&PolarMap> {
        self.matrix.apply(black_box(frame), &self.calibration.response, &mut self.map)?;
        Ok(&self.map)
    }

    fn frame_to_polar(
        mut self,
        frames: &[PathBuf],
        table: &Path,
        maps: &Path,
    ) -> Result<(Option<usize>, Work)> {
        let radiance = self.calibration.response.table();
        save(table, (0..1 << 16).map(|code: usize| radiance[code.min(radiance.len() - 1)].to_le_bytes()))?;
        let mut values = Vec::new();
        for frame in frames {
            let frame = self.read(frame)?;
            values.extend(self.apply(&frame)?.pixels.iter().map(|pixel| pixel[0].to_le_bytes()));
        }
        save(maps, values)?;
        let frame = self.read(frames.first().ok_or("no frames")?)?;
        let bytes = self.matrix.streamed_bytes() + 2 * frame.width * frame.height;
        Ok((Some(bytes), repeated(move || self.apply(&frame).map(drop))))
    }

    fn chain(mut self, frame: &Path, count: u64, samples: &Path) -> Result<Work> {
        let frame = self.read(frame)?;
        let points: Vec<[f64; 2]> = (1..=count).map(|index| [halton(index, 2), halton(index, 3)]).collect();
        let mut distribution = Distribution::new(Inversion::Standard, self.map.shape);
        let mut values = vec![0.0; self.map.shape.len()];
        let mut step = move || -> Result<Vec<[f64; 2]>> {
            for (value, &pixel) in values.iter_mut().zip(&self.apply(&frame)?.pixels) {
                *value = luminance(pixel);
            }
            distribution.update(&values);
            Ok(points.iter().map(|&u| distribution.sample(u)).collect())
        };
        save(samples, step()?.as_flattened().iter().map(|value| value.to_le_bytes()))?;
        Ok(repeated(step))
    }
}

enum Distribution {
    Standard(Standard),
    Bicontinuous(Bicontinuous),
}

impl Distribution {
    fn new(inversion: Inversion, shape: PolarShape) -> Self {
        let z = |row: f64| 1.0 - (shape.theta_max_rad * row / shape.rows as f64).cos();
        match inversion {
            Inversion::Standard => {
                let edges: Vec<f64> = (0..=shape.rows).map(|row| z(row as f64)).collect();
                Self::Standard(Standard::new(shape.columns, &edges))
            }
            Inversion::Bicontinuous => {
                let centres: Vec<f64> = (0..shape.rows).map(|row| z(row as f64 + 0.5)).collect();
                Self::Bicontinuous(Bicontinuous::new(shape.columns, &centres, z(shape.rows as f64)))
            }
        }
    }

    fn update(&mut self, values: &[f32]) {
        match self {
            Self::Standard(standard) => standard.update(values),
            Self::Bicontinuous(bicontinuous) => bicontinuous.update(values),
        }
    }

    fn sample(&self, u: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Standard(standard) => standard.sample(u),
            Self::Bicontinuous(bicontinuous) => bicontinuous.sample(u),
        }
    }

    fn pdf(&self, x: [f64; 2]) -> f64 {
        match self {
            Self::Standard(standard) => standard.pdf(x),
            Self::Bicontinuous(bicontinuous) => bicontinuous.pdf(x),
        }
    }
}

fn sampling(
    mut distribution: Distribution,
    part: Part,
    values: Vec<f32>,
    points: &Path,
    samples: &Path,
) -> Result<Work> {
    let points = numbers(points, f64::from_le_bytes)?.as_chunks::<2>().0.to_vec();
    distribution.update(&values);
    let results = points.iter().flat_map(|&u| {
        let x = distribution.sample(u);
        [x[0], x[1], distribution.pdf(x)]
    });
    save(samples, results.map(f64::to_le_bytes))?;
    Ok(match part {
        Part::Cdf => repeated(move || Ok(distribution.update(black_box(&values)))),
        Part::Samples => {
            let mut positions = vec![[0.0; 2]; points.len()];
            repeated(move || {
                for (position, &u) in positions.iter_mut().zip(&points) {
                    *position = distribution.sample(u);
                }
                Ok(black_box(&mut positions)[0])
            })
        }
    })
}

/// Reads every word once, eight sums side by side: what memory gives.
fn stream(words: &[u64]) -> [u64; 8] {
    let mut sums = [0u64; 8];
    for chunk in words.as_chunks::<8>().0 {
        for lane in 0..8 {
            sums[lane] = sums[lane].wrapping_add(chunk[lane]);
        }
    }
    sums
}

fn numbers<T, const N: usize>(path: &Path, number: impl Fn([u8; N]) -> T) -> Result<Vec<T>> {
    let bytes = fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(bytes.as_chunks::<N>().0.iter().map(|&bytes| number(bytes)).collect())
}

fn save<const N: usize>(path: &Path, numbers: impl IntoIterator<Item = [u8; N]>) -> Result<()> {
    let bytes: Vec<u8> = numbers.into_iter().flatten().collect();
    Ok(fs::write(path, bytes).map_err(|error| format!("{}: {error}", path.display()))?)
}
