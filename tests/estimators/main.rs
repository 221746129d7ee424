//! The estimators on small scenes: what is hidden, what is followed, what is unknown, and what it takes.

#![allow(clippy::cast_possible_truncation, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // a test may fail

#[path = "../common/mod.rs"]
mod common;

mod camera_3d;
mod obstacles;
mod radar_2d;
mod radar_3d;
mod settling;
mod sizes;
mod standing;
mod text_pictures;
mod version;
