//! The outlines of a frame's pixels on the sphere, as closed polygons in the equal-area cylinder.
//!
//! Neighbouring pixels share the polyline of the edge between them, so the polygons tile the field of view
//! without gaps or overlaps. A pixel that the rim of the lens cuts is closed along the rim.
//!
//! In a mosaic, the pixels at one position in its period of two columns and two rows have the area of four
//! pixels about their own centres, and so tile the field of view by themselves. At the border of the frame
//! this area is cut or extended to end with the frame: all four positions see the same field.

#[cfg(test)]
mod tests;

use super::chart::{ChartPoint, SkyPoint, append_curve, close_loop, push_point, turn_rad};
use super::{Lens, Projection};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Area between an edge and its polyline, relative to a pixel. Four edges bound the error of a pixel's power
/// by 1.2e-4; the errors of opposite edges largely cancel, which leaves far less.
const EDGE_TOLERANCE: f64 = 3e-5;

/// Frames with a side below this are traversed on a finer lattice, so that every polygon is small compared
/// with the sphere: half a turn between two corners would be ambiguous.
const LATTICE_SIDE_MIN: usize = 32;

/// The part of one pixel edge inside the field of view, from its left or upper corner.
#[derive(Clone, Copy, Debug, Default)]
struct Edge {
    /// End of its points in the row's list; they start where those of the previous edge end.
    points_end: usize,
    /// Where the edge enters and leaves the field of view, as fractions of its length; `None` outside.
    part: Option<[f64; 2]>,
}

/// One line of edges.
#[derive(Default)]
struct EdgeLine {
    points: Vec<ChartPoint>,
    edges: Vec<Edge>,
}

impl EdgeLine {
    fn points(&self, index: usize) -> &[ChartPoint] {
        let start = index.checked_sub(1).map_or(0, |before| self.edges[before].points_end);
        &self.points[start..self.edges[index].points_end]
    }

    /// Appends a copy of the first edge.
    fn repeat_first(&mut self) {
        let Some(&first) = self.edges.first() else { return };
        self.points.extend_from_within(..first.points_end);
        self.edges.push(Edge { points_end: self.points.len(), ..first });
    }
}

/// A corner inside the field of view.
#[derive(Clone, Copy)]
struct Corner {
    world: DVec3,
    sky: SkyPoint,
}

/// Traverses the pixels of a projection.
pub(super) struct Footprints<'a> {
    projection: &'a Projection,
    world_from_camera: DMat3,
    /// Column and row, in the period of a mosaic, of the pixels to traverse; `None`: all pixels.
    place: Option<[usize; 2]>,
    /// Lattice cells per pixel and side.
    subdivision: usize,
    /// Angle of the last ray, from which the search for the next one starts.
    theta_rad: f64,
}

impl<'a> Footprints<'a> {
    pub(super) fn new(projection: &'a Projection, world_from_camera: DMat3) -> Self {
        Self { projection, world_from_camera, place: None, subdivision: 1, theta_rad: 0.0 }.subdivided()
    }

    /// Traverses only every second column and row, starting at a position in the period of a mosaic: the
    /// pixels of a picture of half the size. Width and height of the projection, a fisheye, are even.
    pub(super) fn of_place(projection: &'a Projection, world_from_camera: DMat3, place: [usize; 2]) -> Self {
        Self { place: Some(place), ..Self::new(projection, world_from_camera) }.subdivided()
    }

    fn subdivided(self) -> Self {
        let [width, height] = self.size();
        Self { subdivision: LATTICE_SIDE_MIN.div_ceil(width.min(height)), ..self }
    }

    /// Width and height of the picture whose pixels are traversed.
    pub(super) fn size(&self) -> [usize; 2] {
        let per_period = if self.place.is_some() { 2 } else { 1 };
        [self.projection.width() / per_period, self.projection.height() / per_period]
    }

    /// Calls `visit(row, column, polygon)` for every piece of every pixel that is seen, row by row; a pixel
    /// of a small frame comes in several pieces.
    pub(super) fn for_each(&mut self, mut visit: impl FnMut(usize, usize, &[ChartPoint])) {
        let [columns, rows] = self.size().map(|side| side * self.subdivision);
        let (mut above, mut below, mut upright) =
            (EdgeLine::default(), EdgeLine::default(), EdgeLine::default());
        let (mut corners_above, mut corners_below) = (Vec::new(), Vec::new());
        let mut polygon = Vec::new();
        for line in 0..=rows {
            std::mem::swap(&mut above, &mut below);
            std::mem::swap(&mut corners_above, &mut corners_below);
            self.corners(line, columns, &mut corners_below);
            below.points.clear();
            below.edges.clear();
            for column in 0..columns {
                let corners = [corners_below[column], corners_below[column + 1]];
                self.edge([column, line], [column + 1, line], corners, &mut below);
            }
            if line == 0 {
                continue;
            }
            let row = line - 1;
            upright.points.clear();
            upright.edges.clear();
            for column in 0..=columns {
                if column == columns && self.closes_round() {
                    upright.repeat_first();
                } else {
                    let corners = [corners_above[column], corners_below[column]];
                    self.edge([column, row], [column, line], corners, &mut upright);
                }
            }
            for column in 0..columns {
                self.outline([column, row], &above, &below, &upright, &mut polygon);
                if polygon.len() > 3 {
                    visit(row / self.subdivision, column / self.subdivision, &polygon);
                }
            }
        }
    }

    /// Whether the first and the last line of the lattice are the same on the sphere.
    fn closes_round(&self) -> bool {
        matches!(self.projection, Projection::LatLong { .. })
    }

    /// Frame position of a lattice point.
    fn position(&self, point: [usize; 2]) -> DVec2 {
        // Divided, not multiplied: whole pixels stay whole numbers.
        let position = DVec2::new(point[0] as f64, point[1] as f64) / self.subdivision as f64;
        let Some(place) = self.place else { return position };
        DVec2::new(
            position_of_place(position.x, place[0], self.projection.width()),
            position_of_place(position.y, place[1], self.projection.height()),
        )
    }

    fn corners(&mut self, line: usize, columns: usize, corners: &mut Vec<Option<Corner>>) {
        corners.clear();
        for column in 0..=columns {
            if column == columns && self.closes_round() {
                corners.push(corners[0]);
                continue;
            }
            let position = self.position([column, line]);
            let inside = match self.projection {
                Projection::LatLong { .. } => true,
                Projection::Fisheye(lens) => lens.normalized(position).length() <= lens.radius_max(),
            };
            corners.push(inside.then(|| {
                let world = self.world(position);
                Corner { world, sky: SkyPoint::new(world) }
            }));
        }
    }

    /// World direction of a frame position; positions outside a lens's field of view count as its rim.
    fn world(&mut self, position: DVec2) -> DVec3 {
        self.world_from_camera
            * match self.projection {
                Projection::Fisheye(lens) => {
                    lens.unproject_normalized(lens.normalized(position), &mut self.theta_rad)
                }
                // Every position of a lat-long picture has a direction.
                lat_long => lat_long.unproject(position).unwrap_or(DVec3::Y),
            }
    }

    /// Appends the part inside the field of view of the edge between two neighbouring lattice points.
    fn edge(&mut self, from: [usize; 2], to: [usize; 2], corners: [Option<Corner>; 2], line: &mut EdgeLine) {
        let (start, end) = (self.position(from), self.position(to));
        let part = match (self.projection, corners) {
            (Projection::LatLong { .. }, _) | (_, [Some(_), Some(_)]) => Some([0.0, 1.0]),
            (Projection::Fisheye(lens), _) => part_inside(lens, start, end),
        };
        if let Some([enter, leave]) = part {
            let mut at = |t: f64| {
                let world = self.world(start.lerp(end, t));
                Corner { world, sky: SkyPoint::new(world) }
            };
            // A corner that a neighbouring edge also uses must be the same point to the last bit.
            let first = corners[0].filter(|_| enter == 0.0).unwrap_or_else(|| at(enter));
            let last = corners[1].filter(|_| leave == 1.0).unwrap_or_else(|| at(leave));
            let area_sr = match self.projection {
                Projection::Fisheye(_) => first.world.distance_squared(last.world),
                Projection::LatLong { .. } => self.lat_long_area_sr(from, to),
            };
            append_curve(&mut line.points, first.sky, last.sky, EDGE_TOLERANCE * area_sr, &mut |t| {
                SkyPoint::new(self.world(start.lerp(end, enter + t * (leave - enter))))
            });
        }
        line.edges.push(Edge { points_end: line.points.len(), part });
    }

    /// Solid angle of the smaller lattice cell beside an edge of a lat-long picture: near its poles cells are
    /// so narrow that the square of an edge says nothing about them.
    fn lat_long_area_sr(&self, from: [usize; 2], to: [usize; 2]) -> f64 {
        let rows = self.projection.height() * self.subdivision;
        let step = std::f64::consts::PI / rows as f64;
        // The row nearest to a pole that touches the edge.
        let row = if from[1] == to[1] {
            from[1].saturating_sub(1).min(rows - 1).min(rows - 1 - from[1].min(rows - 1))
        } else {
            from[1].min(rows - 1 - from[1])
        };
        let theta_rad = (row as f64 + 0.5) * step;
        theta_rad.sin() * step * TAU / (self.projection.width() * self.subdivision) as f64
    }

    /// The closed outline of a lattice cell: the upper and right edges forwards, the lower and left edges
    /// backwards, and an arc of the rim between parts that the rim cuts off.
    fn outline(
        &self,
        cell: [usize; 2],
        above: &EdgeLine,
        below: &EdgeLine,
        upright: &EdgeLine,
        polygon: &mut Vec<ChartPoint>,
    ) {
        polygon.clear();
        let [column, row] = cell;
        let sides = [
            (above, column, [column, row], [column + 1, row], false),
            (upright, column + 1, [column + 1, row], [column + 1, row + 1], false),
            (below, column, [column, row + 1], [column + 1, row + 1], true),
            (upright, column, [column, row], [column, row + 1], true),
        ];
        let (mut opened_at, mut left_at) = (None, None);
        let mut whole = true;
        for (line, index, from, to, backwards) in sides {
            let Some([enter, leave]) = line.edges[index].part else {
                whole = false;
                continue;
            };
            whole &= enter == 0.0 && leave == 1.0;
            let mut ends = [enter, leave].map(|t| self.position(from).lerp(self.position(to), t));
            if backwards {
                ends.reverse();
            }
            match left_at {
                None => opened_at = Some(ends[0]),
                Some(left) => self.append_rim(left, ends[0], polygon),
            }
            append_polyline(polygon, line.points(index), backwards);
            left_at = Some(ends[1]);
        }
        match (whole, opened_at, left_at) {
            (true, ..) => {}
            (false, Some(opened), Some(left)) => self.append_rim(left, opened, polygon),
            _ => self.append_whole_rim(cell, polygon),
        }
        close_loop(polygon);
    }

    /// Appends the rim from one frame position to another, clockwise on the picture; nothing where the two
    /// are the same corner.
    fn append_rim(&self, from: DVec2, to: DVec2, polygon: &mut Vec<ChartPoint>) {
        let Projection::Fisheye(lens) = self.projection else { return };
        if from == to {
            return;
        }
        let psi = [from, to].map(|position| {
            let m = lens.normalized(position);
            m.y.atan2(m.x)
        });
        let arc_rad = (psi[1] - psi[0]).rem_euclid(TAU);
        // An arc of nearly 0 or nearly a full turn joins points that are the same up to rounding.
        if arc_rad > 1e-9 && arc_rad < TAU - 1e-9 {
            self.append_arc(lens, psi[0], arc_rad, polygon);
        }
    }

    /// The whole rim, where the cell contains the whole field of view.
    fn append_whole_rim(&self, cell: [usize; 2], polygon: &mut Vec<ChartPoint>) {
        let Projection::Fisheye(lens) = self.projection else { return };
        let centre = lens.pixel(DVec2::ZERO);
        let (low, high) = (self.position(cell), self.position([cell[0] + 1, cell[1] + 1]));
        if centre.cmpge(low).all() && centre.cmple(high).all() {
            for quarter in 0..4 {
                self.append_arc(lens, f64::from(quarter) * FRAC_PI_2, FRAC_PI_2, polygon);
            }
        }
    }

    fn append_arc(&self, lens: &Lens, psi_rad: f64, arc_rad: f64, polygon: &mut Vec<ChartPoint>) {
        let (sin_theta, cos_theta) = lens.theta_max_rad().sin_cos();
        let at = |t: f64| {
            let (sin_psi, cos_psi) = (psi_rad + t * arc_rad).sin_cos();
            self.world_from_camera * DVec3::new(sin_theta * cos_psi, sin_theta * sin_psi, cos_theta)
        };
        let (first, last) = (at(0.0), at(1.0));
        let tolerance_sr = EDGE_TOLERANCE * first.distance_squared(last);
        append_curve(polygon, SkyPoint::new(first), SkyPoint::new(last), tolerance_sr, &mut |t| {
            SkyPoint::new(at(t))
        });
    }
}

/// Frame position, along one side of `count` pixels, of a position in the picture of every second pixel from
/// `first` on: its pixels reach from half a pixel before to half a pixel after the pixels of the frame that
/// they stand for, the outermost ones to the border of the frame.
fn position_of_place(position: f64, first: usize, count: usize) -> f64 {
    let last = count / 2;
    let border = |pixel: usize| match pixel {
        0 => 0.0,
        pixel if pixel == last => count as f64,
        pixel => (2 * pixel + first) as f64 - 0.5,
    };
    let pixel = (position as usize).min(last - 1);
    border(pixel) + (position - pixel as f64) * (border(pixel + 1) - border(pixel))
}

/// Appends a polyline without changing its turns: its first point is unwrapped against the last of the
/// polygon.
fn append_polyline(polygon: &mut Vec<ChartPoint>, points: &[ChartPoint], backwards: bool) {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return };
    let start = if backwards { last } else { first };
    push_point(polygon, start[0], start[1]);
    // A whole number of turns, without the rounding of the sum; it is nearly always 0.
    let shift = match polygon.last().map_or(0.0, |p| p[0] - start[0]) {
        shift if shift.abs() < 1.0 => 0.0,
        shift => (shift / TAU).round() * TAU,
    };
    debug_assert!(polygon.last().is_none_or(|p| turn_rad(p[0], start[0]).abs() < 1e-9));
    let place = |p: &ChartPoint| [p[0] + shift, p[1]];
    if backwards {
        polygon.extend(points[..points.len() - 1].iter().rev().map(place));
    } else {
        polygon.extend(points[1..].iter().map(place));
    }
}

/// The part of an edge of a pixel, which runs along x or y, inside the rim: a segment meets a disc in one
/// piece.
fn part_inside(lens: &Lens, from: DVec2, to: DVec2) -> Option<[f64; 2]> {
    let (a, b) = (lens.normalized(from), lens.normalized(to));
    let along_x = from.y == to.y;
    let (across, start, end) = if along_x { (a.y, a.x, b.x) } else { (a.x, a.y, b.y) };
    let half = (lens.radius_max().powi(2) - across * across).max(0.0).sqrt();
    let fraction = |position: f64| ((position - start) / (end - start)).clamp(0.0, 1.0);
    let (enter, leave) = (fraction(-half), fraction(half));
    (leave > enter).then_some([enter, leave])
}
