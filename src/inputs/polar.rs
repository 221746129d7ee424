//! Cartesian coordinates of a radar, in centimetres, to range, azimuth and elevation.

use crate::fixed::angle::Angle;
use crate::fixed::trig;

/// Range, azimuth and elevation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spherical {
    pub(crate) range_cm: u16,
    /// Square of the range before it was rounded.
    square: u32,
    pub(crate) azimuth: Angle,
    pub(crate) elevation: Angle,
}

/// Of a place x ahead, y to the left and z up. `None` at the radar itself and beyond 655 m.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // bounded by the range
pub(crate) fn spherical([x, y, z]: [i32; 3]) -> Option<Spherical> {
    let square = |v: i32| u64::from(v.unsigned_abs()) * u64::from(v.unsigned_abs());
    let ground = u32::try_from(square(x) + square(y)).ok()?;
    let slant = u32::try_from(u64::from(ground) + square(z)).ok()?;
    let range_cm = u16::try_from(root(slant)).ok().filter(|r| *r > 0)?;
    let elevation = trig::bearing(root(ground) as i32, z);
    Some(Spherical { range_cm, square: slant, azimuth: trig::bearing(x, y), elevation })
}

impl Spherical {
    /// The part of a velocity along the line of sight to the place x ahead and y to the left, + receding.
    #[allow(clippy::cast_possible_truncation)] // cut to 16 bits
    pub(crate) fn radial(&self, [x, y]: [i32; 2], [vx, vy]: [i32; 2]) -> i16 {
        let dot = i64::from(x) * i64::from(vx) + i64::from(y) * i64::from(vy);
        let range = i64::from(self.range_cm.max(1));
        let fine = 256 * dot / range;
        // what rounding the range took away, to first order
        let rest = i64::from(self.square) - range * range;
        let corrected = fine - fine * rest / (2 * i64::from(self.square.max(1)));
        ((corrected + 128) >> 8).clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16
    }
}

/// Nearest whole root.
fn root(v: u32) -> u32 {
    let r = v.isqrt();
    r + u32::from(v - r * r > r)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn left_and_up_are_positive() {
        let s = spherical([3000, 4000, 0]).unwrap();
        assert_eq!((s.range_cm, s.elevation), (5000, Angle::ZERO));
        assert!((s.azimuth.radians() - 0.9273).abs() < 4e-4, "left");
        assert!(spherical([3000, -4000, 0]).unwrap().azimuth.raw() < 0, "right");
        assert!(spherical([3000, 0, 300]).unwrap().elevation.raw() > 0, "up");
    }

    #[test]
    fn ranges_are_rounded_and_have_limits() {
        assert_eq!(spherical([1, 1, 0]).unwrap().range_cm, 1);
        assert_eq!(spherical([10, 10, 0]).unwrap().range_cm, 14);
        assert_eq!(spherical([65_535, 0, 0]).unwrap().range_cm, 65_535);
        for none in [[0, 0, 0], [65_536, 0, 0], [i32::MIN, i32::MIN, i32::MIN], [0, 0, i32::MAX]] {
            assert_eq!(spherical(none), None);
        }
    }

    #[test]
    fn receding_is_positive_and_what_passes_broadside_has_no_radial_speed() {
        let radial = |x, y, v| spherical([x, y, 0]).unwrap().radial([x, y], v);
        assert_eq!(radial(5000, 0, [1000, 700]), 1000);
        assert_eq!(radial(0, 5000, [1000, -700]), -700);
        assert_eq!(radial(3000, 4000, [-1000, 0]), -600);
        assert_eq!(radial(3000, 4000, [-4000, 3000]), 0);
    }

    #[test]
    fn radial_velocities_are_right_to_a_centimetre_a_second() {
        for i in 0..2000_i32 {
            let (x, y) = (200 + i * 31, (i * 7919) % 20_000 - 10_000);
            let (vx, vy) = ((i * 131) % 14_000 - 7_000, (i * 57) % 6_000 - 3_000);
            let exact =
                (f64::from(x) * f64::from(vx) + f64::from(y) * f64::from(vy)) / f64::from(x).hypot(f64::from(y));
            let got = spherical([x, y, 0]).unwrap().radial([x, y], [vx, vy]);
            assert!((f64::from(got) - exact).abs() < 0.52, "({x}, {y}), ({vx}, {vy}): {got} for {exact}");
        }
    }
}
