//! What the numbers of a sequence's files mean.

/// The least number that is a time: of milliseconds since 1970 (13 digits) from September 2001 on, of
/// microseconds and nanoseconds (16 and 19 digits) likewise. A frame has no number of this size.
const UNITS: [(i64, i64); 3] =
    [(1_000_000_000_000_000_000, 1), (1_000_000_000_000_000, 1_000), (1_000_000_000_000, 1_000_000)];

/// From so many missing numbers for each file on, the user is told; and where there are so many in all, they
/// are no lost frames.
const IMPLAUSIBLE: u64 = 10;
const IMPLAUSIBLE_IN_ALL: u64 = 100;

/// The files of a sequence in time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Timeline {
    /// Frame number of each file, ascending; between two there are as many frames lost as numbers missing.
    pub numbers: Vec<u64>,
    /// When each was captured after the first, where the names are times.
    pub times_ns: Option<Vec<i64>>,
    /// What is unusual about the names, for the user.
    pub note: Option<String>,
}

/// Nanoseconds for each unit of the numbers, where these are times.
fn unit_ns(numbers: &[i64]) -> Option<i64> {
    let lowest = *numbers.first()?;
    UNITS.iter().find(|(least, _)| lowest >= *least).map(|&(_, unit_ns)| unit_ns)
}

/// The frame rate that the files' names tell, where these are times: that of the median interval.
pub(super) fn rate_hz(numbers: &[i64]) -> Option<f64> {
    let unit_ns = unit_ns(numbers)?;
    let mut intervals: Vec<i64> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_unstable();
    let median = *intervals.get(intervals.len() / 2)?;
    Some(1e9 / (median as f64 * unit_ns as f64))
}

impl Timeline {
    /// Of files with these numbers, ascending, at a frame rate; 0 where there is none.
    pub fn new(numbers: &[i64], frame_rate_hz: f64) -> Self {
        let lowest = numbers.first().copied().unwrap_or_default();
        let (frames, times_ns) = match unit_ns(numbers) {
            None => {
                // Frame numbers are counts; where a sequence begins below 0, they are counted from there.
                let base = lowest.min(0);
                (numbers.iter().map(|number| number.abs_diff(base)).collect(), None)
            }
            Some(unit_ns) => {
                let times_ns: Vec<i64> =
                    numbers.iter().map(|number| (number - lowest).saturating_mul(unit_ns)).collect();
                let mut next = 0;
                let frame = |&time_ns: &i64| {
                    // Two that are closer than half a frame are two frames all the same.
                    let number = ((time_ns as f64 * 1e-9 * frame_rate_hz).round() as u64).max(next);
                    next = number + 1;
                    number
                };
                (times_ns.iter().map(frame).collect(), Some(times_ns))
            }
        };
        Self { numbers: frames, times_ns, note: None }.closed(frame_rate_hz)
    }

    /// Where more is missing than can have been lost, every gap becomes that of one frame.
    fn closed(mut self, frame_rate_hz: f64) -> Self {
        let (Some(&first), Some(&last)) = (self.numbers.first(), self.numbers.last()) else { return self };
        let count = self.numbers.len() as u64;
        let missing = last - first - (count - 1);
        if missing / count < IMPLAUSIBLE {
            return self;
        }
        let told = format!(
            "{missing} frames are missing between {count} files, by the numbers in their names, far more than are \
             there"
        );
        if missing < IMPLAUSIBLE_IN_ALL {
            self.note = Some(told + "; they count as lost");
            return self;
        }
        self.note = Some(told + ": every gap counts as one lost frame");
        let (mut taken, mut before) = (0, first);
        for (index, number) in self.numbers.iter_mut().enumerate() {
            let gap = number.saturating_sub(before);
            before = *number;
            taken += gap.saturating_sub(2);
            *number -= taken;
            if let Some(times_ns) = &mut self.times_ns
                && frame_rate_hz > 0.0
            {
                times_ns[index] -= (taken as f64 * 1e9 / frame_rate_hz).round() as i64;
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_are_frames_and_count_from_the_lowest_below_zero() {
        let of = |numbers: &[i64]| Timeline::new(numbers, 25.0);
        assert_eq!(of(&[1001, 1002, 1005]).numbers, [1001, 1002, 1005]);
        assert_eq!(of(&[-2, -1, 0, 1]).numbers, [0, 1, 2, 3]);
        assert_eq!(of(&[5]).numbers, [5]);
        assert_eq!(of(&[1, 20]).note, None);
        let sparse = of(&[1, 90]);
        assert_eq!(sparse.numbers, [1, 90]);
        assert!(sparse.note.unwrap().ends_with("far more than are there; they count as lost"));
        assert_eq!(rate_hz(&[1, 2, 3]), None);
    }

    #[test]
    fn times_in_nanoseconds_microseconds_and_milliseconds_are_times() {
        // 20 Hz with some jitter, and two frames lost, as EuRoC's cameras have it.
        let ns = [0, 50_000_128, 99_999_744, 250_000_128, 300_000_000]
            .map(|time| 1_403_636_579_763_555_584 + time);
        for unit in [1, 1_000, 1_000_000] {
            let stamps = ns.map(|time| time / unit);
            let rate = rate_hz(&stamps).unwrap();
            assert!((rate - 20.0).abs() < 0.5, "{rate}");
            let Timeline { numbers, times_ns, note } = Timeline::new(&stamps, rate);
            assert_eq!((numbers, note), (vec![0, 1, 2, 5, 6], None));
            let times_ns = times_ns.unwrap();
            assert!(times_ns[0] == 0 && (times_ns[3] - 250_000_128).abs() <= 2 * unit, "{times_ns:?}");
        }
        assert_eq!(rate_hz(&[1_403_636_579_763_555_584]), None);
        // Two at almost the same time.
        let close = [0, 50_000_000, 50_000_100].map(|time| 1_403_636_579_000_000_000 + time);
        assert_eq!(Timeline::new(&close, 20.0).numbers, [0, 1, 2]);
    }

    #[test]
    fn gaps_that_cannot_be_are_told_and_closed() {
        let Timeline { numbers, note, .. } = Timeline::new(&[7, 8, 50_000_000, 50_000_001, 50_000_003], 25.0);
        assert_eq!(numbers, [7, 8, 10, 11, 13]);
        assert!(note.unwrap().contains("49999992 frames are missing between 5 files"));
        // Two takes, a day apart.
        let day = [0, 40, 86_400_000, 86_400_040].map(|time| 1_700_000_000_000 + time);
        let Timeline { numbers, times_ns, note } = Timeline::new(&day, 25.0);
        assert_eq!(numbers, [0, 1, 3, 4]);
        assert!(note.is_some());
        assert_eq!(times_ns.unwrap(), [0, 40_000_000, 120_000_000, 160_000_000]);
    }
}
