//! The plots of a report.

use super::table::{Row, Table};
use crate::picture::{Panel, Plot, Series};

/// The quantity along x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Against {
    /// Time, of a map or a frame.
    Time(&'static str),
    /// Number of lights.
    Lights,
}

/// A panel for each ranked measure that has values, a series for each method with a point for each number of
/// lights, a ring about those on the front, and a thick line for ours.
pub(super) fn plot(title: &str, table: &Table, against: Against) -> Plot {
    let mut methods: Vec<&str> = Vec::new();
    for row in &table.rows {
        if !methods.contains(&row.method.as_str()) {
            methods.push(&row.method);
        }
    }
    let x_label = match against {
        Against::Time(unit) => unit,
        Against::Lights => "lights",
    };
    let panels = table.shown().filter(|&at| table.measures[at].ranked).map(|at| {
        let place = |row: &Row| {
            let x = if against == Against::Lights { row.lights as f64 } else { row.time_ms };
            (x, row.values[at])
        };
        let series = methods.iter().map(|method| Series {
            name: (*method).to_owned(),
            points: table.rows.iter().filter(|row| row.method == **method).map(place).collect(),
        });
        Panel {
            title: table.measures[at].name.to_owned(),
            x_label: x_label.to_owned(),
            y_label: table.measures[at].name.to_owned(),
            series: series.collect(),
            emphasis: Some(table.ours.to_owned()),
            rings: table.rows.iter().filter(|row| row.front[at]).map(place).collect(),
        }
    });
    Plot { title: title.to_owned(), panels: panels.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::document::tests::document;

    #[test]
    fn methods_are_series_over_the_lights_and_the_front_has_rings() {
        let document = document();
        let of_map = plot("a map", &document.maps[0], Against::Time("ms per map"));
        assert_eq!(of_map.panels.len(), 1);
        let panel = &of_map.panels[0];
        assert_eq!((panel.x_label.as_str(), panel.y_label.as_str()), ("ms per map", "shadow error"));
        assert_eq!((panel.series[0].name.as_str(), panel.emphasis.as_deref()), ("refined", Some("refined")));
        assert_eq!(panel.series[0].points, [(1.0, 0.04), (2.0, 0.01)]);
        assert_eq!(panel.rings, [(1.0, 0.04), (2.0, 0.01), (1.5, 0.02)]);
        let by_lights = plot("a map", &document.maps[0], Against::Lights);
        assert_eq!(by_lights.panels[0].series[1].points, [(4.0, 0.08), (8.0, 0.02)]);
        assert_eq!(by_lights.panels[0].x_label, "lights");
    }
}
