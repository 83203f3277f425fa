use crate::rt::Metrics;
use crate::rt::link::Receiver;
use lightcast_core::image::PolarMap;
use lightcast_core::light::{Light, LightList};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The source of the lights.
pub enum LightSource {
    /// Static lights.
    Still(Vec<Light>),
    /// Lists that arrive through a `latest` link.
    Live {
        /// The lists.
        lists: Receiver<LightList>,
        /// The maps from which the lights are made, where they are known, also through a `latest` link. The
        /// filter delays lights, so the newest map is a few frames ahead of the newest list.
        maps: Option<Receiver<PolarMap>>,
        /// Counts the lists that are shown and those that are skipped.
        metrics: Arc<Metrics>,
    },
}

/// The list that is shown.
pub(super) struct Feed {
    lists: Option<Receiver<LightList>>,
    maps: Option<Receiver<PolarMap>>,
    metrics: Option<Arc<Metrics>>,
    list: LightList,
    arrived: Option<Instant>,
}

impl Feed {
    pub fn new(source: LightSource) -> Self {
        let mut list = LightList::default();
        let (lists, maps, metrics) = match source {
            LightSource::Still(lights) => {
                list.lights = lights;
                (None, None, None)
            }
            LightSource::Live { lists, maps, metrics } => (Some(lists), maps, Some(metrics)),
        };
        Self { lists, maps, metrics, list, arrived: None }
    }

    /// Takes the waiting list, if there is one; returns whether there was.
    pub fn poll(&mut self, now: Instant) -> bool {
        let (Some(lists), Some(metrics)) = (&mut self.lists, &self.metrics) else { return false };
        let has_ended = match lists.try_receive() {
            Ok(Some(received)) => {
                metrics.frames.add(1);
                metrics.drops.add(received.overwritten());
                self.list.copy_from(&received);
                self.arrived = Some(now);
                return true;
            }
            Ok(None) => false,
            Err(_) => true,
        };
        if has_ended {
            // The list taken last is kept.
            self.lists = None;
        }
        false
    }

    /// Passes the waiting map, if there is one, to `show`.
    pub fn poll_map(&mut self, show: impl FnOnce(&PolarMap)) {
        if let Some(maps) = &mut self.maps
            && let Ok(Some(map)) = maps.try_receive()
        {
            show(&map);
        }
    }

    /// The list that is shown.
    pub fn list(&self) -> &LightList {
        &self.list
    }

    /// Whether lists arrive, or arrived, over a link.
    pub fn is_live(&self) -> bool {
        self.metrics.is_some()
    }

    /// Whether there are lights to show: always for static lights, otherwise from the first list on.
    pub fn is_ready(&self) -> bool {
        !self.is_live() || self.arrived.is_some()
    }

    /// Whether all lists have been taken and no more will arrive.
    pub fn has_ended(&self) -> bool {
        self.is_live() && self.lists.is_none()
    }

    /// Records the time that the frame of a new list took.
    pub fn record(&self, time: Duration) {
        if let Some(metrics) = &self.metrics {
            metrics.time_ns.record(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        }
    }

    /// Sequence number of the list that is shown, time since it arrived, lists that were skipped so far.
    pub fn state(&self, now: Instant) -> Option<(u64, Duration, u64)> {
        let (arrived, metrics) = (self.arrived?, self.metrics.as_ref()?);
        Some((self.list.stamp.sequence, now.duration_since(arrived), metrics.drops.get()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rt::{Shutdown, link};
    use lightcast_core::image::PolarShape;

    #[test]
    fn the_newest_list_is_shown_and_the_skipped_are_counted() {
        let shutdown = Shutdown::new();
        let (mut sender, receiver) = link::latest(&shutdown, LightList::default);
        let metrics = Metrics::new("window");
        let mut feed = Feed::new(LightSource::Live { lists: receiver, maps: None, metrics: metrics.clone() });
        let now = Instant::now();
        assert!(!feed.poll(now) && !feed.is_ready() && feed.state(now).is_none());
        for sequence in 0..5 {
            let mut list = sender.take().unwrap();
            list.stamp.sequence = sequence;
            sender.send(list).unwrap();
        }
        drop(sender);
        assert!(feed.poll(now) && feed.is_ready() && !feed.has_ended());
        assert_eq!(feed.state(now), Some((4, Duration::ZERO, 4)));
        assert!(!feed.poll(now) && feed.has_ended() && feed.is_ready());
        assert_eq!((feed.list().stamp.sequence, metrics.frames.get()), (4, 1));
    }

    #[test]
    fn the_newest_map_is_shown_once() {
        let shutdown = Shutdown::new();
        let (_lists, lists) = link::latest(&shutdown, LightList::default);
        let (mut sender, maps) = link::latest(&shutdown, || PolarMap::black(PolarShape::hemisphere(4, 1)));
        let mut feed =
            Feed::new(LightSource::Live { lists, maps: Some(maps), metrics: Metrics::new("window") });
        let mut seen = Vec::new();
        feed.poll_map(|map| seen.push(map.stamp.sequence));
        for sequence in 1..4 {
            let mut map = sender.take().unwrap();
            map.stamp.sequence = sequence;
            sender.send(map).unwrap();
        }
        drop(sender);
        for _ in 0..3 {
            feed.poll_map(|map| seen.push(map.stamp.sequence));
        }
        assert_eq!(seen, [3]);
    }

    #[test]
    fn lights_that_stand_still_are_there_at_once_and_never_end() {
        let mut feed = Feed::new(LightSource::Still(Vec::new()));
        assert!(!feed.poll(Instant::now()) && feed.is_ready() && !feed.has_ended() && !feed.is_live());
    }
}
