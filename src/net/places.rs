//! The places of connections that ask for something: who gets one, and who has to leave when all are taken.

use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// Least time for the answer to a request, and how many of its bytes a client has to take in a second beyond
/// that.
const ANSWER_WITHIN_NS: i64 = 10_000_000_000;
const BYTES_PER_SECOND: u64 = 32_768;
/// A client that has taken nothing of its answer for this long leaves when others wait.
const STALLED_NS: i64 = 2_000_000_000;
/// A connection that has asked for nothing may stay this long when others wait: clients that all come at
/// once, as after a restart, have asked by then, and none of them pushes another out.
const TO_ASK_NS: i64 = 50_000_000;

/// All places. Some are for requests about the program's health alone, so that these are answered whatever
/// the others do.
#[derive(Debug)]
pub(super) struct Places {
    most: usize,
    most_for_health: usize,
    taken: Mutex<Vec<Arc<Visit>>>,
}

/// One connection in its place. Times are those of the monotonic clock in nanoseconds.
#[derive(Debug)]
pub(super) struct Visit {
    came_ns: i64,
    /// Whether only requests about the program's health are answered.
    pub is_for_health: bool,
    /// When its request was complete; 0: it is not.
    asked_ns: AtomicI64,
    /// When it last took bytes of its answer, and how many so far.
    took_ns: AtomicI64,
    bytes: AtomicU64,
    is_stream: AtomicBool,
    /// Tells its task to end.
    pub leave: Notify,
    /// Tells its session that it sends too many frames.
    pub flood: Notify,
}

/// What there is for a connection that has come.
pub(super) enum Found {
    Place(Place),
    /// Nothing now, but one will have to leave soon: ask again.
    Soon,
    Nothing,
}

/// A place, free again when dropped.
pub(super) struct Place {
    places: Arc<Places>,
    pub visit: Arc<Visit>,
}

impl Places {
    /// `count` places, of which a few are for health alone.
    pub fn new(count: usize) -> Arc<Self> {
        let most_for_health = (count / 8).clamp(1, 8);
        let most = count.saturating_sub(most_for_health);
        Arc::new(Self { most, most_for_health, taken: Mutex::default() })
    }

    /// A place for a connection that has come now. Where all are taken, the oldest that has not asked for
    /// anything yet leaves once it had time to, or else the one that has taken nothing of its answer for the
    /// longest time; where there is none of either, the place is one for health, if one is free.
    pub fn take(self: &Arc<Self>, now_ns: i64) -> Found {
        let mut taken = self.lock();
        let for_health = taken.iter().filter(|visit| visit.is_for_health).count();
        let mut is_for_health = false;
        if taken.len() - for_health >= self.most {
            if let Some(index) = who_leaves(&taken, now_ns) {
                let leaver = taken.swap_remove(index);
                leaver.leave.notify_one();
                is_for_health = leaver.is_for_health;
            } else if taken.iter().any(|visit| visit.asked_ns() == 0) {
                return Found::Soon;
            } else if for_health < self.most_for_health {
                is_for_health = true;
            } else {
                return Found::Nothing;
            }
        }
        let visit = Arc::new(Visit {
            came_ns: now_ns,
            is_for_health,
            asked_ns: AtomicI64::new(0),
            took_ns: AtomicI64::new(0),
            bytes: AtomicU64::new(0),
            is_stream: AtomicBool::new(false),
            leave: Notify::new(),
            flood: Notify::new(),
        });
        taken.push(visit.clone());
        Found::Place(Place { places: self.clone(), visit })
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Visit>>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Who has to leave for a newcomer.
fn who_leaves(taken: &[Arc<Visit>], now_ns: i64) -> Option<usize> {
    let idle = (0..taken.len())
        .filter(|&index| taken[index].asked_ns() == 0 && now_ns - taken[index].came_ns >= TO_ASK_NS);
    let stalled = (0..taken.len()).filter(|&index| now_ns - taken[index].active_ns() >= STALLED_NS);
    let oldest_idle = idle.min_by_key(|&index| taken[index].came_ns);
    oldest_idle.or_else(|| stalled.min_by_key(|&index| taken[index].active_ns()))
}

impl Visit {
    /// Notes that its request is complete.
    pub fn asks(&self, now_ns: i64) {
        self.asked_ns.store(now_ns, Ordering::Relaxed);
    }

    /// Notes that it has taken bytes of its answer.
    pub fn takes(&self, bytes: usize, now_ns: i64) {
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
        self.took_ns.store(now_ns, Ordering::Relaxed);
    }

    /// Whether it takes its answer too slowly.
    pub fn is_too_slow(&self, now_ns: i64) -> bool {
        let bytes = self.bytes.load(Ordering::Relaxed);
        let more_ns =
            i64::try_from(bytes.saturating_mul(1_000_000_000) / BYTES_PER_SECOND).unwrap_or(i64::MAX);
        self.asked_ns() != 0 && now_ns - self.asked_ns() > ANSWER_WITHIN_NS.saturating_add(more_ns)
    }

    /// Notes that what follows is a stream of lists.
    pub fn becomes_stream(&self) {
        self.is_stream.store(true, Ordering::Relaxed);
    }

    pub fn is_stream(&self) -> bool {
        self.is_stream.load(Ordering::Relaxed)
    }

    fn asked_ns(&self) -> i64 {
        self.asked_ns.load(Ordering::Relaxed)
    }

    /// When it last asked or took something.
    fn active_ns(&self) -> i64 {
        self.asked_ns().max(self.took_ns.load(Ordering::Relaxed))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.lock().retain(|visit| !Arc::ptr_eq(visit, &self.visit));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: i64 = 1_000_000_000;

    fn take(places: &Arc<Places>, now_ns: i64) -> Option<Place> {
        match places.take(now_ns) {
            Found::Place(place) => Some(place),
            Found::Soon | Found::Nothing => None,
        }
    }

    fn is_in(places: &Places, place: &Place) -> bool {
        places.lock().iter().any(|visit| Arc::ptr_eq(visit, &place.visit))
    }

    #[test]
    fn the_oldest_that_has_asked_for_nothing_leaves_first_then_the_one_that_takes_nothing() {
        let places = Places::new(4);
        let [first, second, third] = [1, 2, 3].map(|second| take(&places, second * SECOND_NS).unwrap());
        first.visit.asks(3 * SECOND_NS);
        let fourth = take(&places, 4 * SECOND_NS).unwrap();
        assert_eq!([&first, &second, &third].map(|place| is_in(&places, place)), [true, false, true]);
        for place in [&third, &fourth] {
            place.visit.asks(4 * SECOND_NS);
        }
        third.visit.takes(100, 5 * SECOND_NS);
        let fifth = take(&places, 6 * SECOND_NS).unwrap();
        assert_eq!([&first, &third, &fourth].map(|place| is_in(&places, place)), [false, true, true]);
        assert!(!fifth.visit.is_for_health && !is_in(&places, &first));
    }

    #[test]
    fn places_for_health_are_free_while_all_others_are_busy() {
        let places = Places::new(4);
        let busy: Vec<_> = (0..3).map(|_| take(&places, SECOND_NS).unwrap()).collect();
        busy.iter().for_each(|place| place.visit.asks(SECOND_NS));
        let health = take(&places, SECOND_NS).unwrap();
        assert!(health.visit.is_for_health && busy.iter().all(|place| !place.visit.is_for_health));
        health.visit.asks(SECOND_NS);
        assert!(take(&places, SECOND_NS).is_none());
        drop(health);
        let health = take(&places, SECOND_NS).unwrap();
        // One that holds it without a word leaves to the next, when it had time for one.
        assert!(matches!(places.take(SECOND_NS), Found::Soon) && is_in(&places, &health));
        let next = take(&places, SECOND_NS + TO_ASK_NS).unwrap();
        assert!(next.visit.is_for_health && !is_in(&places, &health));
        drop(busy);
        assert!(!take(&places, SECOND_NS).unwrap().visit.is_for_health);
    }

    #[test]
    fn an_answer_has_to_be_taken_at_some_rate() {
        let places = Places::new(4);
        let place = take(&places, SECOND_NS).unwrap();
        assert!(!place.visit.is_too_slow(100 * SECOND_NS), "another limit is for those that ask nothing");
        place.visit.asks(100 * SECOND_NS);
        assert!(!place.visit.is_too_slow(110 * SECOND_NS) && place.visit.is_too_slow(111 * SECOND_NS));
        place.visit.takes(20 * 32_768, 111 * SECOND_NS);
        assert!(!place.visit.is_too_slow(130 * SECOND_NS) && place.visit.is_too_slow(131 * SECOND_NS));
    }
}
