use super::*;
use glam::{DMat4, DVec3, Mat4, Quat, Vec3};

/// A strip along +Y of `rows` x 2 vertices, bent by two joints, the second at height 1, and drawn twice as
/// wide by a target; its instance stands at a node that is 100 m away, which counts for nothing.
fn strip(rows: usize) -> Scene {
    let corners = (0..2 * rows).map(|i| Vertex {
        position: [(i % 2) as f32 - 0.5, 2.0 * (i / 2) as f32 / (rows - 1) as f32, 0.0],
        normal: [0.0, 0.0, 1.0],
        ..Vertex::default()
    });
    let vertices: Vec<Vertex> = corners.collect();
    let triangles = (0..2 * (rows as u32 - 1)).map(|i| [i, i + 1 + i % 2, i + 2 - i % 2]);
    let influences = vertices.iter().flat_map(|vertex| {
        let second = (0.5 * vertex.position[1]).clamp(0.0, 1.0);
        [Influence { joint: 0, weight: 1.0 - second }, Influence { joint: 1, weight: second }]
    });
    let target = MorphTarget {
        positions: vertices.iter().map(|vertex| Vec3::X * vertex.position[0]).collect(),
        normals: vertices.iter().map(|vertex| Vec3::X * vertex.position[0]).collect(),
    };
    let node = Node { parent: None, transform: Transform::IDENTITY };
    let at = |y: f32| Transform::Trs {
        translation: Vec3::new(0.0, y, 0.0),
        rotation: Quat::IDENTITY,
        scale: Vec3::ONE,
    };
    let joint =
        |node, y: f32| Joint { node, joint_from_mesh: Mat4::from_translation(Vec3::new(0.0, -y, 0.0)) };
    Scene {
        deformations: vec![Deformation {
            influences: influences.collect(),
            targets: vec![target],
            is_flat: false,
        }],
        skins: vec![Skin { joints: vec![joint(0, 0.0), joint(1, 1.0)] }],
        figures: vec![Figure { instance: 0, deformation: 0, skin: Some(0), weights: vec![0.0] }],
        nodes: vec![
            node,
            Node { parent: Some(0), transform: at(1.0) },
            Node { parent: None, transform: at(100.0) },
        ],
        instances: vec![Instance { mesh: 0, node: 2, roles: Roles::ALL }],
        channels: vec![
            channel(1, Keys::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_x(1.5)])),
            channel(2, Keys::Weights(vec![0.0, 2.0])),
        ],
        meshes: vec![Mesh::new(vertices, triangles.flatten().collect(), 0)],
        ..Scene::default()
    }
}

fn channel(node: usize, keys: Keys) -> Channel {
    Channel { node, duration_s: 2.0, interpolation: Interpolation::Linear, times_s: vec![0.0, 2.0], keys }
}

fn posed(scene: &Scene, time_s: f64) -> Pose {
    let mut pose = Pose::default();
    scene.pose(time_s, &mut pose);
    pose
}

#[test]
fn vertices_follow_their_joints_and_targets_as_the_definition_says() {
    let scene = strip(9);
    for time in [0.0_f64, 0.3, 1.0, 1.9] {
        let pose = posed(&scene, time);
        assert_eq!((pose.world_from_mesh(), pose.vertices().len()), (&[Mat4::IDENTITY][..], 18));
        let bent = DMat4::from_translation(DVec3::Y)
            * DMat4::from_rotation_x(0.75 * time)
            * DMat4::from_translation(-DVec3::Y);
        let mut expected_bounds = Bounds::EMPTY;
        for (vertex, rest) in pose.vertices().iter().zip(&scene.meshes[0].vertices) {
            let [x, y, _] = rest.position.map(f64::from);
            let morphed = DVec3::new(x + time * x, y, 0.0);
            let second = 0.5 * y;
            let matrix = DMat4::IDENTITY * (1.0 - second) + bent * second;
            let expected = matrix.transform_point3(morphed).as_vec3();
            assert!(Vec3::from(vertex.position).abs_diff_eq(expected, 1e-5), "{time}: {vertex:?} {expected}");
            let normal = matrix.inverse().transpose().transform_vector3(DVec3::new(time * x, 0.0, 1.0));
            let normal = normal.normalize_or_zero().as_vec3();
            assert!(Vec3::from(vertex.normal).abs_diff_eq(normal, 1e-5), "{time}: {vertex:?} {normal}");
            expected_bounds = expected_bounds.union(&Bounds::of([expected]));
        }
        let bounds = scene.caster_bounds(&pose);
        assert!(bounds.min.abs_diff_eq(expected_bounds.min, 1e-5), "{bounds:?} {expected_bounds:?}");
        assert!(bounds.max.abs_diff_eq(expected_bounds.max, 1e-5), "{bounds:?} {expected_bounds:?}");
    }
}

#[test]
fn poses_need_no_memory_after_the_first() {
    let scene = strip(100);
    let mut pose = posed(&scene, 0.0);
    let place = pose.vertices().as_ptr();
    for frame in 0..100 {
        scene.pose(0.1 * f64::from(frame), &mut pose);
        assert_eq!((pose.vertices().as_ptr(), pose.vertices().len()), (place, 200));
    }
    assert_eq!(pose.vertices_of(&scene, 0).as_ptr(), place);
}

#[test]
fn without_a_skin_a_figure_stays_at_its_node_and_follows_its_targets_alone() {
    let mut scene = strip(3);
    scene.figures[0].skin = None;
    let pose = posed(&scene, 1.0);
    assert_eq!(pose.world_from_mesh()[0], Mat4::from_translation(Vec3::new(0.0, 100.0, 0.0)));
    assert_eq!(pose.vertices()[1].position, [1.0, 0.0, 0.0]);
    assert_eq!(scene.bounds(&pose).max, Vec3::new(1.0, 102.0, 0.0));
    // A second instance of the mesh, which is rigid.
    scene.instances.insert(0, Instance { mesh: 0, node: 0, roles: Roles::ALL });
    scene.figures[0].instance = 1;
    let pose = posed(&scene, 1.0);
    assert_eq!(pose.vertices_of(&scene, 0), scene.meshes[0].vertices);
    assert_eq!(pose.vertices_of(&scene, 1)[1].position, [1.0, 0.0, 0.0]);
    assert_eq!(
        scene.bounds(&pose),
        Bounds { min: Vec3::new(-1.0, 0.0, 0.0), max: Vec3::new(1.0, 102.0, 0.0) }
    );
}

#[test]
fn flat_triangles_stay_flat() {
    let mut scene = strip(3);
    let (vertices, indices) = normals::flat(&scene.meshes[0].vertices, &scene.meshes[0].indices);
    let corners = scene.meshes[0].indices.clone();
    scene.deformations[0] = Deformation { is_flat: true, ..scene.deformations[0].of_corners(6, &corners) };
    scene.meshes[0] = Mesh::new(vertices, indices, 0);
    let pose = posed(&scene, 1.9);
    assert_eq!(pose.vertices().len(), 12);
    for triangle in pose.vertices().as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(|corner| Vec3::from(corner.position));
        let normal = (b - a).cross(c - a).normalize_or_zero();
        assert!(triangle.iter().all(|corner| Vec3::from(corner.normal).abs_diff_eq(normal, 1e-5)));
    }
}

#[test]
fn what_overflows_is_not_drawn() {
    let mut scene = strip(3);
    scene.channels[1].keys = Keys::Weights(vec![0.0, f32::MAX]);
    for target in &mut scene.deformations[0].targets {
        target.positions.iter_mut().for_each(|delta| *delta *= 1e30);
    }
    let pose = posed(&scene, 1.0);
    assert_eq!(pose.world_from_mesh(), [Mat4::ZERO]);
    assert_eq!((pose.vertices(), scene.bounds(&pose)), (&scene.meshes[0].vertices[..], Bounds::EMPTY));

    let mut scene = strip(3);
    scene.channels.clear();
    let huge = Transform::Matrix(Mat4::from_scale(Vec3::splat(1e30)));
    (scene.nodes[0].transform, scene.nodes[1].transform) = (huge, huge);
    assert_eq!(posed(&scene, 0.0).world_from_mesh(), [Mat4::ZERO]);
    // A joint that flattens everything loses normals, which stay as they were.
    let flat = Transform::Matrix(Mat4::from_scale(Vec3::ZERO));
    (scene.nodes[0].transform, scene.nodes[1].transform) = (flat, flat);
    let pose = posed(&scene, 0.0);
    assert!(
        pose.vertices().iter().all(|vertex| vertex.position == [0.0; 3] && vertex.normal == [0.0, 0.0, 1.0])
    );
}

#[test]
fn splines_of_weights_keep_the_targets_apart() {
    let mut channel = channel(0, Keys::Weights(Vec::new()));
    channel.interpolation = Interpolation::CubicSpline;
    // In-tangents, values and out-tangents of two targets; without tangents a spline is half-way in the
    // middle.
    let key = |values: [f32; 2]| [[0.0; 2], values, [0.0; 2]].concat();
    channel.keys = Keys::Weights([key([0.0, 10.0]), key([1.0, 30.0])].concat());
    let mut weights = [7.0; 3];
    channel.apply_weights(1.0, &mut weights);
    assert_eq!(weights, [0.5, 20.0, 7.0]);
    channel.apply_weights(f64::MAX, &mut weights[..1]);
    assert!(weights[0].is_finite());
}
