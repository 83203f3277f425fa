//! One camera: its configuration, and its frames.

use super::control::{self, ControlValue};
use super::identity::{self, Identity};
use super::node::{Node, Stream, pix_format};
use super::pixel_format::{self, PixelFormat, Samples};
use super::unpack::Layout;
use crate::error::{Error, Kind, Place, Result};
use crate::files::{MAX_PIXELS, MAX_SIDE_PX, decode_jpeg};
use crate::rt::monotonic_ns;
use crate::source::{BadBuffer, Captured, ExposureControl, FrameFormat, LiveCamera, Mark};
use lightcast_core::image::{Frame, LatLongCentres, Pixels};
use std::collections::BTreeMap;
use std::io;
use std::time::Duration;
use v4l::v4l_sys as sys;

/// Which camera, and how it is set up. Settings that are `None` are left as the driver has them.
#[derive(Clone, Debug, PartialEq)]
pub struct V4l2Options {
    /// A stable name as `lightcast devices` prints it, or a path.
    pub device: String,
    /// V4L2's name of a pixel format; `None`: the deepest that the camera has.
    pub format: Option<String>,
    /// Columns and rows.
    pub size: Option<[u32; 2]>,
    /// Frames per second.
    pub frame_rate_hz: Option<f64>,
    /// Controls by name.
    pub controls: BTreeMap<String, ControlValue>,
    /// Buffers shared with the driver, which it can fill while a frame is being processed.
    pub buffers: u32,
}

impl Default for V4l2Options {
    fn default() -> Self {
        Self {
            device: "/dev/video0".to_owned(),
            format: None,
            size: None,
            frame_rate_hz: None,
            controls: BTreeMap::new(),
            buffers: 4,
        }
    }
}

/// Drivers choose the nearest rate that they support; 1 % is below what the filter's bands can resolve.
const RATE_TOLERANCE: f64 = 0.01;

/// A V4L2 camera.
#[derive(Debug)]
pub struct V4l2Camera {
    options: V4l2Options,
    /// The name by which it is found after a loss, also used in messages.
    name: String,
    pixel_format: PixelFormat,
    layout: Layout,
    frame_rate_hz: f64,
    exposure_s: Option<f64>,
    /// The control that sets the exposure while the camera streams.
    exposure_control: Option<u32>,
    stream: Option<Stream>,
}

impl V4l2Camera {
    /// Opens the camera and sets it up, without starting it.
    ///
    /// # Errors
    /// `Usage`: the camera cannot do what the options ask for; the message says what it can. `LostDevice`: it
    /// is not there, in use by another program, or does not answer.
    pub fn open(mut options: V4l2Options) -> Result<Self> {
        let identity = identity::find(&options.device)?;
        let name = if identity.names.contains(&options.device) {
            options.device.clone()
        } else {
            tracing::info!(
                "{}: this is {}, by which it is found again after a loss",
                options.device,
                identity.names[0]
            );
            identity.names[0].clone()
        };
        let (node, set_up) = set_up(&identity, &options).map_err(|error| error.at(&name))?;
        let exposure_s = exposure_s(&node);
        let SetUp { pixel_format, layout, frame_rate_hz } = set_up;
        // A camera that was unplugged comes back with its own defaults: what the options leave open stays as
        // found now.
        options.format = Some(pixel_format::name(pixel_format.fourcc));
        options.size = Some([layout.width as u32, layout.height as u32]);
        Ok(Self {
            options,
            name,
            pixel_format,
            layout,
            frame_rate_hz,
            exposure_s,
            exposure_control: None,
            stream: None,
        })
    }

    /// Its best stable name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The format of its frames.
    pub fn format(&self) -> FrameFormat {
        FrameFormat {
            width: self.layout.width,
            height: self.layout.height,
            channels: self.layout.samples.channels(),
            bayer: self.pixel_format.bayer,
            is_codes: true,
            latlong_centres: LatLongCentres::Half,
            frame_rate_hz: self.frame_rate_hz,
        }
    }

    /// Exposure in seconds, where the camera has V4L2's standard control for it and automatic exposure is
    /// off.
    pub fn exposure_s(&self) -> Option<f64> {
        self.exposure_s
    }

    /// Chooses the control that sets the exposure, and checks the values that it will be set to.
    ///
    /// # Errors
    /// `Usage`, naming the key `control` or the element of `values`: the camera has no such control or value.
    /// `LostDevice`: it does not answer.
    pub fn choose_exposure_control(&mut self, name: &str, values: &[i64]) -> Result<()> {
        let identity = identity::find(&self.name)?;
        let node = Node::open(&identity.node).map_err(|error| lost(&self.name, "cannot be opened", error))?;
        let control = control::find(&node, name).map_err(|error| error.at(&self.name))?;
        for (index, &value) in values.iter().enumerate() {
            let set = || {
                control.number(&ControlValue::Number(value))?;
                node.set_control(control.id, value).map_err(|error| {
                    Error::usage("the driver refuses it; is an automatic exposure on?").because(error)
                })
            };
            set()
                .map_err(|error| error.at(Place::value(format!("values[{index}]"), value)).at(&self.name))?;
        }
        self.exposure_control = Some(control.id);
        Ok(())
    }
}

impl LiveCamera for V4l2Camera {
    fn start(&mut self) -> Result<()> {
        self.stream = None;
        let identity = identity::find(&self.name)?;
        // The camera had all of this when it was opened: if it lacks something now, it is not ready, and
        // another attempt follows later.
        let (node, found) = set_up(&identity, &self.options)
            .map_err(|error| error.at(&self.name).with_kind(Kind::LostDevice))?;
        // The filter's taps are designed for one rate; the next attempt may find the camera as it was.
        if (found.frame_rate_hz - self.frame_rate_hz).abs() > RATE_TOLERANCE * self.frame_rate_hz {
            return Err(Error::lost_device(format!(
                "came back at {} Hz and not at {}; write frame_rate_hz into the configuration",
                found.frame_rate_hz, self.frame_rate_hz
            ))
            .at(format_args!("camera {}", self.name)));
        }
        // The memory layout of the rows may differ; the pictures are the same.
        self.layout = found.layout;
        let stream = Stream::start(node, self.options.buffers)
            .map_err(|error| lost(&self.name, "does not start to stream", error))?;
        self.stream = Some(stream);
        Ok(())
    }

    fn capture(&mut self, patience: Duration, frame: &mut Frame) -> Result<Captured> {
        let Self { name, pixel_format, layout, stream, .. } = self;
        let stream = stream.as_mut().ok_or_else(|| not_started(name))?;
        let buffer = match stream.dequeue(patience) {
            Ok(Some(buffer)) => buffer,
            Ok(None) => return Ok(Captured::Nothing),
            Err(error) => return Err(lost(name, "gives no more frames", error)),
        };
        let now_ns = monotonic_ns();
        let time_ns = buffer.time_ns.unwrap_or(now_ns);
        let mark = Mark { sequence: buffer.sequence, time_ns, age_ns: now_ns.saturating_sub(time_ns) };
        let bad = if buffer.is_faulty {
            Some(BadBuffer::Faulty)
        } else {
            read(stream.bytes(&buffer), *pixel_format, layout, frame)
        };
        stream.queue(buffer).map_err(|error| lost(name, "takes no buffer back", error))?;
        Ok(bad.map_or(Captured::Frame(mark), |bad| Captured::Bad(mark, bad)))
    }

    fn stop(&mut self) {
        self.stream = None;
    }
}

impl ExposureControl for V4l2Camera {
    fn set_exposure(&mut self, value: i64) -> Result<()> {
        let (Some(stream), Some(id)) = (&self.stream, self.exposure_control) else {
            return Err(not_started(&self.name));
        };
        let set = stream.node().set_control(id, value);
        set.map_err(|error| lost(&self.name, "refuses an exposure", error))
    }
}

fn lost(name: &str, what: &str, error: io::Error) -> Error {
    Error::lost_device(what).because(error).at(format_args!("camera {name}"))
}

fn not_started(name: &str) -> Error {
    lost(name, "is not started", io::ErrorKind::NotConnected.into())
}

/// Copies a picture out of a buffer; says why when that is not possible.
fn read(bytes: &[u8], pixel_format: PixelFormat, layout: &Layout, frame: &mut Frame) -> Option<BadBuffer> {
    if layout.samples == Samples::Jpeg {
        let is_whole = decode_jpeg(bytes, frame).is_ok()
            && (frame.width, frame.height, frame.channels) == (layout.width, layout.height, 3);
        return (!is_whole).then_some(BadBuffer::Undecodable);
    }
    (frame.width, frame.height) = (layout.width, layout.height);
    (frame.channels, frame.bayer) = (layout.samples.channels(), pixel_format.bayer);
    if matches!(frame.pixels, Pixels::Radiance(_)) {
        frame.pixels = Pixels::Codes(Vec::new());
    }
    let is_whole = match &mut frame.pixels {
        Pixels::Codes(codes) => layout.unpack(bytes, codes),
        Pixels::Radiance(_) => false,
    };
    (!is_whole).then_some(BadBuffer::Short)
}

/// Exposure in seconds; `None` where the driver does not report it or automatic exposure is on.
fn exposure_s(node: &Node) -> Option<f64> {
    let automatic = node.control(sys::V4L2_CID_EXPOSURE_AUTO, false);
    if automatic.is_ok_and(|mode| mode != i64::from(sys::v4l2_exposure_auto_type_V4L2_EXPOSURE_MANUAL)) {
        return None;
    }
    // Its unit is 100 microseconds by definition.
    node.control(sys::V4L2_CID_EXPOSURE_ABSOLUTE, false).ok().map(|ticks| ticks as f64 * 1e-4)
}

/// The state of a camera after setup.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SetUp {
    pixel_format: PixelFormat,
    layout: Layout,
    frame_rate_hz: f64,
}

/// Opens the node and sets format, rate and controls.
fn set_up(identity: &Identity, options: &V4l2Options) -> Result<(Node, SetUp)> {
    if !identity.is_single_planar {
        return Err(Error::usage(
            "gives its frames in several planes only (V4L2's multi-planar interface), which is not supported",
        ));
    }
    let node = Node::open(&identity.node).map_err(|error| gone("cannot be opened", error))?;
    let (pixel_format, layout) = set_format(&node, options)?;
    let frame_rate_hz = set_rate(&node, options.frame_rate_hz)?;
    control::set(&node, &options.controls)?;
    Ok((node, SetUp { pixel_format, layout, frame_rate_hz }))
}

fn gone(what: &str, error: io::Error) -> Error {
    Error::lost_device(what).because(error)
}

/// Codes of the formats that the camera offers.
pub(super) fn offered(node: &Node) -> io::Result<Vec<[u8; 4]>> {
    let mut fourccs = Vec::new();
    // More than any driver has, in case a driver repeats its list without end.
    for index in 0..256 {
        let Some(description) = node.format_description(index)? else { break };
        fourccs.push(description.pixelformat.to_le_bytes());
    }
    Ok(fourccs)
}

fn set_format(node: &Node, options: &V4l2Options) -> Result<(PixelFormat, Layout)> {
    let offered = offered(node).map_err(|error| gone("its formats cannot be listed", error))?;
    let names = || offered.iter().map(|&fourcc| pixel_format::name(fourcc)).collect::<Vec<_>>().join(", ");
    let wanted = match &options.format {
        Some(name) => {
            let known = pixel_format::fourcc(name).and_then(pixel_format::find);
            known.ok_or_else(|| {
                let all: Vec<_> =
                    pixel_format::KNOWN.iter().map(|format| pixel_format::name(format.fourcc)).collect();
                Error::usage(format!(
                    "cannot be captured; the camera has {}, this program takes {}",
                    names(),
                    all.join(", ")
                ))
                .at(Place::value("format", format_args!("\"{name}\"")))
            })?
        }
        None => {
            let best = pixel_format::KNOWN.iter().find(|format| offered.contains(&format.fourcc));
            *best.ok_or_else(|| {
                Error::usage(format!("none of its formats can be captured: it has {}", names()))
            })?
        }
    };
    let current = node.format().map_err(|error| gone("its format cannot be read", error))?;
    let size = options.size.unwrap_or([current.width, current.height]);
    let found = node
        .set_format(pix_format(wanted.fourcc, size))
        .map_err(|error| gone("its format cannot be set (is another program using it?)", error))?;
    let fourcc = found.pixelformat.to_le_bytes();
    if fourcc != wanted.fourcc {
        return Err(Error::usage(format!(
            "was made {} by the driver; it has {}",
            pixel_format::name(fourcc),
            names()
        ))
        .at(Place::value("format", format_args!("\"{}\"", pixel_format::name(wanted.fourcc)))));
    }
    if options.size.is_some_and(|size| size != [found.width, found.height]) {
        return Err(Error::usage(format!(
            "was made {} x {} by the driver; `lightcast devices` lists the sizes",
            found.width, found.height
        ))
        .at(Place::value("size", format_args!("{size:?}"))));
    }
    let (width, height) = (found.width as usize, found.height as usize);
    if width == 0 || height == 0 || width > MAX_SIDE_PX || height > MAX_SIDE_PX || width * height > MAX_PIXELS
    {
        return Err(Error::usage(format!("frames of {width} x {height} pixels cannot be used")));
    }
    if wanted.samples == Samples::Yuyv && !width.is_multiple_of(2) {
        return Err(Error::usage(format!(
            "YUYV frames {width} pixels wide cannot be used: give an even number"
        )));
    }
    let least = wanted.samples.row_bytes(width);
    let stride = found.bytesperline as usize;
    if stride != 0 && stride < least {
        return Err(Error::usage(format!("the driver says that rows of {width} pixels have {stride} bytes")));
    }
    let is_full_range = found.quantization == sys::v4l2_quantization_V4L2_QUANTIZATION_FULL_RANGE
        || found.quantization == sys::v4l2_quantization_V4L2_QUANTIZATION_DEFAULT
            && found.colorspace == sys::v4l2_colorspace_V4L2_COLORSPACE_JPEG;
    let layout = Layout { samples: wanted.samples, width, height, stride: stride.max(least), is_full_range };
    if wanted.samples != Samples::Jpeg && (found.sizeimage as usize) < layout.least_bytes() {
        return Err(Error::usage(format!(
            "the driver says that frames of {width} x {height} have {} bytes; {} are needed",
            found.sizeimage,
            layout.least_bytes()
        )));
    }
    Ok((wanted, layout))
}

/// Sets the rate if one is wanted; returns the driver's, 0 if it has none.
fn set_rate(node: &Node, wanted_hz: Option<f64>) -> Result<f64> {
    let read = |node: &Node| match node.interval() {
        Ok((numerator, denominator)) if numerator > 0 => f64::from(denominator) / f64::from(numerator),
        _ => 0.0,
    };
    let Some(wanted_hz) = wanted_hz else { return Ok(read(node)) };
    // Whole rates and NTSC rates (in units of 1/1001) are exact, slow rates are in thousandths of a second.
    let (numerator, denominator) = if wanted_hz < 1.0 {
        ((1000.0 / wanted_hz).round() as u32, 1000)
    } else if (wanted_hz - wanted_hz.round()).abs() < 1e-6 {
        (1, wanted_hz.round() as u32)
    } else {
        (1001, (wanted_hz * 1001.0).round() as u32)
    };
    let key = || Place::value("frame_rate_hz", wanted_hz);
    node.set_interval((numerator, denominator))
        .map_err(|error| Error::usage("the driver has no rate to set; remove it").because(error).at(key()))?;
    let found_hz = read(node);
    if (found_hz - wanted_hz).abs() > RATE_TOLERANCE * wanted_hz {
        return Err(Error::usage(format!(
            "the driver has made it {found_hz}; `lightcast devices` lists the rates"
        ))
        .at(key()));
    }
    Ok(found_hz)
}

#[cfg(test)]
mod tests;
