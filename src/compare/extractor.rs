use super::kollig_keller::kollig_keller;
use super::median_cut::median_cut;
use super::seeds::{Inversion, Seeds};
use super::structured::structured;
use super::variance_minimisation::variance_minimisation;
use crate::error::{Error, Result};
use lightcast_core::image::{PolarMap, PolarShape, luminance};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::{
    self, Extractor, LightList, MapIrradiance, Voronoi, dampened_luminance, equal_power,
};

/// The method that turns a map into lights: that of the live path, or a published method of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampler {
    /// The method of `lightcast run`.
    Live(light::Sampler),
    /// Rectangles of equal energy (Debevec 2005).
    MedianCut,
    /// Rectangles of low variance (Viriyothai and Debevec 2009).
    VarianceMinimisation,
    /// Strata of connected pixels of similar radiance (Agarwal et al. 2003).
    Structured,
    /// Cells of relaxed sites whose number grows (Kollig and Keller 2003).
    KolligKeller,
}

/// What to extract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Number of lights, as [`light::Options::count`].
    pub count: usize,
    /// The method.
    pub sampler: Sampler,
    /// Which inverse transform places samples, for methods that use one.
    pub inversion: Inversion,
}

/// Extracts lights by any method. Methods of others allocate in every frame.
#[derive(Clone, Debug)]
pub struct AnyExtractor(Method);

/// The state that each method keeps from map to map.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a report has one extractor at a time: its size is of no account"
)]
enum Method {
    Live(Box<Extractor>),
    /// A method of others, or a live one with another inversion.
    Other {
        other: Other,
        count: usize,
        map_irradiance: MapIrradiance,
    },
}

#[derive(Clone, Debug)]
enum Other {
    EqualPower(Seeds),
    Refined(Seeds, Voronoi),
    MedianCut,
    VarianceMinimisation,
    Structured,
    KolligKeller(Seeds, Voronoi),
}

impl AnyExtractor {
    /// Precomputes points and tables for maps of one shape.
    ///
    /// # Errors
    /// Those of [`Extractor::new`]; `Usage` for another inversion than the bicontinuous one for persistent or
    /// adaptive lights, which support no other.
    pub fn new(shape: PolarShape, options: &Options) -> Result<Self> {
        let Options { count, sampler, inversion } = *options;
        let live = light::Options { count, ..light::Options::default() };
        live.check()?;
        let seeds = || Seeds::new(shape, count, live.relaxation_steps, inversion);
        let voronoi = || Voronoi::new(shape, count);
        let other = match sampler {
            Sampler::Live(sampler) => match (sampler, inversion) {
                (sampler, Inversion::Bicontinuous) => {
                    let extractor = Extractor::new(shape, &light::Options { sampler, ..live })?;
                    return Ok(Self(Method::Live(Box::new(extractor))));
                }
                (light::Sampler::EqualPower, _) => Other::EqualPower(seeds()),
                (light::Sampler::Refined, _) => Other::Refined(seeds(), voronoi()),
                (light::Sampler::Persistent | light::Sampler::Adaptive, _) => {
                    return Err(Error::usage(
                        "inversion: persistent and adaptive lights have the bicontinuous one only; leave it out",
                    ));
                }
            },
            Sampler::MedianCut => Other::MedianCut,
            Sampler::VarianceMinimisation => Other::VarianceMinimisation,
            Sampler::Structured => Other::Structured,
            Sampler::KolligKeller => Other::KolligKeller(seeds(), voronoi()),
        };
        Ok(Self(Method::Other { other, count, map_irradiance: MapIrradiance::new(shape) }))
    }

    /// As [`Extractor::step`].
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn step(&mut self, map: &PolarMap, referenced: &mut ReferencedList) {
        match &mut self.0 {
            Method::Live(extractor) => extractor.step(map, referenced),
            Method::Other { other, count, map_irradiance } => {
                other.extract(map, *count, &mut referenced.list);
                map_irradiance.reference(map, &mut referenced.reference_irradiance);
            }
        }
    }

    /// As [`Extractor::extract`].
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn extract(&mut self, map: &PolarMap, list: &mut LightList) {
        match &mut self.0 {
            Method::Live(extractor) => extractor.extract(map, list),
            Method::Other { other, count, .. } => other.extract(map, *count, list),
        }
    }
}

impl Other {
    fn extract(&mut self, map: &PolarMap, count: usize, list: &mut LightList) {
        let lights = &mut list.lights;
        let mut sites = Vec::with_capacity(count);
        match self {
            Self::EqualPower(seeds) => {
                seeds.sites(map, luminance, &mut sites);
                equal_power(map, &sites, lights);
            }
            Self::Refined(seeds, voronoi) => {
                seeds.sites(map, dampened_luminance, &mut sites);
                voronoi.refine(map, &sites, lights);
            }
            Self::MedianCut => median_cut(map, count, lights),
            Self::VarianceMinimisation => variance_minimisation(map, count, lights),
            Self::Structured => structured(map, count, lights),
            Self::KolligKeller(seeds, voronoi) => {
                seeds.sites(map, dampened_luminance, &mut sites);
                kollig_keller(map, voronoi, &mut sites, lights);
            }
        }
        list.stamp = map.stamp;
        list.error = None;
        list.prefix_errors.clear();
        (list.filter_delay_frames, list.chosen_lights) = (0, None);
        list.power = list.sum_of_lights();
    }
}
