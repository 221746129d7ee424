//! A single echo and the scatterer it comes from, on whatever way.

use crate::geometry::pose::Spherical;
use crate::twin::random::Dice;

/// Power from one place, before the sensor resolves anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Echo {
    pub range_m: f64,
    pub azimuth_rad: f64,
    pub elevation_rad: f64,
    /// Receding, m/s.
    pub velocity_mps: f64,
    /// Field in units of the noise: real and imaginary part.
    pub amplitude: [f64; 2],
}

impl Echo {
    pub fn power(&self) -> f64 {
        self.amplitude[0].powi(2) + self.amplitude[1].powi(2)
    }
}

/// A scatterer under way: where it is seen and how strongly.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    pub place: [f64; 3],
    pub seen: Spherical,
    /// Road frame, m/s.
    pub velocity: [f64; 2],
    /// Mean RCS towards the sensor, dBsm.
    pub rcs_dbsm: f64,
    /// One-way gain of its direction, dB.
    pub gain_db: f64,
    /// Behind its own vehicle's glass.
    pub inside: bool,
}

/// A gamma-distributed factor of mean 1.
pub fn fading(shape: u32, dice: &mut Dice) -> f64 {
    if shape == 0 { 1.0 } else { (0..shape).map(|_| dice.exponential()).sum::<f64>() / f64::from(shape) }
}

/// Radial velocity of a place that moves, + receding.
pub fn radial(place: [f64; 3], velocity: [f64; 2], eye: [f64; 3]) -> f64 {
    let d = [place[0] - eye[0], place[1] - eye[1], place[2] - eye[2]];
    (d[0] * velocity[0] + d[1] * velocity[1]) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}
