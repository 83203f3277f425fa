use crate::design::RateFilter;
use crate::error::Result;
use crate::rt::stage::{Flow, Stage};
use lightcast_core::light::LightList;

/// Filters the lights over time.
pub struct Filter(pub RateFilter);

impl Stage for Filter {
    type Input = LightList;
    type Output = LightList;

    fn step(&mut self, list: &LightList, filtered: &mut LightList) -> Result<Flow> {
        self.0.step(list, filtered)?;
        Ok(Flow::Send)
    }
}
