//! Vehicles put together by hand, for the tests of the rules around them.

use std::vec::Vec;

use super::Obstacles;
use super::config::ObstacleConfig;
use super::parameters::TrackingParameters;
use super::tallness::Tallness;
use crate::fixed::math::length;
use crate::fixed::time::Step;
use crate::fixed::trig::Direction;
use crate::frame::by_range::ByRange;
use crate::frame::reflection::Reflection;
use crate::sensor::noise::NoiseConfig;

/// Default rules for a road straight ahead, followed to 225 m.
pub fn rules() -> TrackingParameters {
    ObstacleConfig::default().tracking(NoiseConfig::default().noise().unwrap(), Direction::AHEAD, 22_500).unwrap()
}

/// Certain to be tall.
pub fn tall() -> Tallness {
    let mut t = Tallness::default();
    (0..10).for_each(|_| t.add(290, 10));
    assert!(t.is_tall());
    t
}

/// A reflection at a place, with a radial velocity.
pub fn seen_at(x_cm: i32, y_cm: i32, radial_velocity_cm_s: i16) -> Reflection {
    Reflection {
        x_cm,
        y_cm,
        ground_cm: length(x_cm, y_cm) as u16,
        sight: Direction::of(x_cm, y_cm),
        radial_velocity_cm_s,
        across_cm: 40,
        height_cm: None,
        rcs_half_dbsm: None,
    }
}

/// A reflection of something that moves, metres and m/s.
pub fn reflection([x, y]: [f64; 2], [vx, vy]: [f64; 2]) -> Reflection {
    let distance = x.hypot(y);
    let (x_cm, y_cm) = ((x * 100.0).round() as i32, (y * 100.0).round() as i32);
    Reflection {
        x_cm,
        y_cm,
        ground_cm: length(x_cm, y_cm) as u16,
        sight: Direction::of(x_cm, y_cm),
        radial_velocity_cm_s: ((vx * x + vy * y) / distance * 100.0).round() as i16,
        across_cm: (distance * 0.87).round().max(1.0) as u16,
        height_cm: None,
        rcs_half_dbsm: None,
    }
}

/// An upright box that moves, metres and m/s; it reflects every 2.5 m along its sides.
#[derive(Clone, Copy)]
pub struct Vehicle {
    pub at: [f64; 2],
    pub heading: [f64; 2],
    pub size: [f64; 2],
    pub velocity: [f64; 2],
}

impl Vehicle {
    pub fn reflections(&self) -> Vec<Reflection> {
        let [hx, hy] = self.heading;
        let stretches = (self.size[0] / 2.5).ceil();
        let along = (0..=stretches as u32).map(|k| f64::from(k) / stretches - 0.5);
        let points = along.flat_map(|a| [-0.5, 0.5].map(|b| (a, b)));
        points
            .map(|(a, b)| {
                let (ahead, left) = (a * self.size[0], b * self.size[1]);
                reflection([self.at[0] + ahead * hx - left * hy, self.at[1] + ahead * hy + left * hx], self.velocity)
            })
            .collect()
    }

    pub fn moved(&mut self, seconds: f64) {
        self.at = [self.at[0] + self.velocity[0] * seconds, self.at[1] + self.velocity[1] * seconds];
    }
}

/// A car that drives at so many m/s along a unit heading.
pub fn car(at: [f64; 2], heading: [f64; 2], speed: f64) -> Vehicle {
    Vehicle { at, heading, size: [4.5, 1.8], velocity: heading.map(|c| c * speed) }
}

pub const PERIOD_S: f64 = 0.067;

/// Changes the speed of all by 2 m/s in a second, up to or down to this.
pub fn change_speed<const N: usize>(list: &mut Obstacles<N>, vehicles: &mut [Vehicle], to: f64) {
    loop {
        for v in &mut *vehicles {
            let speed = v.velocity[0].hypot(v.velocity[1]);
            let speed = speed + (to - speed).clamp(-2.0 * PERIOD_S, 2.0 * PERIOD_S);
            v.velocity = v.heading.map(|c| c * speed);
        }
        follow(list, vehicles, 1.01 * PERIOD_S, true);
        if vehicles.iter().all(|v| (v.velocity[0].hypot(v.velocity[1]) - to).abs() < 1e-9) {
            return;
        }
    }
}

/// Follows vehicles for some seconds; `in_view` says whether anything unseen should have been seen.
pub fn follow<const N: usize>(list: &mut Obstacles<N>, vehicles: &mut [Vehicle], seconds: f64, in_view: bool) {
    let t = rules();
    for _ in 0..(seconds / PERIOD_S) as usize {
        let reflections: Vec<Reflection> = vehicles.iter().flat_map(Vehicle::reflections).collect();
        let step = Step::from_micros((PERIOD_S * 1e6) as u64);
        list.step(&reflections, &ByRange::<256>::sort(&reflections, t.limit_cm), step, &t, |_, _| in_view);
        vehicles.iter_mut().for_each(|v| v.moved(PERIOD_S));
    }
}
