//! Where everything in a scene is at a given time.

use super::Scene;
use glam::Mat4;

impl Scene {
    /// Whether anything in the scene is animated.
    pub fn is_animated(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Duration of the longest animation in seconds; 0 where nothing moves.
    pub fn duration_s(&self) -> f64 {
        self.channels.iter().map(|channel| f64::from(channel.duration_s)).fold(0.0, f64::max)
    }

    /// The pose of every instance at `time_s`: one matrix from the frame of its mesh to the world for each of
    /// [`Scene::instances`]. Allocates nothing once `world_from_mesh` has room for all nodes and instances.
    ///
    /// All animations play at the same time, each looping over its own duration and jumping from its end to
    /// its start. Of two channels that change the same property of a node the later one wins. A `time_s` that
    /// is not finite counts as 0, a negative one counts back from the end.
    ///
    /// A matrix may mirror (negative determinant): the winding of the mesh is then reversed, and the renderer
    /// must swap front and back faces. Normals transform with the inverse transpose, or with the cofactor
    /// matrix times the sign of the determinant, which exists also where a scale is zero. A matrix that
    /// overflows is returned as zeros, which draw nothing.
    pub fn pose(&self, time_s: f64, world_from_mesh: &mut Vec<Mat4>) {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        // The matrices of the nodes come first; those of the instances are appended and refer to them.
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
