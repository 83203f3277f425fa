#![doc = include_str!("../ARCHITECTURE.md")]

pub mod camera;
pub mod cli;
pub mod config;
pub mod error;
pub mod image;
pub mod light;
pub mod math;
pub mod picture;
pub mod report;
pub mod rt;
pub mod sampling;
pub mod service;
pub mod source;
pub mod stage;
pub mod temporal;
