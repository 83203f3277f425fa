//! Computed (synthetic) sequences, for the demo, tests and benches.
//!
//! A [`Script`] describes the surroundings (a sky, a room or a recorded panorama), what moves in them, and
//! the camera. A scene is a function `radiance(direction, time)`; a pixel is its mean over the pixel's solid
//! angle (so that radiance times solid angle sums to the scene's power, METHODS section 4), times the
//! exposure's gain, with noise, mapped by the response. Everything follows from the script and the frame's
//! number: any frame can be made on its own, and the same script always produces the same bytes.

mod animation;
mod area;
mod emitter;
mod integrate;
mod noise;
mod panorama;
mod room;
mod script;
mod sensor;
mod sky;
mod surroundings;

pub use script::{FrameName, Script};

use super::{FrameSource, Next};
use crate::error::Result;
use animation::gain;
use integrate::PixelIntegral;
use lightcast_core::camera::Projection;
use lightcast_core::image::{Frame, Pixels, Stamp, luminance};
use surroundings::SceneAt;

/// The source that makes the frames of a script, one after the other, once.
#[derive(Clone, Debug)]
pub struct Synthetic {
    script: Script,
    next: usize,
    /// One frame of radiance, before the response.
    radiance: Vec<f32>,
}

impl Synthetic {
    /// Starts at frame 0.
    pub fn new(script: Script) -> Self {
        Self { script, next: 0, radiance: Vec::new() }
    }

    /// The script.
    pub fn script(&self) -> &Script {
        &self.script
    }

    /// Makes one frame, counted from 0; frames past the script's end continue it. Uses all processors.
    pub fn render(&mut self, index: usize, frame: &mut Frame) {
        let script = &self.script;
        let time_s = index as f64 / script.frame_rate_hz;
        let (width, height) = (script.view.projection.width(), script.view.projection.height());
        frame.stamp = Stamp {
            sequence: script.name.first_number + index as u64,
            capture_time_ns: (time_s * 1e9).round() as i64,
            lost_before: 0,
            frame_rate_hz: script.frame_rate_hz,
        };
        (frame.width, frame.height, frame.channels) = (width, height, script.channels);

        if script.response.is_identity() {
            if !matches!(frame.pixels, Pixels::Radiance(_)) {
                frame.pixels = Pixels::Radiance(Vec::new());
            }
            if let Pixels::Radiance(samples) = &mut frame.pixels {
                script.radiance(index, time_s, samples);
            }
            return;
        }
        script.radiance(index, time_s, &mut self.radiance);
        if !matches!(frame.pixels, Pixels::Codes(_)) {
            frame.pixels = Pixels::Codes(Vec::new());
        }
        if let Pixels::Codes(codes) = &mut frame.pixels {
            let noise = script.noise.map(|noise| noise.at(index as u64));
            codes.clear();
            codes.extend(self.radiance.iter().zip(0u64..).map(|(radiance, sample)| {
                let code = script.response.encode(*radiance);
                noise.map_or(code, |noise| noise.code(code, sample, &script.response))
            }));
        }
    }
}

impl FrameSource for Synthetic {
    fn next(&mut self, frame: &mut Frame) -> Result<Next> {
        if self.next >= self.script.frames {
            return Ok(Next::End);
        }
        self.render(self.next, frame);
        self.next += 1;
        Ok(Next::Frame)
    }
}

impl Script {
    /// Fills `samples` with a frame's radiance: exposure and photon noise are applied, the response is not.
    fn radiance(&self, index: usize, time_s: f64, samples: &mut Vec<f32>) {
        let projection = &self.view.projection;
        let (width, height, channels) = (projection.width(), projection.height(), self.channels);
        samples.clear();
        samples.resize(width * height * channels, 0.0);
        let scene = self.scene.at(time_s);
        let put = |pixel: &mut [f32], rgb: [f64; 3]| match pixel {
            [value] => *value = luminance(rgb.map(|v| v as f32)),
            _ => pixel.iter_mut().zip(rgb).for_each(|(value, v)| *value = v as f32),
        };
        match (&scene, projection) {
            // Resampling from grid to grid is exact, and a panorama that turns by whole columns keeps every
            // bit.
            (SceneAt::Panorama(panorama), Projection::LatLong { .. }) => {
                panorama.write_lat_long(width, height, |row, column, rgb| {
                    let start = (row * width + column) * channels;
                    put(&mut samples[start..start + channels], rgb);
                });
            }
            _ => self.integrate(&scene, samples, put),
        }
        let gain = gain(&self.exposure, time_s) as f32;
        let noise = self.noise.map(|noise| noise.at(index as u64));
        for (value, sample) in samples.iter_mut().zip(0u64..) {
            *value *= gain;
            if let Some(noise) = noise {
                *value = noise.radiance(f64::from(*value), sample) as f32;
            }
        }
    }

    /// Pixel means. The rows are distributed to as many threads as there are processors; each row depends
    /// only on the script, so the number of threads does not affect the result.
    fn integrate(&self, scene: &SceneAt<'_>, samples: &mut [f32], put: impl Fn(&mut [f32], [f64; 3]) + Sync) {
        let width = self.view.projection.width();
        let details = scene.details();
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut hands: Vec<Vec<(usize, &mut [f32])>> = (0..threads).map(|_| Vec::new()).collect();
        for (row, line) in samples.chunks_exact_mut(width * self.channels).enumerate() {
            hands[row % threads].push((row, line));
        }
        std::thread::scope(|scope| {
            for hand in hands {
                let work = || {
                    let mut integral = PixelIntegral::default();
                    for (row, line) in hand {
                        for (column, pixel) in line.chunks_exact_mut(self.channels).enumerate() {
                            let place = [column, row];
                            let mean =
                                integral.mean(&self.view, place, self.cells, &details, |d| scene.radiance(d));
                            put(pixel, mean);
                        }
                    }
                };
                scope.spawn(work);
            }
        });
    }
}

#[cfg(test)]
mod tests;
