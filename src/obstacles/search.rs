//! Which detections can belong to an obstacle, and how well they fit.
//!
//! The gate of the speed does not open while a vehicle is not seen: what a wider one finds is often the next vehicle.

use super::body::LONGEST_LOW_CM;
use super::gathered::{sigma_across, sigma_along};
use super::obstacle::Obstacle;
use super::parameters::{TrackingParameters, speed_error};
use super::profile::Extent;
use crate::fixed::math::length;
use crate::fixed::trig::Direction;
use crate::frame::reflection::Reflection;

/// How far noise carries a detection beyond its obstacle, centimetres.
const NOISE_REACH_CM: i32 = 600;
/// How far beyond the longest vehicle an outline may be stretched, centimetres.
const LENGTH_TO_SPARE_CM: i32 = 100;
/// How far beyond its outline an end of a vehicle may reflect, centimetres: noise has been taken off the outline.
const END_CM: i32 = 50;
/// One, in the scale of a misfit: a squared distance in standard deviations, 2^-8.
const UNIT: i32 = 256;
/// Distance beyond an end that counts as one, squared and over [`UNIT`]: 0.7 m, cm^2.
const BEYOND_SCALE: i32 = 70 * 70 / UNIT;
/// Error of the speed that counts as one, squared and over [`UNIT`]: 0.35 m/s, for half a metre a second
/// counts twice, (2^-4 cm/s)^2.
const SPEED_SCALE: i32 = (50 << 4) * (50 << 4) / 2 / UNIT;
/// The root of [`UNIT`], which keeps squares of distances in 32 bits.
const UNIT_ROOT: i32 = 16;

/// An obstacle with what every comparison needs at hand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search {
    heading: Direction,
    /// 2^-4 cm/s
    velocity: (i32, i32),
    extent: Extent,
    anchor: (i32, i32),
    /// Longest stretch of it without reflections.
    gap_cm: i32,
    /// Farthest from the anchor a detection of this obstacle can lie along either axis.
    reach_cm: i32,
    /// The square which that spans: its corner of least coordinates, and its side.
    corner: (i32, i32),
    side_cm: u32,
    /// Whether it is low for certain, and so no lorry.
    is_low: bool,
}

/// A detection in an obstacle's axes, centimetres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offset {
    /// To the left of the centre line.
    left: i32,
    /// Beside the strip detections of a vehicle spread over.
    beside: i32,
    /// Beyond either end of the outline.
    beyond: i32,
}

impl Search {
    /// Least and greatest distance from the sensor a detection of this obstacle can have.
    pub fn distances_cm(&self) -> (i32, i32) {
        let (x, y) = self.anchor;
        let distance = length(x, y).max(1);
        // how far the square that is searched, in the obstacle's axes, reaches along the line of sight; and
        // as far it reaches to its sides, whose corners lie a little farther out
        let part = (self.heading.along(x, y).abs() + self.heading.across(x, y).abs()).min(3 * distance / 2);
        let reach = (self.reach_cm * part) / distance;
        (distance - reach, distance + reach + reach * reach / distance / 2)
    }

    /// Whether a place is near enough to look closer.
    #[inline]
    pub fn reaches(&self, x_cm: i32, y_cm: i32) -> bool {
        // one comparison for both ends; across the road first, for what is compared lies at the same range
        let within = |v: i32, corner: i32| v.wrapping_sub(corner).cast_unsigned() <= self.side_cm;
        within(y_cm, self.corner.1) && within(x_cm, self.corner.0)
    }

    /// Where a detection lies in the obstacle's axes; `None` where it is out of reach, whatever the direction
    /// of its noise.
    #[inline]
    pub fn offset(&self, r: &Reflection, t: &TrackingParameters) -> Option<Offset> {
        let (dx, dy) = (r.x_cm - self.anchor.0, r.y_cm - self.anchor.1);
        let noise = (t.sigmas * (t.noise.range_cm + i32::from(r.across_cm))) >> 4;
        let left = self.heading.across(dx, dy);
        let beside = (left.abs() - t.half_width_cm).max(0);
        if beside > t.lateral_gate_cm + noise {
            return None;
        }
        let beyond = self.extent.beyond_cm(self.heading.along(dx, dy));
        (beyond <= self.gap_cm + noise).then_some(Offset { left, beside, beyond })
    }

    /// Difference between a detection's radial velocity and the one the obstacle's motion explains, 2^-4 cm/s.
    #[inline]
    pub fn speed_error(&self, r: &Reflection) -> i32 {
        speed_error(self.velocity, r).abs()
    }

    /// Whether a detection may come from a wheel of this obstacle, which returns anything between standstill
    /// and twice its speed.
    #[inline]
    pub fn is_speed_of_wheel(&self, r: &Reflection, t: &TrackingParameters) -> bool {
        let body = r.sight.along(self.velocity.0, self.velocity.1);
        let wheel = i32::from(r.radial_velocity_cm_s) << 4;
        let spun = if body < 0 { -wheel } else { wheel };
        (0..=2 * body.abs() + t.doppler_gate).contains(&spun)
    }

    /// How badly a detection with this offset and error of its speed fits, 2^-8; `None` where it cannot belong
    /// to this obstacle.
    pub fn misfit(&self, r: &Reflection, offset: Offset, error: i32, t: &TrackingParameters) -> Option<i32> {
        let Offset { left, beside, beyond } = offset;
        let stretched = self.extent.length_cm() + beyond;
        // one as long as a lorry that shows nothing high keeps its ends
        let becomes_lorry = beyond > END_CM && stretched > LONGEST_LOW_CM;
        if stretched > t.max_length_cm + LENGTH_TO_SPARE_CM || (self.is_low && becomes_lorry) {
            return None;
        }
        // far along the vehicle or far to its side, but not both
        let part = |distance: i32, gate: i32, sigma: i32| (distance * UNIT) / (gate + ((t.sigmas * sigma) >> 4)).max(1);
        let ahead = if beyond > 0 { part(beyond, self.gap_cm, sigma_along(self.heading, r, &t.noise)) } else { 0 };
        let sigma_across = sigma_across(self.heading, r, &t.noise);
        let aside = if beside > 0 { part(beside, t.lateral_gate_cm, sigma_across) } else { 0 };
        if ahead > UNIT || aside > UNIT || ahead * ahead + aside * aside > UNIT * UNIT {
            return None;
        }
        // each term is a squared distance in its own scale; across, that of the width and the noise
        let variance = t.half_width_cm * t.half_width_cm + sigma_across * sigma_across;
        let by_length = beyond * beyond / BEYOND_SCALE;
        let by_width = (left * left * UNIT_ROOT) / (variance / UNIT_ROOT).max(1);
        let by_speed = error * error / SPEED_SCALE;
        Some(by_length + by_width + by_speed)
    }
}

impl Obstacle {
    /// What it takes to look for this obstacle's detections.
    pub(super) fn search(&self, t: &TrackingParameters) -> Search {
        let outline = self.extent.front_cm.max(-self.extent.rear_cm);
        let gap_cm = self.gap_cm(t);
        let anchor = self.anchor();
        let reach_cm = outline + gap_cm + NOISE_REACH_CM;
        Search {
            heading: self.heading,
            velocity: (self.velocity.0 >> 4, self.velocity.1 >> 4),
            extent: self.extent,
            anchor,
            gap_cm,
            reach_cm,
            corner: (anchor.0 - reach_cm, anchor.1 - reach_cm),
            side_cm: 2 * reach_cm.unsigned_abs(),
            is_low: self.tallness.is_low(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::made_up::{rules, seen_at};
    use super::*;

    const AHEAD: Direction = Direction::AHEAD;

    #[test]
    fn what_is_low_for_certain_does_not_grow_to_a_lorry() {
        let t = rules();
        let mut o = Obstacle::new(&seen_at(5000, 0, 2000), AHEAD, 2000);
        o.extent = Extent { rear_cm: -225, front_cm: 225 };
        let fits = |o: &Obstacle, x_cm: i32| {
            let (search, r) = (o.search(&t), seen_at(x_cm, 0, 2000));
            search.offset(&r, &t).and_then(|offset| search.misfit(&r, offset, 0, &t)).is_some()
        };
        assert!(fits(&o, 5700), "9.25 m in all");
        (0..100).for_each(|_| o.tallness.add(70, 30));
        assert!(!fits(&o, 5700));
        assert!(fits(&o, 5600), "8.25 m in all");
        // one that is longer already keeps its ends
        o.extent = Extent { rear_cm: -600, front_cm: 600 };
        assert!(fits(&o, 5550) && fits(&o, 5640) && !fits(&o, 5660));
    }

    #[test]
    fn a_wheel_turns_the_way_its_vehicle_drives_between_standstill_and_twice_its_speed() {
        let t = rules();
        for (heading, sign) in [(AHEAD, 1), (AHEAD.reversed(), -1)] {
            let search = Obstacle::new(&seen_at(5000, 0, sign * 2000), heading, 2000).search(&t);
            let may = |speed: i16| search.is_speed_of_wheel(&seen_at(5000, 0, sign * speed), &t);
            assert!(may(0) && may(500) && may(3900), "{heading:?}");
            assert!(!may(-500) && !may(-2000) && !may(4500), "{heading:?}");
        }
    }
}
