use std::fmt::Write as _;
use std::time::Duration;

/// Number of frames whose median time is shown.
const FRAMES: usize = 31;

/// Times of the last frames.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameTimes {
    ring: [u64; FRAMES],
    filled: usize,
    next: usize,
}

impl FrameTimes {
    pub fn add(&mut self, time: Duration) {
        self.ring[self.next] = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.next = (self.next + 1) % FRAMES;
        self.filled = (self.filled + 1).min(FRAMES);
    }

    /// Median of the last 31 frame times, or of as many as there are, in nanoseconds; `None` before the
    /// first.
    pub fn median_ns(&self) -> Option<u64> {
        let mut sorted = self.ring;
        let sorted = &mut sorted[..self.filled];
        sorted.sort_unstable();
        sorted.get(self.filled / 2).copied()
    }
}

/// The contents of the window's title.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Title<'a> {
    /// Name of the scene.
    pub name: &'a str,
    pub timings: Option<Timings>,
    pub is_frozen: bool,
    /// Whether the source of lists has ended.
    pub has_ended: bool,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Timings {
    pub frame_ns: Option<u64>,
    pub lights: usize,
    pub shadow_maps: usize,
    pub samples: u32,
    /// For live lists: sequence number of the one that is shown, time since it arrived, and lists that were
    /// skipped.
    pub list: Option<(u64, Duration, u64)>,
}

impl Title<'_> {
    pub fn text(&self) -> String {
        let mut text = format!("lightcast: {}", self.name);
        if let Some(timings) = &self.timings {
            if let Some(frame_ns) = timings.frame_ns {
                let _ = write!(text, " | {:.1} ms", frame_ns as f64 * 1e-6);
            }
            let Timings { lights, shadow_maps, samples, .. } = timings;
            let _ = write!(text, " | {lights} lights, {shadow_maps} shadow maps, {samples} samples");
            if let Some((sequence, age, skipped)) = timings.list {
                let age_s = age.as_secs_f64();
                let _ = write!(text, " | list {sequence}, {age_s:.2} s old, {skipped} skipped");
            }
        }
        if self.is_frozen {
            text.push_str(" | frozen");
        }
        if self.has_ended {
            text.push_str(" | ended");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_the_last_31_frames() {
        let mut times = FrameTimes::default();
        assert_eq!(times.median_ns(), None);
        times.add(Duration::from_nanos(5));
        assert_eq!(times.median_ns(), Some(5));
        for time_ns in 100..131 {
            times.add(Duration::from_nanos(time_ns));
        }
        assert_eq!(times.median_ns(), Some(115));
        times.add(Duration::MAX);
        assert_eq!(times.median_ns(), Some(116), "one slow frame says nothing");
    }

    #[test]
    fn a_title_says_what_there_is_to_say() {
        let mut title = Title { name: "sky.hdr", ..Title::default() };
        assert_eq!(title.text(), "lightcast: sky.hdr");
        title.is_frozen = true;
        title.has_ended = true;
        assert_eq!(title.text(), "lightcast: sky.hdr | frozen | ended");
        title.is_frozen = false;
        title.has_ended = false;
        let list = Some((12, Duration::from_millis(40), 3));
        title.timings =
            Some(Timings { frame_ns: Some(12_345_678), lights: 72, shadow_maps: 8, samples: 4, list });
        assert_eq!(
            title.text(),
            "lightcast: sky.hdr | 12.3 ms | 72 lights, 8 shadow maps, 4 samples | list 12, 0.04 s old, 3 skipped"
        );
    }
}
