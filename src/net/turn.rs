//! Which of the lists that were posted a client gets next, and which it has lost.

use super::board::Post;
use crate::wire::Subscription;
use std::sync::Arc;

/// How far a client is.
#[derive(Debug)]
pub(super) struct Turn {
    subscription: Subscription,
    /// Number of the first post that it has not yet had or passed over.
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

    /// From now on.
    pub fn subscribe(&mut self, subscription: Subscription) {
        self.subscription = subscription;
        self.due_ns = None;
    }

    /// The next post of `posts` (their numbers are consecutive) that is due, and how many lists that were due before it
    /// are lost; `None`: all that is due was had.
    pub fn next<'a>(
        &mut self,
        posts: impl ExactSizeIterator<Item = &'a Arc<Post>>,
    ) -> Option<(Arc<Post>, u64)> {
        let mut posts = posts.peekable();
        let oldest = *posts.peek()?;
        let mut lost = self.lost_unseen(oldest);
        let (mut first, mut last, mut due_count) = (None, None, 0);
        let mut due_ns = self.due_ns;
        for post in posts {
            if post.number < self.next_number {
                continue;
            }
            if let Some(after_ns) = self.due_after(due_ns, post) {
                due_ns = after_ns;
                due_count += 1;
                let found = (post, after_ns);
                first.get_or_insert(found);
                last = Some(found);
            }
        }
        let is_behind = lost > 0 || due_count > u64::from(self.subscription.queue);
        let (post, due_ns) = if is_behind { last? } else { first? };
        if is_behind {
            lost += due_count - 1;
        }
        (self.next_number, self.due_ns) = (post.number + 1, due_ns);
        Some((post.clone(), lost))
    }

    /// Lists that were due and are no longer among the posts: as many as their rate against the frame rate lets expect.
    fn lost_unseen(&self, oldest: &Post) -> u64 {
        let unseen = oldest.number.saturating_sub(self.next_number);
        let frame_rate_hz = oldest.list.stamp.frame_rate_hz;
        match self.subscription.rate_hz {
            Some(rate_hz) if rate_hz < frame_rate_hz => (unseen as f64 * rate_hz / frame_rate_hz) as u64,
            _ => unseen,
        }
    }

    /// Whether `post` is due, and then when the next one is.
    fn due_after(&self, due_ns: Option<i64>, post: &Post) -> Option<Option<i64>> {
        let Some(rate_hz) = self.subscription.rate_hz else { return Some(None) };
        let period_ns = (1e9 / rate_hz) as i64;
        let stamp = &post.list.stamp;
        let time_ns = stamp.capture_time_ns;
        let next_ns = match due_ns {
            Some(due_ns) => {
                // Frames come a little early or late; half a frame's time decides between two.
                let rate_hz = stamp.frame_rate_hz;
                let half_frame_ns = if rate_hz > 0.0 { (5e8 / rate_hz) as i64 } else { 0 };
                let until_ns = due_ns.saturating_sub(time_ns);
                // Times that ran back, by a clock that was set or a source that began anew, are not waited for.
                if until_ns > half_frame_ns.min(period_ns / 2) && until_ns <= period_ns.saturating_mul(2) {
                    return None;
                }
                if until_ns.saturating_abs() > period_ns { time_ns } else { due_ns }
            }
            None => time_ns,
        };
        Some(Some(next_ns.saturating_add(period_ns)))
    }
}
