//! The only file that names a floating-point library.
//!
//! Floats are used at start-up, to turn a configuration in SI units into integer tables. Both
//! libraries are pure Rust, so host and target compute the same bits. Free functions are called
//! on purpose: the standard library's methods would win on the host and differ in the last bit.

/// Sine of an angle in radians, error below 3e-7.
pub(crate) fn sin(x: f32) -> f32 {
    libm::sinf(x)
}

/// Cosine of an angle in radians, error below 3e-7.
pub(crate) fn cos(x: f32) -> f32 {
    libm::cosf(x)
}

/// Angle of the vector (x, y) in radians.
pub(crate) fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Square root.
pub(crate) fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Nearest integer, halves away from zero.
pub(crate) fn round(x: f32) -> f32 {
    libm::roundf(x)
}

/// Exponential for kernel tables of eight bits; relative error below 0.25 %.
pub(crate) fn exp_coarse(x: f32) -> f32 {
    micromath::F32(x).exp().0
}

/// `round(x)` as an `i32`, saturating; not a number becomes 0.
#[allow(clippy::cast_possible_truncation)] // float casts saturate
pub(crate) fn round_i32(x: f32) -> i32 {
    round(x) as i32
}

/// Length of (a, b), at most 7 % above and 3 % below the exact value, for noise gates.
pub(crate) fn hypot_gate(a: i32, b: i32) -> i32 {
    let (a, b) = (a.abs(), b.abs());
    let (long, short) = if a > b { (a, b) } else { (b, a) };
    long + ((short * 3) >> 3)
}

/// `value * factor / 2^shift`, computed in 64 bits and rounded down.
#[allow(clippy::cast_possible_truncation)] // callers' products fit after the shift
pub(crate) const fn mul_shift(value: i32, factor: i32, shift: u32) -> i32 {
    ((value as i64 * factor as i64) >> shift) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coarse_exponential_is_good_to_eight_bits() {
        let worst = (0..=800)
            .map(|i| {
                let x = -(i as f32) * 0.01;
                (f64::from(exp_coarse(x)) - f64::from(x).exp()).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst < 0.5 / 255.0, "off by {worst}");
    }

    #[test]
    fn the_gate_length_stays_within_its_bounds() {
        for a in (0..1000).step_by(7) {
            for b in (0..1000).step_by(11) {
                let exact = f64::from(a).hypot(f64::from(b));
                let got = f64::from(hypot_gate(a, b));
                assert!(got <= exact * 1.07 + 1.0 && got >= exact * 0.97 - 1.0, "({a}, {b}): {got} for {exact}");
            }
        }
    }

    #[test]
    fn rounding_saturates() {
        assert_eq!(round_i32(2.5), 3);
        assert_eq!(round_i32(-2.5), -3);
        assert_eq!(round_i32(1e12), i32::MAX);
        assert_eq!(round_i32(f32::NAN), 0);
    }
}
