//! How large a scene may be.

use crate::error::{Error, Result};

/// Most vertices of a scene (800 MB), counted after vertices with one position and several normals were
/// split.
pub const MAX_VERTICES: usize = 1 << 24;

/// Most triangles of a scene's meshes, each mesh counted once.
pub const MAX_TRIANGLES: usize = 1 << 24;

/// Most pairs of a vertex and something that moves it, a morph target or four joints (512 MB).
const MAX_MOVERS: usize = 1 << 24;

/// What a scene's files may still use up.
pub(super) struct Budget {
    vertices: usize,
    triangles: usize,
    movers: usize,
}

impl Default for Budget {
    fn default() -> Self {
        Self { vertices: MAX_VERTICES, triangles: MAX_TRIANGLES, movers: MAX_MOVERS }
    }
}

impl Budget {
    /// Subtracts a mesh from what is left, before anything is allocated for it.
    pub(super) fn take(&mut self, vertices: usize, triangles: usize) -> Result<()> {
        match (self.vertices.checked_sub(vertices), self.triangles.checked_sub(triangles)) {
            (Some(left), Some(triangles_left)) => {
                (self.vertices, self.triangles) = (left, triangles_left);
                Ok(())
            }
            _ => Err(Error::usage(format!(
                "is said to have {vertices} vertices and {triangles} triangles, with what came before more than the \
                 {MAX_VERTICES} and {MAX_TRIANGLES} that a scene may have"
            ))),
        }
    }

    /// Subtracts what moves the vertices of a mesh, `each` things for each, before anything is allocated.
    pub(super) fn take_movers(&mut self, vertices: usize, each: usize) -> Result<()> {
        let left = vertices.checked_mul(each).and_then(|movers| self.movers.checked_sub(movers));
        self.movers = left.ok_or_else(|| {
            Error::usage(format!(
                "has {vertices} vertices with {each} morph targets and sets of four joints; with what came before \
                 that is more than {MAX_MOVERS} pairs, which a scene may have"
            ))
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_is_used_up_by_all_meshes_together() {
        let mut budget = Budget::default();
        budget.take(MAX_VERTICES - 5, 3).unwrap();
        assert!(budget.take(6, 1).is_err());
        budget.take(5, 1).unwrap();
        assert!(budget.take(0, MAX_TRIANGLES).is_err());
        budget.take_movers(MAX_MOVERS / 4, 3).unwrap();
        assert!(budget.take_movers(MAX_MOVERS / 4, 2).is_err());
        assert!(budget.take_movers(2, usize::MAX).is_err());
    }
}
