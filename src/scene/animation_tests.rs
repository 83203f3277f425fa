use super::*;
use glam::{Mat4, Quat, Vec3};
use std::f32::consts::PI;

fn scene(interpolation: Interpolation, times_s: &[f32], keys: Keys) -> Scene {
    let node = Node { parent: None, transform: Transform::IDENTITY };
    Scene {
        nodes: vec![node, Node { parent: Some(0), ..node }],
        instances: vec![Instance { mesh: 0, node: 1, roles: Roles::ALL }],
        channels: vec![Channel {
            node: 1,
            duration_s: *times_s.last().unwrap(),
            interpolation,
            times_s: times_s.to_vec(),
            keys,
        }],
        ..Scene::default()
    }
}

fn at(scene: &Scene, time_s: f64) -> Mat4 {
    let mut pose = Pose::default();
    scene.pose(time_s, &mut pose);
    assert_eq!(pose.world_from_mesh().len(), scene.instances.len());
    pose.world_from_mesh()[0]
}

fn moved(scene: &Scene, time_s: f64) -> f32 {
    at(scene, time_s).w_axis.x
}

#[test]
fn steps_and_lines_stay_before_the_first_key_and_start_again_after_the_last() {
    let keys = || Keys::Translation([3.0, 5.0, 1.0].map(|x| Vec3::new(x, 0.0, 0.0)).to_vec());
    let step = scene(Interpolation::Step, &[1.0, 2.0, 4.0], keys());
    let line = scene(Interpolation::Linear, &[1.0, 2.0, 4.0], keys());
    assert_eq!((step.duration_s(), step.is_animated()), (4.0, true));
    for (time, stepped, straight) in [
        (0.0, 3.0, 3.0),
        (0.999, 3.0, 3.0),
        (1.0, 3.0, 3.0),
        (1.25, 3.0, 3.5),
        (2.0, 5.0, 5.0),
        (3.5, 5.0, 2.0),
        (4.0, 3.0, 3.0),
        (4.0e9 + 1.25, 3.0, 3.5),
        (-0.5, 5.0, 2.0),
        (f64::NAN, 3.0, 3.0),
        (f64::INFINITY, 3.0, 3.0),
    ] {
        assert_eq!((moved(&step, time), moved(&line, time)), (stepped, straight), "{time}");
    }
}

#[test]
fn rotations_take_the_shorter_arc_at_constant_speed() {
    let end = Quat::from_rotation_y(0.75 * PI);
    for end in [end, -end] {
        let turning = scene(Interpolation::Linear, &[0.0, 3.0], Keys::Rotation(vec![Quat::IDENTITY, end]));
        for (time, angle) in [(0.0, 0.0), (1.0, 0.25), (1.5, 0.375), (2.5, 0.625)] {
            let expected = Mat4::from_rotation_y(angle * PI);
            assert!(at(&turning, time).abs_diff_eq(expected, 1e-6), "{time}");
        }
    }
}

#[test]
fn cubic_splines_keep_to_the_polynomial_that_their_tangents_define() {
    // x = t^3 - 2 t + 1 between unequal keys is a cubic, which the Hermite form reproduces exactly.
    let (value, slope) = (|t: f32| t * t * t - 2.0 * t + 1.0, |t: f32| 3.0 * t * t - 2.0);
    let times = [0.5, 1.0, 3.0];
    let keys = times.iter().flat_map(|&t| [slope(t), value(t), slope(t)].map(|x| Vec3::new(x, -x, 7.0 * x)));
    let spline = scene(Interpolation::CubicSpline, &times, Keys::Scale(keys.collect()));
    for t in [0.5_f32, 0.6, 0.75, 1.0, 1.1, 2.0, 2.75] {
        let matrix = at(&spline, f64::from(t));
        assert!((matrix.x_axis.x - value(t)).abs() < 1e-4, "{t}: {matrix}");
        assert!((matrix.z_axis.z - 7.0 * value(t)).abs() < 1e-3);
    }
    assert_eq!(at(&spline, 0.0).x_axis.x, value(0.5));

    // With zero tangents a rotation is eased, and it has unit length throughout.
    let quarter = Quat::from_rotation_z(0.5 * PI);
    let zero = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let keys = Keys::Rotation(vec![zero, Quat::IDENTITY, zero, zero, quarter, zero]);
    let eased = scene(Interpolation::CubicSpline, &[0.0, 1.0], keys);
    assert!(at(&eased, 0.5).abs_diff_eq(Mat4::from_rotation_z(0.25 * PI), 1e-6));
    for time in [0.1, 0.3, 0.7, 0.9] {
        assert!((at(&eased, time).determinant() - 1.0).abs() < 1e-5);
    }
    // A spline through zero has no direction there.
    let keys = Keys::Rotation(vec![zero, Quat::IDENTITY, zero, zero, -Quat::IDENTITY, zero]);
    assert_eq!(at(&scene(Interpolation::CubicSpline, &[0.0, 1.0], keys), 0.5), Mat4::IDENTITY);
}

#[test]
fn parents_carry_their_children_and_of_two_channels_the_later_one_wins() {
    let mut tree = scene(Interpolation::Step, &[0.0], Keys::Translation(vec![Vec3::X]));
    tree.nodes[0].transform = Transform::Matrix(Mat4::from_rotation_z(0.5 * PI));
    assert!(at(&tree, 9.0).transform_point3(Vec3::ZERO).abs_diff_eq(Vec3::Y, 1e-6));
    let mut second = tree.channels[0].clone();
    second.keys = Keys::Translation(vec![2.0 * Vec3::X]);
    tree.channels.push(second);
    assert!(at(&tree, 0.0).transform_point3(Vec3::ZERO).abs_diff_eq(2.0 * Vec3::Y, 1e-6));
    // A channel to a matrix changes nothing.
    tree.nodes[1].transform = Transform::Matrix(Mat4::IDENTITY);
    assert!(at(&tree, 0.0).transform_point3(Vec3::ZERO).abs_diff_eq(Vec3::ZERO, 1e-6));
}

#[test]
fn animations_of_different_durations_go_round_each_for_itself() {
    let mut two =
        scene(Interpolation::Linear, &[0.0, 2.0], Keys::Translation(vec![Vec3::ZERO, 2.0 * Vec3::X]));
    let mut other = two.channels[0].clone();
    (other.duration_s, other.times_s[1]) = (3.0, 3.0);
    other.keys = Keys::Scale(vec![Vec3::ONE, 4.0 * Vec3::ONE]);
    two.channels.push(other);
    assert_eq!(two.duration_s(), 3.0);
    let matrix = at(&two, 2.5);
    assert!((matrix.w_axis.x - 0.5).abs() < 1e-6 && (matrix.x_axis.x - 3.5).abs() < 1e-6, "{matrix}");
}

#[test]
fn what_overflows_is_not_drawn_and_poses_need_no_memory_after_the_first() {
    let mut huge = scene(Interpolation::Step, &[0.0], Keys::Scale(vec![Vec3::splat(1e30)]));
    huge.nodes[0].transform = Transform::Matrix(Mat4::from_scale(Vec3::splat(1e30)));
    assert_eq!(at(&huge, 0.0), Mat4::ZERO);
    huge.meshes.push(Mesh { bounds: Bounds::of([Vec3::ZERO, Vec3::ONE]), ..Mesh::default() });
    let mut poses = Pose::default();
    huge.pose(0.0, &mut poses);
    assert_eq!(huge.bounds(&poses), Bounds::EMPTY);
    let place = poses.world_from_mesh().as_ptr();
    for time in 0..100 {
        huge.pose(f64::from(time), &mut poses);
        assert_eq!((poses.world_from_mesh().as_ptr(), poses.world_from_mesh().len()), (place, 1));
    }
}
