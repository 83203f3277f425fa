//! Connected pixels of a map.

use crate::image::PolarShape;
use std::f64::consts::PI;

/// Appends to `members` the pixels that are connected with `start` (eight neighbours). The map wraps around
/// in azimuth, and all pixels at a pole touch each other.
///
/// `close` says whether a pixel belongs to the component and has not been seen before, and remembers it; it
/// is not called for `start`. `stack` is scratch memory.
pub fn collect_component(
    shape: PolarShape,
    start: usize,
    mut close: impl FnMut(usize) -> bool,
    stack: &mut Vec<usize>,
    members: &mut Vec<usize>,
) {
    let (columns, rows, theta_max_rad) = (shape.columns(), shape.rows(), shape.theta_max_rad());
    stack.clear();
    stack.push(start);
    let mut is_pole_done = [false; 2];
    while let Some(index) = stack.pop() {
        members.push(index);
        let (row, column) = (index / columns, index % columns);
        let mut visit = |neighbour: usize| {
            if close(neighbour) {
                stack.push(neighbour);
            }
        };
        for r in row.saturating_sub(1)..(row + 2).min(rows) {
            for c in [column + columns - 1, column, column + 1] {
                visit(r * columns + c % columns);
            }
        }
        let is_polar = [row == 0, row + 1 == rows && theta_max_rad >= PI];
        for (is_polar, is_done) in is_polar.into_iter().zip(&mut is_pole_done) {
            if is_polar && !std::mem::replace(is_done, true) {
                (row * columns..(row + 1) * columns).for_each(&mut visit);
            }
        }
    }
}
