//! Where everything in a scene is at a given time.

use super::{Bounds, Channel, Instance, Scene, Vertex};
use glam::Mat4;

/// Where everything in a scene is at one time. Made by [`Scene::pose`], which fills it again and again.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    world_from_mesh: Vec<Mat4>,
    /// The vertices of all figures, one figure after another.
    vertices: Vec<Vertex>,
    /// Where each figure's vertices end, and the box around its triangles in their frame.
    figures: Vec<(usize, Bounds)>,
    world_from_node: Vec<Mat4>,
    /// The weights of the figure in work.
    weights: Vec<f32>,
    /// The matrices of its joints, from the frame of the mesh at rest to the world.
    world_from_rest: Vec<Mat4>,
}

impl Pose {
    /// For each of [`Scene::instances`] the matrix from the frame of its mesh to the world; the identity for a
    /// figure with a skin, whose vertices lie in the world.
    ///
    /// A matrix may mirror (negative determinant): the winding of the mesh is then reversed. Normals transform
    /// with the inverse transpose, or with the cofactor matrix times the sign of the determinant, which exists
    /// also where a scale is zero. What overflows has a matrix of zeros, which draws nothing.
    pub fn world_from_mesh(&self) -> &[Mat4] {
        &self.world_from_mesh
    }

    /// The vertices of all of [`Scene::figures`], one figure after another, each with as many as its mesh.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// The vertices of an instance of the posed scene, in the frame of its matrix: those of its figure, or of
    /// its mesh.
    pub fn vertices_of<'a>(&'a self, scene: &'a Scene, instance: usize) -> &'a [Vertex] {
        let mesh = &scene.meshes[scene.instances[instance].mesh];
        match scene.figures.binary_search_by_key(&instance, |figure| figure.instance) {
            Ok(figure) => {
                let end = self.figures[figure].0;
                &self.vertices[end - mesh.vertices.len()..end]
            }
            Err(_) => &mesh.vertices,
        }
    }
}

impl Scene {
    /// Whether anything in the scene is animated.
    pub fn is_animated(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Duration of the longest animation in seconds; 0 where nothing moves.
    pub fn duration_s(&self) -> f64 {
        self.channels.iter().map(|channel| f64::from(channel.duration_s)).fold(0.0, f64::max)
    }

    /// Poses everything as at `time_s`: matrices for all instances, and for figures their vertices too.
    /// Allocates nothing once `pose` was filled by this scene.
    ///
    /// All animations play at the same time, each looping over its own duration and jumping from its end to
    /// its start. Of two channels that change the same property of a node the later one wins. A `time_s` that
    /// is not finite counts as 0, a negative one counts back from the end.
    pub fn pose(&self, time_s: f64, pose: &mut Pose) {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        pose.world_from_node.clear();
        let mut channels = self.channels.iter().peekable();
        for (number, node) in self.nodes.iter().enumerate() {
            let mut transform = node.transform;
            while let Some(channel) = channels.next_if(|channel| channel.node == number) {
                channel.apply(time_s, &mut transform);
            }
            let local = transform.parent_from_node();
            let world = match node.parent {
                Some(parent) => pose.world_from_node[parent] * local,
                None => local,
            };
            pose.world_from_node.push(if world.is_finite() { world } else { Mat4::ZERO });
        }
        pose.world_from_mesh.clear();
        let Pose { world_from_mesh, world_from_node, .. } = pose;
        world_from_mesh.extend(self.instances.iter().map(|instance| world_from_node[instance.node]));
        pose.vertices.clear();
        pose.figures.clear();
        for number in 0..self.figures.len() {
            self.pose_figure(number, time_s, pose);
        }
    }

    /// Appends the vertices of a figure and sets its instance's matrix.
    fn pose_figure(&self, number: usize, time_s: f64, pose: &mut Pose) {
        let figure = &self.figures[number];
        let instance = self.instances[figure.instance];
        let mesh = &self.meshes[instance.mesh];
        pose.weights.clear();
        pose.weights.extend_from_slice(&figure.weights);
        for channel in self.channels_of(instance.node) {
            channel.apply_weights(time_s, &mut pose.weights);
        }
        pose.world_from_rest.clear();
        let mut is_whole = true;
        if let Some(skin) = figure.skin {
            for joint in &self.skins[skin].joints {
                let world_from_joint = pose.world_from_node[joint.node];
                is_whole &= world_from_joint != Mat4::ZERO;
                pose.world_from_rest.push(world_from_joint * joint.joint_from_mesh);
            }
            pose.world_from_mesh[figure.instance] = Mat4::IDENTITY;
        }
        let start = pose.vertices.len();
        pose.vertices.extend_from_slice(&mesh.vertices);
        let vertices = &mut pose.vertices[start..];
        let deformation = &self.deformations[figure.deformation];
        is_whole &= deformation.apply(mesh, &pose.weights, &pose.world_from_rest, vertices);
        let bounds = if is_whole {
            Bounds::of(mesh.indices.iter().map(|index| vertices[*index as usize].position.into()))
        } else {
            vertices.copy_from_slice(&mesh.vertices);
            pose.world_from_mesh[figure.instance] = Mat4::ZERO;
            Bounds::EMPTY
        };
        pose.figures.push((pose.vertices.len(), bounds));
    }

    fn channels_of(&self, node: usize) -> &[Channel] {
        let start = self.channels.partition_point(|channel| channel.node < node);
        let count = self.channels[start..].partition_point(|channel| channel.node == node);
        &self.channels[start..start + count]
    }

    /// Box around all instances of a posed scene.
    pub fn bounds(&self, pose: &Pose) -> Bounds {
        self.bounds_where(pose, |_| true)
    }

    /// Box around the instances of a posed scene that cast shadows.
    pub fn caster_bounds(&self, pose: &Pose) -> Bounds {
        self.bounds_where(pose, |instance| instance.roles.casts)
    }

    fn bounds_where(&self, pose: &Pose, is_meant: impl Fn(&Instance) -> bool) -> Bounds {
        let mut figures = self.figures.iter().zip(&pose.figures).peekable();
        let mut all = Bounds::EMPTY;
        for (number, (instance, matrix)) in self.instances.iter().zip(&pose.world_from_mesh).enumerate() {
            let figure = figures.next_if(|(figure, _)| figure.instance == number);
            if is_meant(instance) && *matrix != Mat4::ZERO {
                let bounds = figure.map_or(self.meshes[instance.mesh].bounds, |(_, (_, bounds))| *bounds);
                all = all.union(&bounds.transformed(matrix));
            }
        }
        all
    }
}
