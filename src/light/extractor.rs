use super::equal_power::equal_power;
use super::kollig_keller::{Voronoi, kollig_keller};
use super::median_cut::median_cut;
use super::nearest::NearestSites;
use super::peaks::{PeakOptions, Peaks};
use super::refine::Cells;
use super::structured::structured;
use super::variance_minimisation::variance_minimisation;
use super::{Light, LightList, MapIrradiance};
use crate::error::{Error, Result};
use crate::image::{PolarMap, PolarShape, luminance};
use crate::sampling::{Bicontinuous, Standard, sample_points};
use serde::Deserialize;

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
    /// As refined, about the directions of the last frame. For sequences.
    #[default]
    Persistent,
    /// Rectangles of even energy (Debevec 2005). This and the following are for comparison: they allocate in every frame.
    MedianCut,
    /// Rectangles of little variance (Viriyothai and Debevec 2009).
    VarianceMinimisation,
    /// Strata of connected pixels of alike radiance (Agarwal et al. 2003).
    Structured,
    /// Cells about relaxed sites whose number grows (Kollig and Keller 2003).
    KolligKeller,
}

impl Sampler {
    /// Whether dominant peaks may be taken apart before.
    fn takes_peaks(self) -> bool {
        matches!(self, Self::Refined | Self::Persistent)
    }
}

/// Which inverse transform places samples (METHODS section 5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Inversion {
    /// [`Bicontinuous`].
    #[default]
    Bicontinuous,
    /// [`Bicontinuous`] with rows normalised before they are interpolated, as the paper has it.
    NormalisedRows,
    /// [`Standard`], the baseline.
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
    /// Dominant peaks that become lights of their own; for refined and persistent lights only.
    pub peaks: PeakOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            count: 64,
            sampler: Sampler::default(),
            inversion: Inversion::default(),
            // What the tables of METHODS were measured with.
            relaxation_steps: 4,
            peaks: PeakOptions::default(),
        }
    }
}

/// Extracts the lights of one polar map after another.
#[derive(Clone, Debug)]
pub struct Extractor {
    shape: PolarShape,
    sampler: Sampler,
    points: Vec<[f64; 2]>,
    distribution: Distribution,
    importance: Vec<f32>,
    sites: Vec<[f32; 3]>,
    /// Whether `sites` are the directions of a frame that had light.
    lit: bool,
    nearest_sites: NearestSites,
    nearest: Vec<u32>,
    cells: Cells,
    peaks: Option<Peaks>,
    map_irradiance: MapIrradiance,
}

#[derive(Clone, Debug)]
enum Distribution {
    Standard(Standard),
    Bicontinuous(Bicontinuous),
}

impl Extractor {
    /// Prepares points and tables for maps of one shape.
    ///
    /// # Errors
    /// `Usage` for a count of 0 or above [`MAX_LIGHTS`], for more than 100 relaxation steps, for peaks that leave no
    /// light for the rest, have a threshold of 1 or less or are asked of a sampler that has none, and for a shape without
    /// pixels, with too many, narrower than 0.001 rad or not within the sphere.
    pub fn new(shape: PolarShape, options: &Options) -> Result<Self> {
        let Options { count, sampler, inversion, relaxation_steps, peaks } = *options;
        if !(1..=MAX_LIGHTS).contains(&count) {
            return Err(Error::usage(format!("count: {count} lights; give 1 to {MAX_LIGHTS}")));
        }
        if relaxation_steps > 100 {
            return Err(Error::usage(format!(
                "relaxation_steps: {relaxation_steps}; a few suffice, give 0 to 100"
            )));
        }
        peaks.check(count)?;
        if peaks.slots > 0 && !sampler.takes_peaks() {
            return Err(Error::usage(
                "peaks.slots: only refined and persistent lights have them; give 0, or one of these samplers",
            ));
        }
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
        let z = |row: f64| 2.0 * (0.5 * shape.theta_max_rad * row / shape.rows as f64).sin().powi(2);
        let distribution = match inversion {
            Inversion::Standard => {
                let edges: Vec<f64> = (0..=shape.rows).map(|row| z(row as f64)).collect();
                Distribution::Standard(Standard::new(shape.columns, &edges))
            }
            Inversion::Bicontinuous | Inversion::NormalisedRows => {
                let centres: Vec<f64> = (0..shape.rows).map(|row| z(row as f64 + 0.5)).collect();
                let distribution = Bicontinuous::new(shape.columns, &centres, z(shape.rows as f64));
                Distribution::Bicontinuous(if inversion == Inversion::NormalisedRows {
                    distribution.with_normalised_rows()
                } else {
                    distribution
                })
            }
        };
        let site_count = count - peaks.slots;
        Ok(Self {
            shape,
            sampler,
            points: sample_points(site_count, relaxation_steps),
            distribution,
            importance: vec![0.0; shape.len()],
            sites: Vec::with_capacity(site_count),
            lit: false,
            nearest_sites: NearestSites::new(shape, site_count),
            nearest: vec![0; shape.len()],
            cells: Cells::new(shape.columns, site_count),
            peaks: (peaks.slots > 0).then(|| Peaks::new(shape, &peaks)),
            map_irradiance: MapIrradiance::new(shape),
        })
    }

    /// Fills `list` with the lights of `map`: stamp, lights in slot order, their power, and the map's irradiances.
    /// Its errors come last, by [`super::error::ListError::measure`]: the filter measures every list that it
    /// lets out, so they are not worked out here only to be replaced.
    ///
    /// Equal-power lights keep the luminous power of the map, the others its RGB power. A map without light gives
    /// lights without power: towards uniform directions, or, persistent, where they were. Lights of peaks come first.
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn step(&mut self, map: &PolarMap, list: &mut LightList) {
        self.extract(map, list);
        self.map_irradiance.reference(map, &mut list.reference_irradiance);
    }

    /// [`Self::step`] without the map's irradiances, which are left as they are.
    ///
    /// # Panics
    /// If the map is not of this extractor's shape.
    pub fn extract(&mut self, map: &PolarMap, list: &mut LightList) {
        assert!(map.shape == self.shape && map.pixels.len() == self.shape.len(), "the map's shape");
        list.stamp = map.stamp;
        list.filter_delay_frames = 0;
        let mut peaks = self.peaks.take();
        let rest = peaks.as_mut().map_or(map, |peaks| peaks.step(map));
        self.extract_rest(rest, &mut list.lights);
        if let Some(peaks) = &peaks {
            // First in the list, so that no prefix joins them to anything.
            let site_count = list.lights.len();
            list.lights.extend(peaks.lights());
            list.lights.rotate_left(site_count);
            for (id, light) in list.lights.iter_mut().enumerate() {
                light.id = id as u32;
            }
        }
        self.peaks = peaks;
        list.power = list.sum_of_lights();
    }

    /// The lights of the map, or of what its peaks leave.
    fn extract_rest(&mut self, map: &PolarMap, lights: &mut Vec<Light>) {
        match self.sampler {
            Sampler::EqualPower => {
                self.sample_sites(map, luminance);
                equal_power(map, &self.sites, lights);
            }
            Sampler::Refined => {
                self.sample_sites(map, dampened);
                self.refine(map, lights);
            }
            Sampler::Persistent => {
                // Until there was light, the last directions say nothing about where to look for it.
                if !self.lit {
                    self.sample_sites(map, dampened);
                }
                self.refine(map, lights);
                self.lit |= lights.iter().any(|light| light.irradiance != [0.0; 3]);
                for (site, light) in self.sites.iter_mut().zip(lights.iter()) {
                    *site = light.direction;
                }
            }
            Sampler::MedianCut => median_cut(map, self.points.len(), lights),
            Sampler::VarianceMinimisation => variance_minimisation(map, self.points.len(), lights),
            Sampler::Structured => structured(map, self.points.len(), lights),
            Sampler::KolligKeller => {
                self.sample_sites(map, dampened);
                let voronoi = Voronoi {
                    nearest_sites: &mut self.nearest_sites,
                    nearest: &mut self.nearest,
                    cells: &mut self.cells,
                };
                kollig_keller(map, voronoi, &mut self.sites, lights);
            }
        }
    }

    /// Puts the sites where the inverse transform of `importance(pixel)` takes the points.
    fn sample_sites(&mut self, map: &PolarMap, importance: impl Fn([f32; 3]) -> f32) {
        for (value, &pixel) in self.importance.iter_mut().zip(&map.pixels) {
            *value = importance(pixel);
        }
        self.sites.clear();
        match &mut self.distribution {
            Distribution::Standard(standard) => {
                standard.update(&self.importance);
                self.sites.extend(self.points.iter().map(|&u| site(standard.sample(u))));
            }
            Distribution::Bicontinuous(bicontinuous) => {
                bicontinuous.update(&self.importance);
                self.sites.extend(self.points.iter().map(|&u| site(bicontinuous.sample(u))));
            }
        }
    }

    fn refine(&mut self, map: &PolarMap, lights: &mut Vec<Light>) {
        self.nearest_sites.assign(&self.sites, &mut self.nearest);
        self.cells.refine(map, &self.nearest, &self.sites, lights);
    }
}

/// Importance for sites: luminance^0.75. Sites by luminance itself crowd in the brightest spots, where one light is as
/// good as ten.
fn dampened(pixel: [f32; 3]) -> f32 {
    let root = luminance(pixel).sqrt();
    root * root.sqrt()
}

/// Unit vector of `[z, phi]`, z = 1 - cos theta.
fn site([z, phi]: [f64; 2]) -> [f32; 3] {
    let sin_theta = (z * (2.0 - z)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi.sin_cos();
    [(sin_theta * cos_phi) as f32, (1.0 - z) as f32, (sin_theta * sin_phi) as f32]
}
