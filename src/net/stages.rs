use crate::rt::Metrics;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The stages of the service that posts on a board, and what the program counts besides.
#[derive(Debug, Default)]
pub(super) struct Stages {
    of_service: Mutex<Vec<Arc<Metrics>>>,
    always: Mutex<Vec<Arc<Metrics>>>,
}

impl Stages {
    pub fn replace(&self, stages: Vec<Arc<Metrics>>) {
        *lock(&self.of_service) = stages;
    }

    pub fn add_for_good(&self, metrics: Arc<Metrics>) {
        lock(&self.always).push(metrics);
    }

    pub fn all(&self) -> Vec<Arc<Metrics>> {
        let of_service = lock(&self.of_service).clone();
        of_service.into_iter().chain(lock(&self.always).clone()).collect()
    }
}

fn lock(stages: &Mutex<Vec<Arc<Metrics>>>) -> MutexGuard<'_, Vec<Arc<Metrics>>> {
    stages.lock().unwrap_or_else(PoisonError::into_inner)
}
