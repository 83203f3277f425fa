use std::time::Duration;

/// Growing waits between repeated attempts: none before the first attempt, then a first wait that doubles
/// with every further attempt, up to a longest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BackOff {
    first: Duration,
    longest: Duration,
    attempts: u32,
}

impl BackOff {
    /// No attempt yet; waits will go from `first` to `longest`.
    pub fn new(first: Duration, longest: Duration) -> Self {
        Self { first, longest, attempts: 0 }
    }

    /// Wait that is due before the next attempt.
    pub fn wait(&self) -> Duration {
        match self.attempts {
            0 => Duration::ZERO,
            attempts => self.first.saturating_mul(1 << (attempts - 1).min(16)).min(self.longest),
        }
    }

    /// Counts an attempt.
    pub fn attempt(&mut self) {
        self.attempts = self.attempts.saturating_add(1);
    }

    /// Attempts since the last success.
    pub fn attempts(&self) -> u32 {
        self.attempts
    }

    /// Whether the failure of this attempt should be logged: the first, second, fourth, eighth... are, so
    /// that a device that is missing for days does not fill the log.
    pub fn is_worth_telling(&self) -> bool {
        self.attempts.is_power_of_two()
    }

    /// Notes a success: the next attempt is a first one.
    pub fn succeeded(&mut self) {
        self.attempts = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest_and_begin_again_after_a_success() {
        let mut back_off = BackOff::new(Duration::from_millis(300), Duration::from_secs(1));
        let waits = |back_off: &mut BackOff| {
            [0; 5].map(|_| {
                let wait = back_off.wait().as_millis();
                back_off.attempt();
                (wait, back_off.is_worth_telling())
            })
        };
        let expected = [(0, true), (300, true), (600, false), (1000, true), (1000, false)];
        assert_eq!(waits(&mut back_off), expected);
        back_off.succeeded();
        assert_eq!(waits(&mut back_off), expected);
        (0..100).for_each(|_| back_off.attempt());
        assert_eq!(back_off.wait(), Duration::from_secs(1));
    }
}
