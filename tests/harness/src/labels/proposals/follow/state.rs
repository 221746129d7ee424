//! The state of a vehicle that is followed: which reflections fit it, and what they measure.

use super::super::motion::Motion;
use super::super::reflections::{Reflection, STANDS_MPS};
use super::super::tracker::{ALIKE, DOPPLER_MPS, across_m};
use super::around::Around;
use crate::labels::near_face;

/// Spread of a place along the line of sight, metres.
const RADIAL_M: f64 = 0.4;
/// Squares of standard deviations up to which a reflection fits.
pub const FITS: f64 = 9.0;
/// No reflection lies farther from its middle than its length and this, metres.
const NEAR_M: f64 = 6.0;
/// Longer ones reflect from anywhere, not from near the near face only, metres.
const LONG_M: f64 = 7.0;
/// Speed below which it stands, and from which on its heading is that of its velocity, m/s.
pub const STANDS_BELOW_MPS: f64 = 0.5;
const HEADED_MPS: f64 = 1.5;

/// Where a vehicle is at a frame.
#[derive(Debug, Clone, Copy)]
pub struct State {
    /// Of the box's centre.
    pub motion: Motion,
    pub heading_rad: f64,
}

impl State {
    /// The one that its label tells.
    pub fn labelled(around: &Around, frame: usize) -> Option<Self> {
        let step = around.label(frame)?;
        let motion = Motion::new(step.center, around.velocity(frame)?, 0.3, [1.0, 0.0], [0.5; 2]);
        Some(Self { motion, heading_rad: step.heading_rad })
    }

    pub fn stands(&self) -> bool {
        self.motion.speed() < STANDS_BELOW_MPS
    }

    /// The reflections of a frame that fit, and how badly.
    pub fn fitting(&self, frame: usize, around: &Around) -> Vec<(usize, f64)> {
        let all = around.instants.get(frame).into_iter().flat_map(|i| i.reflections.iter().enumerate());
        all.filter_map(|(i, r)| Some((i, self.cost(frame, r, around)?))).collect()
    }

    /// How badly a reflection fits, as a sum of squares of standard deviations; `None` where it does not.
    pub(super) fn cost(&self, frame: usize, r: &Reflection, around: &Around) -> Option<f64> {
        let [x, y] = self.motion.place();
        let [dx, dy] = [r.place[0] - x, r.place[1] - y];
        if dx.hypot(dy) > around.size[0] + NEAR_M || (r.fixture && !self.stands()) {
            return None;
        }
        let (s, c) = self.heading_rad.sin_cos();
        let [along, left] = beyond([dx, dy], self.heading_rad, around.size);
        let ground = r.sight[0].hypot(r.sight[1]).max(1e-6);
        let [ux, uy] = r.sight.map(|v| v / ground);
        let [bx, by] = [along * c - left * s, along * s + left * c];
        let known = |h: [f64; 4]| self.motion.variance(h).sqrt().min(1.0);
        let radial = (bx * ux + by * uy) / RADIAL_M.hypot(known([ux, uy, 0.0, 0.0]));
        let across = (bx * uy - by * ux) / (0.6 * across_m(r.distance_m)).hypot(known([-uy, ux, 0.0, 0.0]));
        let [vx, vy] = self.motion.velocity();
        let spread = DOPPLER_MPS.hypot(known([0.0, 0.0, r.sight[0], r.sight[1]]));
        let doppler = (r.doppler_mps - r.sight[0] * vx - r.sight[1] * vy) / spread;
        let cost = radial * radial + across * across + doppler * doppler;
        (cost <= FITS && !around.is_another_s(frame, r, along.hypot(left))).then_some(cost)
    }

    /// Measures with a frame's reflections.
    pub fn measure(&mut self, frame: usize, own: &[usize], around: &Around) {
        let (size, heading_rad) = (around.size, self.heading_rad);
        let Some(reflections) = around.instants.get(frame).map(|i| &i.reflections) else { return };
        let all: Vec<&Reflection> = own.iter().filter_map(|i| reflections.get(*i)).collect();
        let motion = &mut self.motion;
        if all.is_empty() {
            if motion.speed() < STANDS_BELOW_MPS {
                motion.stop(DOPPLER_MPS);
            }
            return;
        }
        let n = all.len() as f64;
        let mean = |f: &dyn Fn(&Reflection) -> f64| all.iter().map(|r| f(r)).sum::<f64>() / n;
        let at = [mean(&|r| r.place[0]), mean(&|r| r.place[1])];
        let (s, c) = heading_rad.sin_cos();
        // reflections come from near the near face, of long vehicles from anywhere
        let face = near_face::offset(at, heading_rad, size, around.sensor);
        let share = if size[0] > LONG_M { 0.4 } else { 0.6 };
        let middle = [0, 1].map(|k| at[k] + share * face[k]);
        let noise_m = 0.5 * across_m(mean(&|r| r.distance_m));
        let along_m = noise_m.hypot(0.2 * size[0]);
        let left_m = noise_m.hypot(0.25 * size[1]);
        motion.update([c, s, 0.0, 0.0], c * middle[0] + s * middle[1], ALIKE * along_m);
        motion.update([-s, c, 0.0, 0.0], -s * middle[0] + c * middle[1], ALIKE * left_m);
        // nothing reflects beyond its ends
        let [x, y] = motion.place();
        let ahead = |r: &&Reflection| (r.place[0] - x) * c + (r.place[1] - y) * s;
        let half_m = 0.5 * size[0];
        let over = all.iter().map(ahead).map(|m| m - m.clamp(-half_m, half_m));
        let over = over.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
        if over != 0.0 {
            motion.update([c, s, 0.0, 0.0], c * x + s * y + over, ALIKE * RADIAL_M.hypot(noise_m));
        }
        let [ux, uy] = [mean(&|r| r.sight[0]), mean(&|r| r.sight[1])];
        let doppler = mean(&|r| r.doppler_mps);
        motion.update([0.0, 0.0, ux, uy], doppler, DOPPLER_MPS);
        if doppler.abs() < STANDS_MPS && motion.speed() < 2.0 * STANDS_BELOW_MPS {
            motion.stop(DOPPLER_MPS);
        }
        if motion.speed() >= HEADED_MPS {
            let [vx, vy] = motion.velocity();
            self.heading_rad = vy.atan2(vx);
        }
    }
}

/// How far a place, seen from a box's centre, lies outside of it along and left of its heading.
fn beyond([dx, dy]: [f64; 2], heading_rad: f64, size: [f64; 3]) -> [f64; 2] {
    let (s, c) = heading_rad.sin_cos();
    let local = [dx * c + dy * s, -dx * s + dy * c];
    [0, 1].map(|k| local[k] - local[k].clamp(-0.5 * size[k], 0.5 * size[k]))
}
