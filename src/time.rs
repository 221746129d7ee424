//! Time as the caller tells it; nothing in this library reads a clock.

/// A moment on the radar's clock.
///
/// # Units
/// Microseconds since any fixed moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Time(u64);

impl Time {
    /// From microseconds.
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// In microseconds.
    pub const fn micros(self) -> u64 {
        self.0
    }

    /// Microseconds since an earlier moment; `None` where `earlier` is later.
    pub const fn since(self, earlier: Self) -> Option<u64> {
        self.0.checked_sub(earlier.0)
    }
}

/// A duration of at most 2^15 seconds.
///
/// # Units
/// 1 LSB = 2^-16 s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step(i32);

impl Step {
    /// From microseconds, saturating.
    #[allow(clippy::cast_possible_truncation)] // bounded by the minimum
    pub const fn from_micros(micros: u64) -> Self {
        let raw = (micros.saturating_mul(4295)) >> 16; // 2^16 / 10^6 = 4295 / 2^16, 8e-6 high
        Self(if raw > i32::MAX as u64 { i32::MAX } else { raw as i32 })
    }

    /// In 2^-16 s.
    pub const fn raw(self) -> i32 {
        self.0
    }

    /// What a memory of this length (2^-16 s) keeps over the step, 2^-16: 1 / (1 + step / memory),
    /// within 0.1 % of the exponential for 67 ms and 1.5 s.
    #[allow(clippy::cast_possible_truncation)] // a share
    pub const fn keep(self, memory: i32) -> i32 {
        let whole = memory as i64 + self.0 as i64;
        (((memory as i64) << 16) / if whole > 0 { whole } else { 1 }) as i32
    }

    /// Way made at a speed, in the speed's unit times seconds.
    pub const fn times(self, per_second: i32) -> i32 {
        crate::math::mul_shift(per_second, self.0, 16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_right_to_a_part_in_ten_thousand() {
        let s = Step::from_micros(66_972);
        assert!((f64::from(s.raw()) / 65536.0 - 0.066_972).abs() < 2e-5);
        assert_eq!(Step::from_micros(1_000_000).times(2500), 2500);
        assert_eq!(Step::from_micros(u64::MAX).raw(), i32::MAX);
    }

    #[test]
    fn memories_fade_by_time_not_by_frames() {
        let fade = |frames: u64| {
            let step = Step::from_micros(1_000_000 / frames);
            (0..frames).fold(1.0, |v: f64, _| v * f64::from(step.keep(3 << 15)) / 65536.0)
        };
        // one second of a 1.5 s memory: exp(-1 / 1.5) = 0.513
        assert!((fade(15) - 0.513).abs() < 0.02, "{}", fade(15));
        assert!((fade(15) - fade(30)).abs() < 0.01);
        assert_eq!(Step::from_micros(0).keep(1 << 16), 1 << 16);
    }

    #[test]
    fn time_running_backwards_has_no_length() {
        assert_eq!(Time::from_micros(5).since(Time::from_micros(6)), None);
    }
}
