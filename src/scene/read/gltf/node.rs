//! What nodes of glTF files say of themselves: transforms, roles, cameras.

use crate::error::{Error, Result};
use crate::scene::{Camera, Instance, Pose, Roles, Scene, Transform};
use glam::{Mat4, Quat, Vec3, Vec4};

/// A node's transform.
pub(super) fn transform(node: &gltf::Node) -> Result<Transform> {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => {
            let matrix = Mat4::from_cols_array_2d(&matrix);
            if matrix.is_finite() && matrix.row(3) == Vec4::W {
                return Ok(Transform::Matrix(matrix));
            }
            Err(Error::usage("is damaged: its matrix is not affine (bottom row 0, 0, 0, 1) or not finite"))
        }
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            let (translation, scale) = (Vec3::from(translation), Vec3::from(scale));
            match Vec4::from(rotation).try_normalize() {
                Some(rotation) if translation.is_finite() && scale.is_finite() => {
                    Ok(Transform::Trs { translation, rotation: Quat::from_vec4(rotation), scale })
                }
                _ => Err(Error::usage(
                    "is damaged: translation or scale not finite, or rotation of length zero",
                )),
            }
        }
    }
}

/// The roles that a node's extras give to it and all nodes below it: `{"lightcast": {"roles": ["seen",
/// "casts", "receives"]}}` with the roles that it plays; `None` where the extras do not name any. Extras of
/// other programs are ignored.
pub(super) fn own_roles(node: &gltf::Node) -> Result<Option<Roles>> {
    let Some(extras) = node.extras() else { return Ok(None) };
    let Ok(extras) = serde_json::from_str::<serde_json::Value>(extras.get()) else { return Ok(None) };
    let Some(roles) = extras.get("lightcast").and_then(|ours| ours.get("roles")) else { return Ok(None) };
    let names: Option<Vec<&str>> =
        roles.as_array().and_then(|names| names.iter().map(serde_json::Value::as_str).collect());
    let outcome = match names {
        Some(names) => Roles::of_names(names),
        None => Err(Error::usage("is no list of names, such as [\"casts\"]")),
    };
    outcome.map(Some).map_err(|error| error.at("extras.lightcast.roles"))
}

/// The first node of the tree with a perspective camera, as it stands at time 0.
pub(super) fn camera(gltf: &gltf::Document, places: &[Option<usize>], scene: &Scene) -> Option<Camera> {
    let (node, (fov, near)) = gltf.nodes().find_map(|node| {
        let place = places[node.index()]?;
        match node.camera()?.projection() {
            gltf::camera::Projection::Perspective(perspective) => {
                Some((place, (perspective.yfov(), perspective.znear())))
            }
            gltf::camera::Projection::Orthographic(_) => None,
        }
    })?;
    let mut pose = Pose::default();
    scene.pose(0.0, &mut pose);
    let centre = scene.bounds(&pose).centre();
    // The same tree with the camera as its only instance.
    let at_node = Scene {
        nodes: scene.nodes.clone(),
        channels: scene.channels.clone(),
        instances: vec![Instance { mesh: 0, node, roles: Roles::NONE }],
        ..Scene::default()
    };
    at_node.pose(0.0, &mut pose);
    let matrix = pose.world_from_mesh()[0];
    let eye = matrix.w_axis.truncate();
    let forward = (-matrix.z_axis.truncate()).try_normalize()?;
    let up = matrix.y_axis.truncate().try_normalize()?;
    let is_sound = fov > 0.0 && fov < std::f32::consts::PI && near > 0.0 && near.is_finite();
    // The target: the point of the optical axis that is nearest to the centre of the scene.
    let ahead = forward.dot(centre - eye);
    let distance = if ahead > near && ahead.is_finite() { ahead } else { near.max(1.0) };
    is_sound.then(|| Camera { eye, target: eye + forward * distance, up, vertical_fov_rad: fov, near })
}
