//! Where a roadside radar can see, and where it is blind.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

#[cfg(test)]
extern crate std;

pub mod angle;
pub mod axes;
pub mod bitmap;
pub mod bits;
pub mod cartesian;
pub mod config;
pub mod detection;
pub mod evidence;
pub mod field_of_view;
pub mod gate;
pub mod health;
pub mod map;
mod math;
pub mod mount;
pub mod obstacles;
pub mod polar;
pub mod query;
pub mod radar_2d;
pub mod radar_3d;
pub mod raycast;
pub mod reflection;
pub mod resample;
pub mod scan;
pub mod sensor;
pub mod sightlines;
pub mod solid;
pub mod spherical;
pub mod time;
pub mod trig;
pub mod voxelise;
