//! The script file: what a synthetic sequence shows and how it is taken.
//!
//! TOML; unknown keys are refused. One of `[sky]`, `[room]`, `[panorama]` describes the surroundings, one of
//! `[lat_long]`, `[fisheye]` the projection.

use super::animation::Exposure;
use super::integrate::FrameView;
use super::panorama::{Panorama, PanoramaOptions};
use super::room::Room;
use super::sensor::Noise;
use super::sky::Sky;
use super::surroundings::Surroundings;
use crate::calibrate::Calibration;
use crate::error::{Error, Kind, Place, Result, TomlText};
use crate::files::{MAX_PIXELS, MAX_SIDE_PX, read};
use glam::DMat3;
use lightcast_core::camera::{LOOKING_UP, Lens, LensParameters, Projection, Response, ResponseModel};
use lightcast_core::image::{Frame, LatLongCentres};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A checked script.
#[derive(Clone, Debug)]
pub struct Script {
    /// File names of the frames.
    pub name: FrameName,
    /// How many frames there are.
    pub frames: usize,
    /// Frames per second.
    pub frame_rate_hz: f64,
    /// 3 for colour, 1 for luminance only.
    pub channels: usize,
    /// OpenEXR files hold half floats.
    pub half: bool,
    /// Least number of cells across a pixel.
    pub(super) cells: usize,
    /// Ascending in time.
    pub(super) exposure: Vec<Exposure>,
    /// `None` for no noise.
    pub(super) noise: Option<Noise>,
    /// The surroundings.
    pub(super) scene: Surroundings,
    /// The directions of pixels; the camera frame is the world for a lat-long picture.
    pub(super) view: FrameView,
    /// The response of the sensor; the identity for frames of radiance.
    pub(super) response: Response,
}

/// Name of a frame's file: a sequence of `#` stands for the number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameName {
    before: String,
    digits: usize,
    after: String,
    /// Number of the first frame.
    pub first_number: u64,
}

impl FrameName {
    fn parse(pattern: &str, first_number: u64) -> Option<Self> {
        let start = pattern.find('#')?;
        let digits = pattern[start..].bytes().take_while(|byte| *byte == b'#').count();
        let (before, after) = (pattern[..start].to_owned(), pattern[start + digits..].to_owned());
        let plain = !pattern.contains(['/', '\\']) && !after.contains('#') && digits <= 18;
        // A digit beside the number would be read as part of it.
        let apart = !before.ends_with(|c: char| c.is_ascii_digit())
            && !after.starts_with(|c: char| c.is_ascii_digit());
        (plain && apart).then_some(Self { before, digits, after, first_number })
    }

    /// The pattern, such as `name.####.exr`.
    pub fn pattern(&self) -> String {
        format!("{}{}{}", self.before, "#".repeat(self.digits), self.after)
    }

    /// File of a frame, counted from 0.
    pub fn file(&self, index: usize) -> String {
        let number = self.first_number + index as u64;
        format!("{}{number:0width$}{}", self.before, self.after, width = self.digits)
    }
}

/// The file's keys.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    name: String,
    frames: usize,
    frame_rate_hz: f64,
    #[serde(default)]
    first_number: u64,
    #[serde(default = "yes")]
    colour: bool,
    #[serde(default)]
    half: bool,
    #[serde(default = "cells")]
    cells_per_pixel: usize,
    #[serde(default)]
    exposure: Vec<Exposure>,
    noise: Option<Noise>,
    lat_long: Option<LatLong>,
    fisheye: Option<Fisheye>,
    sky: Option<Sky>,
    room: Option<Room>,
    panorama: Option<PanoramaOptions>,
}

fn yes() -> bool {
    true
}

/// Sixteen cells per pixel antialias edges.
fn cells() -> usize {
    4
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LatLong {
    width: usize,
    height: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fisheye {
    width: usize,
    height: usize,
    /// Full angle.
    field_of_view_deg: f64,
    /// k1 to k4 of Kannala and Brandt.
    #[serde(default)]
    k: [f64; 4],
    /// By default the circle of the field of view touches the nearer border.
    focal_px: Option<f64>,
    /// Principal point, half-pixel centres; by default the middle.
    centre_px: Option<[f64; 2]>,
    /// Rows of the rotation from the camera to the world; by default the camera looks straight up.
    world_from_camera: Option<[[f64; 3]; 3]>,
    /// Frames are raw codes by this response; radiance without it.
    #[serde(default)]
    response: ResponseModel,
}

impl Script {
    /// Reads a script. Paths in it are relative to its folder; those that begin with `data:` lie below
    /// `data`.
    ///
    /// # Errors
    /// `Usage`, naming the file, the line and the key: a file that cannot be read, is not TOML, has unknown
    /// keys or invalid values, or names a panorama that does not exist.
    pub fn load(path: &Path, data: Option<&Path>) -> Result<Self> {
        Self::parse(&TomlText::load(path)?, data)
    }

    /// As [`Self::load`], from a file that has already been read.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(script: &TomlText, data: Option<&Path>) -> Result<Self> {
        let keys: Keys = script.parse()?;
        let folder = script.path.parent().unwrap_or(Path::new(""));
        keys.check(folder, data).map_err(|error| script.locate("", error))
    }

    /// The camera of a fisheye script, for a calibration file; none for lat-long pictures. The orientation is
    /// not part of it.
    pub fn calibration(&self) -> Option<Calibration> {
        match self.view.projection {
            Projection::LatLong { .. } => None,
            Projection::Fisheye(lens) => {
                Some(Calibration { lens, response: self.response.clone(), notes: Vec::new() })
            }
        }
    }

    /// The projection of the frames.
    pub fn projection(&self) -> &Projection {
        &self.view.projection
    }

    /// Rotation from the camera frame to the world, as a configuration must give it; the identity for
    /// lat-long pictures.
    pub fn world_from_camera(&self) -> DMat3 {
        self.view.world_from_camera
    }
}

impl Keys {
    /// Errors name the key.
    fn check(self, folder: &Path, data: Option<&Path>) -> Result<Script> {
        let fault = |key: &str, fault: &str| Err(Error::usage(fault).at(Place::key(key)));
        if self.frames == 0 || self.frames > 1_000_000 {
            return fault("frames", "must be 1 to 1,000,000");
        }
        if !(1e-3..=1e5).contains(&self.frame_rate_hz) {
            return fault("frame_rate_hz", "must lie between 0.001 and 100,000");
        }
        if self.first_number > 1 << 60 {
            return fault("first_number", "must be below 2^60");
        }
        if !(1..=64).contains(&self.cells_per_pixel) {
            return fault("cells_per_pixel", "must be 1 to 64");
        }
        let Some(name) = FrameName::parse(&self.name, self.first_number) else {
            return fault(
                "name",
                "must hold one run of # for the number, not beside a digit, and no folder: day.####.png",
            );
        };
        let ascending = self.exposure.is_sorted_by(|a, b| a.time_s < b.time_s);
        let moderate = self.exposure.iter().all(|e| e.time_s.is_finite() && e.stops.abs() <= 100.0);
        if !ascending || !moderate {
            return fault("exposure", "must ascend in time_s, its stops between -100 and 100");
        }
        let (projection, world_from_camera, response) = match (&self.lat_long, &self.fisheye) {
            (Some(LatLong { width, height }), None) => {
                let projection =
                    Projection::LatLong { width: *width, height: *height, centres: LatLongCentres::Half };
                (projection, DMat3::IDENTITY, Response::default())
            }
            (None, Some(fisheye)) => fisheye.check().map_err(|error| error.at(Place::key("fisheye")))?,
            _ => return Err(Error::usage("lat_long or fisheye: one of the two sections must be there")),
        };
        self.check_size(&projection)?;
        let codes = !response.is_identity();
        let extension = if codes { ".png" } else { ".exr" };
        if !self.name.ends_with(extension) {
            return fault(
                "name",
                &format!(
                    "must end in {extension}: a fisheye with a response gives raw codes as 16-bit PNG, all else gives \
                     radiance as OpenEXR"
                ),
            );
        }
        if codes && self.half {
            return fault("half", "is for OpenEXR only");
        }
        if let Some(noise) = &self.noise {
            noise.check().map_err(|error| error.at(Place::key("noise")))?;
            if !codes && noise.read_codes != 0.0 {
                return fault("noise.read_codes", "is for raw codes only");
            }
        }
        Ok(Script {
            name,
            frames: self.frames,
            frame_rate_hz: self.frame_rate_hz,
            channels: if self.colour { 3 } else { 1 },
            half: self.half,
            cells: self.cells_per_pixel,
            exposure: self.exposure,
            noise: self.noise,
            scene: scene(
                [self.sky.map(Surroundings::Sky), self.room.map(Surroundings::Room)],
                self.panorama,
                |options| load_panorama(options, self.frame_rate_hz, folder, data),
            )?,
            view: FrameView { projection, world_from_camera },
            response,
        })
    }

    /// Refuses pictures that could not be read back.
    fn check_size(&self, projection: &Projection) -> Result<()> {
        let (width, height) = (projection.width(), projection.height());
        if (1..=MAX_SIDE_PX).contains(&width)
            && (1..=MAX_SIDE_PX).contains(&height)
            && width * height <= MAX_PIXELS
        {
            return Ok(());
        }
        let section = if self.fisheye.is_some() { "fisheye" } else { "lat_long" };
        let fault =
            format!("width and height must be 1 to {MAX_SIDE_PX}, at most {MAX_PIXELS} pixels in all");
        Err(Error::usage(fault).at(Place::key(section)))
    }
}

fn scene(
    analytic: [Option<Surroundings>; 2],
    panorama: Option<PanoramaOptions>,
    load: impl FnOnce(&PanoramaOptions) -> Result<Panorama>,
) -> Result<Surroundings> {
    let (section, scene) = match (analytic, panorama) {
        ([Some(Surroundings::Sky(sky)), None], None) => ("sky", sky.check().map(|()| Surroundings::Sky(sky))),
        ([None, Some(Surroundings::Room(room))], None) => {
            ("room", room.check().map(|()| Surroundings::Room(room)))
        }
        ([None, None], Some(options)) => ("panorama", load(&options).map(Surroundings::Panorama)),
        _ => return Err(Error::usage("sky, room or panorama: one of the three sections must be there")),
    };
    scene.map_err(|error| error.at(Place::key(section)))
}

fn load_panorama(
    options: &PanoramaOptions,
    frame_rate_hz: f64,
    folder: &Path,
    data: Option<&Path>,
) -> Result<Panorama> {
    let at_file = |error: Error| error.at(Place::key("file"));
    let path: PathBuf = match (options.file.strip_prefix("data:"), data) {
        (None, _) => folder.join(&options.file),
        (Some(below), Some(data)) => data.join(below),
        (Some(below), None) => {
            return Err(at_file(Error::usage(format!(
                "is {below} in the data folder: set LIGHTCAST_DATA to that folder's path"
            ))));
        }
    };
    let mut frame = Frame::default();
    let attributes = read(&path, &mut frame).map_err(|error| at_file(error.with_kind(Kind::Usage)))?;
    if attributes.latlong_centres != LatLongCentres::Half {
        return Err(at_file(Error::usage(
            "has its pixel centres on the poles (attribute envmap); convert it to a plain lat-long picture",
        )));
    }
    Panorama::new(options, &frame, frame_rate_hz)
}

impl Fisheye {
    /// Errors name the key, below `fisheye`.
    fn check(&self) -> Result<(Projection, DMat3, Response)> {
        // The focal length may follow from it, so it is checked first.
        if self.field_of_view_deg.is_nan() || self.field_of_view_deg <= 0.0 {
            return Err(Error::usage("must be over 0, at most 360")
                .at(Place::value("field_of_view_deg", self.field_of_view_deg)));
        }
        let theta_max_rad = 0.5 * self.field_of_view_deg.to_radians();
        let [k1, k2, k3, k4] = self.k;
        let t = theta_max_rad * theta_max_rad;
        let radius = theta_max_rad * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4))));
        let focal_px = self.focal_px.unwrap_or(0.5 * self.width.min(self.height) as f64 / radius);
        let [cx, cy] = self.centre_px.unwrap_or([0.5 * self.width as f64, 0.5 * self.height as f64]);
        let lens = Lens::new(LensParameters {
            width: self.width,
            height: self.height,
            fx: focal_px,
            fy: focal_px,
            cx,
            cy,
            k: self.k,
            field_of_view_rad: 2.0 * theta_max_rad,
        })
        .map_err(|error| {
            // A script has its own names for these.
            let name = match error.option() {
                Some("fx" | "fy") => "focal_px",
                Some("cx") => "centre_px[0]",
                Some("cy") => "centre_px[1]",
                _ => return Error::from(error),
            };
            let value = error.value().map(str::to_owned);
            Error::usage(error.message()).at(Place::Key { name: name.to_owned(), value })
        })?;
        let response = Response::new(self.response.clone())
            .map_err(|error| Error::from(error).at(Place::key("response")))?;
        let world_from_camera = match self.world_from_camera {
            None => LOOKING_UP,
            Some(rows) => {
                let rotation = DMat3::from_cols_array_2d(&rows).transpose();
                let error = rotation * rotation.transpose() - DMat3::IDENTITY;
                let worst = error.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
                // 1e-6 is the deviation of a rotation written with seven digits.
                if worst.is_nan() || worst > 1e-6 || rotation.determinant() < 0.0 {
                    return Err(Error::usage("must be a rotation matrix, by rows")
                        .at(Place::key("world_from_camera")));
                }
                rotation
            }
        };
        Ok((Projection::Fisheye(lens), world_from_camera, response))
    }
}
