use serde::Deserialize;

/// How frames weigh in the direction of a filtered light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Directions {
    /// By the light's power: the irradiance is filtered.
    #[default]
    ByPower,
    /// All alike, whether the light shines or not: the paper's.
    Alike,
}
