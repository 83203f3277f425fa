/// Time between two messages about the same thing.
const QUIET_NS: i64 = 10_000_000_000;

/// Counts what would fill the log if each had a message: the first has one, those that follow are told in
/// sum.
#[derive(Debug, Default)]
pub(super) struct Burst {
    untold: u64,
    told_ns: Option<i64>,
}

impl Burst {
    /// Counts one more; returns how many are to be told now, if any.
    pub fn note(&mut self, now_ns: i64) -> Option<u64> {
        self.untold += 1;
        self.rest(now_ns)
    }

    /// How many of those before are to be told now, if any.
    pub fn rest(&mut self, now_ns: i64) -> Option<u64> {
        let is_quiet = self.told_ns.is_none_or(|told_ns| now_ns - told_ns >= QUIET_NS);
        if !is_quiet || self.untold == 0 {
            return None;
        }
        self.told_ns = Some(now_ns);
        Some(std::mem::take(&mut self.untold))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_is_told_and_the_others_in_sum() {
        let mut burst = Burst::default();
        assert_eq!(burst.rest(0), None);
        assert_eq!(burst.note(0), Some(1));
        for time_ns in 1..1000 {
            assert_eq!(burst.note(time_ns), None);
        }
        assert_eq!(burst.rest(QUIET_NS - 1), None);
        assert_eq!(burst.rest(QUIET_NS), Some(999));
        assert_eq!(burst.rest(9 * QUIET_NS), None, "all is told");
        assert_eq!(burst.note(9 * QUIET_NS), Some(1));
    }
}
