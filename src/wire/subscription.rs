use crate::error::{Error, Result};
use crate::light::{LightList, MAX_LIGHTS};
use serde::{Deserialize, Serialize};

/// Most lists that wait for a client.
pub const QUEUE_MAX: u32 = 64;
/// Lowest rate that can be asked for: a list in a quarter of an hour.
const LEAST_RATE_HZ: f64 = 1e-3;

/// What a client wants of the lists.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Subscription {
    /// So many lights at most, which the later ones have joined; `None`: all.
    pub lights: Option<u32>,
    /// So many lists a second at most; `None`: all.
    pub rate_hz: Option<f64>,
    /// The shortest prefix whose published error is under this; the longest that `lights` allows where none is.
    pub error: Option<f32>,
    /// So many lists wait for a slow client, 1 to [`QUEUE_MAX`]; one that is further behind gets the newest next. 1, the
    /// default, is for those who show light, more for those who record it.
    pub queue: u32,
}

impl Default for Subscription {
    fn default() -> Self {
        Self { lights: None, rate_hz: None, error: None, queue: 1 }
    }
}

/// What a client may say: `{"subscribe":{"lights":64}}`. Keys that are missing have their defaults.
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
    /// Names the key that is unknown or wrong.
    pub fn from_query(query: &str) -> Result<Self> {
        serde_urlencoded::from_str::<Self>(query)
            .map_err(|error| Error::failed("the query is no subscription").because(error))?
            .checked()
    }

    /// Reads a [`Demand`].
    ///
    /// # Errors
    /// As [`Self::from_query`]; when it is no JSON object.
    pub fn from_message(text: &[u8]) -> Result<Self> {
        let Demand::Subscribe(subscription) = serde_json::from_slice(text)
            .map_err(|error| Error::failed("the message is no subscription").because(error))?;
        subscription.checked()
    }

    fn checked(self) -> Result<Self> {
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

    /// Number of lights of `list` that this asks for.
    pub fn light_count(&self, list: &LightList) -> usize {
        let all = list.lights.len();
        let most = self.lights.map_or(all, |lights| all.min(lights as usize));
        let Some(wanted) = self.error else { return most };
        list.prefix_errors
            .iter()
            .find(|&&(_, error)| error < wanted)
            .map_or(most, |&(count, _)| most.min(count as usize))
    }
}
