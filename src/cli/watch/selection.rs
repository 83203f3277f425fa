use crate::wire::Subscription;
use lightcast_core::light::{Light, LightList, Prefixes};

/// Selects from the lists of a file what a server would send.
pub(super) struct Selection {
    subscription: Subscription,
    /// Capture time of the next list that the rate lets through.
    due_ns: Option<i64>,
    prefixes: Prefixes,
    joined: Vec<Light>,
}

impl Selection {
    pub fn new(subscription: Subscription) -> Self {
        Self { subscription, due_ns: None, prefixes: Prefixes::default(), joined: Vec::new() }
    }

    /// Shortens a list to the lights that are wanted; false if it is not due yet. For a length whose error
    /// the list does not give, the error is unknown.
    pub fn take(&mut self, list: &mut LightList) -> bool {
        let Some(due_ns) = self.subscription.due_after(self.due_ns, &list.stamp) else { return false };
        self.due_ns = due_ns;
        let count = self.subscription.light_count(list);
        if count < list.lights.len() {
            self.prefixes.prefix(&list.lights, count, &mut self.joined);
            std::mem::swap(&mut list.lights, &mut self.joined);
            list.prefix_errors.retain(|&(length, _)| length as usize <= count);
            let published = list.prefix_errors.last().filter(|&&(length, _)| length as usize == count);
            list.error = published.map(|&(_, error)| error);
            list.chosen_lights = list.chosen_lights.map(|chosen| chosen.min(count as u32));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(time_ns: i64) -> LightList {
        let light = |id: u32| Light { id, direction: [0.6, 0.8, 0.0], irradiance: [1.0; 3], spread_rad: 0.0 };
        let mut list = LightList::default();
        list.lights.extend((0..8).map(light));
        list.prefix_errors.extend([(2, 0.5), (4, 0.25), (8, 0.125)]);
        list.error = Some(0.125);
        (list.stamp.capture_time_ns, list.stamp.frame_rate_hz) = (time_ns, 25.0);
        list
    }

    #[test]
    fn a_list_is_shortened_and_keeps_its_power() {
        for (lights, error, count, expected) in
            [(Some(4), None, 4, 0.25), (None, Some(0.6), 2, 0.5), (None, None, 8, 0.125)]
        {
            let subscription = Subscription { lights, error, ..Subscription::default() };
            let mut short = list(0);
            assert!(Selection::new(subscription).take(&mut short));
            assert_eq!((short.lights.len(), short.error), (count, Some(expected)));
            assert_eq!(short.sum_of_lights(), [8.0; 3]);
            assert_eq!(short.prefix_errors.last(), Some(&(count as u32, expected)));
        }
    }

    #[test]
    fn a_rate_counts_by_capture_times() {
        let mut selection = Selection::new(Subscription { rate_hz: Some(10.0), ..Subscription::default() });
        let mut is_taken = |time_ms: i64| selection.take(&mut list(time_ms * 1_000_000));
        let taken: Vec<i64> = (0..10).map(|frame| 40 * frame).filter(|time_ms| is_taken(*time_ms)).collect();
        assert_eq!(taken, [0, 80, 200, 280]);
    }
}
