//! What measured elevations say of an obstacle's height.
//!
//! # Model
//! A reflection that lies two standard deviations above a level proves something there, once it has company:
//! a floor under the height.
//!
//! Farther away hardly any does, but all together they still decide. A car reflects around 0.7 m above the
//! road; of something tall one reflection in twelve comes from around 2.6 m, the others from where a car's do.
//! With reflections of a car spread by 0.35 m and the standard deviation `s` of elevation beside that, a
//! height `h` is `1 - w + w exp((h - 1.65 m) 1.9 m / (s^2 + (0.35 m)^2))` times as likely of something tall
//! (`w` = 0.08). The logarithms are added up, with what the [radar cross section](super::reflectivity) says. Some lorries
//! show nothing high for long, so what is as long as one is not called low, unless it hardly reflects or is several cars in a row (`body.rs`).

/// Heights that are distinguished, centimetres.
const LEVELS_CM: [i32; 5] = [180, 220, 260, 310, 360];
/// Standard deviations a reflection must lie above a level.
const SIGMAS: i32 = 2;
/// Reflections above a level that prove it.
const PROOF: u16 = 3;
/// Least share of all reflections, as one in so many. A lorry shows one in 10 to 20 when near; one
/// in 50 strays over from the next lane.
const ONE_IN: u16 = 20;

/// Height of what is tall for certain, centimetres: a delivery van's.
const TALL_CM: i32 = 260;
/// Height of what is low for certain, centimetres: a high car's.
const LOW_CM: i32 = 160;
/// Half way between where a car and something tall reflect, and how far these are apart, centimetres.
const BETWEEN_CM: i32 = 165;
const APART_CM: i32 = 190;
/// Variance of the heights at which a car reflects, cm^2.
const CAR_VARIANCE: i32 = 35 * 35;
/// Evidence from which something is tall, or low: a factor of 400. 2^-8 nats.
const SURE: i16 = 6 << 8;
/// Most evidence that is kept, 2^-8 nats.
const MOST: i16 = 16 << 8;
/// `ln(1 - w + w exp(x))` for `x` from -4 in steps of a quarter, 2^-8 nats.
const LIKELIER: [i16; 33] = [
    -21, -21, -21, -20, -20, -20, -20, -19, -18, -18, -16, -15, -13, -11, -8, -5, 0, 6, 13, 22, 33, 47, 63, 83, 106,
    133, 164, 198, 237, 280, 326, 375, 426,
];

/// Reflections counted by the levels they prove, and how much likelier all are of something tall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tallness {
    measured: u16,
    above: [u16; LEVELS_CM.len()],
    /// 2^-8 nats.
    tall: i16,
    /// What the radar cross section adds to that.
    reflected: i16,
}

impl Tallness {
    /// Counts a reflection of measured height and its standard deviation, centimetres.
    pub fn add(&mut self, height_cm: i32, sigma_cm: i32) {
        if self.measured == u16::MAX {
            self.measured /= 2;
            self.above.iter_mut().for_each(|n| *n /= 2);
        }
        self.measured += 1;
        self.weigh(height_cm, sigma_cm);
        let sure = height_cm - SIGMAS * sigma_cm;
        for (n, level) in self.above.iter_mut().zip(LEVELS_CM) {
            if sure <= level {
                break;
            }
            *n += 1;
        }
    }

    /// Adds what a reflection says of tall and low.
    fn weigh(&mut self, height_cm: i32, sigma_cm: i32) {
        let (height, sigma) = (height_cm.clamp(-5000, 5000), sigma_cm.clamp(0, 5000));
        let eighths = (height - BETWEEN_CM) * APART_CM * 8 / (CAR_VARIANCE + sigma * sigma).max(1);
        let quarters = (eighths + 1) >> 1;
        let place = usize::try_from(quarters + 16).unwrap_or(0).min(LIKELIER.len() - 1);
        self.tall = (self.tall + LIKELIER.get(place).copied().unwrap_or(0)).clamp(-MOST, MOST);
    }

    /// Takes how much likelier its radar cross section makes something tall, 2^-8 nats.
    pub fn set_reflected(&mut self, nats: i16) {
        self.reflected = nats;
    }

    fn evidence(&self) -> i16 {
        self.tall.saturating_add(self.reflected)
    }

    /// The height it does not exceed, centimetres, if it is short.
    pub fn ceiling_cm(&self) -> i32 {
        if self.is_low() { LOW_CM } else { i32::MAX }
    }

    /// Whether it is low for certain.
    pub fn is_low(&self) -> bool {
        self.evidence() <= -SURE
    }

    /// Whether it is as tall as a delivery van for certain.
    pub fn is_tall(&self) -> bool {
        self.floor_cm() >= TALL_CM
    }

    /// Takes over another's counts.
    pub fn join(&mut self, other: &Self) {
        self.measured = self.measured.saturating_add(other.measured);
        self.tall = (self.tall + other.tall).clamp(-MOST, MOST);
        for (n, m) in self.above.iter_mut().zip(other.above) {
            *n = n.saturating_add(m);
        }
    }

    /// The height that is proven, centimetres; 0 while nothing is.
    pub fn floor_cm(&self) -> i32 {
        let tall = if self.evidence() >= SURE { TALL_CM } else { 0 };
        let proven = |n: &u16| *n >= PROOF && u32::from(*n) * u32::from(ONE_IN) >= u32::from(self.measured);
        let mut levels = self.above.iter().zip(&LEVELS_CM).rev();
        levels.find(|(n, _)| proven(n)).map_or(0, |(_, level)| *level).max(tall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many reflections each of a height and standard deviation, evenly mixed.
    fn of(hits: &[(i32, i32, usize)]) -> Tallness {
        let mut t = Tallness::default();
        let total: usize = hits.iter().map(|h| h.2).sum();
        for k in 0..total {
            for &(height, sigma, _) in hits.iter().filter(|h| (k + 1) * h.2 / total > k * h.2 / total) {
                t.add(height, sigma);
            }
        }
        t
    }

    #[test]
    fn heights_too_uncertain_to_prove_anything_tell_together_what_is_tall() {
        // 60 m away: a tenth of a lorry's reflections come from 2.6 m, none of them proves 1.8 m
        let lorry = of(&[(80, 105, 90), (260, 105, 10)]);
        assert!(lorry.above == [0; 5] && lorry.ceiling_cm() == i32::MAX, "{lorry:?}");
        let lorry = of(&[(80, 50, 160), (265, 50, 40)]);
        assert_eq!((lorry.above[0], lorry.floor_cm()), (0, 260), "{lorry:?}");
    }

    #[test]
    fn what_it_reflects_tips_the_balance_towards_low() {
        let mut t = of(&[(70, 40, 40)]);
        assert!(!t.is_low() && t.tall < -2 * 256, "{t:?}");
        t.set_reflected(-4 * 256);
        assert!(t.is_low());
        let mut t = of(&[(70, 40, 5)]);
        t.set_reflected(-4 * 256);
        assert!(!t.is_low(), "and decides nothing alone");
    }

    #[test]
    fn a_hundred_low_reflections_from_nearby_make_a_car_and_ten_do_not() {
        assert_eq!(of(&[(70, 40, 100)]).ceiling_cm(), 160);
        assert_eq!(of(&[(70, 40, 10)]).ceiling_cm(), i32::MAX);
        assert_eq!(of(&[(70, 400, 100)]).ceiling_cm(), i32::MAX, "far away low means nothing");
        let mut t = of(&[(70, 40, 100)]);
        (0..20).for_each(|_| t.add(300, 40));
        assert!(t.ceiling_cm() == i32::MAX && t.floor_cm() >= 260, "and what it shows then counts: {t:?}");
    }

    #[test]
    fn some_high_reflections_prove_a_lorry_and_low_ones_disprove_nothing() {
        assert_eq!(of(&[(100, 40, 200), (350, 40, 12)]).floor_cm(), 260);
        assert_eq!(of(&[(100, 40, 200)]).floor_cm(), 0);
    }

    #[test]
    fn noise_and_strays_prove_nothing() {
        assert_eq!(of(&[(70, 175, 500), (400, 175, 20)]).floor_cm(), 0, "far away 4 m is within the noise");
        assert_eq!(of(&[(70, 40, 100), (350, 40, 2)]).floor_cm(), 0, "two are strays");
        assert_eq!(of(&[(70, 40, 1000), (350, 40, 40)]).floor_cm(), 0, "so are forty in a thousand");
    }

    #[test]
    fn the_table_holds_the_logarithm_of_the_model() {
        for (k, entry) in LIKELIER.iter().enumerate() {
            let exact = 256.0 * (1.0 - 0.08 + 0.08 * f64::exp(-4.0 + 0.25 * k as f64)).ln();
            assert!((f64::from(*entry) - exact).abs() <= 0.5, "{k}: {entry}, {exact}");
        }
    }

    #[test]
    fn counting_never_overflows() {
        let mut t = of(&[(400, 10, 70_000)]);
        t.join(&of(&[(400, 10, 70_000)]));
        t.add(400, 10);
        assert_eq!(t.floor_cm(), 360);
    }
}
