use crate::rt::{Metrics, WAITS};
use crate::stage::ATTEMPTS;
use std::fmt;
use std::sync::Arc;

/// The metrics of every stage, as a table.
#[derive(Clone, Debug)]
pub struct Summary {
    stages: Vec<Arc<Metrics>>,
}

impl Summary {
    /// The stages in the order of the data.
    pub fn of(stages: Vec<Arc<Metrics>>) -> Self {
        Self { stages }
    }

    /// With one more stage, which runs outside the service.
    #[must_use]
    pub fn with(mut self, stage: Arc<Metrics>) -> Self {
        self.stages.push(stage);
        self
    }

    /// The stages in the order of the data.
    pub fn stages(&self) -> &[Arc<Metrics>] {
        &self.stages
    }

    /// A number that grows as long as the service works: its lists, see [`Self::lists_made`], the frames that
    /// the source had to pass over, and its attempts to get what is missing, such as a camera.
    pub fn progress(&self) -> u64 {
        let Some(source) = self.stage("source") else { return self.lists_made() };
        let is_attempt = |(name, _): &&(&str, u64)| [ATTEMPTS, WAITS].contains(name);
        let attempts: u64 = source.counters().iter().filter(is_attempt).map(|(_, count)| count).sum();
        self.lists_made() + source.bad_frames.get() + attempts
    }

    /// Number of filtered light lists that are ready for clients; without a board, of those that were made.
    pub fn lists_made(&self) -> u64 {
        self.stage("board").or_else(|| self.stage("filter")).map_or(0, |stage| stage.frames.get())
    }

    /// The metrics of the stage of this name.
    pub fn stage(&self, name: &str) -> Option<&Metrics> {
        self.stages.iter().find(|stage| stage.name() == name).map(AsRef::as_ref)
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { stages } = self;
        writeln!(
            f,
            "{:<10} {:>8} {:>8} {:>10} {:>10} {:>10} {:>10}",
            "stage", "frames", "drops", "bad frames", "p50 ms", "p99 ms", "max ms"
        )?;
        for stage in stages {
            let ms = |time_ns: u64| time_ns as f64 * 1e-6;
            let time = &stage.time_ns;
            writeln!(
                f,
                "{:<10} {:>8} {:>8} {:>10} {:>10.3} {:>10.3} {:>10.3}",
                stage.name(),
                stage.frames.get(),
                stage.drops.get(),
                stage.bad_frames.get(),
                ms(time.percentile(0.5)),
                ms(time.percentile(0.99)),
                ms(time.maximum()),
            )?;
        }
        for stage in stages {
            let counters = stage.counters();
            if !counters.is_empty() {
                let counts: Vec<String> =
                    counters.iter().map(|(name, count)| format!("{count} {name}")).collect();
                writeln!(f, "{}: {}", stage.name(), counts.join(", "))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_for_every_stage_and_a_line_for_its_counters() {
        let stage = Metrics::new("calibrate");
        stage.frames.add(75);
        stage.drops.add(2);
        stage.bad_frames.add(1);
        stage.time_ns.record(1_500_000);
        stage.counter("pixels saturated").add(12);
        let summary = Summary::of(vec![Metrics::new("source"), stage]);
        let text = summary.to_string();
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines[1], ["source", "0", "0", "0", "0.000", "0.000", "0.000"]);
        assert_eq!(
            lines[2],
            ["calibrate", "75", "2", "1", "1.491", "1.491", "1.500"],
            "centres of buckets, and the maximum"
        );
        assert_eq!(text.lines().last(), Some("calibrate: 12 pixels saturated"));
        assert_eq!(summary.stage("source").unwrap().frames.get(), 0);
    }
}
