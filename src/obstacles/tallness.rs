//! What measured elevations say of an obstacle's height: a floor, never a ceiling.
//!
//! Most reflections come from below the roof, so low ones prove nothing. A reflection that lies two
//! standard deviations above a level proves something there, once it has company.

/// Heights that are told apart, centimetres.
const LEVELS_CM: [i32; 5] = [180, 220, 260, 310, 360];
/// Standard deviations a reflection must lie above a level.
const SIGMAS: i32 = 2;
/// Reflections above a level that prove it.
const PROOF: u16 = 3;
/// Least share of all reflections, as one in so many. A lorry shows one in 10 to 20 when near; one
/// in 50 strays over from the next lane.
const ONE_IN: u16 = 20;

const MOST: i16 = 4096;
const TALL: i16 = 1024;
const LOW: i16 = 1536;
const RATIO: [i16; 33] = [-21, -21, -21, -20, -20, -20, -20, -19, -18, -18, -16, -15, -13, -11, -8, -5, 0, 6, 13, 22, 33, 47, 63, 83, 106, 133, 164, 198, 237, 280, 326, 375, 426];

/// Reflections counted by the levels they prove.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tallness {
    /// How much likelier all heights are of something tall than of a car, 2^-8 nats.
    likelier: i16,
    measured: u16,
    above: [u16; LEVELS_CM.len()],
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

    fn weigh(&mut self, height_cm: i32, sigma_cm: i32) {
        let sigma = sigma_cm.min(3000);
        let s2 = 35 * 35 + sigma * sigma;
        let e = ((height_cm.clamp(-5000, 5000) - 165) * 190 * 4 / s2.max(1)).clamp(-16, 16);
        let gain = RATIO.get((e + 16) as usize).copied().unwrap_or(0);
        self.likelier = (self.likelier + gain).clamp(-MOST, MOST);
    }

    /// The height it does not exceed, as far as its reflections tell, centimetres.
    pub fn ceiling_cm(&self) -> i32 {
        if self.likelier <= -LOW { 160 } else { i32::MAX }
    }

    /// Takes over another's counts.
    pub fn join(&mut self, other: &Self) {
        self.measured = self.measured.saturating_add(other.measured);
        self.likelier = (self.likelier + other.likelier).clamp(-MOST, MOST);
        for (n, m) in self.above.iter_mut().zip(other.above) {
            *n = n.saturating_add(m);
        }
    }

    /// The height that is proven, centimetres; 0 while nothing is.
    pub fn floor_cm(&self) -> i32 {
        let tall = if self.likelier >= TALL { 260 } else { 0 };
        let proven = |n: &u16| *n >= PROOF && u32::from(*n) * u32::from(ONE_IN) >= u32::from(self.measured);
        let mut levels = self.above.iter().zip(&LEVELS_CM).rev();
        levels.find(|(n, _)| proven(n)).map_or(0, |(_, level)| *level).max(tall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(hits: &[(i32, i32, usize)]) -> Tallness {
        let mut t = Tallness::default();
        for &(height, sigma, n) in hits {
            (0..n).for_each(|_| t.add(height, sigma));
        }
        t
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
    fn counting_never_overflows() {
        let mut t = of(&[(400, 10, 70_000)]);
        t.join(&of(&[(400, 10, 70_000)]));
        t.add(400, 10);
        assert_eq!(t.floor_cm(), 360);
    }
}
