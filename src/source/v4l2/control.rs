//! Controls of a camera by name: exposure, gain, black level and whatever else its driver has.

use super::node::{Node, text};
use crate::error::{Error, Place, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::io;
use v4l::v4l_sys as sys;

/// What a control is set to in a configuration.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum ControlValue {
    /// A switch.
    Switch(bool),
    /// A number in the driver's unit.
    Number(i64),
    /// An item of a menu by its name.
    Item(String),
}

impl fmt::Display for ControlValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Switch(value) => write!(f, "{value}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::Item(value) => write!(f, "\"{value}\""),
        }
    }
}

/// A control that has one number as its value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Control {
    /// Name as a configuration gives it: the driver's name in lower case, with other characters as
    /// underscores.
    pub name: String,
    #[serde(skip)]
    pub(super) id: u32,
    /// `integer`, `switch` or `menu`.
    pub kind: ControlKind,
    /// Smallest value.
    pub minimum: i64,
    /// Largest value.
    pub maximum: i64,
    /// Distance between two values.
    pub step: u64,
    /// The driver's default.
    pub default: i64,
    /// Current value; `None` where the driver does not report it.
    pub value: Option<i64>,
    /// Values and names of a menu.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub items: BTreeMap<i64, String>,
    /// Whether it cannot be set.
    pub is_read_only: bool,
    /// Whether it has 64 bits, not 32.
    #[serde(skip)]
    pub(super) is_wide: bool,
    /// Whether it is a bit mask of 32 bits, an unsigned number.
    #[serde(skip)]
    pub(super) is_mask: bool,
}

/// What the number of a control means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ControlKind {
    /// A quantity in the driver's unit.
    Integer,
    /// 0 or 1.
    Switch,
    /// One of the items.
    Menu,
}

/// More controls than any driver has, in case a driver repeats them in a cycle.
const CONTROLS_MAX: usize = 1000;

/// All controls with one number as their value, in the driver's order. Others (buttons, strings, tables) are
/// left out.
pub(super) fn list(node: &Node) -> io::Result<Vec<Control>> {
    let mut controls = Vec::new();
    let mut id = 0;
    for _ in 0..CONTROLS_MAX {
        let found = match node.control_after(id) {
            Ok(Some(found)) => found,
            Ok(None) => break,
            // Some cameras cannot describe one of their controls; those before it are still usable.
            Err(_) if !controls.is_empty() => break,
            Err(error) => return Err(error),
        };
        id = found.id;
        let (kind, is_wide) = match found.type_ {
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER | sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BITMASK => {
                (ControlKind::Integer, false)
            }
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER64 => (ControlKind::Integer, true),
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BOOLEAN => (ControlKind::Switch, false),
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_MENU | sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU => {
                (ControlKind::Menu, false)
            }
            _ => continue,
        };
        let is_array = found.flags & sys::V4L2_CTRL_FLAG_HAS_PAYLOAD != 0;
        if is_array || found.flags & sys::V4L2_CTRL_FLAG_DISABLED != 0 {
            continue;
        }
        let is_integer_menu = found.type_ == sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU;
        let mut items = BTreeMap::new();
        if kind == ControlKind::Menu {
            for index in found.minimum.max(0)..=found.maximum.min(found.minimum.max(0) + CONTROLS_MAX as i64)
            {
                // The cast is lossless: a menu's indices have 32 bits.
                if let Ok(Some(name)) = node.menu_item(found.id, index as u32, is_integer_menu) {
                    items.insert(index, name);
                }
            }
        }
        let is_mask = found.type_ == sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BITMASK;
        let is_write_only = found.flags & sys::V4L2_CTRL_FLAG_WRITE_ONLY != 0;
        controls.push(Control {
            name: identifier(&text(&found.name)),
            id: found.id,
            kind,
            minimum: found.minimum,
            maximum: found.maximum,
            step: found.step.max(1),
            default: found.default_value,
            value: if is_write_only { None } else { read(node, found.id, is_wide, is_mask).ok() },
            items,
            is_read_only: found.flags & sys::V4L2_CTRL_FLAG_READ_ONLY != 0,
            is_wide,
            is_mask,
        });
    }
    Ok(controls)
}

fn read(node: &Node, id: u32, is_wide: bool, is_mask: bool) -> io::Result<i64> {
    let number = node.control(id, is_wide)?;
    // The kernel returns 32 bits as a signed number.
    Ok(if is_mask { number & i64::from(u32::MAX) } else { number })
}

/// A driver's human-readable name as an identifier: `Exposure Time, Absolute` is `exposure_time_absolute`.
fn identifier(name: &str) -> String {
    let words: Vec<String> = name
        .split(|letter: char| !letter.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty())
        .map(str::to_ascii_lowercase)
        .collect();
    words.join("_")
}

impl Control {
    /// The number that represents `value`.
    ///
    /// # Errors
    /// `Usage`, naming the valid values; the caller says where the value is from.
    pub(super) fn number(&self, value: &ControlValue) -> Result<i64> {
        if self.is_read_only {
            return Err(Error::usage("the camera lets nobody set this control; remove it"));
        }
        let number = match (self.kind, value) {
            (ControlKind::Switch, ControlValue::Switch(value)) => i64::from(*value),
            (ControlKind::Menu, ControlValue::Item(item)) => {
                let found = self.items.iter().find(|(_, name)| identifier(name) == identifier(item));
                *found.map(|(number, _)| number).ok_or_else(|| self.refused())?
            }
            (_, ControlValue::Number(number)) => *number,
            _ => return Err(self.refused()),
        };
        let is_there = self.kind != ControlKind::Menu || self.items.contains_key(&number);
        let is_step =
            number.checked_sub(self.minimum).is_some_and(|above| above.unsigned_abs() % self.step == 0);
        if !(self.minimum..=self.maximum).contains(&number) || !is_there || !is_step {
            return Err(self.refused());
        }
        Ok(number)
    }

    fn refused(&self) -> Error {
        Error::usage(format!("is not possible; give {}", self.possible()))
    }

    /// Its valid values, for messages.
    pub fn possible(&self) -> String {
        match self.kind {
            ControlKind::Switch => "true or false".to_owned(),
            ControlKind::Menu => {
                let items: Vec<String> = self.items.values().map(|name| format!("\"{name}\"")).collect();
                items.join(", ")
            }
            ControlKind::Integer if self.step > 1 => {
                format!("{} to {} in steps of {}", self.minimum, self.maximum, self.step)
            }
            ControlKind::Integer => format!("{} to {}", self.minimum, self.maximum),
        }
    }
}

/// The control of this name, which is the value of the key `control`.
///
/// # Errors
/// `Usage`: there is none; the message lists the existing ones. `LostDevice` when the camera is gone.
pub(super) fn find(node: &Node, name: &str) -> Result<Control> {
    let controls = list(node).map_err(|error| lost("its controls cannot be listed", error))?;
    let place = || Place::value("control", format_args!("\"{name}\""));
    named(&controls, name).cloned().map_err(|error| error.at(place()))
}

fn named<'a>(controls: &'a [Control], name: &str) -> Result<&'a Control> {
    controls.iter().find(|control| control.name == name).ok_or_else(|| {
        let names: Vec<&str> = controls.iter().map(|control| control.name.as_str()).collect();
        Error::usage(format!("the camera has only the controls {}", names.join(", ")))
    })
}

/// Sets controls and reads them back. Some hold only when others were set before (an exposure, once the
/// automatic one is off), in an order that is the driver's own, and drivers that refuse a value too early are
/// fewer than those that forget it: so all are set twice.
///
/// # Errors
/// `Usage`, naming the key, for a name or value that the camera does not have, or a value that the driver
/// changes to another; `LostDevice` when it is gone.
pub(super) fn set(node: &Node, wanted: &BTreeMap<String, ControlValue>) -> Result<()> {
    if wanted.is_empty() {
        return Ok(());
    }
    let controls = list(node).map_err(|error| lost("its controls cannot be listed", error))?;
    let mut settings = Vec::new();
    for (name, value) in wanted {
        let place = Place::value(format!("controls.{name}"), value);
        let control = named(&controls, name).map_err(|error| error.at(place.clone()))?;
        let number = control.number(value).map_err(|error| error.at(place.clone()))?;
        settings.push((control, place, number));
    }
    for (control, _, number) in &settings {
        // What is refused now may hold the second time.
        let _ = node.set_control(control.id, *number);
    }
    for (control, place, number) in &settings {
        node.set_control(control.id, *number)
            .map_err(|error| Error::usage("the driver refuses it").because(error).at(place.clone()))?;
    }
    for (control, place, number) in settings {
        let found = match read(node, control.id, control.is_wide, control.is_mask) {
            Ok(found) => found,
            Err(error) => return Err(lost("cannot be read back", error).at(place)),
        };
        if found != number {
            let fault =
                format!("set to {number}, the driver made {found} of it; is an automatic control on?");
            return Err(Error::usage(fault).at(place));
        }
    }
    Ok(())
}

fn lost(what: &str, error: io::Error) -> Error {
    Error::lost_device(what).because(error)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(kind: ControlKind, minimum: i64, maximum: i64, step: u64) -> Control {
        let items = [(1, "Manual Mode"), (3, "Aperture Priority Mode")].map(|(n, name)| (n, name.to_owned()));
        Control {
            name: "a".to_owned(),
            id: 1,
            kind,
            minimum,
            maximum,
            step,
            default: minimum,
            value: None,
            items: if kind == ControlKind::Menu { items.into() } else { BTreeMap::new() },
            is_read_only: false,
            is_wide: false,
            is_mask: false,
        }
    }

    #[test]
    fn names_are_those_of_the_usual_tool() {
        assert_eq!(identifier("Exposure Time, Absolute"), "exposure_time_absolute");
        assert_eq!(identifier("White Balance, Automatic"), "white_balance_automatic");
        assert_eq!(identifier(" Loop  Video "), "loop_video");
    }

    #[test]
    fn values_that_a_control_has_become_its_number() {
        let gain = control(ControlKind::Integer, -10, 50, 5);
        assert_eq!(gain.number(&ControlValue::Number(-5)).unwrap(), -5);
        let switch = control(ControlKind::Switch, 0, 1, 1);
        assert_eq!(switch.number(&ControlValue::Switch(true)).unwrap(), 1);
        let menu = control(ControlKind::Menu, 0, 3, 1);
        assert_eq!(menu.number(&ControlValue::Item("manual mode".into())).unwrap(), 1);
        assert_eq!(menu.number(&ControlValue::Number(3)).unwrap(), 3);
    }

    #[test]
    fn others_are_refused_with_what_would_do() {
        for (control, value, expected) in [
            (control(ControlKind::Integer, -10, 50, 5), ControlValue::Number(3), "-10 to 50 in steps of 5"),
            (
                control(ControlKind::Integer, 0, 9, 1),
                ControlValue::Number(10),
                "is not possible; give 0 to 9",
            ),
            (control(ControlKind::Integer, 0, 9, 1), ControlValue::Number(i64::MIN), "give 0 to 9"),
            (control(ControlKind::Integer, 0, 9, 1), ControlValue::Switch(true), "give 0 to 9"),
            (control(ControlKind::Switch, 0, 1, 1), ControlValue::Number(2), "give true or false"),
            (
                control(ControlKind::Menu, 0, 3, 1),
                ControlValue::Item("auto".into()),
                "is not possible; give \"Manual Mode\", \"Aperture Priority Mode\"",
            ),
            (control(ControlKind::Menu, 0, 3, 1), ControlValue::Number(2), "is not possible"),
        ] {
            let message = control.number(&value).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        let fixed = Control { is_read_only: true, ..control(ControlKind::Integer, 0, 9, 1) };
        assert!(fixed.number(&ControlValue::Number(1)).unwrap_err().to_string().contains("remove it"));
    }
}
