//! The light of a picture, the parts of the scene that are in it, and its look.

use crate::cli::input::is_standard_input;
use crate::cli::panorama::{Panorama, PanoramaArguments};
use crate::error::{Error, Result};
use crate::render::{self, Background, Exposure, Lightings};
use crate::scene::{Roles, Scene};
use clap::ValueEnum;
use std::path::Path;

#[derive(Debug, clap::Args)]
pub(super) struct Look {
    /// Kinds of light that add up: directional lights with shadows, and the ground's (ambient; see
    /// --ground-albedo).
    #[arg(long, value_name = "KIND,...", value_enum, value_delimiter = ',',
        default_values_t = [LightingName::Directional, LightingName::Ambient])]
    lighting: Vec<LightingName>,

    /// Albedo of a ground all around; its light, which a camera that looks up does not capture, falls on
    /// undersides. 0: none.
    #[arg(long, value_name = "ALBEDO", default_value_t = 0.0, value_parser = albedo)]
    ground_albedo: f32,

    /// Behind the scene: R,G,B (linear radiance), `panorama` (INPUT itself), or `transparent` (alpha in PNG
    /// and EXR). Default: a dark grey.
    #[arg(long, value_name = "BACKGROUND", value_parser = background)]
    background: Option<BackgroundName>,

    /// Multiply radiance by two to the power of this [default: what suits the picture, smoothed over time].
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true, value_parser = stops)]
    exposure: Option<f32>,

    /// Curve from radiance to PNG or window: Reinhard's, that of sRGB alone (clips at 1), or none (clips
    /// too).
    #[arg(long, value_enum, default_value_t = ToneName::Reinhard)]
    tone: ToneName,

    /// Node of the scene, with all below it, that is not seen but casts its shadows. May be given again. For
    /// pictures that must match each other give --eye and --target: the default camera frames what casts
    /// shadows.
    #[arg(long, value_name = "NODE")]
    hold_out: Vec<String>,

    /// Node that neither is seen nor casts shadows. May be given again.
    #[arg(long, value_name = "NODE")]
    unseen: Vec<String>,

    /// Node that casts no shadows. May be given again.
    #[arg(long, value_name = "NODE")]
    no_shadow: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LightingName {
    Directional,
    Ambient,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum BackgroundName {
    Colour([f32; 3]),
    Panorama,
    Transparent,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ToneName {
    Reinhard,
    Srgb,
    None,
}

/// Most columns of a panorama behind a scene: 128 MB on the device.
const MOST_COLUMNS: usize = 4096;

impl Look {
    /// The lightings that are summed.
    ///
    /// # Errors
    /// `Usage` where the light of a ground and the ground's albedo are not given together.
    pub(super) fn lighting(&self) -> Result<Lightings> {
        let has = |name| self.lighting.contains(&name);
        let lightings =
            Lightings { directional: has(LightingName::Directional), ambient: has(LightingName::Ambient) };
        if lightings == (Lightings { directional: false, ambient: true }) && self.ground_albedo == 0.0 {
            return Err(Error::usage("--lighting ambient alone needs --ground-albedo; of 0 comes no light"));
        }
        if self.ground_albedo > 0.0 && !lightings.ambient {
            return Err(Error::usage(
                "--ground-albedo is for --lighting ambient; add it or leave the albedo out",
            ));
        }
        Ok(lightings)
    }

    pub(super) fn ground_albedo(&self) -> f32 {
        self.ground_albedo
    }

    pub(super) fn is_transparent(&self) -> bool {
        self.background == Some(BackgroundName::Transparent)
    }

    /// Gives the scene's nodes the roles that were asked for.
    pub(super) fn set_roles(&self, scene: &mut Scene) -> Result<()> {
        let mut change = |names: &[String], changed: fn(Roles) -> Roles| {
            names.iter().try_for_each(|name| scene.change_roles(name, changed))
        };
        // A ground that is held out still casts no shadow: it would widen every shadow map.
        change(&self.hold_out, |roles| Roles { seen: false, ..roles })?;
        change(&self.unseen, |_| Roles::NONE)?;
        change(&self.no_shadow, |roles| Roles { casts: false, ..roles })
    }

    /// How pictures look; `panorama`: INPUT, if it is one.
    pub(super) fn of_pictures(
        &self,
        panorama: Option<&Path>,
        how: PanoramaArguments,
    ) -> Result<render::Look> {
        let background = match self.background {
            None => Background::Grey,
            Some(BackgroundName::Colour(colour)) => Background::Colour(colour),
            Some(BackgroundName::Transparent) => Background::Transparent,
            Some(BackgroundName::Panorama) => {
                let path = panorama.ok_or_else(|| {
                    Error::usage("--background panorama shows the panorama that is the input; give one")
                })?;
                if is_standard_input(path) {
                    return Err(Error::usage(
                        "--background panorama reads the panorama again; give a file, not `-`",
                    ));
                }
                let panorama = Panorama::read(path, how)?;
                Background::Panorama(panorama.map(panorama.own_shape(MOST_COLUMNS)?)?)
            }
        };
        Ok(render::Look {
            background,
            exposure: self.exposure.map_or(Exposure::Automatic, Exposure::Stops),
            tone: match self.tone {
                ToneName::Reinhard => render::Tone::Reinhard,
                ToneName::Srgb => render::Tone::Srgb,
                ToneName::None => render::Tone::None,
            },
        })
    }
}

fn albedo(text: &str) -> Result<f32, String> {
    let albedo: Option<f32> = text.parse().ok();
    albedo.filter(|albedo| (0.0..=1.0).contains(albedo)).ok_or("give 0 to 1".to_owned())
}

fn stops(text: &str) -> Result<f32, String> {
    let stops: Option<f32> = text.parse().ok();
    stops.filter(|stops| (-64.0..=64.0).contains(stops)).ok_or("give -64 to 64 stops".to_owned())
}

fn background(text: &str) -> Result<BackgroundName, String> {
    match text {
        "panorama" => return Ok(BackgroundName::Panorama),
        "transparent" => return Ok(BackgroundName::Transparent),
        _ => {}
    }
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[r, g, b]) if [r, g, b].iter().all(|v| v.is_finite() && *v >= 0.0) => {
            Ok(BackgroundName::Colour([r, g, b]))
        }
        _ => {
            Err("write `panorama`, `transparent`, or three numbers of at least 0, such as 0.1,0.2,0.3"
                .to_owned())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_take_roles_away_and_give_none() {
        let look = |flags: &[&str]| {
            #[derive(clap::Parser)]
            struct Line {
                #[command(flatten)]
                look: Look,
            }
            let line = ["render"].into_iter().chain(flags.iter().copied());
            <Line as clap::Parser>::try_parse_from(line).map(|line| line.look).unwrap()
        };
        let roles = |flags: &[&str]| {
            let mut scene = Scene::built_in();
            look(flags).set_roles(&mut scene).unwrap();
            scene.instances.iter().map(|instance| instance.roles).collect::<Vec<_>>()
        };
        assert_eq!(roles(&[]), [Roles::ALL, Roles::ALL, Roles::NO_SHADOW]);
        let unseen = Roles { seen: false, ..Roles::ALL };
        assert_eq!(
            roles(&["--hold-out", "knot", "--hold-out", "ground"]),
            [unseen, Roles::ALL, Roles { casts: false, ..unseen }]
        );
        assert_eq!(roles(&["--unseen", "knot", "--no-shadow", "knot"])[0], Roles::NONE);
        assert_eq!(roles(&["--no-shadow", "sphere"])[1], Roles::NO_SHADOW);
    }

    #[test]
    fn backgrounds_are_colours_or_names() {
        assert_eq!(background("0.5, 1,2e1"), Ok(BackgroundName::Colour([0.5, 1.0, 20.0])));
        assert_eq!(background("transparent"), Ok(BackgroundName::Transparent));
        for text in ["", "grey", "1,2", "1,2,-3", "1,2,nan", "1,2,inf"] {
            assert!(background(text).is_err(), "{text}");
        }
        assert!(albedo("1.1").is_err() && albedo("nan").is_err() && albedo("0.3") == Ok(0.3));
        assert!(stops("inf").is_err() && stops("-3") == Ok(-3.0));
    }
}
