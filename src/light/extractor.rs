use super::adaptive::Adaptive;
use super::count::Count;
use super::equal_power::equal_power;
use super::kollig_keller::kollig_keller;
use super::median_cut::median_cut;
use super::occlusion::OcclusionError;
use super::refine::Voronoi;
use super::seeds::{Seeds, dampened};
use super::structured::structured;
use super::variance_minimisation::variance_minimisation;
use super::{LightList, MapIrradiance};
use crate::error::{Error, Place, Result};
use crate::image::{PolarMap, PolarShape, luminance};
use serde::Deserialize;
use std::time::Duration;

/// The most lights and pixels that an [`Extractor`] accepts.
///
/// Relaxation measures Voronoi cells on 65,536 lattice points; more lights than a quarter of that would have cells of
/// fewer than four. Site numbers and tables stay far inside u32 and memory for 2^28 pixels (3 GiB of map).
pub const MAX_LIGHTS: usize = 16_384;
const MAX_PIXELS: usize = 1 << 28;

/// The narrowest map. Directions are unit vectors in f32, good to 1e-7: in a narrower map they would lie on a raster
/// of less than ten thousand steps, and far below it the heights of neighbouring rows are the same number.
const LEAST_THETA_MAX_RAD: f64 = 1e-3;

/// How a map becomes lights (METHODS section 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampler {
    /// The paper's: lights of equal luminous power at the samples.
    EqualPower,
    /// Cells about samples of luminance^0.75; their flux, mean direction and spread. For single maps.
    Refined,
    /// As refined, about the directions of the last frame.
    Persistent,
    /// As persistent, with dominant peaks apart and idle lights moved to where they help. For sequences.
    #[default]
    Adaptive,
    /// Rectangles of even energy (Debevec 2005). For comparison: it allocates in every frame.
    MedianCut,
    /// Rectangles of little variance (Viriyothai and Debevec 2009). For comparison: it allocates in every frame.
    VarianceMinimisation,
    /// Strata of connected pixels of alike radiance (Agarwal et al. 2003). For comparison: it allocates in every frame.
    Structured,
    /// Cells about relaxed sites whose number grows (Kollig and Keller 2003). For comparison: it takes many passes.
    KolligKeller,
}

/// Which inverse transform places samples (METHODS section 5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inversion {
    /// [`crate::sampling::Bicontinuous`].
    #[default]
    Bicontinuous,
    /// [`crate::sampling::Bicontinuous`] with rows normalised before they are interpolated, as the paper has it.
    NormalisedRows,
    /// [`crate::sampling::Standard`], the baseline.
    Standard,
}

/// What to extract.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct Options {
    /// Number of lights, 1 to [`MAX_LIGHTS`]. Samples are spread best at counts of the form 2^k 3^m.
    pub count: usize,
    /// How a map becomes lights.
    pub sampler: Sampler,
    /// Which inverse transform places samples.
    pub inversion: Inversion,
    /// Steps of Lloyd's relaxation of the sample points, 0 to 100, at start-up.
    pub relaxation_steps: usize,
    /// Use only as many of the lights as keep the occlusion error below this: of the light in front of 300 planes, whose
    /// edges are soft by 3 degrees to either side, RMS relative to the mean, with lights as wide as their spread. Adaptive
    /// lights only.
    pub error_target: Option<f32>,
    /// Use only as many of the lights as are made in this time, in ms a frame; adaptive lights only.
    pub budget_ms: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            count: 64,
            sampler: Sampler::default(),
            inversion: Inversion::default(),
            // What the tables of METHODS were measured with.
            relaxation_steps: 4,
            error_target: None,
            budget_ms: None,
        }
    }
}

/// Extracts the lights of one polar map after another.
#[derive(Clone, Debug)]
pub struct Extractor {
    shape: PolarShape,
    sampler: Sampler,
    seeds: Seeds,
    sites: Vec<[f32; 3]>,
    /// Whether `sites` are the directions of a frame that had light.
    lit: bool,
    voronoi: Voronoi,
    adaptive: Option<Adaptive>,
    chosen: Option<Count>,
    occlusion_error: OcclusionError,
    map_irradiance: MapIrradiance,
}

impl Extractor {
    /// Prepares points and tables for maps of one shape.
    ///
    /// # Errors
    /// `Usage` for a count of 0 or above [`MAX_LIGHTS`], for more than 100 relaxation steps, for a target or a budget
    /// that is none or is asked of other lights than adaptive ones, and for a shape without pixels, with too many,
    /// narrower than 0.001 rad or not within the sphere.
    pub fn new(shape: PolarShape, options: &Options) -> Result<Self> {
        let Options { count, sampler, inversion, relaxation_steps, error_target, budget_ms } = *options;
        if !(1..=MAX_LIGHTS).contains(&count) {
            return Err(
                Error::usage(format!("give 1 to {MAX_LIGHTS} lights")).at(Place::value("count", count))
            );
        }
        if relaxation_steps > 100 {
            return Err(Error::usage("a few suffice, give 0 to 100")
                .at(Place::value("relaxation_steps", relaxation_steps)));
        }
        if (error_target.is_some() || budget_ms.is_some()) && sampler != Sampler::Adaptive {
            let key = if error_target.is_some() { "error_target" } else { "budget_ms" };
            return Err(Error::usage(
                "only adaptive lights change their number; leave this key out, or choose sampler = \"adaptive\"",
            )
            .at(Place::key(key)));
        }
        let chosen = Count::new(count, error_target, budget_ms)?;
        let pixels = shape.columns.checked_mul(shape.rows).filter(|&n| (1..=MAX_PIXELS).contains(&n));
        if pixels.is_none() {
            return Err(Error::usage(format!(
                "a polar map of {} x {} pixels; give 1 to {MAX_PIXELS} pixels in all",
                shape.columns, shape.rows
            )));
        }
        // NaN lies in no range.
        if !(LEAST_THETA_MAX_RAD..=std::f64::consts::PI).contains(&shape.theta_max_rad) {
            return Err(Error::usage(format!(
                "a polar map down to theta = {:?} rad; give {LEAST_THETA_MAX_RAD} to pi",
                shape.theta_max_rad
            )));
        }
        Ok(Self {
            shape,
            sampler,
            seeds: Seeds::new(shape, count, relaxation_steps, inversion),
            sites: Vec::with_capacity(count),
            lit: false,
            voronoi: Voronoi::new(shape, count),
            chosen,
            occlusion_error: OcclusionError::new(),
            adaptive: (sampler == Sampler::Adaptive).then(|| Adaptive::new(shape, count)),
            map_irradiance: MapIrradiance::new(shape),
        })
    }

    /// Fills `list` with the lights of `map`: stamp, lights in slot order, their power, and the map's irradiances.
    /// Its errors come last, by [`super::error::ListError::measure`]: the filter measures every list that it
    /// lets out, so they are not worked out here only to be replaced.
    ///
    /// Equal-power lights keep the luminous power of the map, the others its RGB power. A map without light gives
    /// lights without power: towards uniform directions, or, persistent and adaptive, where they were.
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn step(&mut self, map: &PolarMap, list: &mut LightList) {
        self.extract(map, list);
        self.map_irradiance.reference(map, &mut list.reference_irradiance);
        if let Some(count) = self.chosen.as_mut().filter(|count| count.needs_error()) {
            let error = self.occlusion_error.relative_error(&list.lights, self.map_irradiance.blocks());
            let used = self.adaptive.as_ref().map_or(0, Adaptive::used);
            count.saw_error(error, used, map.stamp.frame_rate_hz);
            self.choose();
        }
    }

    /// Whether [`Self::took`] is of use.
    pub fn has_budget(&self) -> bool {
        self.chosen.as_ref().is_some_and(Count::has_budget)
    }

    /// How long the last list took, so that the next one keeps the budget.
    pub fn took(&mut self, time: Duration, frame_rate_hz: f64) {
        if let Some(count) = &mut self.chosen {
            count.saw_time(time.as_secs_f64() * 1e3, frame_rate_hz);
            self.choose();
        }
    }

    fn choose(&mut self) {
        if let (Some(count), Some(adaptive)) = (&self.chosen, &mut self.adaptive) {
            adaptive.want(count.lights());
        }
    }

    /// [`Self::step`] without the map's irradiances, which are left as they are.
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn extract(&mut self, map: &PolarMap, list: &mut LightList) {
        assert!(map.shape == self.shape && map.pixels.len() == self.shape.len(), "the map's shape");
        list.stamp = map.stamp;
        list.filter_delay_frames = 0;
        let (lights, seeds) = (&mut list.lights, &mut self.seeds);
        match self.sampler {
            Sampler::EqualPower => {
                seeds.sites(map, luminance, &mut self.sites);
                equal_power(map, &self.sites, lights);
            }
            Sampler::Refined => {
                seeds.sites(map, dampened, &mut self.sites);
                self.voronoi.refine(map, &self.sites, lights);
            }
            Sampler::Persistent => {
                // Until there was light, the last directions say nothing about where to look for it.
                if !self.lit {
                    seeds.sites(map, dampened, &mut self.sites);
                }
                self.voronoi.refine(map, &self.sites, lights);
                self.lit |= lights.iter().any(|light| light.irradiance != [0.0; 3]);
                for (site, light) in self.sites.iter_mut().zip(lights.iter()) {
                    *site = light.direction;
                }
            }
            Sampler::Adaptive => {
                let adaptive = self.adaptive.as_mut().expect("made for this sampler");
                let seed = |map: &PolarMap, sites: &mut Vec<_>| seeds.sites(map, dampened, sites);
                adaptive.step(map, seed, |rest, sites| self.voronoi.sum(sites, |row| rest.row(row)), lights);
            }
            Sampler::MedianCut => median_cut(map, seeds.count(), lights),
            Sampler::VarianceMinimisation => variance_minimisation(map, seeds.count(), lights),
            Sampler::Structured => structured(map, seeds.count(), lights),
            Sampler::KolligKeller => {
                seeds.sites(map, dampened, &mut self.sites);
                kollig_keller(map, &mut self.voronoi, &mut self.sites, lights);
            }
        }
        list.power = list.sum_of_lights();
        let used = self.adaptive.as_ref().map(|adaptive| adaptive.used() as u32);
        list.chosen_lights = used.filter(|_| self.chosen.is_some());
    }
}
