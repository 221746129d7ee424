//! Time as the caller gives it; nothing in this library reads a clock.

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
    /// No time.
    pub const NONE: Self = Self(0);

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

    /// What is left of it after a shorter one.
    pub const fn less(self, other: Self) -> Self {
        Self(if self.0 > other.0 { self.0 - other.0 } else { 0 })
    }

    /// What a memory of this length (2^-16 s) keeps over the step, 2^-16: 1 / (1 + step / memory),
    /// within 0.1 % of the exponential for 67 ms and 1.5 s.
    #[allow(clippy::cast_possible_truncation)] // a share
    pub const fn keep(self, memory: i32) -> i32 {
        let whole = memory as i64 + self.0 as i64;
        (((memory as i64) << 16) / if whole > 0 { whole } else { 1 }) as i32
    }

    /// What an exponential memory of this length (2^-16 s) keeps over the step, 2^-24: exp(-step / memory),
    /// what is lost right to 0.2 % for steps from 20 ms and memories up to 600 s.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share
    pub const fn decay(self, memory: i32) -> u32 {
        const BITS: u32 = 30;
        const ONE: i64 = 1 << BITS;
        const LN_2: i64 = 744_261_118;
        // beyond 20 memories nothing is left of a byte
        let memory = if memory > 0 { memory as i64 } else { 1 };
        let times = ((self.0 as i64) << BITS) / memory;
        let times = if times > 20 * ONE { 20 * ONE } else { times };
        // 2^-halvings by shifting, the rest by the series up to the eighth power: its end is below 1e-7
        let (halvings, rest) = (times / LN_2, times % LN_2);
        let (mut sum, mut power) = (ONE, 8);
        while power > 0 {
            sum = ONE - ((sum * rest) >> BITS) / power;
            power -= 1;
        }
        let shift = BITS - 24 + halvings as u32;
        ((sum + (1 << (shift - 1))) >> shift) as u32
    }

    /// Way made at a speed, in the speed's unit times seconds.
    pub const fn times(self, per_second: i32) -> i32 {
        crate::fixed::math::mul_shift(per_second, self.0, 16)
    }
}

/// How far into a second a row of steps has come: what goes on at a rate is counted from it, so that the parts of steps
/// add up. Rounded down step by step, a slow rate would come to nothing where steps are short.
///
/// # Units
/// 1 LSB = 2^-16 s, up to one second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Phase(i32);

impl Phase {
    /// At the start of a second.
    pub const START: Self = Self(0);

    /// What a rate, a whole number a second, comes to over the next step.
    pub const fn times(self, step: Step, per_second: i32) -> i32 {
        let until = self.0.saturating_add(step.0);
        crate::fixed::math::mul_shift(per_second, until, 16) - crate::fixed::math::mul_shift(per_second, self.0, 16)
    }

    /// After a step. A second more or less makes no difference: a rate comes to a whole number in it.
    pub const fn after(self, step: Step) -> Self {
        Self(self.0.saturating_add(step.0) & 0xFFFF)
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
        let (long, short) = (Step::from_micros(3_000_000), Step::from_micros(1_000_000));
        assert_eq!((long.less(short).raw(), short.less(long)), (long.raw() - short.raw(), Step::NONE));
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
    fn a_memory_decays_as_the_exponential_from_a_thousandth_of_it_to_all() {
        for memory_s in [0.05, 0.4, 1.0, 5.0, 120.0, 600.0_f64] {
            for step_us in [20_000, 66_667, 200_000, 1_000_000] {
                let (step, memory) = (Step::from_micros(step_us), (memory_s * 65536.0).round() as i32);
                let exact = (-(step_us as f64) * 1e-6 / memory_s).exp();
                let lost = 1.0 - f64::from(step.decay(memory)) / f64::from(1 << 24);
                assert!((lost / (1.0 - exact) - 1.0).abs() < 2e-3, "{memory_s} s, {step_us} us: {lost}");
            }
        }
        assert_eq!(Step::from_micros(0).decay(1 << 16), 1 << 24);
        assert_eq!(Step::from_micros(u64::MAX).decay(1), 0);
        assert_eq!(Step::from_micros(1).decay(0), Step::from_micros(1).decay(1));
    }

    #[test]
    fn time_running_backwards_has_no_length() {
        assert_eq!(Time::from_micros(5).since(Time::from_micros(6)), None);
    }

    #[test]
    fn parts_of_steps_add_up_whatever_the_rate_of_frames_is() {
        for frames in [1, 7, 15, 26, 30, 60, 1000] {
            for rate in [1, 15, 26, 1280, 100_000] {
                let (mut phase, mut sum) = (Phase::START, 0);
                let step = Step::from_micros(1_000_000 / frames);
                for _ in 0..10 * frames {
                    let part = phase.times(step, rate);
                    assert!(part >= 0);
                    sum += part;
                    phase = phase.after(step);
                }
                let exact = (i64::from(rate) * i64::from(step.raw()) * 10 * frames as i64) >> 16;
                assert!((i64::from(sum) - exact).abs() <= 1, "{frames} frames and {rate} a second: {sum}, {exact}");
            }
        }
    }
}
