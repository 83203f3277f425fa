//! A table of a report: figures by method and number of lights, with the front marked.

use super::pareto::{Contender, figure, finding, front};
use super::stills::geometric_mean;
use serde_json::{Map, Value, json};

/// What is measured besides the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Measure {
    /// Its key in JSON.
    pub key: &'static str,
    /// Its name for people, with its unit if it has one.
    pub name: &'static str,
    /// Whether less of it is better and it has a front and a plot; other measures are only listed.
    pub ranked: bool,
}

/// A method with some number of lights.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The method's name.
    pub method: String,
    /// Number of lights.
    pub lights: usize,
    /// Median time.
    pub time_ms: f64,
    /// One for each measure of the table.
    pub values: Vec<f64>,
    /// For each measure of the table, whether this row is on its front.
    pub front: Vec<bool>,
}

/// Figures of methods and numbers of lights on one input, or means over inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// The input's name.
    pub name: String,
    /// The command that prints these figures.
    pub command: String,
    /// Further remarks.
    pub notes: String,
    /// What is measured.
    pub measures: &'static [Measure],
    /// By number of lights, then in the order of the methods.
    pub rows: Vec<Row>,
    /// The method of this program that [`Self::findings`] are about.
    pub ours: &'static str,
}

impl Table {
    /// Sorts the rows by the number of lights and finds the fronts.
    ///
    /// # Panics
    /// When a row has not one value for each measure.
    pub fn new(
        name: String,
        command: String,
        measures: &'static [Measure],
        ours: &'static str,
        mut rows: Vec<Row>,
    ) -> Self {
        assert!(rows.iter().all(|row| row.values.len() == measures.len()), "a value for each measure");
        rows.sort_by_key(|row| row.lights);
        for of_count in rows.chunk_by_mut(|a, b| a.lights == b.lights) {
            of_count.iter_mut().for_each(|row| row.front = vec![false; measures.len()]);
            for at in (0..measures.len()).filter(|&at| measures[at].ranked) {
                let points: Vec<(f64, f64)> =
                    of_count.iter().map(|row| (row.time_ms, row.values[at])).collect();
                for (row, is_on_front) in of_count.iter_mut().zip(front(&points)) {
                    row.front[at] = is_on_front;
                }
            }
        }
        Self { name, command, notes: String::new(), measures, rows, ours }
    }

    /// Geometric means of times and ranked measures over tables of the same measures; `None` for none. A
    /// value of zero makes its mean zero. Other measures have no mean. A note that all tables have is also
    /// that of the means.
    pub fn mean(name: String, command: String, tables: &[Self]) -> Option<Self> {
        let first = tables.first()?;
        let mut rows = Vec::new();
        for model in &first.rows {
            let same = || {
                let all = tables.iter().flat_map(|table| &table.rows);
                all.filter(|row| row.method == model.method && row.lights == model.lights)
            };
            let of = |at: usize| match first.measures[at].ranked {
                true => geometric_mean(same().map(|row| row.values[at])),
                false => f64::NAN,
            };
            rows.push(Row {
                time_ms: geometric_mean(same().map(|row| row.time_ms)),
                values: (0..first.measures.len()).map(of).collect(),
                ..model.clone()
            });
        }
        let mut means = Self::new(name, command, first.measures, first.ours, rows);
        if tables.iter().all(|table| table.notes == first.notes) {
            means.notes.clone_from(&first.notes);
        }
        Some(means)
    }

    /// A sentence for every ranked measure: whether ours is on the front.
    pub fn findings(&self) -> Vec<String> {
        let ranked = (0..self.measures.len()).filter(|&at| self.measures[at].ranked);
        ranked
            .filter_map(|at| {
                let contenders: Vec<Contender> = self
                    .rows
                    .iter()
                    .map(|row| Contender {
                        method: &row.method,
                        lights: row.lights,
                        time_ms: row.time_ms,
                        value: row.values[at],
                    })
                    .collect();
                finding(&format!("{}, {}", self.name, self.measures[at].name), self.ours, &contenders)
            })
            .collect()
    }

    /// The measures that have values.
    pub fn shown(&self) -> impl Iterator<Item = usize> {
        (0..self.measures.len()).filter(|&at| self.rows.iter().any(|row| !row.values[at].is_nan()))
    }

    /// Lines for a terminal, header first; `*` marks values on the front.
    pub fn lines(&self) -> Vec<String> {
        let shown: Vec<usize> = self.shown().collect();
        let widths: Vec<usize> =
            shown.iter().map(|&at| self.measures[at].name.chars().count().max(9) + 1).collect();
        let method_width = self.rows.iter().map(|row| row.method.chars().count()).max().unwrap_or(0);
        let mut header = format!("  {:<method_width$} {:>6} {:>9}", "method", "lights", "ms");
        for (&at, width) in shown.iter().zip(&widths) {
            header += &format!(" {:>width$} ", self.measures[at].name);
        }
        let mut lines = vec![self.name.clone(), header.trim_end().to_owned()];
        for row in &self.rows {
            let mut line = format!("  {:<method_width$} {:>6} {:>9.3}", row.method, row.lights, row.time_ms);
            for (&at, width) in shown.iter().zip(&widths) {
                let mark = if row.front[at] { '*' } else { ' ' };
                line += &format!(" {:>width$}{mark}", figure(row.values[at]));
            }
            lines.push(line.trim_end().to_owned());
        }
        lines
    }

    /// As `report.json` has it; see [`super::document`].
    pub(super) fn to_json(&self) -> Value {
        let rows: Vec<Value> = self.rows.iter().map(|row| self.row_to_json(row)).collect();
        let measures: Vec<Value> = self
            .measures
            .iter()
            .map(|measure| json!({"key": measure.key, "name": measure.name, "ranked": measure.ranked}))
            .collect();
        json!({
            "name": self.name, "command": self.command, "notes": self.notes, "measures": measures, "rows": rows
        })
    }

    fn row_to_json(&self, row: &Row) -> Value {
        let mut object = Map::new();
        object.insert("method".to_owned(), json!(row.method));
        object.insert("lights".to_owned(), json!(row.lights));
        object.insert("time_ms".to_owned(), json!(row.time_ms));
        for (measure, value) in self.measures.iter().zip(&row.values) {
            object.insert(measure.key.to_owned(), json!(value));
        }
        let on_front = self.measures.iter().zip(&row.front).filter(|(_, is_on)| **is_on);
        let front: Vec<&str> = on_front.map(|(measure, _)| measure.key).collect();
        object.insert("front".to_owned(), json!(front));
        Value::Object(object)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::report::document::tests::document;

    const MEASURES: [Measure; 2] = [
        Measure { key: "shadow", name: "shadow error", ranked: true },
        Measure { key: "estimate", name: "estimate", ranked: false },
    ];

    pub(in super::super) fn row(method: &str, lights: usize, time_ms: f64, values: [f64; 2]) -> Row {
        Row { method: method.to_owned(), lights, time_ms, values: values.to_vec(), front: Vec::new() }
    }

    pub(in super::super) fn table(name: &str, rows: Vec<Row>) -> Table {
        Table::new(name.to_owned(), "lightcast report".to_owned(), &MEASURES, "refined", rows)
    }

    #[test]
    fn rows_are_sorted_and_have_fronts_of_their_number_of_lights() {
        let table = &document().maps[0];
        let fronts: Vec<(usize, &str, &[bool])> =
            table.rows.iter().map(|row| (row.lights, row.method.as_str(), row.front.as_slice())).collect();
        assert_eq!(
            fronts,
            [
                (4, "refined", &[true, false][..]),
                (4, "standard", &[false, false]),
                (8, "refined", &[true, false]),
                (8, "standard", &[true, false]),
            ]
        );
    }

    #[test]
    fn means_are_geometric_zero_where_one_is_and_none_of_what_is_only_told() {
        let noted = |table| Table { notes: "in a small size".to_owned(), ..table };
        let one = noted(table("a", vec![row("refined", 4, 1.0, [0.01, 1.0])]));
        let other = noted(table("b", vec![row("refined", 4, 4.0, [0.0001, 1.0])]));
        let mean = Table::mean("m".into(), "c".into(), &[one.clone(), other]).unwrap();
        assert_eq!(mean.notes, one.notes);
        let Row { time_ms, values, .. } = &mean.rows[0];
        assert!((time_ms - 2.0).abs() < 1e-12 && (values[0] - 0.001).abs() < 1e-12 && values[1].is_nan());
        assert_eq!(mean.shown().collect::<Vec<_>>(), [0]);
        let dark = table("dark", vec![row("refined", 4, 1.0, [0.0, 0.0])]);
        let mean = Table::mean("m".into(), "c".into(), &[one, dark]).unwrap();
        assert_eq!((mean.rows[0].values[0], mean.notes.as_str()), (0.0, ""));
        assert_eq!(Table::mean("m".into(), "c".into(), &[]), None);
    }

    #[test]
    fn lines_mark_the_front_and_leave_out_what_has_no_values() {
        let document = document();
        let lines = document.maps[0].lines();
        assert_eq!((lines.len(), lines[0].as_str()), (6, "<b>&.hdr"));
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&lines[2]), ["refined", "4", "1.000", "0.04000*", "inf"]);
        assert_eq!(words(&lines[3]), ["standard", "4", "1.500", "0.08000", "0.10000"]);
        let means = document.means.unwrap().lines();
        assert_eq!(words(&means[1]), ["method", "lights", "ms", "shadow", "error"]);
    }
}
