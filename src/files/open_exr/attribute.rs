//! What a recorded file holds besides the standard attributes of OpenEXR, as attributes of type string.

use crate::error::{Error, Result};
use exr::meta::attribute::{AttributeValue, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use lightcast_core::image::{Bayer, Frame, Pixels};

/// `codes`: uint channels hold sensor codes of up to 16 bits, and not radiance.
const SAMPLES: &str = "lightcastSamples";
const CODES: &str = "codes";

/// Colours of a mosaic sensor's pixels, as in [`Bayer`]: `RGGB`. The picture then has the channel `Y` only.
const BAYER: &str = "lightcastBayer";

/// Capture time in nanoseconds, by the clock of the camera that was recorded.
const CAPTURE_TIME: &str = "lightcastCaptureTimeNs";

/// Frames per second without rounding; 0 where the camera has no rate.
const FRAME_RATE: &str = "lightcastFrameRateHz";

/// The lens of the camera, as in a calibration file.
const LENS: &str = "lightcastLens";

/// What the attributes of a file say.
#[derive(Default)]
pub(super) struct Recorded {
    pub(super) is_codes: bool,
    pub(super) bayer: Option<Bayer>,
    pub(super) capture_time_ns: Option<i64>,
    /// Finite, 0 or more.
    pub(super) frame_rate_hz: Option<f64>,
}

/// Reads the attributes of a part whose channels `names` are used.
pub(super) fn read(header: &Header, names: &[String]) -> Result<Recorded> {
    let text = |name: &str| match header.own_attributes.other.get(Text::from(name).as_slice()) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    };
    let fault = |name: &str, value: &str| {
        Error::bad_frame(format!("has the attribute {name} = {value}, which means nothing"))
    };
    let is_codes = match text(SAMPLES) {
        None => false,
        Some(samples) if samples == CODES => true,
        Some(samples) => return Err(fault(SAMPLES, &samples)),
    };
    let has_other = |channel: &exr::meta::attribute::ChannelDescription| {
        names.iter().any(|name| channel.name.eq(name.as_str())) && channel.sample_type != SampleType::U32
    };
    if is_codes && header.channels.list.iter().any(has_other) {
        return Err(Error::bad_frame("is said to hold sensor codes, but its channels are not of type uint"));
    }
    let bayer = match text(BAYER) {
        None => None,
        Some(pattern) => {
            let all = [Bayer::Rggb, Bayer::Grbg, Bayer::Gbrg, Bayer::Bggr];
            let found = all.into_iter().find(|bayer| bayer.to_string() == pattern);
            Some(found.filter(|_| is_codes && names.len() == 1).ok_or_else(|| fault(BAYER, &pattern))?)
        }
    };
    let capture_time_ns = match text(CAPTURE_TIME) {
        None => None,
        Some(time) => Some(time.parse().map_err(|_| fault(CAPTURE_TIME, &time))?),
    };
    let frame_rate_hz = match text(FRAME_RATE) {
        None => None,
        Some(rate) => {
            let rate_hz = rate.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate >= 0.0);
            Some(rate_hz.ok_or_else(|| fault(FRAME_RATE, &rate))?)
        }
    };
    Ok(Recorded { is_codes, bayer, capture_time_ns, frame_rate_hz })
}

/// Adds the attributes of a recorded frame.
pub(super) fn add(attributes: &mut LayerAttributes, frame: &Frame, lens: Option<&str>) -> Result<()> {
    let mut add = |name: &str, value: &str| -> Result<()> {
        let text = |text: &str| {
            Text::new_or_none(text)
                .ok_or_else(|| Error::failed(format!("the attribute {name} cannot be {text}")))
        };
        attributes.other.insert(text(name)?, AttributeValue::Text(text(value)?));
        Ok(())
    };
    if matches!(frame.pixels, Pixels::Codes(_)) {
        add(SAMPLES, CODES)?;
    }
    if let Some(bayer) = frame.bayer {
        add(BAYER, &bayer.to_string())?;
    }
    if let Some(lens) = lens {
        add(LENS, lens)?;
    }
    add(FRAME_RATE, &frame.stamp.frame_rate_hz.to_string())?;
    add(CAPTURE_TIME, &frame.stamp.capture_time_ns.to_string())
}
