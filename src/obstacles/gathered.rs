//! What the detections of one frame add up to, for one obstacle.

use super::doppler_slope::DopplerSlope;
use crate::fixed::math::hypot_gate;
use crate::fixed::trig::Direction;
use crate::frame::reflection::Reflection;
use crate::sensor::noise::Noise;

/// Variance of where on a vehicle a reflection lies, half a metre squared, cm^2.
const ON_VEHICLE_VARIANCE: i32 = 50 * 50;
/// Weight of a lateral measurement of one square centimetre's variance.
const UNIT_WEIGHT: i32 = 1 << 24;

/// Sums over the detections of one frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gathered {
    pub count: i32,
    /// Speed error along the heading: sum of projection x error (2^-10 cm/s), and of projection
    /// squared (2^-14).
    pub speed: (i32, i32),
    /// Lateral place: sum of weight x offset, and of weights.
    pub lateral: (i32, i32),
    /// Sums of the offsets ahead of the anchor and to its left, cm.
    pub offset: (i32, i32),
    /// Sum of the squared offsets to the left, cm^2.
    pub squares: i32,
    /// Sum of the radial speed errors, 2^-4 cm/s.
    pub radial: i32,
    /// How that error changes over the vehicle.
    pub slope: DopplerSlope,
    /// Line of sight to the last detection.
    pub sight: Direction,
    /// Its standard deviation across that, cm.
    pub across_cm: i32,
    /// Greatest radar cross section, half dBsm.
    pub rcs_half_dbsm: Option<i16>,
}

impl Gathered {
    pub const NONE: Self = Self {
        count: 0,
        speed: (0, 0),
        lateral: (0, 0),
        offset: (0, 0),
        squares: 0,
        radial: 0,
        slope: DopplerSlope::NONE,
        sight: Direction::AHEAD,
        across_cm: 0,
        rcs_half_dbsm: None,
    };

    /// Adds a detection `along` ahead of the anchor and `left` of it (cm), whose radial velocity is
    /// `error` (2^-4 cm/s) off.
    pub fn add(&mut self, r: &Reflection, heading: Direction, (along, left): (i32, i32), error: i32, noise: &Noise) {
        let projection = heading.cosine(r.sight);
        let w = weight(sigma_across(heading, r, noise));
        self.slope.add(self.count == 0, r.sight, error);
        self.count += 1;
        self.speed.0 = self.speed.0.saturating_add((projection * error) >> 8);
        self.speed.1 += (projection * projection) >> 14;
        self.lateral.0 = self.lateral.0.saturating_add(w * left);
        self.lateral.1 = self.lateral.1.saturating_add(w);
        self.offset.0 += along;
        self.offset.1 += left;
        self.squares = self.squares.saturating_add(left * left);
        self.radial += error;
        self.sight = r.sight;
        self.across_cm = i32::from(r.across_cm);
        self.rcs_half_dbsm = self.rcs_half_dbsm.max(r.rcs_half_dbsm);
    }

    /// Standard deviation along a heading that comes from azimuth alone, cm.
    pub fn smear_cm(&self, heading: Direction) -> i32 {
        (self.across_cm * heading.sine(self.sight).abs()) >> 14
    }

    /// Mean squared offset to the left with the azimuth's noise taken off, cm^2; not for none.
    pub fn spread(&self, heading: Direction) -> i32 {
        let noise = (self.across_cm * heading.cosine(self.sight)) >> 14;
        self.squares / self.count.max(1) - noise * noise
    }

    /// Variance of their centre across the line of sight, cm^2: a vehicle of this length reflects
    /// anywhere along the side it shows.
    pub fn centre_variance(&self, heading: Direction, length_cm: i32) -> i32 {
        let shown = (length_cm * heading.sine(self.sight).abs()) >> 14;
        (shown * shown / 12 + ON_VEHICLE_VARIANCE + self.across_cm * self.across_cm) / self.count.max(1)
    }
}

/// Weight of a lateral measurement with a standard deviation in centimetres: the inverse variance.
fn weight(sigma_cm: i32) -> i32 {
    UNIT_WEIGHT / (ON_VEHICLE_VARIANCE + sigma_cm * sigma_cm).max(1)
}

/// Standard deviation of a detection along a heading, centimetres.
pub(super) fn sigma_along(heading: Direction, r: &Reflection, noise: &Noise) -> i32 {
    let across_cm = i32::from(r.across_cm);
    let (along, across) = (heading.cosine(r.sight).abs(), heading.sine(r.sight).abs());
    hypot_gate((noise.range_cm * along) >> 14, (across_cm * across) >> 14)
}

/// Standard deviation of a detection across a heading, centimetres.
pub(super) fn sigma_across(heading: Direction, r: &Reflection, noise: &Noise) -> i32 {
    let across_cm = i32::from(r.across_cm);
    let (along, across) = (heading.cosine(r.sight).abs(), heading.sine(r.sight).abs());
    hypot_gate((noise.range_cm * across) >> 14, (across_cm * along) >> 14)
}

/// Standard deviation of a lateral place of this weight, centimetres.
#[allow(clippy::cast_possible_wrap)] // at most 1000
pub(super) fn sigma_of_weight(weight: i32) -> i32 {
    crate::fixed::math::root(UNIT_WEIGHT.unsigned_abs() / weight.max(1).unsigned_abs()).min(1000) as i32
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{rules, seen_at};
    use super::*;

    const AHEAD: Direction = Direction::AHEAD;

    #[test]
    fn noise_lies_across_the_line_of_sight() {
        let t = rules();
        let r = Reflection { across_cm: 300, ..seen_at(0, 8000, 0) };
        // seen broadside, the noise across the line of sight lies along the road
        assert!((sigma_along(AHEAD, &r, &t.noise) - 300).abs() < 25);
        assert!((sigma_across(AHEAD, &r, &t.noise) - t.noise.range_cm).abs() < 5);
        let r = Reflection { across_cm: 300, ..seen_at(8000, 0, 0) };
        assert!((sigma_across(AHEAD, &r, &t.noise) - 300).abs() < 25);
    }
}
