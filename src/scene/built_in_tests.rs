use super::*;
use crate::scene::mesh::{corners, double_area};
use glam::{DVec3, Mat4, Vec3};
use lightcast_core::test_data::real_folder;

/// Asserts that every index is in range, every normal has length 1 and every triangle has an area.
pub(super) fn assert_sound(scene: &Scene) {
    for mesh in &scene.meshes {
        assert!(mesh.material < scene.materials.len());
        assert!(!mesh.indices.is_empty() && mesh.indices.len() % 3 == 0);
        for vertex in &mesh.vertices {
            assert!((Vec3::from(vertex.normal).length() - 1.0).abs() < 1e-5, "{vertex:?}");
            assert!(vertex.position.iter().chain(&vertex.uv).all(|x| x.is_finite()));
            assert!(vertex.colour.iter().all(|x| (0.0..=1.0).contains(x)));
        }
        for triangle in mesh.indices.as_chunks().0 {
            assert!(double_area(corners(&mesh.vertices, *triangle)) != DVec3::ZERO);
        }
    }
    for (number, node) in scene.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|parent| parent < number));
    }
    assert!(scene.instances.iter().all(|i| i.mesh < scene.meshes.len() && i.node < scene.nodes.len()));
    assert!(scene.channels.is_sorted_by_key(|channel| channel.node));
    for texture in &scene.textures {
        assert_eq!(texture.rgba8.len(), 4 * texture.width as usize * texture.height as usize);
    }
}

/// Smallest cosine between a triangle's own normal and those of its corners.
fn worst_agreement(mesh: &Mesh) -> f64 {
    let mut worst = f64::INFINITY;
    for triangle in mesh.indices.as_chunks().0 {
        let normal = double_area(corners(&mesh.vertices, *triangle)).try_normalize().unwrap();
        for index in triangle {
            let own = DVec3::from(mesh.vertices[*index as usize].normal.map(f64::from));
            worst = worst.min(normal.dot(own));
        }
    }
    worst
}

#[test]
fn built_in_objects_are_sound_face_outwards_and_rest_on_the_ground() {
    let scene = Scene::built_in();
    assert_sound(&scene);
    assert_eq!(scene.meshes.len(), 3);
    // A vertex's normal differs by half a step from those of its triangles: 3.75 degrees on the sphere, 9 on
    // the tube.
    let agreement: Vec<f64> = scene.meshes.iter().map(worst_agreement).collect();
    assert!(agreement[0] > 0.93 && agreement[1] > 0.99 && agreement[2] == 1.0, "{agreement:?}");
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
    assert!((4_000..12_000).contains(&triangles), "{triangles}");

    let mut poses = Pose::default();
    scene.pose(0.0, &mut poses);
    let boxes: Vec<Bounds> =
        (0..3).map(|i| scene.meshes[i].bounds.transformed(&poses.world_from_mesh()[i])).collect();
    assert!(boxes.iter().all(|b| b.min.y.abs() < 1e-6), "{boxes:?}");
    assert!(boxes[0].max.x < boxes[1].min.x, "the objects do not touch");
    assert!(scene.instances.iter().map(|i| i.roles.casts).eq([true, true, false]));
    let casters = scene.caster_bounds(&poses);
    assert_eq!(casters, boxes[0].union(&boxes[1]));
    assert!(boxes[2].max.x - boxes[2].min.x >= 8.0 * (casters.max.x - casters.min.x) * 0.999);
    eprintln!("built in: {triangles} triangles, casters {casters:?}");
}

#[test]
fn the_seams_of_closed_surfaces_are_closed() {
    let scene = Scene::built_in();
    for mesh in &scene.meshes[..2] {
        // The vector areas of a closed surface add up to zero; a gap would leave its own vector area.
        let indices = mesh.indices.as_chunks().0;
        let areas: Vec<DVec3> = indices.iter().map(|t| double_area(corners(&mesh.vertices, *t))).collect();
        let total: f64 = areas.iter().map(|area| area.length()).sum();
        assert!(areas.iter().sum::<DVec3>().length() < 1e-5 * total);
    }
}

#[test]
fn the_sphere_of_normals_has_a_triangle_for_every_direction() {
    let scene = Scene::sphere_of_normals(64);
    assert_sound(&scene);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.indices.len() / 3, 2 * 64 * 32 - 2 * 64);
    let bounds = mesh.bounds;
    assert!(
        bounds.max.abs_diff_eq(Vec3::ONE, 1e-6) && bounds.min.abs_diff_eq(-Vec3::ONE, 1e-6),
        "{bounds:?}"
    );
    for direction in lightcast_core::math::fibonacci_sphere(500) {
        let nearest = mesh
            .indices
            .as_chunks()
            .0
            .iter()
            .filter_map(|triangle| double_area(corners(&mesh.vertices, *triangle)).try_normalize())
            .map(|normal| normal.dot(direction))
            .fold(-1.0, f64::max);
        assert!(nearest > (0.08_f64).cos(), "{direction} {nearest}");
    }
    assert_sound(&Scene::sphere_of_normals(0));
}

#[test]
fn a_ground_lies_under_what_moves_and_under_nothing() {
    let mut empty = Scene::default();
    empty.add_ground();
    assert_eq!(
        empty.meshes[0].bounds,
        Bounds { min: Vec3::new(-4.0, 0.0, -4.0), max: Vec3::new(4.0, 0.0, 4.0) }
    );

    let mut scene = Scene::sphere_of_normals(16);
    scene.channels.push(Channel {
        node: 0,
        duration_s: 2.0,
        interpolation: Interpolation::Linear,
        times_s: vec![0.0, 1.0, 2.0],
        keys: Keys::Translation(vec![Vec3::ZERO, Vec3::new(3.0, -5.0, 0.0), Vec3::ZERO]),
    });
    scene.add_ground();
    let ground = scene.meshes[1].bounds;
    assert!((ground.min.y + 6.0).abs() < 1e-5 && ground.max.y == ground.min.y);
    assert!((ground.centre().x - 1.5).abs() < 1e-5 && (ground.half_extents().x - 4.0 * 5.0).abs() < 1e-4);
    assert!(!scene.instances[1].roles.casts);
    let mut poses = Pose::default();
    scene.pose(1.0, &mut poses);
    assert_eq!(poses.world_from_mesh()[1], Mat4::IDENTITY);
}

#[test]
fn real_meshes_have_the_counts_that_are_known_of_them() {
    let Some(folder) = real_folder("mesh") else { return };
    // Vertices and triangles as listed in SOURCES.md. `spot.obj` has 2930 positions and 3225 texture
    // coordinates.
    for (name, vertices, triangles) in [
        ("bunny.glb", 3161, 5696),
        ("spot.obj", 3225, 5856),
        ("stanford-bunny.obj", 34_834, 69_451),
        ("teapot.obj", 3644, 6320),
        ("cube.gltf", 24, 12),
    ] {
        let scene = Scene::load(&folder.join(name)).unwrap();
        assert_sound(&scene);
        let mut poses = Pose::default();
        scene.pose(0.0, &mut poses);
        let bounds = scene.bounds(&poses);
        let agreement = scene.meshes.iter().map(worst_agreement).fold(1.0, f64::min);
        eprintln!("{name}: {bounds:?}, worst agreement of normals {agreement:.3}, notes {:?}", scene.notes);
        eprintln!("{name}: {:?}, {} textures, {:?}", scene.materials, scene.textures.len(), scene.camera);
        let total: usize = scene.meshes.iter().map(|mesh| mesh.vertices.len()).sum();
        let dropped: usize = scene
            .notes
            .iter()
            .filter_map(|note| {
                note.split_once(" triangles without area")?.0.rsplit(' ').next()?.parse::<usize>().ok()
            })
            .sum();
        let kept: usize = scene.meshes.iter().map(|mesh| mesh.indices.len() / 3).sum();
        eprintln!("{name}: {total} vertices, {kept} + {dropped} triangles");
        assert_eq!(kept + dropped, triangles, "{name}");
        assert_eq!(total, vertices, "{name}");
        // Faces point outwards: the volume that they enclose, holes or not, is positive.
        let volume: f64 = scene
            .meshes
            .iter()
            .flat_map(|mesh| mesh.indices.as_chunks().0.iter().map(|t| corners(&mesh.vertices, *t)))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        let half = bounds.half_extents();
        let part = volume / f64::from(8.0 * half.x * half.y * half.z);
        assert!((0.1..=1.0 + 1e-6).contains(&part), "{name}: {part} of its box");
    }
}
