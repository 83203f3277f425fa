//! The methods that are compared on sequences, with the published figures: the table of METHODS section 7.

use super::{AnyExtractor, Inversion, Options};
use crate::design::FilterOptions;
use crate::error::Result;
use lightcast_core::image::PolarShape;
use lightcast_core::light::Sampler;
use lightcast_core::temporal::Directions;

/// Number of lights for which the published figures are given.
pub const LIGHTS: usize = 128;

/// How the lights of a sequence are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SequenceMethod {
    /// Equal-power lights by the bicontinuous inversion with normalised rows, each frame independently: the
    /// paper's method.
    Paper,
    /// Refined lights, each frame independently.
    Refined,
    /// Persistent lights.
    Persistent,
    /// Adaptive lights, and directions filtered by power: the default of `lightcast run`.
    Adaptive,
}

impl SequenceMethod {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Paper, Self::Refined, Self::Persistent, Self::Adaptive];
    /// The default of `run`.
    pub const OURS: Self = Self::Adaptive;

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "the paper",
            Self::Refined => "refined",
            Self::Persistent => "persistent",
            Self::Adaptive => "adaptive",
        }
    }

    /// The extractor of its lights.
    ///
    /// # Errors
    /// Those of [`AnyExtractor::new`].
    pub fn extractor(self, shape: PolarShape, count: usize) -> Result<AnyExtractor> {
        let (sampler, inversion) = match self {
            Self::Paper => (Sampler::EqualPower, Inversion::NormalisedRows),
            Self::Refined => (Sampler::Refined, Inversion::Bicontinuous),
            Self::Persistent => (Sampler::Persistent, Inversion::Bicontinuous),
            Self::Adaptive => (Sampler::Adaptive, Inversion::Bicontinuous),
        };
        AnyExtractor::new(shape, &Options { count, sampler: super::Sampler::Live(sampler), inversion })
    }

    /// The paper's filter for the methods of METHODS' table, which were measured with it.
    pub fn filter(self) -> FilterOptions {
        let directions = if self == Self::Adaptive { Directions::ByPower } else { Directions::Alike };
        FilterOptions { directions, ..FilterOptions::default() }
    }
}

/// Figures of METHODS section 7, computed with a float64 reference model in which every light is a direction.
/// For adaptive lights they are those of "persistent, dominant peaks apart".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Error and flicker before the filter.
    pub before: [f64; 2],
    /// 99th percentile of light motion before the filter, in degrees per frame.
    pub motion_p99_deg: f64,
    /// Error and flicker after the filter.
    pub after: [f64; 2],
}

/// Targets for adaptive lights after the filter, with shadows softened by their spread: error and flicker ...
pub const GOALS: [(&str, [f64; 2]); 2] = [("garden", [0.003, 0.006]), ("hall", [0.0012, 0.0003])];
/// ... and 99th percentile of light motion before and after it, in degrees per frame.
pub const MOTION_GOAL_DEG: f64 = 2.0;

/// One of METHODS' own sequences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedSequence {
    /// `garden` or `hall`.
    pub name: &'static str,
    /// The panorama from which it is made, without its extension.
    pub panorama: &'static str,
    /// The figures of every method.
    pub published: [(SequenceMethod, Published); 4],
}

/// METHODS' sequences.
pub const PUBLISHED_SEQUENCES: [PublishedSequence; 2] = [
    PublishedSequence {
        name: "garden",
        panorama: "chinese_garden_1k",
        published: [
            (SequenceMethod::Paper, published([0.0268, 0.0149], 18.0, [0.0298, 0.0151])),
            (SequenceMethod::Refined, published([0.0012, 0.0005], 12.0, [0.0454, 0.0896])),
            (SequenceMethod::Persistent, published([0.0030, 0.0070], 1.7, [0.0113, 0.0268])),
            (SequenceMethod::Adaptive, published([0.0035, 0.0083], 1.5, [0.0045, 0.0119])),
        ],
    },
    PublishedSequence {
        name: "hall",
        panorama: "dancing_hall_1k",
        published: [
            (SequenceMethod::Paper, published([0.0343, 0.0656], 100.0, [0.0763, 0.0563])),
            (SequenceMethod::Refined, published([0.0017, 0.0024], 82.0, [0.0450, 0.0458])),
            (SequenceMethod::Persistent, published([0.0012, 0.0008], 1.5, [0.0011, 0.0002])),
            (SequenceMethod::Adaptive, published([0.0012, 0.0009], 1.4, [0.0012, 0.0002])),
        ],
    },
];

const fn published(before: [f64; 2], motion_p99_deg: f64, after: [f64; 2]) -> Published {
    Published { before, motion_p99_deg, after }
}

/// Whether there are published figures for `sequence` made from the panorama with this name (without its
/// extension).
pub fn is_published(sequence: &str, panorama: &str) -> bool {
    PUBLISHED_SEQUENCES.iter().any(|known| (known.name, known.panorama) == (sequence, panorama))
}
