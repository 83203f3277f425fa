use super::adaptive::Adaptive;
use super::count::Count;
use super::equal_power::equal_power;
use super::occlusion::OcclusionError;
use super::refine::Voronoi;
use super::seeds::{Seeds, dampened_luminance};
use super::{Light, LightList, MapIrradiance, Options, ReferencedList, Sampler};
use crate::error::Result;
use crate::image::{PolarMap, PolarShape, luminance};
use std::time::Duration;

/// Extracts the lights of one polar map after another.
#[derive(Clone, Debug)]
pub struct Extractor {
    shape: PolarShape,
    method: Method,
    map_irradiance: MapIrradiance,
}

/// What each sampler keeps from map to map.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a service has one extractor: its size is of no account")]
enum Method {
    EqualPower {
        seeds: Seeds,
        sites: Vec<[f32; 3]>,
    },
    Refined {
        seeds: Seeds,
        sites: Vec<[f32; 3]>,
        voronoi: Voronoi,
    },
    Persistent {
        seeds: Seeds,
        sites: Vec<[f32; 3]>,
        /// Whether `sites` are the directions of a frame that had light.
        is_lit: bool,
        voronoi: Voronoi,
    },
    Adaptive {
        seeds: Seeds,
        adaptive: Adaptive,
        voronoi: Voronoi,
        /// `None` where all lights are used.
        count: Option<Count>,
        occlusion_error: OcclusionError,
    },
}

impl Extractor {
    /// Prepares points and tables for maps of one shape.
    ///
    /// # Errors
    /// Those of [`Options::check`].
    pub fn new(shape: PolarShape, options: &Options) -> Result<Self> {
        options.check()?;
        Ok(Self { shape, method: Method::new(shape, options), map_irradiance: MapIrradiance::new(shape) })
    }

    /// Fills in the list of `map`: stamp, lights in slot order, their power, and the map's irradiances. Its
    /// errors come last, by [`super::error::ListError::measure`]: the filter measures every list that it
    /// outputs, so they are not computed here only to be replaced.
    ///
    /// Equal-power lights keep the luminous power of the map, the others its RGB power. A map without light
    /// gives lights without power: towards uniform directions, or, persistent and adaptive, where they were.
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn step(&mut self, map: &PolarMap, referenced: &mut ReferencedList) {
        let ReferencedList { list, reference_irradiance } = referenced;
        self.extract(map, list);
        self.map_irradiance.reference(map, reference_irradiance);
        if let Method::Adaptive { adaptive, count: Some(count), occlusion_error, .. } = &mut self.method
            && count.needs_error()
        {
            let error = occlusion_error.relative_error(&list.lights, self.map_irradiance.blocks());
            count.saw_error(error, adaptive.used(), map.stamp.frame_rate_hz);
            adaptive.want(count.lights());
        }
    }

    /// Whether [`Self::took`] needs to be called.
    pub fn has_budget(&self) -> bool {
        matches!(&self.method, Method::Adaptive { count: Some(count), .. } if count.has_budget())
    }

    /// How long the last list took, so that the next one keeps the budget.
    pub fn took(&mut self, time: Duration, frame_rate_hz: f64) {
        if let Method::Adaptive { adaptive, count: Some(count), .. } = &mut self.method {
            count.saw_time(time.as_secs_f64() * 1e3, frame_rate_hz);
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
        list.error = None;
        list.prefix_errors.clear();
        self.method.extract(map, &mut list.lights);
        list.power = list.sum_of_lights();
        list.chosen_lights = match &self.method {
            Method::Adaptive { adaptive, count: Some(_), .. } => Some(adaptive.used() as u32),
            _ => None,
        };
    }
}

impl Method {
    /// For a shape and options that have been checked.
    fn new(shape: PolarShape, options: &Options) -> Self {
        let Options { count, sampler, relaxation_steps, error_target, budget_ms } = *options;
        let seeds = Seeds::new(shape, count, relaxation_steps);
        let sites = Vec::with_capacity(count);
        let voronoi = || Voronoi::new(shape, count);
        match sampler {
            Sampler::EqualPower => Self::EqualPower { seeds, sites },
            Sampler::Refined => Self::Refined { seeds, sites, voronoi: voronoi() },
            Sampler::Persistent => Self::Persistent { seeds, sites, is_lit: false, voronoi: voronoi() },
            Sampler::Adaptive => Self::Adaptive {
                seeds,
                adaptive: Adaptive::new(shape, count),
                voronoi: voronoi(),
                count: Count::new(count, error_target, budget_ms),
                occlusion_error: OcclusionError::new(),
            },
        }
    }

    /// Writes the lights of a map, one per slot.
    fn extract(&mut self, map: &PolarMap, lights: &mut Vec<Light>) {
        match self {
            Self::EqualPower { seeds, sites } => {
                seeds.sites(map, luminance, sites);
                equal_power(map, sites, lights);
            }
            Self::Refined { seeds, sites, voronoi } => {
                seeds.sites(map, dampened_luminance, sites);
                voronoi.refine(map, sites, lights);
            }
            Self::Persistent { seeds, sites, is_lit, voronoi } => {
                // Until there was light, the last directions say nothing about where to look for it.
                if !*is_lit {
                    seeds.sites(map, dampened_luminance, sites);
                }
                voronoi.refine(map, sites, lights);
                *is_lit |= lights.iter().any(|light| light.irradiance != [0.0; 3]);
                for (site, light) in sites.iter_mut().zip(lights.iter()) {
                    *site = light.direction;
                }
            }
            Self::Adaptive { seeds, adaptive, voronoi, .. } => {
                let seed = |map: &PolarMap, sites: &mut Vec<_>| seeds.sites(map, dampened_luminance, sites);
                adaptive.step(map, seed, |rest, sites| voronoi.sum(sites, |row| rest.row(row)), lights);
            }
        }
    }
}
