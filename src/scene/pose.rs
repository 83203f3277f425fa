//! Where everything in a scene stands at a time.

use super::Scene;
use glam::Mat4;

impl Scene {
    /// Whether anything moves.
    pub fn is_animated(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Duration of the longest animation in seconds; 0 where nothing moves.
    pub fn duration_s(&self) -> f64 {
        self.channels.iter().map(|channel| f64::from(channel.duration_s)).fold(0.0, f64::max)
    }

    /// Where every instance stands at `time_s`: one matrix from the frame of its mesh to the world for each
    /// of [`Scene::instances`]. Allocates nothing once `world_from_mesh` has room for all nodes and
    /// instances.
    ///
    /// All animations play at the same time, each again and again over its own duration; at its end it jumps
    /// to its start. Of two channels that change the same property of a node the later one wins. A `time_s`
    /// that is not finite counts as 0, a negative one goes back from the end.
    ///
    /// A matrix may mirror (negative determinant): the winding of the mesh is then turned round, and so must
    /// be what the renderer takes for front faces. Normals go with the inverse transpose, or with the matrix
    /// of cofactors times the sign of the determinant, which exists where a scale is zero, too. A matrix that
    /// overflows is given as zeros, which draw nothing.
    pub fn pose(&self, time_s: f64, world_from_mesh: &mut Vec<Mat4>) {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        // First the nodes, which the instances behind them then refer to.
        world_from_mesh.clear();
        let mut channels = self.channels.iter().peekable();
        for (number, node) in self.nodes.iter().enumerate() {
            let mut transform = node.transform;
            while let Some(channel) = channels.next_if(|channel| channel.node == number) {
                channel.apply(time_s, &mut transform);
            }
            let local = transform.parent_from_node();
            let world = match node.parent {
                Some(parent) => world_from_mesh[parent] * local,
                None => local,
            };
            world_from_mesh.push(if world.is_finite() { world } else { Mat4::ZERO });
        }
        for instance in &self.instances {
            world_from_mesh.push(world_from_mesh[instance.node]);
        }
        world_from_mesh.drain(..self.nodes.len());
    }
}
