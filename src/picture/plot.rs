//! Line plots with two logarithmic axes, as SVG text: small multiples that share one legend.

mod axis;
#[cfg(test)]
mod tests;

use axis::{Axis, tick_label};
use std::fmt::Write;

/// A plot: panels from left to right, three in a row (four: two), under one title and above one legend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    /// Text above all panels.
    pub title: String,
    /// Small multiples: axes with the same label have the same range.
    pub panels: Vec<Panel>,
}

/// One pair of axes, both logarithmic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Text above the panel.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// Lines, drawn in this order.
    pub series: Vec<Series>,
    /// Points marked by rings, which are drawn over the lines.
    pub rings: Vec<(f64, f64)>,
    /// Name of the series with the thickest and darkest line.
    pub emphasis: Option<String>,
}

/// A plot in pieces, for a page that arranges them itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// Every panel as a separate SVG document, as wide as a phone's screen.
    pub panels: Vec<String>,
    /// The legend: a sample of the line as an SVG document, and the series' name.
    pub legend: Vec<(String, String)>,
}

/// A named line. Series of the same name look the same in all panels and have one entry in the legend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Text in the legend.
    pub name: String,
    /// Points (x, y), joined in this order. A point that cannot be shown on logarithmic axes (zero, negative,
    /// infinite or NaN) is left out and interrupts the line. A series without points appears only in the
    /// legend.
    pub points: Vec<(f64, f64)>,
}

/// Colours that people with any of the common colour deficiencies can tell apart, all dark enough for thin
/// lines on white: M. Okabe and K. Ito 2008, *Color Universal Design*, without yellow.
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9"];
/// The colour of the emphasised series, which no other series then has.
const EMPHASIS: &str = "#000000";
/// Dashes of the lines when all colours have been used once, so that 21 series can be told apart.
const DASHES: [&str; 3] = ["", "7 4", "2 3"];
const COLUMNS: usize = 3;
/// Sizes in px. The plotting area of a panel ...
const AREA_WIDTH: f64 = 260.0;
const AREA_HEIGHT: f64 = 220.0;
/// ... and the space around it: labels left and below, the panel's title above.
const LEFT: f64 = 74.0;
const RIGHT: f64 = 18.0;
const ABOVE: f64 = 30.0;
const BELOW: f64 = 52.0;
const PANEL_WIDTH: f64 = LEFT + AREA_WIDTH + RIGHT;
const PANEL_HEIGHT: f64 = ABOVE + AREA_HEIGHT + BELOW;
const TITLE_HEIGHT: f64 = 36.0;
const LEGEND_LINE: f64 = 20.0;
/// Width of a legend entry besides its text, and average width of a letter of the text.
const LEGEND_SAMPLE: f64 = 56.0;
/// Width of a line in the legend.
const SAMPLE_WIDTH: f64 = 28.0;
const LETTER: f64 = 6.6;

impl Plot {
    /// The plot as an SVG document with a white background. A plot without panels consists of its title.
    pub fn to_svg(&self) -> String {
        let entries = self.entries();
        let columns = if self.panels.len() == 4 { 2 } else { self.panels.len().clamp(1, COLUMNS) };
        let width = columns as f64 * PANEL_WIDTH;
        let legend_top = TITLE_HEIGHT + self.panels.len().div_ceil(columns) as f64 * PANEL_HEIGHT;
        let (legend, legend_height) = legend(&entries, width, legend_top);
        let mut svg = begin(width, legend_top + legend_height);
        text(&mut svg, width / 2.0, 24.0, r#"text-anchor="middle" font-size="16""#, &self.title);
        for (at, panel) in self.panels.iter().enumerate() {
            let left = (at % columns) as f64 * PANEL_WIDTH;
            let top = TITLE_HEIGHT + (at / columns) as f64 * PANEL_HEIGHT;
            self.draw(panel, &mut svg, left, top, &entries);
        }
        svg.push_str(&legend);
        svg.push_str("</svg>\n");
        svg
    }

    /// The plot without its title, in pieces.
    pub fn to_parts(&self) -> Parts {
        let entries = self.entries();
        let panels = self.panels.iter().map(|panel| {
            let mut svg = begin(PANEL_WIDTH, PANEL_HEIGHT);
            self.draw(panel, &mut svg, 0.0, 0.0, &entries);
            svg + "</svg>\n"
        });
        let legend = entries.iter().map(|(name, style)| {
            let mut svg = begin(SAMPLE_WIDTH, 12.0);
            sample(&mut svg, 0.0, 6.0, style);
            (svg + "</svg>", (*name).to_owned())
        });
        Parts { panels: panels.collect(), legend: legend.collect() }
    }

    /// Names and styles of all series, in the order of the legend.
    fn entries(&self) -> Vec<(&str, Style)> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        let is_emphasised =
            |name: &str| self.panels.iter().any(|panel| panel.emphasis.as_deref() == Some(name));
        let palette: Vec<&'static str> = match names.iter().any(|name| is_emphasised(name)) {
            true => COLOURS.into_iter().filter(|colour| *colour != EMPHASIS).collect(),
            false => COLOURS.to_vec(),
        };
        let mut looks =
            DASHES.into_iter().cycle().flat_map(|dash| palette.iter().map(move |colour| (*colour, dash)));
        let mut style = |name: &str| match is_emphasised(name) {
            true => Style { colour: EMPHASIS, dash: "", width: 3.0 },
            false => {
                let (colour, dash) = looks.next().unwrap_or((EMPHASIS, ""));
                Style { colour, dash, width: 1.5 }
            }
        };
        names.into_iter().map(|name| (name, style(name))).collect()
    }

    /// Draws a panel with its upper left corner at (left, top).
    fn draw(&self, panel: &Panel, svg: &mut String, left: f64, top: f64, entries: &[(&str, Style)]) {
        let (left, top) = (left + LEFT, top + ABOVE);
        let alike = |is_alike: fn(&Panel, &Panel) -> bool| {
            self.panels.iter().filter(move |other| is_alike(panel, other)).flat_map(Panel::places)
        };
        let x_values = alike(|one, other| one.x_label == other.x_label).map(|(x, _)| x);
        let y_values = alike(|one, other| one.y_label == other.y_label).map(|(_, y)| y);
        let x_axis = Axis::new(x_values, left, left + AREA_WIDTH);
        let y_axis = Axis::new(y_values, top + AREA_HEIGHT, top);
        panel.draw(svg, &x_axis, &y_axis, entries);
    }
}

/// The beginning of an SVG document with a white background.
fn begin(width: f64, height: f64) -> String {
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12" fill="#222222">
<rect width="{width}" height="{height}" fill="#ffffff"/>
"##
    )
}

impl Panel {
    /// The points that can be shown on logarithmic axes.
    fn places(&self) -> impl Iterator<Item = (f64, f64)> {
        self.series.iter().flat_map(|series| &series.points).copied().filter(has_place)
    }

    fn draw(&self, svg: &mut String, x_axis: &Axis, y_axis: &Axis, entries: &[(&str, Style)]) {
        let ((left, right), (bottom, top)) = (x_axis.ends_px(), y_axis.ends_px());

        for tick in x_axis.ticks() {
            let x = px(x_axis.position(tick.value));
            line(svg, &x, &px(top), &x, &px(bottom), tick.is_labelled);
            if tick.is_labelled {
                let place = x_axis.position(tick.value);
                text(svg, place, bottom + 16.0, r#"text-anchor="middle""#, &tick_label(tick.value));
            }
        }
        for tick in y_axis.ticks() {
            let y = px(y_axis.position(tick.value));
            line(svg, &px(left), &y, &px(right), &y, tick.is_labelled);
            if tick.is_labelled {
                let place = y_axis.position(tick.value) + 4.0;
                text(svg, left - 6.0, place, r#"text-anchor="end""#, &tick_label(tick.value));
            }
        }
        let _ = writeln!(
            svg,
            r##"<rect x="{left}" y="{top}" width="{AREA_WIDTH}" height="{AREA_HEIGHT}" fill="none" stroke="#555555"/>"##
        );
        let middle = (left + right) / 2.0;
        text(svg, middle, top - 8.0, r#"text-anchor="middle" font-weight="bold""#, &self.title);
        text(svg, middle, bottom + 38.0, r#"text-anchor="middle""#, &self.x_label);
        let (x, y) = (left - LEFT + 16.0, (top + bottom) / 2.0);
        text(
            svg,
            x,
            y,
            &format!(r#"text-anchor="middle" transform="rotate(-90 {} {})""#, px(x), px(y)),
            &self.y_label,
        );

        for series in &self.series {
            let Some((_, style)) = entries.iter().find(|(name, _)| *name == series.name) else { continue };
            for run in series.points.split(|point| !has_place(point)).filter(|run| !run.is_empty()) {
                let places: Vec<String> = run
                    .iter()
                    .map(|&(x, y)| format!("{},{}", px(x_axis.position(x)), px(y_axis.position(y))))
                    .collect();
                let _ = writeln!(svg, r#"<polyline points="{}" {}/>"#, places.join(" "), style.line());
                for place in &places {
                    let (x, y) = place.split_once(',').unwrap_or_default();
                    let _ = writeln!(svg, r#"<circle cx="{x}" cy="{y}" r="2.5" fill="{}"/>"#, style.colour);
                }
            }
        }
        for (x, y) in self.rings.iter().filter(|&ring| has_place(ring)) {
            let (x, y) = (px(x_axis.position(*x)), px(y_axis.position(*y)));
            let _ = writeln!(
                svg,
                r##"<circle cx="{x}" cy="{y}" r="5" fill="none" stroke="#222222" stroke-width="0.9"/>"##
            );
        }
    }
}

/// How a series is drawn.
struct Style {
    colour: &'static str,
    dash: &'static str,
    width: f64,
}

impl Style {
    fn line(&self) -> String {
        let dash = match self.dash {
            "" => String::new(),
            dash => format!(r#" stroke-dasharray="{dash}""#),
        };
        let Self { colour, width, .. } = self;
        format!(r#"fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round"{dash}"#)
    }
}

/// The entries of the legend from left to right, broken into as many lines as the width requires, and its
/// height.
fn legend(entries: &[(&str, Style)], width: f64, top: f64) -> (String, f64) {
    let mut svg = String::new();
    let (mut x, mut y) = (LEFT, top + LEGEND_LINE / 2.0);
    for (name, style) in entries {
        let entry = LEGEND_SAMPLE + LETTER * name.chars().count() as f64;
        if x + entry > width && x > LEFT {
            (x, y) = (LEFT, y + LEGEND_LINE);
        }
        sample(&mut svg, x, y, style);
        text(&mut svg, x + 34.0, y + 4.0, "", name);
        x += entry;
    }
    (svg, if entries.is_empty() { 0.0 } else { y - top + LEGEND_LINE })
}

/// A short sample of a line.
fn sample(svg: &mut String, x: f64, y: f64, style: &Style) {
    let (end, middle) = (px(x + SAMPLE_WIDTH), px(x + SAMPLE_WIDTH / 2.0));
    let _ = writeln!(svg, r#"<line x1="{}" y1="{y}" x2="{end}" y2="{y}" {}/>"#, px(x), style.line());
    let _ = writeln!(svg, r#"<circle cx="{middle}" cy="{y}" r="2.5" fill="{}"/>"#, style.colour);
}

fn has_place(&(x, y): &(f64, f64)) -> bool {
    [x, y].iter().all(|value| *value > 0.0 && value.is_finite())
}

/// A coordinate, rounded to a hundredth of a pixel.
fn px(value: f64) -> String {
    format!("{value:.2}")
}

/// A line of the grid; those with a label are darker.
fn line(svg: &mut String, x1: &str, y1: &str, x2: &str, y2: &str, is_strong: bool) {
    let colour = if is_strong { "#cccccc" } else { "#eeeeee" };
    let _ = writeln!(svg, r#"<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{colour}"/>"#);
}

fn text(svg: &mut String, x: f64, y: f64, attributes: &str, content: &str) {
    let space = if attributes.is_empty() { "" } else { " " };
    let _ =
        writeln!(svg, r#"<text x="{}" y="{}"{space}{attributes}>{}</text>"#, px(x), px(y), escaped(content));
}

/// Text as XML content, or as an attribute in double quotes. Characters that XML does not allow, such as most
/// control characters, become U+FFFD.
pub fn escaped(content: &str) -> String {
    let mut safe = String::with_capacity(content.len());
    for character in content.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\t' | '\n' | '\r' => safe.push(' '),
            '\0'..' ' | '\u{fffe}' | '\u{ffff}' => safe.push('\u{fffd}'),
            other => safe.push(other),
        }
    }
    safe
}
