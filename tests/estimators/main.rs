//! The estimators on small scenes: what is hidden, what is followed, what is unknown, and what it takes.

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
