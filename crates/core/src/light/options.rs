use super::MAX_LIGHTS;
use crate::error::{Error, Result};
use serde::Deserialize;

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
    /// As persistent, with dominant peaks kept apart and idle lights moved to where they help. For sequences.
    #[default]
    Adaptive,
}

/// What to extract.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct Options {
    /// Number of lights, 1 to [`MAX_LIGHTS`]. Samples are spread best at counts of the form 2^k 3^m.
    pub count: usize,
    /// How a map becomes lights.
    pub sampler: Sampler,
    /// Steps of Lloyd's relaxation of the sample points, 0 to 100, at start-up.
    pub relaxation_steps: usize,
    /// Use only as many of the lights as keep the occlusion error below this: the RMS error, relative to the
    /// mean, of the light in front of 300 planes whose edges are soft by 3 degrees to either side, with
    /// lights as wide as their spread. Adaptive lights only.
    pub error_target: Option<f32>,
    /// Use only as many of the lights as can be computed in this time, in ms per frame; adaptive lights only.
    pub budget_ms: Option<f64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            count: 64,
            sampler: Sampler::default(),
            // What the tables of METHODS were measured with.
            relaxation_steps: 4,
            error_target: None,
            budget_ms: None,
        }
    }
}

impl Options {
    /// Checks whether lights can be extracted with these options.
    ///
    /// # Errors
    /// `Usage`, naming the key, for a count of 0 or above [`MAX_LIGHTS`], for more than 100 relaxation steps,
    /// and for a target or a budget that is not a number above 0 or is set for lights other than adaptive
    /// ones.
    pub fn check(&self) -> Result<()> {
        let Self { count, sampler, relaxation_steps, error_target, budget_ms } = *self;
        if !(1..=MAX_LIGHTS).contains(&count) {
            return Err(
                Error::usage(format!("give 1 to {MAX_LIGHTS} lights")).in_option("count", Some(&count))
            );
        }
        if relaxation_steps > 100 {
            return Err(Error::usage("a few suffice, give 0 to 100")
                .in_option("relaxation_steps", Some(&relaxation_steps)));
        }
        if (error_target.is_some() || budget_ms.is_some()) && sampler != Sampler::Adaptive {
            let key = if error_target.is_some() { "error_target" } else { "budget_ms" };
            return Err(Error::usage(
                "only adaptive lights change their number; leave this key out, or choose sampler = \"adaptive\"",
            )
            .in_option(key, None));
        }
        let is_sound = |value: f64| value.is_finite() && value > 0.0;
        if let Some(target) = error_target.filter(|&target| !is_sound(f64::from(target))) {
            return Err(Error::usage("must be a relative error above 0, such as 0.01")
                .in_option("error_target", Some(&target)));
        }
        if let Some(budget) = budget_ms.filter(|&budget| !is_sound(budget)) {
            return Err(Error::usage("must be a time above 0 ms").in_option("budget_ms", Some(&budget)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_by_name_and_unknown_names_refused() {
        let options: Options = toml::from_str(
            "count = 300\nsampler = \"equal-power\"\nrelaxation_steps = 0\nerror_target = 0.003\nbudget_ms = 1",
        )
        .unwrap();
        let expected = Options {
            count: 300,
            sampler: Sampler::EqualPower,
            relaxation_steps: 0,
            error_target: Some(0.003),
            budget_ms: Some(1.0),
        };
        assert_eq!(options, expected);
        assert_eq!(toml::from_str::<Options>("").unwrap(), Options::default());
        // The methods of others are for comparison, not for a sequence.
        for text in ["cuont = 3", "sampler = \"median-cut\"", "inversion = \"standard\""] {
            let message = toml::from_str::<Options>(text).unwrap_err().to_string();
            assert!(message.contains(text.split(' ').next().unwrap()), "{message}");
        }
    }

    #[test]
    fn targets_and_budgets_that_are_none_are_refused_by_key() {
        for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let options = Options { error_target: Some(wrong), ..Options::default() };
            let message = options.check().unwrap_err().to_string();
            assert!(message.starts_with("error_target = "), "{message}");
            let options = Options { budget_ms: Some(wrong.into()), ..Options::default() };
            let message = options.check().unwrap_err().to_string();
            assert!(message.starts_with("budget_ms = "), "{message}");
        }
    }
}
