//! A piece of work that can be done again and again.

use std::error::Error;
use std::hint::black_box;

pub type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// One step of a piece of work.
pub type Work = Box<dyn FnMut() -> Result<()>>;

/// Work whose every step calls `step` and drops the result.
pub fn repeated<T: 'static>(mut step: impl FnMut() -> Result<T> + 'static) -> Work {
    Box::new(move || step().map(|result| drop(black_box(result))))
}
