use crate::design::RateFilter;
use crate::error::Result;
use crate::rt::stage::{Flow, Stage};
use lightcast_core::light::ReferencedList;

/// Filters the lights over time.
pub struct Filter(pub RateFilter);

impl Stage for Filter {
    type Input = ReferencedList;
    type Output = ReferencedList;

    fn step(&mut self, list: &ReferencedList, filtered: &mut ReferencedList) -> Result<Flow> {
        self.0.step(list, filtered)?;
        Ok(Flow::Send)
    }
}
