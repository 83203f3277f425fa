//! The medians that criterion has stored, as one table.

use std::path::PathBuf;

/// Rows in the order in which they were measured.
#[derive(Default)]
pub struct Table {
    rows: Vec<Row>,
}

struct Row {
    group: String,
    name: String,
    published: Option<&'static str>,
    remark: String,
}

impl Table {
    /// Adds a row for a benchmark, with the published figure and a remark.
    pub fn row(&mut self, group: &str, name: &str, published: Option<&'static str>, remark: String) {
        self.rows.push(Row { group: group.to_owned(), name: name.to_owned(), published, remark });
    }

    /// Prints the rows that have been measured, now or earlier.
    pub fn print(&self) {
        println!(
            "
{:<62} {:>11}   published (2005)",
            "median of one step, one thread", "ms"
        );
        for Row { group, name, published, remark } in &self.rows {
            if let Some(median_ns) = median_ns(group, name) {
                let step = format!("{group}: {name}");
                let line = format!(
                    "{step:<62} {:>11.4}   {:<31} {remark}",
                    median_ns / 1e6,
                    published.unwrap_or("")
                );
                println!("{}", line.trim_end());
            }
        }
    }
}

/// Median of a benchmark's last run, from the file where criterion keeps it.
fn median_ns(group: &str, name: &str) -> Option<f64> {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/target")), PathBuf::from);
    let file = target.join("criterion").join(group).join(name).join("new").join("estimates.json");
    let estimates: serde_json::Value = serde_json::from_slice(&std::fs::read(file).ok()?).ok()?;
    estimates["median"]["point_estimate"].as_f64()
}
