//! What cameras this machine has and what they can do, for people and for programs.

use super::camera::offered;
use super::control::{self, Control};
use super::identity::{self, Identity};
use super::node::Node;
use super::pixel_format;
use serde::Serialize;
use std::io;
use std::path::PathBuf;

/// A camera of this machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Device {
    /// The name to put into a configuration; it stays the same after unplugging and restarts.
    pub name: String,
    /// Further names of the same camera.
    pub other_names: Vec<String>,
    /// The node that it has now.
    pub node: PathBuf,
    /// Product name given by the maker.
    pub card: String,
    /// The kernel's driver.
    pub driver: String,
    /// Serial number, where the bus reports one.
    pub serial: Option<String>,
    /// Why it cannot be used; `None` if it can.
    pub unsupported: Option<String>,
    /// Formats, in the driver's order.
    pub formats: Vec<Format>,
    /// Controls with one number as their value.
    pub controls: Vec<Control>,
}

/// A pixel format of a camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Format {
    /// Name for a configuration.
    pub name: String,
    /// Whether this program can capture it.
    pub is_supported: bool,
    /// Frame sizes, in the driver's order.
    pub sizes: Vec<Size>,
}

/// A frame size of a camera, or a range of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Size {
    /// Smallest columns and rows.
    pub least: [u32; 2],
    /// Largest columns and rows; the same where there is one size.
    pub most: [u32; 2],
    /// Frame rates at the largest size in Hz; for a range the highest.
    pub rates_hz: Vec<f64>,
}

/// More entries than any driver has, in case a driver repeats its list without end.
const ENTRIES_MAX: u32 = 256;

/// All cameras, including those that cannot be used, in the order of their nodes.
pub fn devices() -> Vec<Device> {
    identity::list().iter().map(describe).collect()
}

fn describe(identity: &Identity) -> Device {
    let mut device = Device {
        name: identity.names[0].clone(),
        other_names: identity.names[1..].to_vec(),
        node: identity.node.clone(),
        card: identity.card.clone(),
        driver: identity.driver.clone(),
        serial: identity.serial.clone(),
        unsupported: None,
        formats: Vec::new(),
        controls: Vec::new(),
    };
    if !identity.is_single_planar {
        device.unsupported = Some("gives its frames in several planes only (multi-planar)".to_owned());
        return device;
    }
    let mut ask = || -> io::Result<()> {
        let node = Node::open(&identity.node)?;
        device.formats = formats(&node)?;
        device.controls = control::list(&node)?;
        Ok(())
    };
    if let Err(error) = ask() {
        device.unsupported = Some(format!("does not answer: {error}"));
    } else if !device.formats.iter().any(|format| format.is_supported) {
        device.unsupported = Some("has no pixel format that can be captured".to_owned());
    }
    device
}

fn formats(node: &Node) -> io::Result<Vec<Format>> {
    let mut formats = Vec::new();
    for fourcc in offered(node)? {
        let code = u32::from_le_bytes(fourcc);
        let mut sizes = Vec::new();
        for index in 0..ENTRIES_MAX {
            let Some(range) = node.frame_size(code, index)? else { break };
            let mut rates_hz = Vec::new();
            for index in 0..ENTRIES_MAX {
                match node.frame_interval(code, range.most, index)? {
                    None => break,
                    Some((0, _)) => {}
                    Some((numerator, denominator)) => {
                        rates_hz.push(f64::from(denominator) / f64::from(numerator));
                    }
                }
            }
            sizes.push(Size { least: range.least, most: range.most, rates_hz });
        }
        let is_supported = pixel_format::find(fourcc).is_some();
        formats.push(Format { name: pixel_format::name(fourcc), is_supported, sizes });
    }
    Ok(formats)
}
