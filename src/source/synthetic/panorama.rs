//! A real panorama, turned about the vertical, with some of its pixels flickering.

use super::animation::Flicker;
use super::area::AreaMean;
use super::emitter::Detail;
use crate::error::{Error, Place, Result};
use glam::DVec3;
use lightcast_core::image::{Frame, Pixels, PolarMap, PolarShape};
use lightcast_core::math::percentile;
use lightcast_core::math::polar;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// Which panorama, and what moves in it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanoramaOptions {
    /// Lat-long HDR file: a path relative to the script, or `data:PATH` below the folder that LIGHTCAST_DATA
    /// names.
    pub file: String,
    /// Columns and rows of the grid to which the file is resampled first, by exact areas; columns and
    /// percentiles below refer to this grid. Without it the file's own size is used.
    pub resolution: Option<[usize; 2]>,
    /// Without it the panorama does not turn.
    #[serde(default)]
    pub turn: Turn,
    /// Without it the panorama does not flicker.
    pub flicker: Option<PixelFlicker>,
}

/// Rotation about the vertical: the picture moves towards greater phi.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Turn {
    /// Angle at time 0 in degrees.
    pub start_deg: f64,
    /// Instead of `start_deg`: the column, counted from phi = 0, at which the brightest column of the upper
    /// half (by luminous power) is at time 0.
    pub peak_column: Option<f64>,
    /// Speed in degrees per second.
    pub degrees_per_second: f64,
    /// Instead of `degrees_per_second`: columns of the grid per frame.
    pub columns_per_frame: Option<f64>,
}

/// Flicker of the bright pixels in some columns of the upper half, as they are before any rotation.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PixelFlicker {
    /// First and last column, both included, counted from phi = 0.
    pub columns: [usize; 2],
    /// Only pixels above this percentile of the luminance of all pixels of the upper half (linear between
    /// ranks).
    pub above_percentile: f64,
    /// Cycles per second.
    pub frequency_hz: f64,
    /// Amplitude as a fraction of the mean, 0 to 1.
    pub depth: f64,
    /// Phase at time 0 in turns.
    #[serde(default)]
    pub phase_turns: f64,
}

impl PixelFlicker {
    fn sine(&self) -> Flicker {
        Flicker { frequency_hz: self.frequency_hz, depth: self.depth, phase_turns: self.phase_turns }
    }
}

/// A pixel with more than this fraction of the total power is integrated finely, if it also outshines its
/// surroundings. The error of any other pixel is at most its own power, of either sign.
const HOT_SHARE: f64 = 2e-5;

/// Factor above the mean radiance from which a pixel outshines its surroundings: below it, neighbours are
/// similar and coarse cells suffice.
const HOT_CONTRAST: f64 = 30.0;

/// Cells across a pixel of the grid that integrate its bilinear hat to 1e-3.
const CELLS_PER_PIXEL: f64 = 12.0;

/// A loaded panorama.
#[derive(Clone, Debug)]
pub struct Panorama {
    /// The whole sphere.
    map: PolarMap,
    /// Pixels that flicker, if any do.
    flickering: Vec<bool>,
    flicker: Option<Flicker>,
    /// Pixels with a large fraction of the power.
    hot: Vec<(usize, usize)>,
    start_columns: f64,
    columns_per_second: f64,
}

impl Panorama {
    /// Builds it from a lat-long frame of radiance with half-pixel centres (OpenEXR's orientation) and 1 or 3
    /// channels.
    ///
    /// Errors say which option does not fit the picture, and name the key below `panorama`.
    pub fn new(options: &PanoramaOptions, frame: &Frame, frame_rate_hz: f64) -> Result<Self> {
        let Pixels::Radiance(samples) = &frame.pixels else {
            return Err(Error::usage("holds raw codes, not radiance").at(Place::key("file")));
        };
        let channels = frame.channels;
        let [columns, rows] = options.resolution.unwrap_or([frame.width, frame.height]);
        if columns == 0 || columns > frame.width || rows < 2 || rows % 2 == 1 || rows > frame.height {
            return Err(Error::usage(format!(
                "must be at most the file's {} x {}, with an even number of rows",
                frame.width, frame.height
            ))
            .at(Place::key("resolution")));
        }
        let pixel = |row: usize, column: usize| {
            let start = (row * frame.width + column) * channels;
            // Negative values and values that are not finite cannot be radiance and count as 0.
            let sample = |channel: usize| {
                let value = samples[start + channel.min(channels - 1)];
                if value.is_finite() { f64::from(value.max(0.0)) } else { 0.0 }
            };
            [sample(0), sample(1), sample(2)]
        };
        // phi = 2 pi u - pi/2: column 0 of the map begins a quarter of the file's width in.
        let mut mean = AreaMean::new([frame.width, frame.height], [columns, rows], frame.width as f64 / 4.0);
        let shape = PolarShape::new(columns, rows, PI).map_err(|error| {
            Error::usage(format!("{error}; give a smaller one")).at(Place::key("resolution"))
        })?;
        let mut map = PolarMap::black(shape);
        mean.write(pixel, |row, column, value| map.pixels[row * columns + column] = value.map(|v| v as f32));

        let start_columns = match options.turn.peak_column {
            Some(column) => column - brightest_column(&map) as f64,
            None => options.turn.start_deg / 360.0 * columns as f64,
        };
        let columns_per_second = match options.turn.columns_per_frame {
            Some(speed) => speed * frame_rate_hz,
            None => options.turn.degrees_per_second / 360.0 * columns as f64,
        };
        // Beyond 1e9 a millionth of a column is lost after a few seconds; infinity would give NaN.
        if !(start_columns.abs() <= 1e9 && columns_per_second.abs() <= 1e9) {
            return Err(Error::usage("must be at most 1e9 columns, and 1e9 columns per second")
                .at(Place::key("turn")));
        }
        let flickering = match &options.flicker {
            None => Vec::new(),
            Some(flicker) => {
                flicker.sine().check()?;
                if flicker.columns[0] > flicker.columns[1] || flicker.columns[1] >= columns {
                    return Err(Error::usage(format!("must ascend and end below {columns}"))
                        .at(Place::key("flicker.columns")));
                }
                if !(0.0..=100.0).contains(&flicker.above_percentile) {
                    return Err(
                        Error::usage("must lie between 0 and 100").at(Place::key("flicker.above_percentile"))
                    );
                }
                flicker_mask(&map, flicker)
            }
        };
        let hot = hot_pixels(&map);
        let flicker = options.flicker.map(|flicker| flicker.sine());
        Ok(Self { map, flickering, flicker, hot, start_columns, columns_per_second })
    }

    /// The panorama at a time.
    pub fn at(&self, time_s: f64) -> PanoramaAt<'_> {
        let turn = self.start_columns + self.columns_per_second * time_s;
        PanoramaAt {
            panorama: self,
            // Rounded to a millionth of a column, so that whole columns stay whole despite the rounding of
            // frame times.
            turn_columns: (turn * 1e6).round() / 1e6,
            factor: self.flicker.map_or(1.0, |flicker| flicker.factor(time_s)),
        }
    }

    fn width(&self) -> usize {
        self.map.shape.columns()
    }
}

/// A panorama at one time.
pub struct PanoramaAt<'a> {
    panorama: &'a Panorama,
    turn_columns: f64,
    factor: f64,
}

impl PanoramaAt<'_> {
    /// Radiance from a direction (unit vector), bilinear between the pixels' centres.
    pub fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let (columns, rows) = (self.panorama.map.shape.columns(), self.panorama.map.shape.rows());
        let (theta_rad, phi_rad) = polar(direction);
        let y = (theta_rad / PI * rows as f64 - 0.5).clamp(0.0, (rows - 1) as f64);
        let x = (phi_rad / TAU * columns as f64 - self.turn_columns - 0.5).rem_euclid(columns as f64);
        // rem_euclid may round up to the modulus itself.
        let (row, column) = (y as usize, x as usize % columns);
        let (below, right) = ((row + 1).min(rows - 1), (column + 1) % columns);
        let (ty, tx) = (y.fract(), x.fract());
        let corners = [
            self.value(row, column),
            self.value(row, right),
            self.value(below, column),
            self.value(below, right),
        ];
        let weights = [(1.0 - ty) * (1.0 - tx), (1.0 - ty) * tx, ty * (1.0 - tx), ty * tx];
        std::array::from_fn(|channel| (0..4).map(|i| weights[i] * corners[i][channel]).sum())
    }

    /// Details where single pixels hold much of the power.
    pub fn details(&self) -> impl Iterator<Item = Detail> {
        let shape = self.panorama.map.shape;
        let height_rad = PI / shape.rows() as f64;
        self.panorama.hot.iter().map(move |(row, column)| {
            let theta_rad = (*row as f64 + 0.5) * height_rad;
            let width_rad = TAU / shape.columns() as f64;
            let phi_rad = (*column as f64 + 0.5 + self.turn_columns) * width_rad;
            Detail {
                direction: lightcast_core::math::direction(theta_rad, phi_rad),
                // The hat extends one pixel from its centre in each direction.
                radius_rad: height_rad.hypot(width_rad),
                cell_rad: height_rad.min(width_rad * theta_rad.sin()) / CELLS_PER_PIXEL,
            }
        })
    }

    /// Writes a lat-long picture (OpenEXR's orientation, half-pixel centres) by exact areas of the grid's
    /// pixels, as `write(row, column, radiance)`.
    pub fn write_lat_long(&self, width: usize, height: usize, write: impl FnMut(usize, usize, [f64; 3])) {
        let (columns, rows) = (self.panorama.map.shape.columns(), self.panorama.map.shape.rows());
        AreaMean::new([columns, rows], [width, height], -self.turn_columns - columns as f64 / 4.0)
            .write(|row, column| self.value(row, column), write);
    }

    fn value(&self, row: usize, column: usize) -> [f64; 3] {
        let index = row * self.panorama.width() + column;
        let value = self.panorama.map.pixels[index].map(f64::from);
        if self.panorama.flickering.get(index).copied().unwrap_or(false) {
            value.map(|v| v * self.factor)
        } else {
            value
        }
    }
}

/// Column of the upper half with the greatest luminous power.
fn brightest_column(map: &PolarMap) -> usize {
    let mut power = vec![0.0; map.shape.columns()];
    for row in 0..map.shape.rows() / 2 {
        for (column, sum) in power.iter_mut().enumerate() {
            *sum += f64::from(map.luminance(row, column)) * map.shape.pixel_solid_angle(row);
        }
    }
    let brightest = power.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
    brightest.map_or(0, |(column, _)| column)
}

fn flicker_mask(map: &PolarMap, flicker: &PixelFlicker) -> Vec<bool> {
    let (columns, rows) = (map.shape.columns(), map.shape.rows());
    let mut upper: Vec<f64> = Vec::with_capacity(rows / 2 * columns);
    for row in 0..rows / 2 {
        upper.extend((0..columns).map(|column| f64::from(map.luminance(row, column))));
    }
    upper.sort_by(f64::total_cmp);
    let threshold = percentile(&upper, flicker.above_percentile / 100.0);
    let mut mask = vec![false; map.shape.len()];
    for row in 0..rows / 2 {
        for column in flicker.columns[0]..=flicker.columns[1] {
            mask[row * columns + column] = f64::from(map.luminance(row, column)) > threshold;
        }
    }
    mask
}

fn hot_pixels(map: &PolarMap) -> Vec<(usize, usize)> {
    let power =
        |row: usize, column: usize| f64::from(map.luminance(row, column)) * map.shape.pixel_solid_angle(row);
    let pixels =
        || (0..map.shape.rows()).flat_map(|row| (0..map.shape.columns()).map(move |column| (row, column)));
    let total: f64 = pixels().map(|(row, column)| power(row, column)).sum();
    let hot = |row: usize, column: usize| {
        power(row, column) > HOT_SHARE * total
            && f64::from(map.luminance(row, column)) > HOT_CONTRAST * total / (4.0 * PI)
    };
    pixels().filter(|(row, column)| hot(*row, *column)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::math::direction;

    /// 40 x 20 pixels of 1 with a bright pixel in file column 15 (phi column 5), row 6.
    fn frame() -> Frame {
        let mut samples = vec![1.0f32; 40 * 20];
        samples[6 * 40 + 15] = 5000.0;
        Frame { width: 40, height: 20, pixels: Pixels::Radiance(samples), ..Frame::default() }
    }

    fn options(text: &str) -> PanoramaOptions {
        toml::from_str(&format!("file = 'x.hdr'\n{text}")).unwrap()
    }

    fn bright(panorama: &Panorama, time_s: f64, width: usize, height: usize) -> Vec<(usize, usize, f64)> {
        let mut found = Vec::new();
        panorama.at(time_s).write_lat_long(width, height, |row, column, value| {
            if value[0] != 1.0 {
                found.push((row, column, value[0]));
            }
        });
        found
    }

    #[test]
    fn standing_still_gives_the_file_back_bit_for_bit() {
        let panorama = Panorama::new(&options(""), &frame(), 25.0).unwrap();
        assert_eq!(bright(&panorama, 3.0, 40, 20), [(6, 15, 5000.0)]);
    }

    #[test]
    fn the_peak_moves_by_whole_columns_from_where_it_is_put() {
        let turn = "turn = { peak_column = 20.0, columns_per_frame = -1.0 }";
        let panorama = Panorama::new(&options(turn), &frame(), 25.0).unwrap();
        for frame in 0..40usize {
            // phi column 20 - t is file column 30 - t.
            let expected = (30 + 40 - frame) % 40;
            assert_eq!(bright(&panorama, frame as f64 / 25.0, 40, 20), [(6, expected, 5000.0)], "{frame}");
        }
    }

    #[test]
    fn directions_agree_with_the_lat_long_picture() {
        let panorama = Panorama::new(&options("turn.start_deg = 18.0"), &frame(), 25.0).unwrap();
        // phi column 5 plus two columns of 9 degrees each.
        let middle = direction((6.5f64 * 9.0).to_radians(), (7.5f64 * 9.0).to_radians());
        let at = panorama.at(0.0);
        assert!((at.radiance(middle)[0] / 5000.0 - 1.0).abs() < 1e-9);
        assert_eq!(at.radiance(-middle), [1.0; 3]);
        let detail: Vec<Detail> = at.details().collect();
        assert_eq!(detail.len(), 1);
        assert!(detail[0].direction.dot(middle) > 1.0 - 1e-12);
    }

    #[test]
    fn flicker_takes_bright_pixels_of_its_columns_only() {
        let mut frame = frame();
        if let Pixels::Radiance(samples) = &mut frame.pixels {
            samples[3 * 40 + 25] = 3000.0; // phi column 15: outside
            samples[15 * 40 + 14] = 3000.0; // lower half: outside
        }
        let text = "flicker = { columns = [2, 8], above_percentile = 97.0, frequency_hz = 9.5, depth = 0.5 }";
        let panorama = Panorama::new(&options(text), &frame, 25.0).unwrap();
        let factor = 1.0 + 0.5 * (TAU * 0.38).sin();
        let found = bright(&panorama, 0.04, 40, 20);
        assert_eq!(found.len(), 3);
        assert_eq!((found[0].0, found[0].2, found[2].0, found[2].2), (3, 3000.0, 15, 3000.0));
        assert!((found[1].2 / (5000.0 * factor) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn options_that_do_not_fit_are_refused() {
        for text in [
            "resolution = [41, 20]",
            "resolution = [40, 15]",
            "turn.start_deg = nan",
            "turn.degrees_per_second = 1e308",
            "flicker = { columns = [2, 40], above_percentile = 97.0, frequency_hz = 1.0, depth = 0.5 }",
            "flicker = { columns = [2, 3], above_percentile = 101.0, frequency_hz = 1.0, depth = 0.5 }",
            "flicker = { columns = [2, 3], above_percentile = 1.0, frequency_hz = 1.0, depth = 1.5 }",
        ] {
            assert!(Panorama::new(&options(text), &frame(), 25.0).is_err(), "{text}");
        }
        assert!(toml::from_str::<PanoramaOptions>("file = 'x'\nturns = 1").is_err());
    }
}
