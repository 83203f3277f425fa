use super::geometry::Geometry;
use super::material::Materials;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::{Camera, Pose, Scene};

/// The scene and its resources on the device.
pub(super) struct World {
    pub scene: Scene,
    pub geometry: Geometry,
    pub materials: Materials,
    pose: Pose,
}

impl World {
    /// Uploads a scene, posed as at time 0.
    ///
    /// # Errors
    /// For a scene that the device cannot hold.
    pub fn new(gpu: &Gpu, scene: Scene) -> Result<Self> {
        let geometry = Geometry::new(gpu, &scene)?;
        let materials = Materials::new(gpu, &scene)?;
        let mut world = Self { scene, geometry, materials, pose: Pose::default() };
        world.pose(gpu, 0.0);
        Ok(world)
    }

    /// Poses everything as at `time_s`.
    pub fn pose(&mut self, gpu: &Gpu, time_s: f64) {
        self.scene.pose(time_s, &mut self.pose);
        self.geometry.pose(gpu, &self.scene, &self.pose);
    }

    /// The file's camera, or one that shows the whole scene in a picture of `aspect`.
    pub fn default_camera(&self, aspect: f32) -> Camera {
        let Geometry { casters, all, .. } = self.geometry;
        // A ground extends far beyond the objects on it.
        let framed = if casters.is_empty() { all } else { casters };
        self.scene.camera.unwrap_or_else(|| Camera::framing(&framed, aspect))
    }
}
