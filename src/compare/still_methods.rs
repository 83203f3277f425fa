//! The methods that are compared on single maps, with the published figures: the table of METHODS section 6.

use super::{AnyExtractor, Inversion, Options, Sampler};
use crate::error::Result;
use lightcast_core::image::PolarShape;
use lightcast_core::light;
use lightcast_core::light::measure::Errors;

/// Size of the maps for which the published figures are given.
pub const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);
/// Numbers of lights in the table.
pub const COUNTS: [usize; 2] = [64, 256];

/// A method that turns a single map into lights, with its row of METHODS section 6 where it has one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillMethod {
    /// Its name in the table.
    pub name: &'static str,
    sampler: Sampler,
    inversion: Inversion,
    /// Geometric means over the thirteen maps, at [`COUNTS`] lights, from a float64 reference model.
    pub published: Option<[Errors; 2]>,
}

/// Names, without extension, of the panoramas over which the published means were taken.
pub const PUBLISHED_MAPS: [&str; 13] = [
    "autoshop_01_1k",
    "brown_photostudio_02_1k",
    "chinese_garden_1k",
    "dancing_hall_1k",
    "dikhololo_night_1k",
    "forest_slope_1k",
    "noon_grass_1k",
    "potsdamer_platz_1k",
    "quarry_01_1k",
    "st_fagans_interior_1k",
    "st_peters_square_night_1k",
    "studio_small_03_1k",
    "venice_sunset_1k",
];

/// Whether these names, without extensions, are those of the panoramas of the published means.
pub fn are_published(names: &[String]) -> bool {
    names.len() == PUBLISHED_MAPS.len()
        && PUBLISHED_MAPS.iter().all(|own| names.iter().any(|name| name == own))
}

const fn errors(shadow: f64, irradiance: f64, glossy: f64) -> Errors {
    Errors { irradiance, shadow, glossy }
}

/// A method with the default inversion.
const fn method(name: &'static str, sampler: Sampler, published: Option<[Errors; 2]>) -> StillMethod {
    StillMethod { name, sampler, inversion: Inversion::Bicontinuous, published }
}

/// The methods of the table.
pub const METHODS: [StillMethod; 9] = [
    StillMethod {
        inversion: Inversion::Standard,
        ..method(
            "standard",
            Sampler::Live(light::Sampler::EqualPower),
            Some([errors(0.0324, 0.0410, 0.216), errors(0.0110, 0.0159, 0.081)]),
        )
    },
    StillMethod {
        inversion: Inversion::NormalisedRows,
        ..method(
            "bicontinuous, the paper's",
            Sampler::Live(light::Sampler::EqualPower),
            Some([errors(0.0222, 0.0611, 0.283), errors(0.0068, 0.0191, 0.099)]),
        )
    },
    method(
        "bicontinuous",
        Sampler::Live(light::Sampler::EqualPower),
        Some([errors(0.0213, 0.0606, 0.280), errors(0.0062, 0.0173, 0.088)]),
    ),
    method("structured", Sampler::Structured, None),
    method(
        "median cut",
        Sampler::MedianCut,
        Some([errors(0.0104, 0.0062, 0.0668), errors(0.0021, 0.00114, 0.0094)]),
    ),
    method("variance minimisation", Sampler::VarianceMinimisation, None),
    method(
        "refined",
        Sampler::Live(light::Sampler::Refined),
        Some([errors(0.0060, 0.0031, 0.0311), errors(0.0014, 0.00066, 0.0051)]),
    ),
    // The row in METHODS is that of refined lights after eight passes, which is close to this.
    method(
        "Kollig-Keller",
        Sampler::KolligKeller,
        Some([errors(0.0048, 0.0023, 0.0184), errors(0.00115, 0.00051, 0.0034)]),
    ),
    method("adaptive", ADAPTIVE, None),
];

/// The method of [`METHODS`] that is the default of `run`. It is evaluated after nine identical frames, the
/// others by their first list.
pub const OURS: &str = "adaptive";
/// The length of the filter at 25 frames/s, after which lights have settled.
const STILL_FRAMES: usize = 9;
const ADAPTIVE: Sampler = Sampler::Live(light::Sampler::Adaptive);

impl StillMethod {
    /// Number of frames of the same map after which its list is evaluated.
    pub fn frames(&self) -> usize {
        if self.sampler == ADAPTIVE { STILL_FRAMES } else { 1 }
    }

    /// The extractor of its lights.
    ///
    /// # Errors
    /// Those of [`AnyExtractor::new`].
    pub fn extractor(&self, shape: PolarShape, count: usize) -> Result<AnyExtractor> {
        AnyExtractor::new(shape, &Options { count, sampler: self.sampler, inversion: self.inversion })
    }
}
