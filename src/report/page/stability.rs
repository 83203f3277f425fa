//! The hard cases on the page.

use crate::compare::stability::{Bound, Row};
use crate::picture::escaped;
use std::fmt::Write;

const EXPLANATION: &str = "\
<p>Every hard case: what the paper's method written down in plain f32 makes of it, what this program makes of it, and a \
reference in f64. Errors are relative to the reference or, where it is marked, absolute; the tests hold this program's to \
the bound.</p>\n";

/// Explanation and table.
pub(super) fn stability(html: &mut String, rows: &[Row]) {
    html.push_str(EXPLANATION);
    super::command(html, "Prints these figures", "lightcast report --stability");
    html.push_str("<div class=\"wide\" tabindex=\"0\"><table class=\"cases\">\n<thead><tr>");
    for (class, title) in [
        (" class=\"name\"", "case"),
        (" class=\"name\"", "input"),
        (" class=\"name\"", "quantity"),
        ("", "plain f32"),
        ("", "ours"),
        ("", "f64"),
        ("", "error, plain"),
        ("", "error, ours"),
        ("", "bound"),
        (" class=\"name\"", "ours is"),
    ] {
        let _ = write!(html, "<th{class}>{title}</th>");
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    let mut last = None;
    for row in rows {
        let class = if last.replace(row.case) == Some(row.case) { "" } else { " class=\"first\"" };
        let _ = write!(html, "<tr{class}>");
        for text in [row.case, row.input, row.quantity] {
            let _ = write!(html, "<td class=\"name\">{}</td>", escaped(text));
        }
        figures(html, row);
        html.push_str("</tr>\n");
    }
    html.push_str("</tbody></table></div>\n");
}

fn figures(html: &mut String, row: &Row) {
    let Some(figures) = row.figures else {
        let tests = row.tested_in.unwrap_or_default();
        let _ = write!(html, "<td class=\"name\" colspan=\"7\">tested in {}</td>", escaped(tests));
        return;
    };
    let (bound, unit) = match figures.bound {
        Bound::Relative(bound) => (bound, ""),
        Bound::Absolute(bound) => (bound, " absolute"),
    };
    let plain = figures.plain_f32;
    let verdict = if figures.is_within() { "within" } else { "beyond" };
    for cell in [
        plain.map_or("-".to_owned(), |plain| format!("{plain:.7}")),
        format!("{:.7}", figures.ours),
        format!("{:.7}", figures.reference),
        plain.map_or("-".to_owned(), |plain| digit(figures.error(plain))),
        digit(figures.error(figures.ours)),
        digit(bound) + unit,
    ] {
        let _ = write!(html, "<td>{cell}</td>");
    }
    let _ = write!(html, "<td class=\"name\">{verdict}</td>");
}

/// One digit and a power of ten.
fn digit(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.0e}") }
}
