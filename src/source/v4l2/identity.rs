//! Names of cameras that stay the same when a cable is pulled and put back, and the node that has such a name
//! now.
//!
//! The kernel numbers its nodes (`/dev/video0`) in the order in which they appear. Stable names are, best
//! first: udev's link in `/dev/v4l/by-id` (maker, model, serial number; only with a serial number), its link
//! in `/dev/v4l/by-path` (the socket), and the bus address that the driver itself reports
//! (`usb-0000:00:14.0-3`), which exists without udev too. Several cameras at one address are distinguished by
//! the suffixes `#1`, `#2` and so on.

use super::node::{Node, text};
use crate::error::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};
use v4l::v4l_sys as sys;

/// Where udev keeps its links, best first.
const LINKS: [&str; 2] = ["/dev/v4l/by-id", "/dev/v4l/by-path"];

/// A camera of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Identity {
    /// The node that it has now.
    pub(super) node: PathBuf,
    /// Its stable names, the best one first; at least one.
    pub(super) names: Vec<String>,
    /// Product name given by the maker.
    pub(super) card: String,
    pub(super) driver: String,
    /// Serial number, where the bus reports one.
    pub(super) serial: Option<String>,
    /// Whether it delivers frames in a single plane, the only layout that is supported.
    pub(super) is_single_planar: bool,
}

/// All nodes that deliver frames, by number. Nodes that cannot be opened are left out.
pub(super) fn list() -> Vec<Identity> {
    let mut found: Vec<Identity> = Vec::new();
    let mut addresses: Vec<String> = Vec::new();
    for path in nodes() {
        let Ok(capability) = Node::open(&path).and_then(|node| node.capability()) else { continue };
        let abilities = if capability.capabilities & sys::V4L2_CAP_DEVICE_CAPS != 0 {
            capability.device_caps
        } else {
            capability.capabilities
        };
        let is_single_planar = abilities & sys::V4L2_CAP_VIDEO_CAPTURE != 0;
        if !is_single_planar && abilities & sys::V4L2_CAP_VIDEO_CAPTURE_MPLANE == 0 {
            continue;
        }
        let address = text(&capability.bus_info);
        let before = addresses.iter().filter(|other| **other == address).count();
        let serial = serial(&path);
        let mut names = links(&path);
        // Two cameras of one model without serial numbers have the same link by maker and model; they are
        // distinguished by the socket.
        if serial.is_none() {
            names.reverse();
        }
        names.push(if before == 0 { address.clone() } else { format!("{address}#{before}") });
        addresses.push(address);
        found.push(Identity {
            serial,
            node: path,
            names,
            card: text(&capability.card),
            driver: text(&capability.driver),
            is_single_planar,
        });
    }
    found
}

/// The camera that a configuration names: by a stable name, or by a path, which is looked up now.
///
/// # Errors
/// `LostDevice`: there is none of this name; the message lists the existing ones.
pub(super) fn find(name: &str) -> Result<Identity> {
    let cameras = list();
    let path = fs::canonicalize(name).ok();
    let is_meant = |camera: &&Identity| {
        camera.names.iter().any(|known| known == name) || path.as_ref() == Some(&camera.node)
    };
    if let Some(camera) = cameras.iter().find(is_meant) {
        return Ok(camera.clone());
    }
    let known: Vec<&str> = cameras.iter().map(|camera| camera.names[0].as_str()).collect();
    let fault = if known.is_empty() {
        "this machine has no camera at all (or none that may be opened: see the group `video`)".to_owned()
    } else {
        format!("is not there; there are {}", known.join(", "))
    };
    Err(Error::lost_device(fault).at(format_args!("camera {name}")))
}

/// `/dev/video0` and so on, by number.
fn nodes() -> Vec<PathBuf> {
    let mut numbers: Vec<u32> = fs::read_dir("/dev")
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_prefix("video")?.parse().ok())
        .collect();
    numbers.sort_unstable();
    numbers.into_iter().map(|number| PathBuf::from(format!("/dev/video{number}"))).collect()
}

/// Names of the links to a node.
fn links(node: &Path) -> Vec<String> {
    let mut names = Vec::new();
    for folder in LINKS {
        let mut here: Vec<String> = fs::read_dir(folder)
            .into_iter()
            .flatten()
            .flatten()
            .filter(|entry| fs::canonicalize(entry.path()).is_ok_and(|target| target == node))
            .filter_map(|entry| entry.file_name().into_string().ok())
            .collect();
        here.sort_unstable();
        names.extend(here);
    }
    names
}

/// The USB serial number is in sysfs, next to the interface that the node belongs to.
fn serial(node: &Path) -> Option<String> {
    let name = node.file_name()?;
    let text =
        fs::read_to_string(Path::new("/sys/class/video4linux").join(name).join("device/../serial")).ok()?;
    Some(text.trim().to_owned()).filter(|serial| !serial.is_empty())
}
