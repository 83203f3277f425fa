//! The hard cases of METHODS section 10, each as rows of figures: the input, the result of a naive f32
//! implementation of the paper's method (the module `plain_paper`), our result, the reference in f64, and the
//! bound on our error.

mod frames;
mod maps;
mod time;

use crate::error::Result;
use serde::Serialize;

/// The bound on the difference of our result from the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// Relative to the reference.
    Relative(f64),
    /// In the quantity's own unit.
    Absolute(f64),
}

/// The figures of a case. In JSON, numbers that are not finite are null.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Result of the paper's method in f32; `None` where the paper has nothing to compare.
    pub plain_f32: Option<f64>,
    /// Result of this program.
    pub ours: f64,
    /// Reference in f64, by an independent computation.
    pub reference: f64,
    /// The bound on our difference from the reference.
    pub bound: Bound,
}

/// One figure of one hard case.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The name of the case in METHODS.
    pub case: &'static str,
    /// The input.
    pub input: &'static str,
    /// What is compared, with its unit.
    pub quantity: &'static str,
    /// The figures; `None` for a property that no figure can express.
    pub figures: Option<Figures>,
    /// The test of the properties without figures.
    pub tested_in: Option<&'static str>,
}

impl Figures {
    /// The difference of a value from the reference, relative or absolute as in the bound. NaN for NaN.
    pub fn error(&self, value: f64) -> f64 {
        match self.bound {
            Bound::Relative(_) => (value / self.reference - 1.0).abs(),
            Bound::Absolute(_) => (value - self.reference).abs(),
        }
    }

    /// Whether our result is within its bound.
    pub fn is_within(&self) -> bool {
        let (Bound::Relative(most) | Bound::Absolute(most)) = self.bound;
        self.error(self.ours) <= most
    }
}

/// A row of figures.
fn row(
    [case, input, quantity]: [&'static str; 3],
    plain_f32: impl Into<Option<f64>>,
    ours: f64,
    reference: f64,
    bound: Bound,
) -> Row {
    let figures = Figures { plain_f32: plain_f32.into(), ours, reference, bound };
    Row { case, input, quantity, figures: Some(figures), tested_in: None }
}

/// Measures a case.
type Case = fn() -> Result<Vec<Row>>;

/// Runs every case, in a few seconds. `goes_on` is called after every case; when it returns false, only the
/// rows until then are returned.
///
/// # Errors
/// Those of the measured parts.
pub fn measure(goes_on: impl Fn() -> bool) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for case in maps::CASES.into_iter().chain(time::CASES).chain(frames::CASES) {
        rows.extend(case()?);
        if !goes_on() {
            return Ok(rows);
        }
    }
    let elsewhere = |case, input, quantity, tested_in| Row {
        case,
        input,
        quantity,
        figures: None,
        tested_in: Some(tested_in),
    };
    rows.push(elsewhere(
        "corrupt or truncated file",
        "in the middle of a sequence",
        "named, counted as lost, the run goes on",
        "tests/run_replay/bad_frames.rs, tests/corrupt_files.rs",
    ));
    rows.push(elsewhere(
        "camera unplugged and back",
        "a kernel's camera driver, unbound and bound",
        "started again under its stable name",
        "tests/camera_guest/faults.rs",
    ));
    Ok(rows)
}

/// Lines for rows, header first.
pub fn lines(rows: &[Row]) -> Vec<String> {
    let widest = |of: fn(&Row) -> &str| rows.iter().map(|row| of(row).len()).max().unwrap_or(0);
    let [a, b, c] = [widest(|row| row.case), widest(|row| row.input), widest(|row| row.quantity)];
    let number = |value: f64| if value.is_nan() { "NaN".to_owned() } else { format!("{value:.6}") };
    let mut lines = vec![format!(
        "{:a$}  {:b$}  {:c$}  {:>13} {:>13} {:>13}  {:>6} {:>6} {:>6}",
        "hard case", "input", "quantity", "plain f32", "ours", "f64", "error", "error", "bound"
    )];
    lines.extend(rows.iter().map(|row| {
        let Row { case, input, quantity, figures, tested_in } = row;
        let Some(figures) = figures else {
            return format!("{case:a$}  {input:b$}  {quantity:c$}  {}", tested_in.unwrap_or_default());
        };
        let plain = figures.plain_f32;
        let (Bound::Relative(bound) | Bound::Absolute(bound)) = figures.bound;
        format!(
            "{case:a$}  {input:b$}  {quantity:c$}  {:>13} {:>13} {:>13}  {:>6} {:>6.0e} {bound:>6.0e}  {}",
            plain.map_or("-".to_owned(), number),
            number(figures.ours),
            number(figures.reference),
            plain.map_or("-".to_owned(), |plain| format!("{:.0e}", figures.error(plain))),
            figures.error(figures.ours),
            if figures.is_within() { "ok" } else { "beyond the bound" }
        )
    }));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_hard_case_is_within_its_bound() {
        let start = std::time::Instant::now();
        let rows = measure(|| true).unwrap();
        lines(&rows).iter().for_each(|line| println!("{line}"));
        println!("{:.1} s", start.elapsed().as_secs_f64());
        for row in &rows {
            assert!(row.figures.is_none_or(|figures| figures.is_within()), "{row:?}");
            assert!(row.figures.is_some() || row.tested_in.is_some(), "{row:?}");
        }
        // The files named in the rows exist.
        for name in rows.iter().filter_map(|row| row.tested_in).flat_map(|names| names.split(", ")) {
            assert!(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(name).exists(), "{name}");
        }
        // The purpose of the comparison: in many cases, f32 throughout is inaccurate or produces NaN.
        let figures: Vec<Figures> = rows.iter().filter_map(|row| row.figures).collect();
        let fails = |figures: &&Figures| {
            figures.plain_f32.is_some_and(|plain| !Figures { ours: plain, ..**figures }.is_within())
        };
        let failing = figures.iter().filter(fails).count();
        println!("beyond the bounds in plain f32: {failing} of {}", figures.len());
        assert!(2 * failing > figures.len());
    }

    #[test]
    fn what_is_no_number_is_beyond_every_bound_and_null_in_json() {
        let names = ["case", "input", "quantity"];
        let row = row(names, f64::NAN, f64::NAN, 1.0, Bound::Relative(0.1));
        assert!(!row.figures.unwrap().is_within());
        let json = serde_json::to_string(&row).unwrap();
        assert!(json.contains("\"plain_f32\":null,\"ours\":null,\"reference\":1.0"), "{json}");
        assert!(json.contains("\"bound\":{\"relative\":0.1}"), "{json}");
        assert!(lines(&[row])[1].ends_with("beyond the bound"));
    }
}
