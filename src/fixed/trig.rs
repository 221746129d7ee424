//! Integer sine, cosine and bearing from two constant tables.
//!
//! # Limits
//! Sine and cosine within 2 LSB of 2^-14, bearings within 2 LSB of 2^-16 turn (0.011 degrees).

use core::f64::consts::{FRAC_PI_2, PI};

use crate::fixed::angle::Angle;
use crate::fixed::math;

/// A direction in the plane: cosine and sine.
///
/// # Units
/// 1 LSB = 2^-14; the length is 1 within 3 LSB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Direction {
    /// Component along x.
    pub x: i16,
    /// Component along y.
    pub y: i16,
}

/// One, in the scale of [`Direction`].
pub const ONE: i32 = 1 << 14;

impl Direction {
    /// Along x.
    pub const AHEAD: Self = Self { x: 1 << 14, y: 0 };

    /// Direction of the vector (x, y), which has a length.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // no component is longer than the vector
    pub fn of(x: i32, y: i32) -> Self {
        // the longer component of 15 bits: squares fit, and a root within two is one within 2 LSB
        let bits = 32 - (x.unsigned_abs() | y.unsigned_abs()).leading_zeros();
        let scaled = |v: i32| if bits > 15 { v >> (bits - 15) } else { v << (15 - bits) };
        let (x, y) = (scaled(x), scaled(y));
        let length = math::length(x, y).max(1);
        Self { x: ((x << 14) / length) as i16, y: ((y << 14) / length) as i16 }
    }

    /// Component of the vector (x, y) along this direction.
    pub fn along(self, x: i32, y: i32) -> i32 {
        dot(x, self.x, y, self.y)
    }

    /// Cosine of the angle to another direction, 2^-14.
    pub fn cosine(self, other: Self) -> i32 {
        self.cosine_wide(other) >> 14
    }

    /// Sine of the angle to another direction, 2^-14; + where that lies to the left.
    pub fn sine(self, other: Self) -> i32 {
        self.sine_wide(other) >> 14
    }

    /// The cosine in 2^-28.
    pub(crate) fn cosine_wide(self, other: Self) -> i32 {
        i32::from(self.x) * i32::from(other.x) + i32::from(self.y) * i32::from(other.y)
    }

    /// The sine in 2^-28.
    pub(crate) fn sine_wide(self, other: Self) -> i32 {
        i32::from(self.x) * i32::from(other.y) - i32::from(self.y) * i32::from(other.x)
    }

    /// Component of the vector (x, y) to the left of this direction.
    pub fn across(self, x: i32, y: i32) -> i32 {
        dot(y, self.x, x, -self.y)
    }

    /// The direction a quarter turn to the left.
    pub fn left(self) -> Self {
        Self { x: -self.y, y: self.x }
    }

    /// The opposite direction.
    pub fn reversed(self) -> Self {
        Self { x: -self.x, y: -self.y }
    }
}

/// a b + c d, 2^-14, in 64 bits: places reach 2^17 centimetres.
#[allow(clippy::cast_possible_truncation)] // a projection is no longer than the vector
fn dot(a: i32, b: i16, c: i32, d: i16) -> i32 {
    ((i64::from(a) * i64::from(b) + i64::from(c) * i64::from(d)) >> 14) as i32
}

const STEPS: usize = 256;
const LAST_STEP: i32 = 255;
const _: () = assert!(LAST_STEP as usize + 1 == STEPS);

/// Sine over a quarter turn, 2^-14.
static SINE: [u16; STEPS + 1] = sine_table();
/// Arc tangent of 0..=1, 2^-16 turn.
static ARC_TANGENT: [u16; STEPS + 1] = arc_tangent_table();

/// Power series; the compiler computes the table, so every target holds the same.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::indexing_slicing)] // compile time
const fn sine_table() -> [u16; STEPS + 1] {
    let mut table = [0; STEPS + 1];
    let mut i = 0;
    while i <= STEPS {
        let x = i as f64 / STEPS as f64 * FRAC_PI_2;
        let (mut sum, mut term, mut n) = (x, x, 1.0);
        while n < 12.0 {
            term *= -x * x / ((2.0 * n) * (2.0 * n + 1.0));
            sum += term;
            n += 1.0;
        }
        table[i] = (sum * ONE as f64 + 0.5) as u16;
        i += 1;
    }
    table
}

/// Euler's series, which converges well up to 1.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::indexing_slicing)] // compile time
const fn arc_tangent_table() -> [u16; STEPS + 1] {
    let mut table = [0; STEPS + 1];
    let mut i = 0;
    while i <= STEPS {
        let x = i as f64 / STEPS as f64;
        let square = x * x / (1.0 + x * x);
        let (mut term, mut n) = (x / (1.0 + x * x), 1.0);
        let mut sum = term;
        while n < 60.0 {
            term *= square * 2.0 * n / (2.0 * n + 1.0);
            sum += term;
            n += 1.0;
        }
        table[i] = (sum / PI * 32768.0 + 0.5) as u16;
        i += 1;
    }
    table
}

/// Sine, 2^-14.
pub fn sin(angle: Angle) -> i32 {
    let raw = angle.raw();
    let quarter = i32::from(raw) & 0x3FFF;
    let rising = raw & 0x4000 == 0;
    let value = interpolate(&SINE, if rising { quarter } else { 0x4000 - quarter }, 6);
    if raw < 0 { -value } else { value }
}

/// Cosine, 2^-14.
pub fn cos(angle: Angle) -> i32 {
    sin(angle + Angle::QUARTER)
}

/// Unit vector of an angle.
#[allow(clippy::cast_possible_truncation)] // both within +-2^14
pub fn direction(angle: Angle) -> Direction {
    let raw = angle.raw();
    let quarter = i32::from(raw) & 0x3FFF;
    let (from_start, from_end) = (interpolate(&SINE, quarter, 6), interpolate(&SINE, 0x4000 - quarter, 6));
    // the second and the fourth quarter mirror the first and the third
    let (sine, cosine) = if raw & 0x4000 == 0 { (from_start, from_end) } else { (from_end, from_start) };
    let ahead = raw.wrapping_add(0x4000) >= 0;
    Direction { x: if ahead { cosine } else { -cosine } as i16, y: if raw < 0 { -sine } else { sine } as i16 }
}

/// Angle of the vector (x, y), counter-clockwise from x; zero for no vector.
///
/// Lengths up to 2^16 per component.
#[allow(clippy::cast_possible_truncation)] // an octant's angle fits, the sum wraps by design
#[inline]
pub fn bearing(x: i32, y: i32) -> Angle {
    let (long, short) = (x.abs().max(y.abs()), x.abs().min(y.abs()));
    if long == 0 {
        return Angle::ZERO;
    }
    let octant = interpolate(&ARC_TANGENT, (short << 14) / long, 6);
    let quadrant = if x.abs() >= y.abs() { octant } else { 0x4000 - octant };
    let half = if x >= 0 { quadrant } else { 0x8000 - quadrant };
    Angle::from_raw(if y >= 0 { half } else { -half } as i16)
}

/// Table value at `position` in 0..=2^14, `position >> shift` being the step.
fn interpolate(table: &[u16; STEPS + 1], position: i32, shift: u32) -> i32 {
    let step = (position >> shift).clamp(0, LAST_STEP);
    let part = position - (step << shift);
    let at = |step: i32| i32::from(table.get(step as usize).copied().unwrap_or(0));
    let (a, b) = (at(step), at(step + 1));
    a + (((b - a) * part + (1 << (shift - 1))) >> shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_within_two_steps_everywhere() {
        for raw in i16::MIN..=i16::MAX {
            let a = Angle::from_raw(raw);
            assert_eq!(direction(a), Direction { x: cos(a) as i16, y: sin(a) as i16 }, "direction {raw}");
            let exact = f64::from(raw) / 32768.0 * PI;
            assert!((f64::from(sin(a)) - exact.sin() * 16384.0).abs() < 2.0, "sin {raw}");
            assert!((f64::from(cos(a)) - exact.cos() * 16384.0).abs() < 2.0, "cos {raw}");
        }
    }

    #[test]
    fn bearings_are_within_two_steps_and_turn_left() {
        assert_eq!(bearing(0, 5), Angle::QUARTER);
        assert_eq!(bearing(0, -5), -Angle::QUARTER);
        assert_eq!(bearing(-5, 0).raw(), i16::MIN);
        assert_eq!(bearing(0, 0), Angle::ZERO);
        for i in 0..2000 {
            let exact = f64::from(i) / 2000.0 * std::f64::consts::TAU - PI;
            let (x, y) = ((exact.cos() * 20_000.0).round(), (exact.sin() * 20_000.0).round());
            let got = bearing(x as i32, y as i32);
            let off = f64::from(got.raw()) - y.atan2(x) / PI * 32768.0;
            let off = (off + 32768.0).rem_euclid(65536.0) - 32768.0;
            assert!(off.abs() < 2.0, "bearing of {exact}: off by {off}");
        }
    }

    #[test]
    fn the_direction_of_a_vector_is_within_three_steps_at_any_length() {
        for i in 0..1000 {
            let angle = f64::from(i) / 1000.0 * std::f64::consts::TAU;
            for length in [3.0, 500.0, 40_000.0, 9e6, 2e9] {
                let (x, y) = ((angle.cos() * length).round(), (angle.sin() * length).round());
                let (d, exact) = (Direction::of(x as i32, y as i32), f64::hypot(x, y));
                let off = |got: i16, v: f64| (f64::from(got) - v / exact * 16384.0).abs();
                assert!(off(d.x, x) < 3.0 && off(d.y, y) < 3.0, "({x}, {y}): {d:?}");
            }
        }
        assert_eq!(Direction::of(0, 0), Direction { x: 0, y: 0 });
    }

    #[test]
    fn along_and_across_follow_the_direction() {
        let d = direction(Angle::from_degrees(90.0));
        assert_eq!((d.along(0, 100), d.across(-100, 0)), (100, 100));
        assert_eq!(d.left().along(-100, 0), 100);
        let (ahead, half_left) = (Direction::AHEAD, direction(Angle::from_degrees(30.0)));
        assert_eq!((ahead.cosine(half_left), ahead.sine(half_left)), (14_189, 8192));
        assert_eq!(half_left.sine(ahead), -8192);
    }
}
