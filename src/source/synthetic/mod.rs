//! x
#![allow(missing_docs)]
mod animation; mod area; mod emitter; mod integrate; mod noise; mod panorama; mod room; mod sensor; mod sky; mod view;
