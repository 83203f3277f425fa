use super::stages::Stages;
use crate::error::Result;
use crate::rt::{CaptureEpoch, Metrics};
use crate::wire::{QUEUE_MAX, Subscription, binary, write_list};
use axum::body::Bytes;
use lightcast_core::image::PolarMap;
use lightcast_core::light::ReferencedList;
use lightcast_core::light::error::ListError;
use lightcast_core::light::{LightList, Prefixes};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::watch;

/// Forms of one list that clients can choose freely: they mostly ask for a few round numbers. Once there are
/// this many, others get a power of two.
const FORMS_MAX: usize = 16;
/// Most bytes of encoded lists that are kept. Those that take more are of the oldest lists, for which hardly
/// a client asks any more, and are made again for one that does; those of the newest list are kept whatever
/// they take.
const FORMS_MAX_BYTES: usize = 1 << 25;

/// Where the service puts data for clients: the newest lists, the newest map, the metrics of its stages.
/// Posting never blocks; a restarted service continues to post on the same board.
pub struct Board {
    lists: Mutex<Lists>,
    /// Number of the next post, for tasks that wait for it.
    next_number: watch::Sender<u64>,
    /// The newest map, and the number of maps before it.
    map: Mutex<Option<(u64, PolarMap)>>,
    shortener: Mutex<Shortener>,
    pub(super) stages: Arc<Stages>,
}

struct Lists {
    /// The newest [`QUEUE_MAX`] posts, oldest first, with consecutive numbers.
    posts: VecDeque<Arc<Post>>,
    posted_at: Option<Instant>,
}

/// A list on the board.
#[derive(Default)]
pub(super) struct Post {
    /// Number of lists posted before it.
    pub number: u64,
    pub list: LightList,
    /// The reference for the errors of its prefixes.
    reference_irradiance: Vec<f32>,
    pub capture_monotonic_ns: Option<i64>,
    forms: Mutex<Vec<Form>>,
}

/// A list as clients get it, without the part that differs between clients.
struct Form {
    is_binary: bool,
    light_count: usize,
    /// `None` if it cannot be encoded.
    bytes: Option<Bytes>,
}

/// Scratch memory for prefixes.
struct Shortener {
    error: ListError,
    prefixes: Prefixes,
    list: LightList,
}

impl Default for Board {
    fn default() -> Self {
        Self {
            lists: Mutex::new(Lists { posts: VecDeque::new(), posted_at: None }),
            next_number: watch::Sender::new(0),
            map: Mutex::default(),
            shortener: Mutex::new(Shortener {
                error: ListError::new(),
                prefixes: Prefixes::default(),
                list: LightList::default(),
            }),
            stages: Arc::default(),
        }
    }
}

impl Board {
    /// Posts a copy of a list; `epoch` relates its capture time to the clock.
    pub fn post(&self, referenced: &ReferencedList, epoch: &CaptureEpoch) {
        let ReferencedList { list, reference_irradiance } = referenced;
        let capture_monotonic_ns = epoch.monotonic_ns(list.stamp.capture_time_ns);
        {
            let mut lists = lock(&self.lists);
            let number = lists.posts.back().map_or(0, |newest| newest.number + 1);
            let oldest = if lists.posts.len() < QUEUE_MAX as usize { None } else { lists.posts.pop_front() };
            // As a rule it is no longer being sent, and its memory is reused.
            let mut slot = oldest.filter(|post| Arc::strong_count(post) == 1).unwrap_or_default();
            let post = Arc::get_mut(&mut slot).expect("the board alone has it");
            post.number = number;
            post.list.copy_from(list);
            post.reference_irradiance.clone_from(reference_irradiance);
            post.capture_monotonic_ns = capture_monotonic_ns;
            post.forms.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
            lists.posts.push_back(slot);
            lists.posted_at = Some(Instant::now());
        }
        self.next_number.send_modify(|number| *number += 1);
    }

    /// Posts a copy of `map` in place of the last one.
    pub fn post_map(&self, map: &PolarMap) {
        let mut kept = lock(&self.map);
        match &mut *kept {
            Some((number, kept)) => {
                *number += 1;
                (kept.stamp, kept.shape) = (map.stamp, map.shape);
                kept.pixels.clone_from(&map.pixels);
            }
            None => *kept = Some((0, map.clone())),
        }
    }

    /// Shows the metrics of these stages, in place of the earlier ones.
    pub fn show_stages(&self, stages: Vec<Arc<Metrics>>) {
        self.stages.replace(stages);
    }

    /// Shows these metrics whichever service posts.
    pub fn show_always(&self, metrics: Arc<Metrics>) {
        self.stages.add_for_good(metrics);
    }

    /// Notifies the caller of every post from now on, with the number of the next.
    pub(super) fn posts(&self) -> watch::Receiver<u64> {
        self.next_number.subscribe()
    }

    /// Calls `look` with the newest posts, oldest first.
    pub(super) fn look<T>(&self, look: impl FnOnce(&VecDeque<Arc<Post>>) -> T) -> T {
        look(&lock(&self.lists).posts)
    }

    /// The newest post, and when it was made.
    pub(super) fn newest(&self) -> Option<(Arc<Post>, Instant)> {
        let lists = lock(&self.lists);
        lists.posts.back().cloned().zip(lists.posted_at)
    }

    /// Number of maps before the newest.
    pub(super) fn map_number(&self) -> Option<u64> {
        lock(&self.map).as_ref().map(|(number, _)| *number)
    }

    /// A copy of the newest map, and the number of maps before it.
    pub(super) fn map(&self) -> Option<(u64, PolarMap)> {
        lock(&self.map).clone()
    }

    /// The list of `post` as `subscription` wants it, encoded as what `wire` calls its body. It is computed
    /// once for all clients that want the same; where they want too many different ones, some get fewer
    /// lights. `None` where it cannot be encoded, which is logged once.
    pub(super) fn body(&self, post: &Post, subscription: &Subscription, is_binary: bool) -> Option<Bytes> {
        let mut light_count = subscription.light_count(&post.list);
        let mut forms = lock(&post.forms);
        let find = |forms: &[Form], count: usize| {
            let form = forms.iter().find(|form| form.is_binary == is_binary && form.light_count == count);
            form.map(|form| form.bytes.clone())
        };
        if let Some(bytes) = find(&forms, light_count) {
            return bytes;
        }
        if forms.len() >= FORMS_MAX && light_count < post.list.lights.len() {
            light_count = 1 << light_count.max(1).ilog2();
            if let Some(bytes) = find(&forms, light_count) {
                return bytes;
            }
        }
        let mut body = Vec::new();
        let encoded = if light_count < post.list.lights.len() {
            encode(lock(&self.shortener).shorten(post, light_count), is_binary, &mut body)
        } else {
            encode(&post.list, is_binary, &mut body)
        };
        if let Err(error) = &encoded {
            tracing::error!("list {}: {error}", post.list.stamp.sequence);
        }
        body.shrink_to_fit();
        let bytes = encoded.is_ok().then(|| Bytes::from(body));
        forms.push(Form { is_binary, light_count, bytes: bytes.clone() });
        drop(forms);
        self.drop_old_forms();
        bytes
    }

    /// Drops the forms of the oldest lists that are more than is kept.
    fn drop_old_forms(&self) {
        let mut kept_bytes = 0;
        for (age, post) in lock(&self.lists).posts.iter().rev().enumerate() {
            let mut forms = lock(&post.forms);
            kept_bytes += bytes_of(&forms);
            if kept_bytes > FORMS_MAX_BYTES && age > 0 {
                forms.clear();
            }
        }
    }
}

impl Shortener {
    /// The prefix of `count` lights, with its own error and the same power.
    fn shorten(&mut self, post: &Post, count: usize) -> &LightList {
        let (short, list) = (&mut self.list, &post.list);
        self.prefixes.prefix(&list.lights, count, &mut short.lights);
        (short.stamp, short.filter_delay_frames, short.chosen_lights, short.power) =
            (list.stamp, list.filter_delay_frames, list.chosen_lights, list.power);
        short.chosen_lights = short.chosen_lights.map(|chosen| chosen.min(count as u32));
        short.prefix_errors.clear();
        short.prefix_errors.extend(list.prefix_errors.iter().filter(|(length, _)| *length as usize <= count));
        let known = short.prefix_errors.last().filter(|(length, _)| *length as usize == count);
        let error = match known {
            Some(&(_, error)) => error,
            None => {
                let error = self.error.relative_error(&short.lights, &post.reference_irradiance);
                short.prefix_errors.push((count as u32, error));
                error
            }
        };
        short.error = Some(error);
        short
    }
}

fn bytes_of(forms: &[Form]) -> usize {
    forms.iter().filter_map(|form| form.bytes.as_ref()).map(Bytes::len).sum()
}

fn encode(list: &LightList, is_binary: bool, body: &mut Vec<u8>) -> Result<()> {
    if is_binary {
        return binary::encode_list(list, body);
    }
    write_list(list, body)
        .map_err(|error| crate::error::Error::failed("cannot be put into JSON").because(error))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked here has left valid values: every change is a few assignments, and the panic
    // ends the service.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Delivery, Message, json};
    use lightcast_core::image::Stamp;
    use lightcast_core::light::Light;

    fn list(sequence: u64, count: u32) -> ReferencedList {
        let lights: Vec<Light> = lightcast_core::math::fibonacci_sphere(count as usize)
            .zip(0..)
            .map(|(direction, id)| Light {
                id,
                direction: direction.as_vec3().to_array(),
                irradiance: [(id % 7) as f32, 0.3, (id % 5) as f32],
                spread_rad: 0.1,
            })
            .collect();
        let mut list = LightList::default();
        list.stamp = Stamp { sequence, frame_rate_hz: 25.0, ..Stamp::default() };
        list.lights = lights;
        list.power = list.sum_of_lights();
        let reference_irradiance = vec![100.0; lightcast_core::light::error::NORMAL_COUNT];
        let mut referenced = ReferencedList { list, reference_irradiance };
        ListError::new().measure(&mut referenced);
        referenced
    }

    fn decoded(board: &Board, subscription: &Subscription, is_binary: bool) -> LightList {
        let (post, _) = board.newest().unwrap();
        let body = board.body(&post, subscription, is_binary).unwrap();
        let (mut bytes, mut message) = (Vec::new(), Message::default());
        if is_binary {
            binary::encode(&body, &Delivery::default(), &mut bytes);
            binary::decode(&bytes, &mut message).unwrap();
        } else {
            json::encode(&body, &Delivery::default(), &mut bytes);
            json::decode(&bytes, &mut message).unwrap();
        }
        message.list
    }

    #[test]
    fn clients_that_want_the_same_share_one_copy_and_the_whole_list_is_the_list() {
        let board = Board::default();
        let whole = list(3, 100);
        board.post(&whole, &CaptureEpoch::default());
        let (post, _) = board.newest().unwrap();
        let all = Subscription::default();
        let body = board.body(&post, &all, false).unwrap();
        assert_eq!(body.as_ptr(), board.body(&post, &all, false).unwrap().as_ptr());
        let more = Subscription { lights: Some(5000), ..all };
        assert_eq!(body.as_ptr(), board.body(&post, &more, false).unwrap().as_ptr());
        let mut line = Vec::new();
        write_list(&whole.list, &mut line).unwrap();
        assert_eq!(body, line);
    }

    #[test]
    fn prefixes_keep_power_and_tell_their_own_error() {
        let board = Board::default();
        let whole = list(0, 100);
        board.post(&whole, &CaptureEpoch::default());
        for is_binary in [false, true] {
            for count in [1, 8, 50, 64, 99] {
                let short =
                    decoded(&board, &Subscription { lights: Some(count), ..Default::default() }, is_binary);
                assert_eq!(short.lights.len(), count as usize);
                assert_eq!(short.power, whole.list.power, "to the last bit");
                assert!(short.prefix_errors.iter().all(|&(length, _)| length <= count));
                assert_eq!(short.prefix_errors.last(), Some(&(count, short.error.unwrap())));
                let published = whole.list.prefix_errors.iter().find(|&&(length, _)| length == count);
                assert!(published.is_none_or(|&(_, error)| Some(error) == short.error), "{count}");
                // Every light is rounded once, to f32 or to 1/1024 of an octave.
                let tolerance = if is_binary { 4e-4 } else { 1e-6 };
                for (sum, power) in short.sum_of_lights().into_iter().zip(whole.list.power) {
                    assert!((sum / power - 1.0).abs() < tolerance, "{count}: {sum} {power}");
                }
            }
        }
    }

    #[test]
    fn an_error_asks_for_the_shortest_prefix_that_is_better() {
        let board = Board::default();
        let whole = list(0, 100);
        board.post(&whole, &CaptureEpoch::default());
        let (_, at_16) = whole.list.prefix_errors[1];
        let wanted = |error| Subscription { error: Some(error), ..Subscription::default() };
        let expected = whole.list.prefix_errors.iter().find(|(_, error)| *error < at_16 * 1.01).unwrap().0;
        assert_eq!(decoded(&board, &wanted(at_16 * 1.01), true).lights.len(), expected as usize);
        assert_eq!(decoded(&board, &wanted(1e-30), true).lights.len(), 100);
    }

    #[test]
    fn clients_that_all_want_something_else_share_powers_of_two() {
        let board = Board::default();
        board.post(&list(0, 100), &CaptureEpoch::default());
        let (post, _) = board.newest().unwrap();
        for lights in (1..=100).chain(1..=100) {
            let wanted = Subscription { lights: Some(lights), ..Subscription::default() };
            for is_binary in [false, true] {
                board.body(&post, &wanted, is_binary).unwrap();
            }
        }
        let kept = lock(&post.forms).len();
        assert!(kept <= FORMS_MAX + 2 * 8, "{kept} forms: two whole lists and the powers up to 64 at most");
        let wanted = Subscription { lights: Some(77), ..Subscription::default() };
        assert_eq!(decoded(&board, &wanted, true).lights.len(), 64);
    }

    #[test]
    fn encoded_lists_take_bounded_memory() {
        let board = Board::default();
        let all = Subscription::default();
        let bytes_kept = |board: &Board| {
            board.look(|posts| posts.iter().map(|post| bytes_of(&lock(&post.forms))).collect::<Vec<usize>>())
        };
        let whole = list(0, 16_000);
        for _ in 0..QUEUE_MAX {
            board.post(&whole, &CaptureEpoch::default());
            let (post, _) = board.newest().unwrap();
            board.body(&post, &all, false).unwrap();
        }
        let kept = bytes_kept(&board);
        assert!(kept.iter().sum::<usize>() <= FORMS_MAX_BYTES, "{kept:?}");
        assert!(kept[0] == 0 && kept[63] > 0 && 64 * kept[63] > FORMS_MAX_BYTES, "{kept:?}");
        // An old list is encoded again.
        let oldest = board.look(|posts| posts[0].clone());
        assert_eq!(board.body(&oldest, &all, false).unwrap().len(), kept[63]);
    }

    #[test]
    fn the_board_keeps_as_many_lists_as_a_client_may_be_behind_and_uses_their_memory_again() {
        let board = Board::default();
        for sequence in 0..200 {
            board.post(&list(sequence, 4), &CaptureEpoch::default());
        }
        let numbers: Vec<u64> = board.look(|posts| posts.iter().map(|post| post.number).collect());
        assert_eq!(numbers, (136..200).collect::<Vec<u64>>());
        let oldest = board.look(|posts| Arc::as_ptr(&posts[0]));
        board.post(&list(200, 4), &CaptureEpoch::default());
        assert_eq!(board.look(|posts| Arc::as_ptr(&posts[63])), oldest);
        let sending = board.look(|posts| posts[0].clone());
        board.post(&list(201, 4), &CaptureEpoch::default());
        assert_ne!(board.look(|posts| Arc::as_ptr(&posts[63])), Arc::as_ptr(&sending));
        assert_eq!(sending.list.stamp.sequence, 137, "it stays what it was for who sends it");
    }
}
