//! Motion without a heading, and when an obstacle goes on with it; metres and seconds.

use super::obstacle::Obstacle;
use super::outline::{BIN_M, Extent, Profile};
use super::rules::Rules;
use crate::geometry::{Ground, across, along, difference, left, moved};

/// Standard deviations of a newborn's place and of its speed across the line of sight.
const NEWBORN: [f64; 2] = [1.5, 10.0];
/// Where on a vehicle a reflection lies, and least standard deviation of a frame's centre, metres.
const ON_VEHICLE_SIGMA: f64 = 0.5;
const LEAST_SIGMA: f64 = 0.2;
/// Greatest standard deviation of a place and of a speed.
const MOST_VARIANCE: f64 = 400.0;
/// Speed of turning that is taken for noise, rad/s, how much higher or lower than assumed a reflection may lie, metres, and
/// the share of the spread of angles that noise may be.
const TURNING: f64 = 0.05;
const HEIGHT: f64 = 2.0;
const MOST_NOISE: f64 = 0.25;
/// Variance that a turn adds to a heading, rad^2 for a metre of way, and the time over which the free motion is a mean.
const TURN: f64 = 0.05;
const SHARED: f64 = 1.0 / 3.0;
/// Frames in a row in which motion along the heading must fail.
const OFF_AXIS_FRAMES: u32 = 2;

/// A Kalman filter of place and speed across the line of sight; Doppler along it.
#[derive(Debug, Clone, Copy)]
pub struct FreeMotion {
    pub place: Ground,
    pub velocity: Ground,
    /// Variance of place, covariance, variance of speed.
    variance: [f64; 3],
}

impl FreeMotion {
    pub fn newborn(place: Ground, velocity: Ground) -> Self {
        Self { place, velocity, variance: [NEWBORN[0].powi(2), 0.0, NEWBORN[1].powi(2)] }
    }

    pub fn is_sure_of(&self, speed: f64, sigmas: f64) -> bool {
        speed.powi(2) > sigmas.powi(2) * self.variance[2]
    }

    fn speed_variance(&self) -> f64 {
        self.variance[2]
    }

    pub fn predict(&mut self, dt: f64, turning_noise: f64) {
        self.place = moved(self.place, self.velocity, dt);
        let [place, both, speed] = self.variance;
        self.variance = [place + dt * (2.0 * both + dt * speed), both + dt * speed, speed + dt * turning_noise.powi(2)]
            .map(|v| v.min(MOST_VARIANCE));
    }

    /// Takes a speed across a line of sight, with its variance.
    fn take_across(&mut self, sight: Ground, speed: f64, variance: f64) {
        let [place, both, known] = self.variance;
        let (to_place, to_speed) = (both / (known + variance), known / (known + variance));
        let off = speed - across(sight, self.velocity);
        self.velocity = moved(self.velocity, left(sight), off * to_speed);
        self.place = moved(self.place, left(sight), off * to_place);
        self.variance = [place - both * to_place, both * (1.0 - to_speed), known * (1.0 - to_speed)];
    }

    /// Takes a centre of `count` detections with its variance, and the radial velocity.
    fn update(&mut self, count: f64, centre: Ground, variance: f64, sight: Ground, radial: f64) {
        let off = difference(centre, self.place);
        let [place, both, speed] = self.variance;
        let (to_place, to_speed) = (place / (place + variance), both / (place + variance));
        let ahead = (radial - along(sight, self.velocity)) * count / (count + 1.0);
        let aside = across(sight, off) * to_speed;
        self.velocity = moved(moved(self.velocity, sight, ahead), left(sight), aside);
        self.place =
            moved(moved(self.place, sight, along(sight, off) * to_place), left(sight), across(sight, off) * to_place);
        self.variance = [place * (1.0 - to_place), both * (1.0 - to_place), speed - both * to_speed];
    }
}

fn length(v: Ground) -> f64 {
    v[0].hypot(v[1])
}

impl Obstacle {
    /// Whether its speed gives the heading of one that goes its own way.
    pub fn knows_its_way(&self, rules: &Rules) -> bool {
        length(self.velocity) > rules.turning_speed
            && self.free.is_sure_of(length(self.free.velocity), rules.heading_sigmas)
    }

    /// Lets the free motion follow this frame's detections.
    pub fn follow(&mut self, rules: &Rules) {
        let g = self.gathered;
        let [ahead, aside] = [g.offset[0] / g.count, g.offset[1] / g.count];
        let centre = moved(moved(self.anchor, self.heading, ahead), left(self.heading), aside);
        // a vehicle reflects anywhere along the side it shows
        let shown = self.extent.length().max(f64::from(rules.sizes.min_length_m)) * across(self.heading, g.sight).abs();
        let variance = (shown.powi(2) / 12.0 + ON_VEHICLE_SIGMA.powi(2) + g.sigma_across.powi(2)) / g.count;
        let radial = along(g.sight, self.velocity) + g.radial / g.count;
        self.free.update(g.count, centre, variance.max(LEAST_SIGMA.powi(2)), g.sight, radial);
        self.take_slope(rules);
        if self.free_heading {
            let centre = self.profile.mean().unwrap_or(self.extent.middle());
            let off = along(self.heading, difference(self.free.place, self.anchor)) - centre;
            self.anchor = moved(self.anchor, self.heading, off * rules.off_axis_follow);
        }
    }

    /// Turns into the free motion's direction as far as that is known better than the heading it has.
    pub fn turn_with_motion(&mut self, dt: f64) {
        let speed = length(self.velocity);
        let motion = self.velocity.map(|v| v / speed);
        let variance = (self.heading_variance + speed * dt * TURN).min(1.0);
        let seen = (self.free.speed_variance() / speed.powi(2)).min(1.0) * (SHARED / dt).max(1.0);
        if along(self.heading, motion) < 0.0 {
            (self.heading, self.heading_variance) = (motion, seen.min(1.0));
            return;
        }
        let gain = variance / (variance + seen);
        let turned = [0, 1].map(|k| self.heading[k] + (motion[k] - self.heading[k]) * gain);
        self.heading = turned.map(|c| c / length(turned));
        self.heading_variance = variance * (1.0 - gain);
    }

    /// Takes what the change of Doppler over the vehicle says of its speed across the line of sight.
    fn take_slope(&mut self, rules: &Rules) {
        let g = self.gathered;
        let (first, [angles, squares, products]) = g.slope;
        let spread = squares - angles * angles / g.count;
        let own = spread - (g.count - 1.0) * rules.azimuth_sigma.powi(2);
        if own <= 0.0 || own < (1.0 - MOST_NOISE) * spread {
            return;
        }
        let slope = (products - angles * g.radial / g.count) / own;
        let distance = length(self.ahead(self.extent.middle()));
        let down = (1.0 - length(g.sight).powi(2)).max(0.0).sqrt();
        let error_of_height = length(self.velocity) * down * HEIGHT / distance;
        let doppler = rules.speed_sigma.powi(2) + error_of_height.powi(2);
        let variance = doppler * spread / own.powi(2) + (TURNING * distance).powi(2);
        if variance > MOST_VARIANCE {
            return;
        }
        let towards = moved(first, left(first), angles / g.count);
        let sight = towards.map(|c| c / length(towards));
        self.free.take_across(sight, across(sight, self.velocity) + slope.clamp(-40.0, 40.0), variance);
    }

    /// Leaves the heading it has where motion along that does not explain what is seen.
    pub fn question_heading(&mut self, rules: &Rules) {
        if self.free_heading {
            return;
        }
        let off = difference(self.free.velocity, self.velocity);
        let aside = across(self.heading, off).abs();
        let certain = aside > rules.off_axis.max(rules.off_axis_share * length(self.velocity))
            && self.free.is_sure_of(length(off), rules.off_axis_sigmas);
        self.unexplained = if certain { self.unexplained + 1 } else { 0 };
        if self.unexplained >= OFF_AXIS_FRAMES {
            self.free_heading = true;
            self.anchor = self.free.place;
            self.velocity = self.free.velocity;
            self.heading = self.velocity.map(|v| v / length(self.velocity));
            self.profile = Profile::EMPTY;
            self.extent = Extent { rear: -BIN_M / 2.0, front: BIN_M / 2.0 };
            self.lateral_weight = 0.0;
        }
    }
}
