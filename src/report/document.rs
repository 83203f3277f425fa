//! The contents of a report: the figures, as the page shows them and as `report.json` holds them.
//!
//! `report.json` is one object. `version` is 1; the meaning of a key never changes without a new version.
//!
//! | key | meaning |
//! |---|---|
//! | `complete` | false while figures are missing: the report was interrupted, or is being made |
//! | `date`, `command`, `machine` | when, by which command and on what it was measured |
//! | `lights` | numbers of lights |
//! | `findings` | sentences: where this program's own methods are on the Pareto front, and where not |
//! | `maps`, `means` | tables of single maps; the geometric means over them (null for none) |
//! | `sequences` | tables of sequences |
//! | `pictures`, `picture_means` | tables of rendered pictures; the geometric means over them (null for none) |
//! | `pictures_skipped` | why there are no pictures (null where there are) |
//! | `stability` | the hard cases, as rows: `case`, `input`, `quantity`, `figures` (`plain_f32`, `ours`, `reference`, `bound`), `tested_in` |
//! | `texts` | tables as text, beside published figures: `title`, `command`, `lines` |
//!
//! A table has `name`, `command` (which prints its figures), `notes`, `measures` (`key`, `name`, `ranked`)
//! and `rows`. A row has `method`, `lights`, `time_ms`, a value for the `key` of every measure (null where it
//! is not finite), and `front`, the keys of those ranked measures for which it is on the Pareto front: no
//! other method with as many lights has at most its time and at most its value, and less of one.

use super::machine::{Machine, now_utc};
use super::table::Table;
use crate::compare::stability;
use serde_json::{Value, json};

/// A table as text.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// What it is about.
    pub title: String,
    /// The command that prints it.
    pub command: String,
    /// Its lines.
    pub lines: Vec<String>,
}

/// A whole report.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// Whether everything that was requested is there.
    pub is_complete: bool,
    /// When it was begun.
    pub date: String,
    /// The command that made it.
    pub command: String,
    /// What it was measured on.
    pub machine: Machine,
    /// Numbers of lights.
    pub lights: Vec<usize>,
    /// One for each map.
    pub maps: Vec<Table>,
    /// Their means, for more than one.
    pub means: Option<Table>,
    /// One for each sequence.
    pub sequences: Vec<Table>,
    /// One for each map that pictures were drawn under.
    pub pictures: Vec<Table>,
    /// Their means, for more than one.
    pub picture_means: Option<Table>,
    /// Why there are no pictures.
    pub pictures_skipped: Option<String>,
    /// The hard cases.
    pub stability: Vec<stability::Row>,
    /// Tables beside published figures.
    pub texts: Vec<Text>,
}

impl Document {
    /// An empty report, on this machine.
    pub fn new(command: String, lights: Vec<usize>) -> Self {
        Self {
            is_complete: false,
            date: now_utc(),
            command,
            machine: Machine::this(),
            lights,
            maps: Vec::new(),
            means: None,
            sequences: Vec::new(),
            pictures: Vec::new(),
            picture_means: None,
            pictures_skipped: None,
            stability: Vec::new(),
            texts: Vec::new(),
        }
    }

    /// Adds the table of a map; `command` prints the means over it and those before.
    pub fn add_map(&mut self, table: Table, command: String) {
        self.maps.push(table);
        self.means = means("geometric means over", command, &self.maps);
    }

    /// Adds the table of the pictures under a map; `command` prints the means over them and those before.
    pub fn add_pictures(&mut self, table: Table, command: String) {
        self.pictures.push(table);
        self.picture_means = means("geometric means over pictures under", command, &self.pictures);
    }

    /// The table that summarises several: the means, or the only one.
    pub fn summary<'a>(means: &'a Option<Table>, tables: &'a [Table]) -> Option<&'a Table> {
        means.as_ref().or(tables.first())
    }

    /// Sentences about the fronts of the means and of every sequence.
    pub fn findings(&self) -> Vec<String> {
        let maps = Self::summary(&self.means, &self.maps);
        let pictures = Self::summary(&self.picture_means, &self.pictures);
        maps.into_iter().chain(pictures).chain(&self.sequences).flat_map(Table::findings).collect()
    }

    /// The text of `report.json`.
    pub fn to_json(&self) -> String {
        let tables = |tables: &[Table]| tables.iter().map(Table::to_json).collect::<Vec<_>>();
        let texts: Vec<Value> = self
            .texts
            .iter()
            .map(|text| json!({"title": text.title, "command": text.command, "lines": text.lines}))
            .collect();
        let document = json!({
            "version": 1,
            "complete": self.is_complete,
            "date": self.date,
            "command": self.command,
            "machine": self.machine,
            "lights": self.lights,
            "findings": self.findings(),
            "maps": tables(&self.maps),
            "means": self.means.as_ref().map(Table::to_json),
            "sequences": tables(&self.sequences),
            "pictures": tables(&self.pictures),
            "picture_means": self.picture_means.as_ref().map(Table::to_json),
            "pictures_skipped": self.pictures_skipped,
            "stability": self.stability,
            "texts": texts,
        });
        format!("{document:#}\n")
    }
}

/// The means over tables of maps, for more than one.
fn means(what: &str, command: String, tables: &[Table]) -> Option<Table> {
    let name = format!("{what} {} maps", tables.len());
    if tables.len() > 1 { Table::mean(name, command, tables) } else { None }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::report::table::tests::{row, table};

    pub(in super::super) fn document() -> Document {
        let rows = |scale: f64| {
            vec![
                row("refined", 8, 2.0, [0.01 * scale, 0.02]),
                row("refined", 4, 1.0, [0.04 * scale, f64::INFINITY]),
                row("standard", 4, 1.5, [0.08 * scale, 0.1]),
                row("standard", 8, 1.5, [0.02 * scale, 0.1]),
            ]
        };
        let mut document = Document::new("lightcast report '<b>&.hdr'".to_owned(), vec![4, 8]);
        for table in [table("<b>&.hdr", rows(1.0)), table("dark", rows(0.0))] {
            document.add_map(table, "lightcast report".to_owned());
        }
        document
    }

    #[test]
    fn means_are_of_what_is_there_so_far_and_of_more_than_one() {
        let of_map = |name| table(name, vec![row("refined", 4, 1.0, [0.1, 1.0])]);
        let mut document = Document::new(String::new(), vec![4]);
        let mut names = Vec::new();
        for name in ["a", "b", "c"] {
            document.add_pictures(of_map(name), name.to_owned());
            let means = &document.picture_means;
            names.push(means.as_ref().map(|means| (means.name.clone(), means.command.clone())));
        }
        let expected = |count: usize, command: &str| {
            Some((format!("geometric means over pictures under {count} maps"), command.to_owned()))
        };
        assert_eq!(names, [None, expected(2, "b"), expected(3, "c")]);
        assert_eq!(document.means, None);
    }

    #[test]
    fn json_has_the_keys_that_are_documented() {
        let document = document();
        let json: Value = serde_json::from_str(&document.to_json()).unwrap();
        let page = include_str!("document.rs");
        for key in json.as_object().unwrap().keys() {
            assert!(
                page.lines().any(|line| line.starts_with("//!") && line.contains(&format!("`{key}`"))),
                "{key}"
            );
        }
        assert_eq!((&json["version"], &json["complete"]), (&json!(1), &json!(false)));
        let row = &json["maps"][0]["rows"][0];
        assert_eq!(row["front"], json!(["shadow"]));
        assert_eq!((&row["shadow"], &row["estimate"]), (&json!(0.04), &Value::Null));
        assert_eq!(
            json["maps"][0]["measures"][0],
            json!({"key": "shadow", "name": "shadow error", "ranked": true})
        );
        assert_eq!(json["findings"].as_array().unwrap().len(), 1);
        assert!(json["machine"]["processor"].is_string() && json["machine"]["adapter"].is_null());
    }
}
