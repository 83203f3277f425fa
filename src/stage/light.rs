use crate::error::Result;
use crate::rt::stage::{Flow, Stage};
use lightcast_core::image::PolarMap;
use lightcast_core::light::{Extractor, LightList};
use std::time::Instant;

/// Turns a map into lights.
pub struct Light(pub Extractor);

impl Stage for Light {
    type Input = PolarMap;
    type Output = LightList;

    fn step(&mut self, map: &PolarMap, list: &mut LightList) -> Result<Flow> {
        let start = self.0.has_budget().then(Instant::now);
        self.0.step(map, list);
        if let Some(start) = start {
            self.0.took(start.elapsed(), map.stamp.frame_rate_hz);
        }
        Ok(Flow::Send)
    }
}
