use super::standard_output::print;
use crate::error::Result;
use crate::source::v4l2::{Control, ControlKind, Device, Size, devices};
use std::fmt::Write as _;

/// List the cameras of this machine: names for a configuration, formats, sizes, rates and controls.
///
/// The first name of a camera stays the same when it is unplugged or the machine restarts: put it into a
/// configuration as `device`. Formats in brackets cannot be captured.
///
/// Example: lightcast devices --json | jq '.[].name'
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Print JSON: a list with one object for each camera.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let devices = devices();
    if devices.is_empty() {
        tracing::info!("no camera (or none that may be opened: see the group `video`)");
    }
    let text = if arguments.json {
        // Text, numbers and lists of them always have a JSON form.
        vec![serde_json::to_string_pretty(&devices).expect("plain data serialises")]
    } else {
        devices.iter().map(|device| describe(device).trim_end().to_owned()).collect()
    };
    print(&text).map(|_| ())
}

fn describe(device: &Device) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let mut line = |indent: usize, content: String| {
        let _ = writeln!(text, "{:indent$}{content}", "");
    };
    line(0, device.name.clone());
    for name in &device.other_names {
        line(2, format!("or {name}"));
    }
    let serial = device.serial.as_ref().map(|serial| format!(", serial {serial}")).unwrap_or_default();
    line(2, format!("{}, {}, driver {}{serial}", device.node.display(), device.card, device.driver));
    if let Some(why) = &device.unsupported {
        line(2, format!("not supported: {why}"));
    }
    if !device.formats.is_empty() {
        line(2, "formats".to_owned());
    }
    for format in &device.formats {
        let name = if format.is_supported { format.name.clone() } else { format!("({})", format.name) };
        let sizes: Vec<String> = format.sizes.iter().map(size).collect();
        line(4, format!("{name:<8} {}", sizes.join(", ")));
    }
    if !device.controls.is_empty() {
        line(2, "controls".to_owned());
    }
    for control in &device.controls {
        line(4, self::control(control));
    }
    text
}

fn size(size: &Size) -> String {
    let one = |[width, height]: [u32; 2]| format!("{width}x{height}");
    let sizes = if size.least == size.most {
        one(size.most)
    } else {
        format!("{} to {}", one(size.least), one(size.most))
    };
    let rates: Vec<String> =
        size.rates_hz.iter().map(|rate| format!("{}", (rate * 100.0).round() / 100.0)).collect();
    if rates.is_empty() { sizes } else { format!("{sizes} at {} Hz", rates.join("/")) }
}

fn control(control: &Control) -> String {
    let value = control.value.map_or("not told".to_owned(), |value| match control.kind {
        ControlKind::Menu => {
            control.items.get(&value).map_or(value.to_string(), |item| format!("\"{item}\""))
        }
        ControlKind::Switch => (value != 0).to_string(),
        ControlKind::Integer => value.to_string(),
    });
    let fixed = if control.is_read_only { ", cannot be set" } else { "" };
    format!("{} = {value} ({}; default {}{fixed})", control.name, control.possible(), control.default)
}
