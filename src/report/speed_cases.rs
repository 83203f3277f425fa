//! The cases for measuring the renderer's speed: scenes, settings and lists of lights.

use crate::error::Result;
use crate::render::{DirectionalOptions, Options};
use crate::scene::{Material, Scene, Shading};
use lightcast_core::image::{PolarMap, PolarShape};

use lightcast_core::light::error::ListError;
use lightcast_core::light::{Extractor, Light, Options as ExtractorOptions, ReferencedList, prefix};
use lightcast_core::math::fibonacci_sphere;

/// Size of the maps that lists are taken from.
pub const SHAPE: PolarShape = PolarShape::hemisphere(360, 90);
/// The size of the paper's pictures, which is used where no other is.
pub const SMALL: [u32; 2] = [320, 240];
/// Gives about as many triangles as the model of the paper's figure 7 has (16,200).
pub const FEW_SEGMENTS: usize = 128;
/// Gives about 800 thousand triangles.
pub const MANY_SEGMENTS: usize = 896;
/// Lights of a list for glossy surfaces, as `lightcast render` takes.
const GLOSSY_LIGHTS: usize = 1152;

/// A scene made in code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// [`Scene::built_in`].
    BuiltIn,
    /// [`Scene::sphere_of_normals`] alone: every pixel that shows it shows a different normal.
    Sphere,
    /// The sphere of normals on a ground.
    OnGround {
        /// Steps around the sphere.
        segments: usize,
        /// Whether it has a highlight (Phong's lobe) over Lambert's law.
        is_glossy: bool,
    },
}

impl Model {
    /// The scene.
    pub fn scene(self) -> Scene {
        match self {
            Self::BuiltIn => Scene::built_in(),
            Self::Sphere => Scene::sphere_of_normals(FEW_SEGMENTS),
            Self::OnGround { segments, is_glossy } => {
                let mut scene = Scene::sphere_of_normals(segments);
                if is_glossy {
                    let phong = Shading::Phong { specular: [0.3; 3], exponent: 30.0 };
                    scene.materials[0] = Material::new(phong, [0.4; 3]);
                }
                scene.add_ground();
                scene
            }
        }
    }
}

/// Lights, and how far they are from their map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    /// The list.
    pub lights: Vec<Light>,
    /// RMS of irradiance relative to the mean, of the lights that light everything.
    pub error: Option<f64>,
}

impl Lights {
    /// `count` lights as `run` makes them by default, from a first frame; the first `head_count`, which the
    /// others join, light everything, and the error is theirs.
    ///
    /// # Errors
    /// As [`Extractor::new`].
    pub fn with_head(map: &PolarMap, count: usize, head_count: usize) -> Result<Self> {
        let options = ExtractorOptions { count, ..ExtractorOptions::default() };
        let mut list = ReferencedList::default();
        Extractor::new(map.shape, &options)?.step(map, &mut list);
        let (mut head, mut error) = (Vec::new(), ListError::new());
        prefix(&list.list.lights, head_count, &mut head);
        let error = error.relative_error(&head, &list.reference_irradiance);
        Ok(Self { error: Some(f64::from(error)), lights: list.list.lights })
    }

    /// `count` lights that all light everything.
    ///
    /// # Errors
    /// As [`Extractor::new`].
    pub fn of_map(map: &PolarMap, count: usize) -> Result<Self> {
        Self::with_head(map, count, count)
    }

    /// `count` equal lights, even over the sphere, from no map.
    pub fn over_sphere(count: usize) -> Self {
        let lights = (0..).zip(fibonacci_sphere(count)).map(|(id, direction)| Light {
            id,
            direction: direction.as_vec3().to_array(),
            irradiance: [1.0 / count as f32; 3],
            spread_rad: 0.0,
        });
        Self { lights: lights.collect(), error: None }
    }
}

/// A row of a table before it is measured.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name, which says what is special about it.
    pub name: String,
    /// The scene.
    pub model: Model,
    /// The settings.
    pub options: Options,
    /// The lights.
    pub lights: Lights,
    /// The published or desired figure; may be empty.
    pub note: String,
}

fn sized(size: [u32; 2], directional: DirectionalOptions) -> Options {
    Options { width_px: size[0], height_px: size[1], directional, ..Options::default() }
}

fn case(name: impl Into<String>, segments: usize, options: Options, lights: Lights) -> Case {
    let model = Model::OnGround { segments, is_glossy: false };
    Case { name: name.into(), model, options, lights, note: String::new() }
}

/// 300 lights with and without angular regions on the sphere of normals.
pub fn culling() -> [Case; 2] {
    let lights = Lights::over_sphere(300);
    [("all lights", false), ("lights of the region", true)].map(|(name, culling)| Case {
        model: Model::Sphere,
        ..case(
            name,
            0,
            sized(SMALL, DirectionalOptions { lights: 300, culling, ..DirectionalOptions::default() }),
            lights.clone(),
        )
    })
}

/// 300 lights of a map, and the same in at most 72 and 24 clusters.
///
/// # Errors
/// As [`Extractor::new`].
pub fn clustering(map: &PolarMap) -> Result<[Case; 3]> {
    let lights = Lights::of_map(map, 300)?;
    let cases = [("300 lights", None), ("in at most 72 clusters", Some(72)), ("in at most 24", Some(24))];
    Ok(cases.map(|(name, clusters)| Case {
        model: Model::BuiltIn,
        ..case(
            name,
            0,
            sized(
                SMALL,
                DirectionalOptions { lights: 300, cone_rad: 0.0, clusters, ..DirectionalOptions::default() },
            ),
            lights.clone(),
        )
    }))
}

/// 16 thousand triangles, 72 lights and 320 x 240 pixels, and from there more triangles, lights or pixels.
///
/// # Errors
/// As [`Extractor::new`].
pub fn growth(map: &PolarMap) -> Result<Vec<Case>> {
    let few = Lights::of_map(map, 72)?;
    let mut cases = vec![
        case("to compare with", FEW_SEGMENTS, sized(SMALL, DirectionalOptions::default()), few.clone()),
        case("triangles", MANY_SEGMENTS, sized(SMALL, DirectionalOptions::default()), few.clone()),
    ];
    for count in [300, 2000] {
        let options = sized(SMALL, DirectionalOptions { lights: count, ..DirectionalOptions::default() });
        cases.push(case("lights", FEW_SEGMENTS, options, Lights::of_map(map, count)?));
    }
    for size in [[640, 480], [1280, 720], [1920, 1080]] {
        cases.push(case("pixels", FEW_SEGMENTS, sized(size, DirectionalOptions::default()), few.clone()));
    }
    Ok(cases)
}

/// The settings of the paper's section 6 and of its figure 7, with the published figures of METHODS section
/// 11; the paper has hard shadows.
///
/// # Errors
/// As [`Extractor::new`].
pub fn paper(map: &PolarMap) -> Result<Vec<Case>> {
    let (few, many) = (
        Lights::of_map(map, 72)?,
        Lights::with_head(map, GLOSSY_LIGHTS, DirectionalOptions::default().lights)?,
    );
    let hard = DirectionalOptions { soft_samples: 1, ..DirectionalOptions::default() };
    let rows = [
        ("Lambert, no regions", false, false, few.clone(), "7 Hz"),
        ("Lambert", false, true, few, "70 % faster: 12 Hz"),
        ("glossy, 72 and 1152 lights", true, true, many, "3.9 Hz no regions, 5.3 Hz figure 7"),
    ];
    Ok(rows
        .into_iter()
        .map(|(name, is_glossy, culling, lights, note)| Case {
            model: Model::OnGround { segments: FEW_SEGMENTS, is_glossy },
            note: note.to_owned(),
            ..case(name, 0, sized(SMALL, DirectionalOptions { culling, ..hard }), lights)
        })
        .collect())
}

/// What a GPU of today should do: 1920 x 1080 with 72 lights above 240 Hz and with 300 above 60 Hz.
///
/// # Errors
/// As [`Extractor::new`].
pub fn full_size(map: &PolarMap) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for (count, aim) in [(72, "240 Hz"), (300, "60 Hz")] {
        let lights = Lights::of_map(map, count)?;
        for (shadows, soft_samples) in [("hard", 1), ("soft", DirectionalOptions::default().soft_samples)] {
            let options = sized(
                [1920, 1080],
                DirectionalOptions { lights: count, soft_samples, ..DirectionalOptions::default() },
            );
            cases.push(Case {
                note: aim.to_owned(),
                ..case(format!("{shadows} shadows"), FEW_SEGMENTS, options, lights.clone())
            });
        }
    }
    Ok(cases)
}

/// A substitute for a panorama where there is none: a bright sky with a window of lamps.
pub fn made_up_map() -> PolarMap {
    PolarMap::from_fn(SHAPE, |row, column| {
        let is_lamp = (30..50).contains(&row) && column % 90 < 20;
        if is_lamp { [60.0, 54.0, 42.0] } else { [0.6, 0.8, 1.0 + 0.01 * row as f32] }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(model: Model) -> usize {
        let scene = model.scene();
        scene.instances.iter().map(|instance| scene.meshes[instance.mesh].indices.len() / 3).sum()
    }

    #[test]
    fn spheres_have_as_many_triangles_as_the_tables_say() {
        // Two for each cell of n by n / 2 steps, one at the poles: n^2 - 2 n. Two of the ground.
        let on_ground = |segments| triangles(Model::OnGround { segments, is_glossy: true });
        assert_eq!(on_ground(FEW_SEGMENTS), 128 * 126 + 2);
        assert_eq!(on_ground(MANY_SEGMENTS), 896 * 894 + 2);
        assert_eq!(triangles(Model::Sphere), 16_128);
        let glossy = Model::OnGround { segments: 8, is_glossy: true }.scene();
        assert!(matches!(glossy.materials[0].shading, Shading::Phong { specular, .. } if specular[0] > 0.0));
        assert_eq!(glossy.materials[1], Material::lambert([0.5; 3]));
    }

    #[test]
    fn lists_have_the_power_and_the_number_of_lights_that_is_asked_for() {
        let even = Lights::over_sphere(300).lights;
        assert!((even.iter().map(|light| light.irradiance[0]).sum::<f32>() - 1.0).abs() < 1e-5);
        assert!(even.iter().zip(0..).all(|(light, id)| light.id == id));
        let map = made_up_map();
        let (few, many) = (Lights::of_map(&map, 72).unwrap(), Lights::of_map(&map, 300).unwrap());
        assert_eq!((few.lights.len(), many.lights.len()), (72, 300));
        assert!(many.error < few.error && few.error < Some(0.05), "{:?} {:?}", few.error, many.error);
        let head = Lights::with_head(&map, 300, 72).unwrap();
        assert_eq!(head.lights, many.lights);
        assert!(head.error > many.error && head.error < Some(0.05), "{:?} {:?}", head.error, many.error);
    }

    #[test]
    fn every_case_is_one_that_a_device_accepts() {
        let map = made_up_map();
        let cases = [growth(&map), paper(&map), full_size(&map)].map(Result::unwrap).concat();
        assert_eq!(cases.len(), 7 + 3 + 4);
        for Case { name, options, lights, .. } in cases {
            assert!(options.directional.lights <= lights.lights.len(), "{name}");
            assert!(
                lights.lights.len() == options.directional.lights || name.starts_with("glossy"),
                "{name}"
            );
        }
    }
}
