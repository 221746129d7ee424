//! The only file that names a floating-point library.
//!
//! Floats are used at start-up, to turn a configuration in SI units into integer tables. Both
//! libraries are pure Rust, so host and target compute the same bits. Free functions are called
//! on purpose: the standard library's methods would win on the host and differ in the last bit.

/// Sine of an angle of at most a few turns in radians, error below 3e-7.
pub(crate) fn sin(x: f32) -> f32 {
    sine_from(0, x)
}

/// Cosine of an angle of at most a few turns in radians, error below 3e-7.
pub(crate) fn cos(x: f32) -> f32 {
    sine_from(1, x)
}

/// Sine of `x` and some quarter turns, in single precision throughout: libm's goes through doubles,
/// which a controller has to emulate.
///
/// # References
/// Reduction and polynomials: Moshier, Cephes `sinf.c`.
fn sine_from(quarter: i32, x: f32) -> f32 {
    let quarters = round(x * core::f32::consts::FRAC_2_PI);
    // a quarter turn in three parts, so that products with small integers are exact
    let r = ((x - quarters * 1.570_312_5) - quarters * 4.837_513e-4) - quarters * 7.549_79e-8;
    let z = r * r;
    let sine = r + r * z * (-0.166_666_55 + z * (8.332_161e-3 - z * 1.951_529_6e-4));
    let cosine = 1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    match (round_i32(quarters).wrapping_add(quarter)) & 3 {
        0 => sine,
        1 => cosine,
        2 => -sine,
        _ => -cosine,
    }
}

/// Angle of the vector (x, y) in radians.
pub(crate) fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// Square root.
pub(crate) fn sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

/// Square root in double precision, for start-up computations that single precision is too coarse for.
pub(crate) fn sqrt_double(x: f64) -> f64 {
    libm::sqrt(x)
}

/// Decimal logarithm.
pub(crate) fn log10(x: f32) -> f32 {
    libm::log10f(x)
}

/// Nearest integer, halves away from zero.
#[inline(never)] // for parameters only
pub(crate) fn round(x: f32) -> f32 {
    libm::roundf(x)
}

/// Exponential for kernel tables of eight bits; relative error below 0.25 %.
pub(crate) fn exp_coarse(x: f32) -> f32 {
    micromath::F32(x).exp().0
}

/// `round(x)` as an `i32`, saturating; not a number becomes 0.
#[allow(clippy::cast_possible_truncation)] // float casts saturate
#[inline(never)] // for parameters only
pub(crate) fn round_i32(x: f32) -> i32 {
    round(x) as i32
}

/// Length of (a, b), at most 7 % above and 3 % below the exact value, for noise gates.
#[inline(never)] // as the root
pub(crate) fn hypot_gate(a: i32, b: i32) -> i32 {
    let (a, b) = (a.abs(), b.abs());
    let (long, short) = if a > b { (a, b) } else { (b, a) };
    long + ((short * 3) >> 3)
}

/// Square root, within two of the exact root (one below 2^30).
///
/// A table of eight bits and one Newton step: a third of what the exact `u32::isqrt` costs.
#[allow(clippy::cast_possible_truncation)] // the root of 32 bits has 16
#[inline(never)] // a hundred bytes of a controller's flash wherever it is called
pub(crate) fn root(v: u32) -> u32 {
    if v < 64 * 64 {
        return v.isqrt();
    }
    // an even shift brings the top of the number into 64..=255
    let shift = (24 - v.leading_zeros()).next_multiple_of(2);
    let guess = match ROOTS.get((v >> shift) as usize) {
        Some(&r) => u32::from(r) << (shift / 2) >> 4,
        None => return v.isqrt(),
    };
    ((guess + v / guess.max(1)) >> 1).min(0xFFFF)
}

/// Sixteen times the root of the index and a half.
static ROOTS: [u8; 256] = roots();

#[allow(clippy::cast_possible_truncation, clippy::indexing_slicing)] // compile time
const fn roots() -> [u8; 256] {
    let mut table = [0; 256];
    let mut i: u32 = 0;
    while i < 256 {
        let root = (256 * i + 128).isqrt();
        table[i as usize] = if root > 255 { 255 } else { root as u8 };
        i += 1;
    }
    table
}

/// Length of a ground vector; beyond 46 340 along an axis it is taken to lie there.
#[allow(clippy::cast_possible_wrap)] // a root of 32 bits
#[inline(never)] // as the root
pub(crate) fn length(x: i32, y: i32) -> i32 {
    let (x, y) = (x.unsigned_abs().min(46_340), y.unsigned_abs().min(46_340));
    root(x * x + y * y) as i32
}

/// `value * factor / 2^shift`, computed in 64 bits and rounded down.
#[allow(clippy::cast_possible_truncation)] // callers' products fit after the shift
pub(crate) const fn mul_shift(value: i32, factor: i32, shift: u32) -> i32 {
    ((value as i64 * factor as i64) >> shift) as i32
}

/// `2^BITS a / b`, rounded towards zero, without a division of 64 bits, which a controller has to emulate. `b` is at least 1, and
/// the result fits into 32 bits. Where `b` is beyond `2^(31 - BITS / 2)`, both lose their last bits until it is not: the result is
/// then right to a part in `2^(30 - BITS / 2)`, and to two more.
pub(crate) const fn ratio<const BITS: u32>(a: i32, b: i32) -> i32 {
    debug_assert!(b > 0, "a ratio to nothing");
    let b = if b > 0 { b } else { 1 };
    debug_assert!((a / b).unsigned_abs() < 1 << (31 - BITS), "a ratio beyond 32 bits");
    let (high, low) = (BITS / 2, BITS - BITS / 2);
    let beyond = (1 + high).saturating_sub(b.leading_zeros());
    // at least 1, which the compiler does not see: an image must not be able to panic
    let (a, b) = (a >> beyond, if b >> beyond > 0 { b >> beyond } else { 1 });
    let (whole, left) = (a / b, (a % b) << high);
    let (upper, left) = (left / b, (left % b) << low);
    (whole << BITS) + (upper << low) + left / b
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
    fn sines_are_right_to_three_parts_in_ten_million() {
        for i in -12_600..=12_600 {
            let x = i as f32 * 1e-3 + 1e-4;
            let off = |got: f32, exact: f64| (f64::from(got) - exact).abs();
            assert!(off(sin(x), f64::from(x).sin()) < 3e-7, "sine of {x}");
            assert!(off(cos(x), f64::from(x).cos()) < 3e-7, "cosine of {x}");
        }
        assert_eq!((sin(0.0), cos(0.0)), (0.0, 1.0));
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
    fn roots_are_within_two() {
        let off = |v: u32| i64::from(root(v)) - i64::from(v.isqrt());
        for v in (0..200_000).chain((0..u32::MAX).step_by(9973)).chain(u32::MAX - 70_000..=u32::MAX) {
            assert!((-2..=2).contains(&off(v)), "{v}: {}", off(v));
        }
    }

    #[test]
    fn ratios_are_those_of_64_bits() {
        let exact = |a: i32, b: i32, bits: u32| i32::try_from((i64::from(a) << bits) / i64::from(b)).ok();
        for a in [0, 1, -1, 77, -4095, 123_456, -9_999_999, 1 << 28] {
            for b in [1, 2, 3, 4369, 65_537, 1 << 20, (1 << 22) - 1] {
                let check = |ratio: fn(i32, i32) -> i32, bits| {
                    if let Some(exact) = exact(a, b, bits) {
                        assert_eq!(ratio(a, b), exact, "{a} / {b}");
                    }
                };
                check(ratio::<8>, 8);
                check(ratio::<12>, 12);
                check(ratio::<16>, 16);
            }
        }
    }

    #[test]
    fn ratios_to_great_numbers_are_those_of_64_bits_to_a_part_in_a_million() {
        for b in [1 << 24, (1 << 25) + 1, 53_000_000, 1 << 28, i32::MAX - 1, i32::MAX] {
            for a in [0, 1, -1, 4_000_000, -4_000_000, b / 3, b - 1, -b] {
                let exact = |bits: u32| f64::from(a) / f64::from(b) * f64::from(1 << bits);
                let off = |got: i32, bits| (f64::from(got) - exact(bits)).abs() - exact(bits).abs() * 1e-6;
                let off = [off(ratio::<8>(a, b), 8), off(ratio::<12>(a, b), 12)];
                assert!(off.iter().all(|off| *off <= 2.0), "{a} / {b}: {off:?}");
            }
        }
        // a place known to 20 m, measured to 70 m: noise of 10 degrees at 400 m
        assert_eq!(ratio::<12>(4_000_000, 4_000_000 + 6_981 * 6_981), 310);
    }

    #[test]
    fn rounding_saturates() {
        assert_eq!(round_i32(2.5), 3);
        assert_eq!(round_i32(-2.5), -3);
        assert_eq!(round_i32(1e12), i32::MAX);
        assert_eq!(round_i32(f32::NAN), 0);
    }
}
