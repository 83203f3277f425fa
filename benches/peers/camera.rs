//! From raw frames to polar maps, and further to samples.

use crate::arrays::{numbers, save};
use crate::distribution::{Distribution, Inversion};
use crate::work::{Result, Work, repeated};
use lightcast::calibrate::Calibration;
use lightcast_core::camera::{FrameToPolar, LOOKING_UP, Projection};
use lightcast_core::image::{Frame, Pixels, PolarMap, PolarShape, luminance};
use lightcast_core::sampling::halton;
use std::hint::black_box;
use std::path::{Path, PathBuf};

/// A calibrated camera that looks up at a hemisphere.
pub struct Camera {
    calibration: Calibration,
    matrix: FrameToPolar,
    map: PolarMap,
}

impl Camera {
    pub fn load(calibration: &Path, shape: PolarShape) -> Result<Self> {
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

    pub fn frame_to_polar(
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

    pub fn chain(mut self, frame: &Path, count: u64, samples: &Path) -> Result<Work> {
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
