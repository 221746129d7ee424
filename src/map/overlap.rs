//! Which cells of a polar map a rectangle of the road touches.
//!
//! # Model
//! A map finds the cell of a point with integer bearings and lengths, so its cells' edges lie some steps beside where
//! geometry has them. The rectangle is grown by what all of that comes to: 4 cm, and 0.1 % of the distance. Between the
//! two edges of an azimuth it is a convex polygon: its corners are corners of the rectangle and places where an edge
//! enters or leaves it, so they have its greatest distance, and its least one is no less than theirs times the cosine
//! of half the azimuth's width. Every cell that holds a point of the rectangle is among those visited, and few others are.
//!
//! # Cost
//! Some hundred instructions for each azimuth, and as many for each corner.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction};
use crate::map::polar::{FARTHEST_CM, PolarGeometry};
use crate::map::query::Footprint;
use crate::sensor::mount::Levelling;

/// Steps of 2^-16 turn by which bearings are off at most, and a bit.
const STEPS: i16 = 4;

/// Nearer than this to the sensor bearings say nothing, centimetres.
const NEAR_CM: i32 = 50;

/// A rectangle as its sensor has it, in the levelled frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// From its middle to the sensor, along it and to its left.
    to_sensor: (i32, i32),
    /// Direction of its length, 2^-14.
    axis: (i32, i32),
    /// Half its sides, grown.
    half: (i32, i32),
    /// Bearing and distance of each corner.
    corners: [(Angle, i32); 4],
    /// Bearing of its right end.
    pub right: Angle,
    /// To its left end, 2^-16 turn.
    pub width: i32,
}

impl Seen {
    /// None of a footprint that cannot be, of one that holds the sensor, and of one that reaches to where places are
    /// not told apart.
    pub fn new(area: &Footprint, levelling: &Levelling) -> Option<Self> {
        let (reach_x, reach_y) = area.reach()?;
        let (origin, heading) = (levelling.origin(), levelling.heading());
        let near = |at: i32, from: i32, reach: i32| {
            at.saturating_sub(from).saturating_abs().saturating_add(reach) < FARTHEST_CM
        };
        if !near(area.centre.x_cm, origin.x_cm, reach_x) || !near(area.centre.y_cm, origin.y_cm, reach_y) {
            return None;
        }
        let (x, y) = levelling.place(area.centre);
        let axis = (rounded(heading.cosine_wide(area.heading)), rounded(heading.sine_wide(area.heading)));
        let farthest = math::length(x, y) + area.half_length_cm + area.half_width_cm;
        let grown = 4 + (farthest >> 10);
        let half = (area.half_length_cm + grown, area.half_width_cm + grown);
        let to_sensor = (-rounded(x * axis.0 + y * axis.1), -rounded(y * axis.0 - x * axis.1));
        if to_sensor.0.abs() <= half.0 + NEAR_CM && to_sensor.1.abs() <= half.1 + NEAR_CM {
            return None;
        }
        let corner = |along: i32, left: i32| {
            let at = (x + rounded(along * axis.0 - left * axis.1), y + rounded(along * axis.1 + left * axis.0));
            (trig::bearing(at.0, at.1), math::length(at.0, at.1))
        };
        let corners =
            [corner(half.0, half.1), corner(half.0, -half.1), corner(-half.0, half.1), corner(-half.0, -half.1)];
        // it does not hold the sensor, so it covers less than half a turn
        let middle = trig::bearing(x, y);
        let (mut right, mut left) = (0, 0);
        for (bearing, _) in corners {
            let offset = (bearing - middle).raw();
            (right, left) = (offset.min(right), offset.max(left));
        }
        let width = i32::from(left) - i32::from(right) + 2 * i32::from(STEPS);
        let right = middle + Angle::from_raw(right) - Angle::from_raw(STEPS);
        Some(Self { to_sensor, axis, half, corners, right, width })
    }

    /// Distances at which a ray from the sensor enters and leaves it.
    fn along(&self, ray: Direction) -> Option<(i32, i32)> {
        let (x, y) = (i32::from(ray.x), i32::from(ray.y));
        let way = (rounded(x * self.axis.0 + y * self.axis.1), rounded(y * self.axis.0 - x * self.axis.1));
        let (mut enters, mut leaves) = (0, i32::MAX);
        for (from, way, half) in [(self.to_sensor.0, way.0, self.half.0), (self.to_sensor.1, way.1, self.half.1)] {
            let side = |side: i32| ((side - from) << 14).checked_div(way);
            let Some((a, b)) = side(-half).zip(side(half)) else {
                // along this side
                if from.abs() > half {
                    return None;
                }
                continue;
            };
            (enters, leaves) = (a.min(b).max(enters), a.max(b).min(leaves));
        }
        (enters <= leaves).then_some((enters, leaves))
    }
}

/// From 2^-14.
fn rounded(v: i32) -> i32 {
    (v + (1 << 13)) >> 14
}

impl PolarGeometry {
    /// Visits the cells of a map of this size that hold any point of an area: an azimuth, its first and its last range.
    /// False if a part of the area lies on no cell.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // cell numbers
    pub(crate) fn touched(
        &self,
        area: &Footprint,
        ranges: usize,
        azimuths: usize,
        mut visit: impl FnMut(usize, usize, usize),
    ) -> bool {
        let Some(seen) = Seen::new(area, &self.levelling) else { return false };
        let columns = self.columns(azimuths);
        let span = i32::from(self.azimuth_span).min(i32::from(i16::MAX));
        let right = i32::from((seen.right - self.azimuth_origin).raw());
        let left = right + seen.width;
        let mut complete = right >= 0 && left <= span;
        if left < 0 || right > span {
            return false;
        }
        let column = |bearing: i32| usize::try_from(columns.place(Angle::from_raw(bearing as i16)) >> 8).unwrap_or(0);
        let (first, last) = (column(right.max(0)), column(left.min(span)).min(azimuths.saturating_sub(1)));
        let cell_cm = self.cell_cm.max(1);
        let edge = |azimuth: usize| self.azimuth_origin + columns.bearing((azimuth << 8) as i32);
        let mut from = edge(first);
        let mut enters_from = seen.along(trig::direction(from));
        for azimuth in first..=last {
            let to = edge(azimuth + 1);
            let enters_to = seen.along(trig::direction(to));
            let width = i32::from((to - from).raw() as u16);
            let (mut near, mut far) = (i32::MAX, 0);
            for (enters, leaves) in [enters_from, enters_to].into_iter().flatten() {
                (near, far) = (near.min(enters), far.max(leaves));
            }
            for (bearing, distance) in seen.corners {
                let beside = Angle::from_raw(2 * STEPS);
                if i32::from((bearing - from + beside).raw() as u16) <= width + 4 * i32::from(STEPS) {
                    (near, far) = (near.min(distance), far.max(distance));
                }
            }
            (from, enters_from) = (to, enters_to);
            if near > far {
                continue;
            }
            let slack = 3 + (far >> 12);
            let cosine = trig::cos(Angle::from_raw((width / 2) as i16)) - 2;
            let near = (((near * cosine.max(0)) >> 14) - slack).max(0) / cell_cm;
            let far = far + slack;
            complete &= far < FARTHEST_CM && (far / cell_cm) < ranges as i32;
            let (near, far) = (near as usize, ((far / cell_cm) as usize).min(ranges.saturating_sub(1)));
            if near <= far {
                visit(azimuth, near, far);
            }
        }
        complete
    }
}
