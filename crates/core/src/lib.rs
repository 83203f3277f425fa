#![doc = include_str!("../README.md")]

pub mod camera;
pub mod error;
pub mod image;
pub mod light;
pub mod math;
pub mod sampling;
pub mod temporal;
#[cfg(any(test, feature = "test-data"))]
pub mod test_data;
