use serde::Deserialize;

/// How frames are weighted in the direction of a filtered light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Directions {
    /// By the light's power: the irradiance is filtered.
    #[default]
    ByPower,
    /// All equally, whether the light shines or not, as in the paper.
    Alike,
}
