//! How large a scene may be.

use crate::error::{Error, Result};

/// Most vertices of a scene (800 MB), counted after vertices with one position and several normals were
/// split.
pub const MAX_VERTICES: usize = 1 << 24;

/// Most triangles of a scene's meshes, each mesh counted once.
pub const MAX_TRIANGLES: usize = 1 << 24;

/// What a scene's files may still use up.
pub(super) struct Budget {
    vertices: usize,
    triangles: usize,
}

impl Default for Budget {
    fn default() -> Self {
        Self { vertices: MAX_VERTICES, triangles: MAX_TRIANGLES }
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
    }
}
