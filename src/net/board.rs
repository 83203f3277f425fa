use super::metrics::Stages;
use crate::error::Result;
use crate::image::{PolarMap, Stamp};
use crate::light::error::ListError;
use crate::light::{Light, LightList, prefix};
use crate::rt::{CaptureEpoch, Metrics};
use crate::wire::{QUEUE_MAX, Subscription, binary};
use axum::body::Bytes;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::watch;

/// Shortened forms of one list that are kept: clients mostly ask for a few round numbers.
const FORMS_MAX: usize = 16;

/// Where the service puts what clients may want: the newest lists, the newest map, what its stages have done. Posting
/// waits for nobody; a service that is started anew goes on posting on the same board.
pub struct Board {
    lists: Mutex<Lists>,
    /// Number of the next post, for those who wait for it.
    next_number: watch::Sender<u64>,
    map: Mutex<Option<PolarMap>>,
    shortener: Mutex<Shortener>,
    pub(super) stages: Arc<Stages>,
}

struct Lists {
    /// The newest [`QUEUE_MAX`] posts, oldest first, with consecutive numbers.
    posts: VecDeque<Arc<Post>>,
    posted_at: Option<Instant>,
}

/// A list on the board.
pub(super) struct Post {
    /// How many were posted before it.
    pub number: u64,
    pub list: LightList,
    pub capture_monotonic_ns: Option<i64>,
    forms: Mutex<Vec<Form>>,
}

/// A list as clients get it, without what is each client's own.
struct Form {
    is_binary: bool,
    light_count: usize,
    bytes: Bytes,
}

/// Scratch memory for prefixes.
struct Shortener {
    error: ListError,
    joined: Vec<Light>,
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
                joined: Vec::new(),
                list: LightList::default(),
            }),
            stages: Arc::default(),
        }
    }
}

impl Board {
    /// Puts a copy of `list` up; its capture time is as `epoch` says.
    pub fn post(&self, list: &LightList, epoch: &CaptureEpoch) {
        let capture_monotonic_ns = epoch.monotonic_ns(list.stamp.capture_time_ns);
        {
            let mut lists = lock(&self.lists);
            let number = lists.posts.back().map_or(0, |newest| newest.number + 1);
            let oldest = if lists.posts.len() < QUEUE_MAX as usize { None } else { lists.posts.pop_front() };
            // Nobody is sending it any more, as a rule, and its memory serves again.
            let mut post = oldest.and_then(Arc::into_inner).unwrap_or_else(Post::empty);
            post.number = number;
            post.list.copy_from(list);
            post.capture_monotonic_ns = capture_monotonic_ns;
            post.forms.get_mut().unwrap_or_else(PoisonError::into_inner).clear();
            lists.posts.push_back(Arc::new(post));
            lists.posted_at = Some(Instant::now());
        }
        self.next_number.send_modify(|number| *number += 1);
    }

    /// Puts a copy of `map` up in place of the last one.
    pub fn post_map(&self, map: &PolarMap) {
        let mut kept = lock(&self.map);
        match &mut *kept {
            Some(kept) => {
                (kept.stamp, kept.shape) = (map.stamp, map.shape);
                kept.pixels.clone_from(&map.pixels);
            }
            None => *kept = Some(map.clone()),
        }
    }

    /// Shows what these stages do, in place of those before.
    pub fn show_stages(&self, stages: Vec<Arc<Metrics>>) {
        self.stages.replace(stages);
    }

    /// Lets a caller know of every post from now on, and the number of the next.
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

    /// When and where in its sequence the newest map was captured.
    pub(super) fn map_stamp(&self) -> Option<Stamp> {
        lock(&self.map).as_ref().map(|map| map.stamp)
    }

    /// A copy of the newest map.
    pub(super) fn map(&self) -> Option<PolarMap> {
        lock(&self.map).clone()
    }

    /// The list of `post` as `subscription` wants it: what `wire` calls its body. It is worked out once for all clients
    /// that want the same.
    ///
    /// # Errors
    /// Those of the encoders.
    pub(super) fn body(&self, post: &Post, subscription: &Subscription, is_binary: bool) -> Result<Bytes> {
        let light_count = subscription.light_count(&post.list);
        let mut forms = lock(&post.forms);
        let is_same = |form: &&Form| form.is_binary == is_binary && form.light_count == light_count;
        if let Some(form) = forms.iter().find(is_same) {
            return Ok(form.bytes.clone());
        }
        let mut body = Vec::new();
        if light_count < post.list.lights.len() {
            let mut shortener = lock(&self.shortener);
            encode(shortener.shorten(&post.list, light_count), is_binary, &mut body)?;
        } else {
            encode(&post.list, is_binary, &mut body)?;
        }
        let bytes = Bytes::from(body);
        if forms.len() < FORMS_MAX {
            forms.push(Form { is_binary, light_count, bytes: bytes.clone() });
        }
        Ok(bytes)
    }
}

impl Post {
    fn empty() -> Self {
        Self { number: 0, list: LightList::default(), capture_monotonic_ns: None, forms: Mutex::default() }
    }
}

impl Shortener {
    /// The prefix of `count` lights, with its own error and the same power.
    fn shorten(&mut self, list: &LightList, count: usize) -> &LightList {
        prefix(&list.lights, count, &mut self.joined);
        let short = &mut self.list;
        (short.stamp, short.filter_delay_frames, short.power) =
            (list.stamp, list.filter_delay_frames, list.power);
        short.lights.clone_from(&self.joined);
        short.prefix_errors.clear();
        short.prefix_errors.extend(list.prefix_errors.iter().filter(|(length, _)| *length as usize <= count));
        short.error = match short.prefix_errors.last() {
            Some(&(length, error)) if length as usize == count => error,
            _ => {
                let error = self.error.relative_error(&short.lights, &list.reference_irradiance);
                short.prefix_errors.push((count as u32, error));
                error
            }
        };
        short
    }
}

fn encode(list: &LightList, is_binary: bool, body: &mut Vec<u8>) -> Result<()> {
    if is_binary {
        return binary::encode_list(list, body);
    }
    list.write_json(body)
        .map_err(|error| crate::error::Error::failed("cannot be put into JSON").because(error))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Whoever panicked here has left sound values: every change is a few assignments, and the panic ends the service.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
