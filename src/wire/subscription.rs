use super::DEMAND_MAX_BYTES;
use crate::error::{Error, Result};
use lightcast_core::image::Stamp;
use lightcast_core::light::{LightList, MAX_LIGHTS};
use serde::{Deserialize, Serialize};

/// Most lists that wait for a client.
pub const QUEUE_MAX: u32 = 64;
/// Lowest rate that can be requested: one list in a quarter of an hour.
const LEAST_RATE_HZ: f64 = 1e-3;

/// The lists that a client wants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Subscription {
    /// At most this many lights, which the later ones have joined; `None`: all.
    pub lights: Option<u32>,
    /// At most this many lists a second; `None`: all.
    pub rate_hz: Option<f64>,
    /// The shortest prefix whose published error is under this; if there is none, the longest that `lights`
    /// allows.
    pub error: Option<f32>,
    /// Number of lists that wait for a slow client, 1 to 64; one that is further behind gets the newest next.
    /// 1, the default, is for clients that display light, more for those that record it.
    pub queue: u32,
}

impl Default for Subscription {
    fn default() -> Self {
        Self { lights: None, rate_hz: None, error: None, queue: 1 }
    }
}

/// A message from a client: `{"subscribe":{"lights":64}}`. Keys that are missing have their defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Demand {
    /// Replaces the subscription.
    Subscribe(Subscription),
}

impl Subscription {
    /// Reads the query of a URL, such as `lights=64&rate_hz=10`.
    ///
    /// # Errors
    /// Names the key that is unknown, repeated, or wrong; more than [`DEMAND_MAX_BYTES`].
    pub fn from_query(query: &str) -> Result<Self> {
        short(query.len())?;
        serde_urlencoded::from_str::<Self>(query)
            .map_err(|error| Error::failed("the query is no subscription").because(error))?
            .checked()
    }

    /// Reads a [`Demand`].
    ///
    /// # Errors
    /// As [`Self::from_query`]; when it is not a JSON object.
    pub fn from_message(text: &[u8]) -> Result<Self> {
        short(text.len())?;
        let Demand::Subscribe(subscription) = serde_json::from_slice(text)
            .map_err(|error| Error::failed("the message is no subscription").because(error))?;
        subscription.checked()
    }

    /// # Errors
    /// Names the key whose value is invalid, and the valid values.
    pub fn checked(self) -> Result<Self> {
        let fault = if self.lights.is_some_and(|lights| !(1..=MAX_LIGHTS as u32).contains(&lights)) {
            format!("lights: give 1 to {MAX_LIGHTS}")
        } else if self.rate_hz.is_some_and(|rate| !(LEAST_RATE_HZ..=1e6).contains(&rate)) {
            format!("rate_hz: give {LEAST_RATE_HZ} to 1e6")
        } else if self.error.is_some_and(|error| !(error > 0.0 && error.is_finite())) {
            "error: give a number above 0".to_owned()
        } else if !(1..=QUEUE_MAX).contains(&self.queue) {
            format!("queue: give 1 to {QUEUE_MAX}")
        } else {
            return Ok(self);
        };
        Err(Error::failed(fault))
    }

    /// Number of lights of `list` that this requests.
    pub fn light_count(&self, list: &LightList) -> usize {
        let all = list.lights.len();
        let most = self.lights.map_or(all, |lights| all.min(lights as usize));
        let Some(wanted) = self.error else { return most };
        list.prefix_errors
            .iter()
            .find(|&&(_, error)| error < wanted)
            .map_or(most, |&(count, _)| most.min(count as usize))
    }

    /// Whether a list of this `stamp` is due where the next one is at `due_ns` (`None`: the first), and then
    /// when the next one is.
    pub fn due_after(&self, due_ns: Option<i64>, stamp: &Stamp) -> Option<Option<i64>> {
        let Some(rate_hz) = self.rate_hz else { return Some(None) };
        let period_ns = (1e9 / rate_hz) as i64;
        let time_ns = stamp.capture_time_ns;
        let next_ns = match due_ns {
            Some(due_ns) => {
                // Frames come a little early or late; half a frame time decides between two.
                let rate_hz = stamp.frame_rate_hz;
                let half_frame_ns = if rate_hz > 0.0 { (5e8 / rate_hz) as i64 } else { 0 };
                let until_ns = due_ns.saturating_sub(time_ns);
                // If times ran backwards, because a clock was set or a source restarted, there is no wait.
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

fn short(length: usize) -> Result<()> {
    if length <= DEMAND_MAX_BYTES {
        return Ok(());
    }
    Err(Error::failed(format!("{length} bytes are no subscription; give {DEMAND_MAX_BYTES} at most")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::light::Light;

    fn message(keys: &str) -> Result<Subscription> {
        Subscription::from_message(format!("{{\"subscribe\":{{{keys}}}}}").as_bytes())
    }

    #[test]
    fn every_key_is_read_from_queries_and_messages_and_has_a_default() {
        let all = Subscription { lights: Some(64), rate_hz: Some(12.5), error: Some(0.02), queue: 7 };
        let default = Subscription::default();
        let (lights, rate_hz, error, queue) = (
            Subscription { lights: Some(16_384), ..default },
            Subscription { rate_hz: Some(1e-3), ..default },
            Subscription { error: Some(1e-9), ..default },
            Subscription { queue: 64, ..default },
        );
        for (query, keys, expected) in [
            ("", "", default),
            ("lights=16384", "\"lights\":16384", lights),
            ("rate_hz=1e-3", "\"rate_hz\":1e-3", rate_hz),
            ("error=1e-9", "\"error\":1e-9", error),
            ("queue=64", "\"queue\":64", queue),
            (
                "queue=7&lights=64&error=0.02&rate_hz=12.5",
                "\"queue\":7,\"lights\":64,\"error\":0.02,\"rate_hz\":12.5",
                all,
            ),
        ] {
            assert_eq!(Subscription::from_query(query).unwrap(), expected, "{query}");
            assert_eq!(message(keys).unwrap(), expected, "{keys}");
        }
        let nulls = message("\"lights\":null,\"rate_hz\":null,\"error\":null");
        assert_eq!(nulls.unwrap(), default);
    }

    #[test]
    fn what_is_answered_can_be_sent_again() {
        for query in ["", "queue=7&lights=64&error=0.02&rate_hz=12.5"] {
            let demand = Demand::Subscribe(Subscription::from_query(query).unwrap());
            let text = serde_json::to_vec(&demand).unwrap();
            assert_eq!(Demand::Subscribe(Subscription::from_message(&text).unwrap()), demand);
        }
    }

    #[test]
    fn faults_name_their_key() {
        for (query, keys, expected) in [
            ("lights=0", "\"lights\":0", "lights: give 1 to 16384"),
            ("lights=16385", "\"lights\":16385", "lights: give 1 to 16384"),
            ("rate_hz=0", "\"rate_hz\":0", "rate_hz: give 0.001 to 1e6"),
            ("rate_hz=-1", "\"rate_hz\":-1", "rate_hz: give 0.001 to 1e6"),
            ("rate_hz=1000001", "\"rate_hz\":1000001", "rate_hz: give 0.001 to 1e6"),
            ("error=0", "\"error\":0", "error: give a number above 0"),
            ("error=-1", "\"error\":-1", "error: give a number above 0"),
            ("queue=0", "\"queue\":0", "queue: give 1 to 64"),
            ("queue=65", "\"queue\":65", "queue: give 1 to 64"),
            ("light=5", "\"light\":5", "unknown field `light`, expected one of `lights`, `rate_hz`"),
            ("lights=5&lights=6", "\"lights\":5,\"lights\":6", "duplicate field `lights`"),
            ("queue=1&queue=1", "\"queue\":1,\"queue\":1", "duplicate field `queue`"),
        ] {
            for error in [Subscription::from_query(query).unwrap_err(), message(keys).unwrap_err()] {
                assert!(error.to_string().contains(expected), "{query}: {error}");
            }
        }
        for query in ["rate_hz=nan", "rate_hz=inf", "error=NaN", "error=-inf", "error=infinity"] {
            let error = Subscription::from_query(query).unwrap_err().to_string();
            assert!(error.starts_with(query.split('=').next().unwrap()), "{query}: {error}");
        }
        for query in ["lights", "lights=", "lights=x", "lights=-1", "lights=1.5", "queue=", "token=secret"] {
            let error = Subscription::from_query(query).unwrap_err().to_string();
            assert!(error.starts_with("the query is no subscription: "), "{query}: {error}");
        }
        for text in [
            "",
            "5",
            "[]",
            "{}",
            "\"subscribe\"",
            "{\"subscribe\":null}",
            "{\"subscribe\":{},\"subscribe\":{}}",
            "{\"subscribe\":{},\"other\":1}",
            "{\"unsubscribe\":{}}",
            "{\"subscribe\":{}} {}",
            "{\"subscribe\":{\"queue\":null}}",
        ] {
            let error = Subscription::from_message(text.as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with("the message is no subscription: "), "{text}: {error}");
        }
    }

    #[test]
    fn what_is_too_long_is_not_read() {
        let spaces = " ".repeat(DEMAND_MAX_BYTES - "{\"subscribe\":{}}".len());
        message(&spaces).unwrap();
        let error = message(&(spaces + " ")).unwrap_err().to_string();
        assert_eq!(error, "4097 bytes are no subscription; give 4096 at most");
        let error = Subscription::from_query(&"&".repeat(4097)).unwrap_err().to_string();
        assert_eq!(error, "4097 bytes are no subscription; give 4096 at most");
        Subscription::from_query(&"&".repeat(4096)).unwrap();
    }

    #[test]
    fn lights_are_as_few_as_the_error_allows_and_never_more_than_asked() {
        let mut list = LightList::default();
        let light = |id| Light { id, direction: [0.0, 1.0, 0.0], irradiance: [1.0; 3], spread_rad: 0.0 };
        list.lights = (0..72).map(light).collect();
        list.prefix_errors = vec![(8, 0.5), (16, 0.25), (32, 0.3), (64, 0.125), (72, 0.0625)];
        let count =
            |lights, error| Subscription { lights, error, ..Subscription::default() }.light_count(&list);
        assert_eq!([count(None, None), count(Some(10), None), count(Some(100), None)], [72, 10, 72]);
        // The first prefix below the wanted error, not at it.
        assert_eq!(
            [0.6, 0.5, 0.28, 0.25, 0.125, 0.1].map(|error| count(None, Some(error))),
            [8, 16, 16, 64, 72, 72]
        );
        // No prefix is good enough: as many as are allowed.
        assert_eq!([count(None, Some(0.01)), count(Some(20), Some(0.01))], [72, 20]);
        // Fewer are allowed than the error asks for.
        assert_eq!([count(Some(10), Some(0.28)), count(Some(40), Some(0.28))], [10, 16]);
        // A list that has no errors, or those of more lights than it has.
        list.prefix_errors.clear();
        let any = Subscription { error: Some(0.5), ..Subscription::default() };
        assert_eq!(any.light_count(&list), 72);
        list.prefix_errors = vec![(100, 0.1)];
        assert_eq!(any.light_count(&list), 72);
        assert_eq!(any.light_count(&LightList::default()), 0);
    }
}
