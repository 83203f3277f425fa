//! Polygons to triangles, for readers whose files have faces of any number of corners.

use glam::{DVec2, DVec3};

/// Most tests of a corner against a triangle for one polygon: ear clipping takes the square of the number of
/// corners as a rule, and its cube at worst.
const TESTS_MAX: usize = 20_000_000;

/// Cuts the polygons of a file, and counts those that are not what they should be.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    /// Left out, as a corner is not finite.
    not_finite: usize,
    /// Not covered once, as they cross themselves or are too large to be cut.
    crossed: usize,
}

impl Polygons {
    /// Appends the triangles of the polygon with these corners, whose positions are `at`, to `indices`. A
    /// convex polygon becomes a fan from its first corner. Any other that does not cross itself is cut by its
    /// ears (Meisters 1975), seen along its mean normal (Newell), so that its triangles cover it once. One
    /// that crosses itself has no inside: its triangles are those of ears as well, as long as there are any,
    /// and what is left is a fan. A polygon with a corner that is not finite is left out.
    pub fn cut(&mut self, polygon: &[u32], at: impl Fn(u32) -> [f32; 3], indices: &mut Vec<u32>) {
        if polygon.iter().any(|&index| at(index).iter().any(|value| !value.is_finite())) {
            self.not_finite += 1;
            return;
        }
        // Most faces are triangles.
        if polygon.len() < 4 {
            indices.extend(if polygon.len() == 3 { polygon } else { &[] });
            return;
        }
        let corners: Vec<DVec3> =
            polygon.iter().map(|&index| DVec3::from(at(index).map(f64::from))).collect();
        let mut triangle = |[a, b, c]: [usize; 3]| indices.extend([polygon[a], polygon[b], polygon[c]]);
        let flat = flat(&corners);
        let fan = (1..polygon.len() - 1).map(|second| [0, second, second + 1]);
        if is_convex(&flat) {
            fan.for_each(triangle);
        } else if !clip_ears(&flat, &mut triangle) {
            self.crossed += 1;
        }
    }

    /// What has been found, for the user.
    pub fn notes(&self, notes: &mut Vec<String>) {
        if self.not_finite > 0 {
            notes.push(format!("{} faces have corners that are not finite; left out", self.not_finite));
        }
        if self.crossed > 0 {
            notes.push(format!(
                "{} faces cross themselves, or have too many corners to be cut; drawn as well as can be",
                self.crossed
            ));
        }
    }
}

/// The corners as seen along the axis that is nearest to the polygon's mean normal, counterclockwise in the
/// mean. Two coordinates of each are taken as they are, so that nothing is rounded.
fn flat(corners: &[DVec3]) -> Vec<DVec2> {
    let cross = |pair: &[DVec3]| (pair[0] - corners[0]).cross(pair[1] - corners[0]);
    let normal: DVec3 = corners.windows(2).map(cross).sum();
    // The halves of a bow tie cancel each other.
    let largest =
        || corners.windows(2).map(cross).max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let normal = if normal == DVec3::ZERO { largest().unwrap_or_default() } else { normal };
    let size = normal.abs();
    let (u, v) = match size.max_element() {
        most if most == size.x => (1, 2),
        most if most == size.y => (2, 0),
        _ => (0, 1),
    };
    let is_seen_from_behind = normal[3 - u - v] < 0.0;
    let (u, v) = if is_seen_from_behind { (v, u) } else { (u, v) };
    corners.iter().map(|corner| DVec2::new(corner[u], corner[v])).collect()
}

/// Twice the area of a triangle, above 0 where it runs counterclockwise.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a fan from the first corner covers the polygon once.
fn is_convex(corners: &[DVec2]) -> bool {
    let count = corners.len();
    let turns = (0..count).map(|i| turn(corners[i], corners[(i + 1) % count], corners[(i + 2) % count]));
    let fan = (1..count - 1).map(|i| turn(corners[0], corners[i], corners[i + 1]));
    turns.chain(fan).all(|turn| turn >= 0.0)
}

/// Cuts off one ear after another; false where none was found before the end and the rest became a fan, or
/// what is left is turned over, as of a polygon that crosses itself.
fn clip_ears(corners: &[DVec2], triangle: &mut impl FnMut([usize; 3])) -> bool {
    let mut rest: Vec<usize> = (0..corners.len()).collect();
    let mut tests_left = TESTS_MAX;
    // Neighbours of the last ear are tried last: thin fans about one corner would come of the first found.
    let mut start = 0;
    while rest.len() > 3 {
        let count = rest.len();
        let around =
            |place: usize| [(place + count - 1) % count, place, (place + 1) % count].map(|p| rest[p]);
        let found = (0..count).map(|step| (start + step) % count).find(|&place| {
            let [a, b, c] = around(place).map(|corner| corners[corner]);
            let size = turn(a, b, c);
            // A corner on the line between its neighbours can be taken off where they are at both sides of
            // it.
            if size == 0.0 {
                return (a - b).dot(c - b) <= 0.0 || a == b || b == c;
            }
            let own = around(place);
            size > 0.0 && {
                tests_left = tests_left.saturating_sub(count);
                rest.iter().filter(|corner| !own.contains(corner)).all(|&other| {
                    let p = corners[other];
                    // A corner at the same place as one of the ear's is one of a bridge to a hole.
                    p == a || p == b || p == c || !is_within([a, b, c], p)
                })
            }
        });
        let Some(place) = found.filter(|_| tests_left > 0) else {
            (1..count - 1).for_each(|second| triangle([rest[0], rest[second], rest[second + 1]]));
            return false;
        };
        let ear = around(place);
        triangle(ear);
        rest.remove(place);
        start = if place < rest.len() { place + 1 } else { 0 };
    }
    triangle([rest[0], rest[1], rest[2]]);
    let [a, b, c] = [rest[0], rest[1], rest[2]].map(|corner| corners[corner]);
    turn(a, b, c) >= 0.0
}

/// Whether a point lies in a counterclockwise triangle or on its edges.
fn is_within([a, b, c]: [DVec2; 3], p: DVec2) -> bool {
    turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, Vec3};
    use lightcast_core::test_data::noise;

    fn cut(corners: &[[f32; 3]]) -> (Vec<[u32; 3]>, Polygons) {
        let polygon: Vec<u32> = (0..corners.len() as u32).collect();
        let (mut polygons, mut indices) = (Polygons::default(), Vec::new());
        polygons.cut(&polygon, |index| corners[index as usize], &mut indices);
        (indices.as_chunks::<3>().0.to_vec(), polygons)
    }

    /// The sum of the triangles' areas, each counted as positive, and the length of the sum of their normals.
    fn areas(corners: &[[f32; 3]], triangles: &[[u32; 3]]) -> (f64, f64) {
        let normal = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|index| Vec3::from(corners[index as usize]).as_dvec3());
            0.5 * (b - a).cross(c - a)
        };
        (
            triangles.iter().map(|t| normal(t).length()).sum(),
            triangles.iter().map(normal).sum::<DVec3>().length(),
        )
    }

    #[test]
    fn convex_polygons_are_fans_from_their_first_corner() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(cut(&square).0, [[0, 1, 2], [0, 2, 3]]);
        let mut turned = square;
        turned.reverse();
        assert_eq!(cut(&turned).0, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(cut(&square[..3]).0, [[0, 1, 2]]);
        assert!(cut(&square[..2]).0.is_empty());
    }

    #[test]
    fn polygons_of_any_shape_are_covered_once_in_any_plane() {
        for case in 0..200 {
            let count = 4 + case % 40;
            let planar = |corner: u32| {
                let angle = f64::from(corner) / f64::from(count) * std::f64::consts::TAU;
                let radius = 0.05 + f64::from(noise((1000 * case + corner) as usize));
                DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
            };
            let turned =
                DMat3::from_rotation_x(f64::from(case)) * DMat3::from_rotation_y(2.3 * f64::from(case));
            let corners: Vec<[f32; 3]> =
                (0..count).map(|corner| (turned * planar(corner)).as_vec3().to_array()).collect();
            let shoelace: f64 = (0..count).map(|c| 0.5 * planar(c).cross(planar((c + 1) % count)).z).sum();
            let (triangles, polygons) = cut(&corners);
            let (sum, net) = areas(&corners, &triangles);
            assert_eq!((triangles.len(), polygons.crossed), (count as usize - 2, 0), "{case}");
            assert!(
                (sum / shoelace - 1.0).abs() < 1e-5 && (net / shoelace - 1.0).abs() < 1e-5,
                "{case}: {sum} {net}"
            );
        }
    }

    #[test]
    fn a_comb_a_hole_with_a_bridge_and_corners_on_edges() {
        // Teeth that no fan covers.
        let comb: Vec<[f32; 3]> = (0..20)
            .map(|i| [i as f32, if i % 2 == 0 { 0.0 } else { 9.0 }, 0.0])
            .chain([[19.0, -1.0, 0.0], [0.0, -1.0, 0.0]])
            .rev()
            .collect();
        // A square of 4 with a hole of 2, entered and left by the same edge.
        let hole = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ]
        .map(|[x, y]| [x, y, 0.0]);
        // An L with a corner in the middle of each side, and one twice.
        let corner = [
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
            [0.0, 1.0],
        ]
        .map(|[x, y]| [0.0, x, y]);
        for (name, corners, area) in [("hole", &hole[..], 12.0), ("corner", &corner[..], 3.0)] {
            let (triangles, polygons) = cut(corners);
            let (sum, net) = areas(corners, &triangles);
            assert!((sum - area).abs() < 1e-9 && (net - area).abs() < 1e-9, "{name}: {sum} {net}");
            assert_eq!(polygons.crossed, 0, "{name}");
        }
        let (triangles, polygons) = cut(&comb);
        let (sum, net) = areas(&comb, &triangles);
        assert!((sum - net).abs() < 1e-9 && polygons.crossed == 0, "{sum} {net}");
    }

    #[test]
    fn what_has_no_inside_or_no_place_is_counted() {
        let bow = [[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        let (triangles, polygons) = cut(&bow);
        assert_eq!((triangles.len(), polygons.crossed), (2, 1));
        let mut notes = Vec::new();
        polygons.notes(&mut notes);
        assert!(notes[0].starts_with("1 faces cross themselves"), "{notes:?}");
        // A pentagram turns left everywhere.
        let star: Vec<[f32; 3]> = (0..5)
            .map(|i| (0.8 * std::f32::consts::PI * i as f32).sin_cos())
            .map(|(x, y)| [x, y, 0.0])
            .collect();
        assert_eq!(cut(&star).0.len(), 3);
        // No area at all.
        let line = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
        assert_eq!(cut(&line).0.len(), 2);
        let broken = [[0.0, 0.0, 0.0], [f32::NAN, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let (triangles, polygons) = cut(&broken);
        assert!(triangles.is_empty());
        polygons.notes(&mut notes);
        assert!(notes.last().unwrap().contains("1 faces have corners that are not finite"), "{notes:?}");
    }

    #[test]
    fn the_work_for_one_polygon_is_bounded() {
        // A spiral, whose ears are few.
        let corner = |i: u32| {
            let (arm, turn) = if i < 3000 { (i, 0.0) } else { (5999 - i, 0.35) };
            let angle = f64::from(arm) * 0.02 + turn;
            let radius = 1.0 + f64::from(arm) * 0.01;
            [(radius * angle.cos()) as f32, (radius * angle.sin()) as f32, 0.0]
        };
        let corners: Vec<[f32; 3]> = (0..6000).map(corner).collect();
        let (triangles, polygons) = cut(&corners);
        assert_eq!((triangles.len(), polygons.crossed), (5998, 1), "too many corners");
    }
}
