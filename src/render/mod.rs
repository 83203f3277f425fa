//! Scenes under the lights of a list.

pub mod budget;
