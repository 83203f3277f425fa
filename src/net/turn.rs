//! Which of the lists that were posted a client gets next, and which it has lost.

use super::board::Post;
use crate::wire::Subscription;
use std::collections::VecDeque;
use std::sync::Arc;

/// The position of a client in the sequence of posts.
#[derive(Debug)]
pub(super) struct Turn {
    subscription: Subscription,
    /// Number of the first post that it has not yet got or skipped.
    next_number: u64,
    /// Capture time of the next list that its rate lets through; `None`: the next list, whichever it is.
    due_ns: Option<i64>,
}

impl Turn {
    /// From the post of number `next_number` on.
    pub fn new(subscription: Subscription, next_number: u64) -> Self {
        Self { subscription, next_number, due_ns: None }
    }

    pub fn subscription(&self) -> &Subscription {
        &self.subscription
    }

    /// Uses another subscription from now on.
    pub fn subscribe(&mut self, subscription: Subscription) {
        self.subscription = subscription;
        self.due_ns = None;
    }

    /// The next post of `posts` (their numbers are consecutive) that is due, and how many lists that were due
    /// before it are lost; `None`: the client has got all that is due.
    pub fn next(&mut self, posts: &VecDeque<Arc<Post>>) -> Option<(Arc<Post>, u64)> {
        let oldest = posts.front()?;
        let end = oldest.number + posts.len() as u64;
        let mut lost = self.lost_unseen(oldest);
        let (mut first, mut last, mut due_count) = (None, None, 0);
        let mut due_ns = self.due_ns;
        let had = self.next_number.saturating_sub(oldest.number) as usize;
        for post in posts.range(had.min(posts.len())..) {
            if let Some(after_ns) = self.subscription.due_after(due_ns, &post.list.stamp) {
                due_ns = after_ns;
                due_count += 1;
                let found = (post, after_ns);
                first.get_or_insert(found);
                last = Some(found);
            }
        }
        if due_count == 0 {
            // The posts are skipped, and not counted as lost if the client should change its rate.
            self.next_number = self.next_number.max(end);
            return None;
        }
        let is_behind = lost > 0 || due_count > u64::from(self.subscription.queue);
        let (post, due_ns) = if is_behind { last? } else { first? };
        if is_behind {
            lost += due_count - 1;
        }
        (self.next_number, self.due_ns) = (post.number + 1, due_ns);
        Some((post.clone(), lost))
    }

    /// Lists that were due and are no longer among the posts: the number is estimated from their rate and the
    /// frame rate.
    fn lost_unseen(&self, oldest: &Post) -> u64 {
        let unseen = oldest.number.saturating_sub(self.next_number);
        let frame_rate_hz = oldest.list.stamp.frame_rate_hz;
        match self.subscription.rate_hz {
            Some(rate_hz) if rate_hz < frame_rate_hz => (unseen as f64 * rate_hz / frame_rate_hz) as u64,
            _ => unseen,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Board;
    use super::*;
    use crate::rt::CaptureEpoch;
    use lightcast_core::image::Stamp;
    use lightcast_core::light::LightList;
    use lightcast_core::light::ReferencedList;

    const FRAME_NS: i64 = 40_000_000;

    fn post(board: &Board, capture_time_ns: i64) {
        let stamp = Stamp { capture_time_ns, frame_rate_hz: 25.0, ..Stamp::default() };
        let list = LightList { stamp, ..LightList::default() };
        board.post(&ReferencedList { list, ..ReferencedList::default() }, &CaptureEpoch::default());
    }

    /// Numbers and losses that a client gets immediately.
    fn take_all(board: &Board, turn: &mut Turn) -> Vec<(u64, u64)> {
        let next = |turn: &mut Turn| board.look(|posts| turn.next(posts));
        std::iter::from_fn(|| next(turn)).map(|(post, lost)| (post.number, lost)).collect()
    }

    #[test]
    fn who_keeps_up_gets_everything_once() {
        let board = Board::default();
        let mut turn = Turn::new(Subscription::default(), 0);
        for number in 0..200 {
            post(&board, FRAME_NS * number as i64);
            assert_eq!(take_all(&board, &mut turn), [(number, 0)]);
        }
        assert_eq!(take_all(&board, &mut turn), []);
    }

    #[test]
    fn who_is_slow_skips_to_the_newest_and_learns_how_many_are_lost() {
        let board = Board::default();
        let mut turn = Turn::new(Subscription::default(), 0);
        for number in 0..5 {
            post(&board, FRAME_NS * number);
        }
        assert_eq!(take_all(&board, &mut turn), [(4, 4)]);
        // Further behind than the board remembers.
        for number in 5..205 {
            post(&board, FRAME_NS * number);
        }
        assert_eq!(take_all(&board, &mut turn), [(204, 199)]);
    }

    #[test]
    fn lists_wait_for_who_asks_for_that() {
        let board = Board::default();
        let mut turn = Turn::new(Subscription { queue: 4, ..Subscription::default() }, 0);
        for number in 0..4 {
            post(&board, FRAME_NS * number);
        }
        assert_eq!(take_all(&board, &mut turn), [(0, 0), (1, 0), (2, 0), (3, 0)]);
        for number in 4..9 {
            post(&board, FRAME_NS * number);
        }
        assert_eq!(take_all(&board, &mut turn), [(8, 4)], "one more than its queue holds");
    }

    #[test]
    fn a_lower_rate_passes_lists_over_that_are_not_lost() {
        for (rate_hz, count) in [(10.0, 40), (25.0, 100), (12.5, 50), (3.0, 12), (1000.0, 100)] {
            let board = Board::default();
            let mut turn = Turn::new(Subscription { rate_hz: Some(rate_hz), ..Subscription::default() }, 0);
            let mut got = 0_i32;
            for number in 0..100 {
                // Frames come a little early or late.
                post(&board, FRAME_NS * number + [0, 3_000_000, -2_000_000][number as usize % 3]);
                for (_, lost) in take_all(&board, &mut turn) {
                    assert_eq!(lost, 0);
                    got += 1;
                }
            }
            assert!((got - count).abs() <= 1, "{rate_hz} Hz: {got}");
        }
    }

    #[test]
    fn at_a_lower_rate_only_lists_that_were_due_are_lost() {
        let board = Board::default();
        let mut turn = Turn::new(Subscription { rate_hz: Some(5.0), ..Subscription::default() }, 0);
        for number in 0..26 {
            post(&board, FRAME_NS * number);
        }
        assert_eq!(take_all(&board, &mut turn), [(25, 5)], "0, 5, 10, 15 and 20 were due before");
        for number in 26..1026 {
            post(&board, FRAME_NS * number);
        }
        let [(number, lost)] = take_all(&board, &mut turn)[..] else { panic!("one list") };
        assert!(number >= 1020 && (195..=200).contains(&lost), "{number} {lost}: a fifth of a thousand");
    }

    #[test]
    fn capture_times_that_jump_stop_nobody() {
        let board = Board::default();
        let mut turn = Turn::new(Subscription { rate_hz: Some(5.0), ..Subscription::default() }, 0);
        post(&board, 3_600_000_000_000);
        assert_eq!(take_all(&board, &mut turn), [(0, 0)]);
        post(&board, 0);
        assert_eq!(take_all(&board, &mut turn), [(1, 0)], "a source that began anew");
        post(&board, FRAME_NS);
        assert_eq!(take_all(&board, &mut turn), []);
        post(&board, i64::MAX);
        post(&board, i64::MIN);
        assert_eq!(take_all(&board, &mut turn), [(4, 1)]);
    }

    #[test]
    fn a_new_subscription_begins_with_the_next_list() {
        let board = Board::default();
        let mut turn = Turn::new(Subscription { rate_hz: Some(0.5), ..Subscription::default() }, 0);
        post(&board, 0);
        post(&board, FRAME_NS);
        assert_eq!(take_all(&board, &mut turn), [(0, 0)]);
        turn.subscribe(Subscription::default());
        post(&board, 2 * FRAME_NS);
        assert_eq!(take_all(&board, &mut turn), [(2, 0)]);
    }
}
