//! What foxglove's messages are made of.

use serde::Serialize;

use crate::geometry::solid::Solid;

#[derive(Serialize)]
pub struct Time {
    sec: i64,
    nsec: i64,
}

impl Time {
    pub fn from_ns(time_ns: i64) -> Self {
        Self { sec: time_ns.div_euclid(1_000_000_000), nsec: time_ns.rem_euclid(1_000_000_000) }
    }
}

#[derive(Serialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

#[derive(Serialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Serialize)]
pub struct Pose {
    position: Vector3,
    orientation: Quaternion,
}

impl Pose {
    /// A place, turned to the left about the vertical.
    pub fn new([x, y, z]: [f64; 3], yaw_rad: f64) -> Self {
        let (sin, cos) = (yaw_rad / 2.0).sin_cos();
        Self { position: Vector3 { x, y, z }, orientation: Quaternion { x: 0.0, y: 0.0, z: sin, w: cos } }
    }

    /// Where a box stands.
    pub fn of(solid: &Solid) -> Self {
        Self::new(solid.center, solid.yaw_rad)
    }
}
