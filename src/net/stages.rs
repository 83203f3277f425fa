use crate::rt::Metrics;
use std::sync::{Arc, Mutex, PoisonError};

/// The stages of the service that posts on a board.
#[derive(Debug, Default)]
pub(super) struct Stages(Mutex<Vec<Arc<Metrics>>>);

impl Stages {
    pub fn replace(&self, stages: Vec<Arc<Metrics>>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = stages;
    }

    pub fn all(&self) -> Vec<Arc<Metrics>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
