//! Upright boxes on the road, in the levelled frame: what obstacles become for the grid.

use crate::fixed::trig::Direction;

/// An upright box standing on the road.
///
/// # Units
/// Centimetres, levelled frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Solid {
    /// Middle of the footprint.
    pub x_cm: i32,
    /// Middle of the footprint, + left.
    pub y_cm: i32,
    /// Direction of its length.
    pub heading: Direction,
    /// Half the length.
    pub half_length_cm: i32,
    /// Half the width.
    pub half_width_cm: i32,
    /// Top above the road.
    pub height_cm: i32,
}

impl Solid {
    /// Corners of the footprint, counter-clockwise.
    pub fn corners(&self) -> [(i32, i32); 4] {
        let left = self.heading.left();
        let (lx, ly) = scaled(self.heading, self.half_length_cm);
        let (wx, wy) = scaled(left, self.half_width_cm);
        [
            (self.x_cm + lx + wx, self.y_cm + ly + wy),
            (self.x_cm - lx + wx, self.y_cm - ly + wy),
            (self.x_cm - lx - wx, self.y_cm - ly - wy),
            (self.x_cm + lx - wx, self.y_cm + ly - wy),
        ]
    }

    /// The origin in the box's own axes, for [`Solid::crossing`].
    pub fn origin(&self) -> (i32, i32) {
        (-self.heading.along(self.x_cm, self.y_cm), -self.heading.across(self.x_cm, self.y_cm))
    }

    /// Where a ray from the origin enters and leaves the footprint, centimetres along the ray;
    /// `None` where it misses. An origin inside enters at 0.
    pub fn crossing(&self, origin: (i32, i32), ray: Direction) -> Option<(i32, i32)> {
        let ahead = (i32::from(ray.x) * i32::from(self.heading.x) + i32::from(ray.y) * i32::from(self.heading.y)) >> 14;
        let left = (i32::from(ray.y) * i32::from(self.heading.x) - i32::from(ray.x) * i32::from(self.heading.y)) >> 14;
        let (mut enter, mut leave) = (0, i32::MAX);
        for (start, step, half) in [(origin.0, ahead, self.half_length_cm), (origin.1, left, self.half_width_cm)] {
            if step.abs() < PARALLEL {
                if start.abs() > half {
                    return None;
                }
                continue;
            }
            // up to 2^17 cm, so that the shift stays in 32 bits
            let at = |side: i32| ((side - start).clamp(-0x1FFFF, 0x1FFFF) << 14).checked_div(step).unwrap_or(0);
            let (a, b) = (at(-half), at(half));
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some((enter, leave))
    }
}

/// Below this a ray counts as parallel to a side, 2^-14: 0.014 degrees.
const PARALLEL: i32 = 4;

fn scaled(d: Direction, length: i32) -> (i32, i32) {
    ((i32::from(d.x) * length) >> 14, (i32::from(d.y) * length) >> 14)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::fixed::trig;

    fn truck(x_cm: i32, y_cm: i32, heading_deg: f32) -> Solid {
        Solid {
            x_cm,
            y_cm,
            heading: trig::direction(Angle::from_degrees(heading_deg)),
            half_length_cm: 800,
            half_width_cm: 125,
            height_cm: 400,
        }
    }

    fn cross(s: Solid) -> Option<(i32, i32)> {
        s.crossing(s.origin(), Direction::AHEAD)
    }

    #[test]
    fn a_ray_crosses_from_face_to_face() {
        assert_eq!(cross(truck(5000, 0, 0.0)), Some((4200, 5800)));
        let across = cross(truck(5000, 0, 90.0)).unwrap();
        assert!((across.0 - 4875).abs() <= 2 && (across.1 - 5125).abs() <= 2, "{across:?}");
        assert_eq!(cross(truck(5000, 126, 0.0)), None);
        assert_eq!(cross(truck(-5000, 0, 0.0)), None, "behind the sensor");
        assert_eq!(cross(truck(0, 0, 0.0)), Some((0, 800)), "over the sensor");
    }

    #[test]
    fn corners_go_round_to_the_left() {
        let c = truck(0, 0, 90.0).corners();
        assert!((c[0].0 + 125).abs() <= 1 && (c[0].1 - 800).abs() <= 1, "{c:?}");
        assert!((c[3].0 - 125).abs() <= 1 && (c[3].1 - 800).abs() <= 1, "{c:?}");
    }
}
