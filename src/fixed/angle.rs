//! Binary angles: 2^16 to the turn, so that wrap-around costs nothing.

use core::f32::consts::TAU;
use core::ops::{Add, Neg, Sub};

use crate::fixed::math;

/// An angle in [-half a turn, half a turn).
///
/// # Units
/// 1 LSB = 2^-16 turn = 0.0055 degrees; 2 cm across at 200 m.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Angle(i16);

impl Angle {
    /// Straight ahead.
    pub const ZERO: Self = Self(0);
    /// A quarter turn, counter-clockwise.
    pub const QUARTER: Self = Self(1 << 14);

    /// From 2^-16 turns.
    pub const fn from_raw(raw: i16) -> Self {
        Self(raw)
    }

    /// In 2^-16 turns.
    pub const fn raw(self) -> i16 {
        self.0
    }

    /// From radians; whole turns drop out, not a number becomes zero.
    #[allow(clippy::cast_possible_truncation)] // reduced to one turn before, wraps at half a turn
    pub fn from_radians(radians: f32) -> Self {
        let turns = radians / TAU;
        let fraction = turns - math::round(turns);
        Self(math::round_i32(fraction * 65536.0) as i16)
    }

    /// From degrees; whole turns drop out.
    pub fn from_degrees(degrees: f32) -> Self {
        Self::from_radians(degrees * (TAU / 360.0))
    }

    /// In radians, -pi to pi.
    pub fn radians(self) -> f32 {
        f32::from(self.0) * (TAU / 65536.0)
    }
}

impl Add for Angle {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }
}

impl Sub for Angle {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.wrapping_sub(other.0))
    }
}

impl Neg for Angle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.wrapping_neg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_is_ninety_degrees_to_the_left() {
        assert_eq!(Angle::from_degrees(90.0), Angle::QUARTER);
        assert_eq!(Angle::from_degrees(-90.0), -Angle::QUARTER);
        assert_eq!(Angle::from_degrees(450.0), Angle::QUARTER);
    }

    #[test]
    fn sums_wrap_at_half_a_turn() {
        let a = Angle::from_degrees(170.0) + Angle::from_degrees(20.0);
        assert!((a.radians().to_degrees() + 170.0).abs() < 0.01);
        assert_eq!(Angle::from_degrees(180.0).raw(), i16::MIN);
    }

    #[test]
    fn no_number_is_no_angle() {
        assert_eq!(Angle::from_radians(f32::NAN), Angle::ZERO);
        assert_eq!(Angle::from_radians(f32::INFINITY), Angle::ZERO);
    }
}
