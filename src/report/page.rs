//! A report as one self-contained HTML page: no script, no other file, no network. It is well-formed XML too.

mod stability;
#[cfg(test)]
mod tests;

use super::document::{Document, Text};
use super::page_plots::{Against, plot};
use super::pareto::figure;
use super::table::{Row, Table};
use crate::picture::escaped;
use std::fmt::Write;

/// The label of the time axis.
const PER_MAP: Against = Against::Time("ms per map");
const PER_FRAME: Against = Against::Time("ms per frame");

/// Explanations of the terms, in the order of the page.
const METHODS: &str = "\
<p>Time is the median of repeated runs on one thread: from the polar map to the list of lights with its own estimate of \
its error; for sequences with the filter besides. Of a single map the first list is judged, of adaptive lights, which settle frame \
by frame, that of the ninth frame in which the map stands still; their time is that of one frame.</p>
<p><b>Irradiance</b>: RMS over 300 normals, relative to the mean, against the sum over all pixels of the map. \
<b>Shadow</b> (after Gibson and Murta 2000): the same over 20 x 20 cells of ground around a sphere that rests on it. \
<b>Glossy</b>: as irradiance with a normalised cos<sup>20</sup> lobe. <b>Own estimate</b>: the error that the list \
carries. Panoramas and frames are averaged to hemispheres of 360 x 90 pixels.</p>
<p>Over a sequence, <b>error</b> is the RMS over frames, 100 cells of ground and 100 normals, against the truth of every \
frame passed through the same filter; shadows are softened by the lights' spread, as the renderer draws them, except \
under <b>hard shadows</b>, where every light is a direction. Adaptive lights have their directions filtered by power, \
which is the default, the others as the paper has it. <b>Flicker</b> is the RMS of the second time difference of that error; \
<b>motion</b> is the angle by which a light moves from one frame to the next, its 99th percentile over all lights and \
frames (also the median, p50, and the maximum). The frames in which the filter starts are left out.</p>
<p><b>Image error</b>: pictures are compared with one that has every pixel of the map as a light, by the <b>RMS</b> of linear \
radiance over the pixels that show a surface, relative to their mean, and by the mean <b>FLIP</b> over the same.</p>";

const FRONT: &str = "\
<p>A value with a dot, and a point with a ring, is on the Pareto front: no other method with as many lights has at most \
its time and at most its value, and less of one.</p>";

/// The page. Its links are to `report.json` and the plots of [`plots`], which lie beside it.
pub fn page(document: &Document) -> String {
    let mut html = String::from(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>lightcast: error against time</title>\n<style>\n",
    );
    html.push_str(include_str!("page.css"));
    html.push_str("</style>\n</head>\n<body>\n<h1>lightcast: error against time</h1>\n");
    head(&mut html, document);
    findings(&mut html, document);
    maps(&mut html, document);
    pictures(&mut html, document);
    sequences(&mut html, document);
    for text in &document.texts {
        section(&mut html, &text.title);
        self::text(&mut html, text);
    }
    if !document.stability.is_empty() {
        section(&mut html, "Numerical stability");
        stability::stability(&mut html, &document.stability);
    }
    section(&mut html, "What is measured");
    html.push_str(METHODS);
    html.push_str("\n</body>\n</html>\n");
    html
}

/// Names and texts of the plots that lie beside the page, as files of SVG.
pub fn plots(document: &Document) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut add = |name: String, title: &str, table: &Table, against| {
        files.push((name, plot(title, table, against).to_svg()));
    };
    if let Some(table) = Document::summary(&document.means, &document.maps) {
        add("maps_time.svg".to_owned(), &format!("Error against time: {}", table.name), table, PER_MAP);
        let title = format!("Error against the number of lights: {}", table.name);
        add("maps_lights.svg".to_owned(), &title, table, Against::Lights);
    }
    for (number, table) in (1..).zip(&document.maps) {
        add(format!("map_{number}.svg"), &format!("Error against time: {}", table.name), table, PER_MAP);
    }
    for (number, table) in (1..).zip(&document.sequences) {
        add(format!("sequence_{number}.svg"), &format!("Steadiness: {}", table.name), table, PER_FRAME);
    }
    if let Some(table) = Document::summary(&document.picture_means, &document.pictures) {
        let title = format!("Error of pictures against time: {}", table.name);
        add("pictures_time.svg".to_owned(), &title, table, PER_MAP);
        let title = format!("Error of pictures against the number of lights: {}", table.name);
        add("pictures_lights.svg".to_owned(), &title, table, Against::Lights);
    }
    files
}

fn head(html: &mut String, document: &Document) {
    if !document.is_complete {
        html.push_str(
            "<p class=\"notice\">This report is not complete: it was interrupted, or is still being made. What is here was \
             measured in full.</p>\n",
        );
    }
    let machine = &document.machine;
    html.push_str("<dl>\n");
    let threads = format!("{}, {} threads", machine.processor, machine.threads);
    let adapter = machine.adapter.as_deref().unwrap_or("not used");
    for (term, meaning) in [
        ("Program", format!("{} ({})", machine.program, machine.build).as_str()),
        ("Processor", &threads),
        ("System", &machine.system),
        ("Vulkan adapter", adapter),
        ("Date", &document.date),
    ] {
        let _ = writeln!(html, "<dt>{term}</dt><dd>{}</dd>", escaped(meaning));
    }
    html.push_str("</dl>\n");
    command(html, "Made by", &document.command);
    html.push_str(
        "<p>All figures are in <a href=\"report.json\">report.json</a>, the plots beside it as SVG. Every table has the \
         command that prints it.</p>\n",
    );
}

fn findings(html: &mut String, document: &Document) {
    let findings = document.findings();
    if findings.is_empty() {
        return;
    }
    section(html, "Where ours is on the front");
    html.push_str(FRONT);
    html.push_str("\n<ul>\n");
    for finding in findings {
        let _ = writeln!(html, "<li>{}</li>", escaped(&finding));
    }
    html.push_str("</ul>\n");
}

fn maps(html: &mut String, document: &Document) {
    let Some(summary) = Document::summary(&document.means, &document.maps) else { return };
    section(html, "Single maps");
    let _ = writeln!(html, "<h3>{}</h3>", escaped(&summary.name));
    figure_of(
        html,
        summary,
        PER_MAP,
        "Error against time; along a line from 4 to 1,024 lights, or as many as were asked for.",
    );
    figure_of(html, summary, Against::Lights, "Error against the number of lights.");
    table(html, summary);
    if document.means.is_some() {
        html.push_str("<h3>Map by map</h3>\n");
        document.maps.iter().for_each(|table| folded(html, table, PER_MAP));
    }
}

fn sequences(html: &mut String, document: &Document) {
    if document.sequences.is_empty() {
        return;
    }
    section(html, "Sequences");
    for of_sequence in &document.sequences {
        let _ = writeln!(html, "<h3>{}</h3>", escaped(&of_sequence.name));
        figure_of(
            html,
            of_sequence,
            PER_FRAME,
            "Error against the filtered truth, flicker and light motion against time per frame.",
        );
        table(html, of_sequence);
    }
}

fn pictures(html: &mut String, document: &Document) {
    if let Some(why) = &document.pictures_skipped {
        section(html, "Pictures");
        let _ = writeln!(html, "<p>Skipped: {}</p>", escaped(why));
    }
    let Some(summary) = Document::summary(&document.picture_means, &document.pictures) else { return };
    section(html, "Pictures");
    let _ = writeln!(html, "<h3>{}</h3>", escaped(&summary.name));
    figure_of(html, summary, PER_MAP, "Error of pictures against the time that the lights take.");
    figure_of(html, summary, Against::Lights, "Error of pictures against the number of lights.");
    table(html, summary);
    if document.picture_means.is_some() {
        html.push_str("<h3>Map by map</h3>\n");
        document.pictures.iter().for_each(|table| folded(html, table, PER_MAP));
    }
}

/// A table with its plot, which opens on demand.
fn folded(html: &mut String, of: &Table, against: Against) {
    let _ = writeln!(html, "<details><summary>{}</summary>", escaped(&of.name));
    figure_of(html, of, against, "Error against time.");
    table(html, of);
    html.push_str("</details>\n");
}

fn figure_of(html: &mut String, of: &Table, against: Against, caption: &str) {
    let parts = plot("", of, against).to_parts();
    let _ = writeln!(html, "<figure><figcaption>{caption}</figcaption>\n<ul class=\"legend\">");
    for (sample, name) in &parts.legend {
        let _ = writeln!(html, "<li>{sample}{}</li>", escaped(name));
    }
    html.push_str("</ul>\n<div class=\"plots\">\n");
    parts.panels.iter().for_each(|panel| html.push_str(panel));
    html.push_str("</div></figure>\n");
}

fn table(html: &mut String, of: &Table) {
    if !of.notes.is_empty() {
        let _ = writeln!(html, "<p>{}</p>", escaped(&of.notes));
    }
    command(html, "Prints these figures", &of.command);
    let shown: Vec<usize> = of.shown().collect();
    html.push_str(
        "<div class=\"wide\" tabindex=\"0\"><table>\n<thead><tr><th>lights</th><th class=\"name\">method</th><th>ms</th>",
    );
    for &at in &shown {
        let _ = write!(html, "<th>{}</th>", escaped(of.measures[at].name));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    let mut last = None;
    for row in &of.rows {
        let is_first = last.replace(row.lights) != Some(row.lights);
        self::row(html, row, &shown, is_first);
    }
    html.push_str("</tbody></table></div>\n");
}

fn row(html: &mut String, row: &Row, shown: &[usize], is_first: bool) {
    let class = if is_first { " class=\"first\"" } else { "" };
    let _ = write!(
        html,
        "<tr{class}><td>{}</td><td class=\"name\">{}</td><td>{:.3}</td>",
        row.lights,
        escaped(&row.method),
        row.time_ms
    );
    for &at in shown {
        let class = if row.front[at] { " class=\"front\"" } else { "" };
        let _ = write!(html, "<td{class}>{}</td>", figure(row.values[at]));
    }
    html.push_str("</tr>\n");
}

fn text(html: &mut String, text: &Text) {
    command(html, "Prints this", &text.command);
    html.push_str("<pre tabindex=\"0\">");
    for line in &text.lines {
        let _ = writeln!(html, "{}", escaped(line));
    }
    html.push_str("</pre>\n");
}

fn section(html: &mut String, title: &str) {
    let _ = writeln!(html, "<h2>{}</h2>", escaped(title));
}

fn command(html: &mut String, what: &str, command: &str) {
    let _ = writeln!(
        html,
        "<p class=\"command\" tabindex=\"0\"><span>{what}:</span> <code>{}</code></p>",
        escaped(command)
    );
}
