//! What an obstacle's radar cross section says of what it is, where the radar measures that.
//!
//! # Model
//! The greatest radar cross section of a frame, in the mean of the last sixteen, lies at 77 GHz around -7 dBsm for a
//! pedestrian, -3 dBsm for a bicycle, 7 dBsm for a car and 15 dBsm for a lorry. Of a lorry most is hidden at times, and a
//! car's flank reflects as a lorry's end does: each spreads by 5 dB. So a mean `m` below the middle between the two, 11 dBsm,
//! speaks for a car by `(11 - m) 8 / 4.8^2` nats, four at most: less than what makes something low, which heights have the
//! last word on. Above it, it speaks for nothing: cars that reflect much are frequent.
//!
//! What is weak and shorter than a car is a pedestrian or rider. What is low and reflects less than a car does is low at any
//! length; what is longer than a car and reflects like a lorry is not low. Single frames say nothing: of cars in a queue most
//! is hidden, and they reflect weakly, too.
//!
//! # Limits
//! The limits are those of a simulated radar. For one that measures otherwise, or is not known, they are set lower rather than
//! higher (`ObstacleConfig`).

/// Frames over which it is averaged.
const MEMORY: i16 = 16;
/// Frames before it says anything.
const LEAST_FRAMES: i16 = 4;
/// Fraction bits of means and limits.
pub const FRACTION: u32 = 6;
/// Most that counts in a frame, half dBsm: 100 dBsm either way.
const MOST: i16 = 200;
/// How much a half decibel says, 2^-8 nats: 8 dB between the kinds, over twice the square of 4.8 dB.
const NATS: i32 = 44;
/// Most it says, 2^-8 nats: a factor of 55.
const MOST_NATS: i32 = 4 << 8;

/// Mean of the greatest radar cross section of each frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reflectivity {
    /// 2^-6 half dBsm.
    mean: i16,
    /// Frames that count, up to [`MEMORY`].
    frames: i16,
}

impl Reflectivity {
    /// Takes a frame's greatest radar cross section, half dBsm.
    pub fn add(&mut self, greatest_half_dbsm: i16) {
        self.frames = (self.frames + 1).clamp(1, MEMORY);
        let off = (greatest_half_dbsm.clamp(-MOST, MOST) << FRACTION) - self.mean;
        self.mean += off / self.frames;
    }

    /// Takes over what is known of another part: the whole reflects as much as either.
    pub fn join(&mut self, other: &Self) {
        self.mean = match (self.frames, other.frames) {
            (_, 0) => self.mean,
            (0, _) => other.mean,
            _ => self.mean.max(other.mean),
        };
        self.frames = self.frames.max(other.frames);
    }

    /// Whether it is known to lie below a limit, 2^-6 half dBsm.
    pub fn is_below(&self, limit: i32) -> bool {
        self.frames >= LEAST_FRAMES && i32::from(self.mean) < limit
    }

    /// Whether it is known to lie above a limit, 2^-6 half dBsm.
    pub fn is_above(&self, limit: i32) -> bool {
        self.frames >= LEAST_FRAMES && i32::from(self.mean) > limit
    }

    /// How much likelier it makes something tall, 2^-8 nats: none, or less. `lorry` is the limit between cars and lorries.
    #[allow(clippy::cast_possible_truncation)] // clamped
    pub fn evidence(&self, lorry: i32) -> i16 {
        if !self.is_below(lorry) {
            return 0;
        }
        (((i32::from(self.mean) - lorry) * NATS) >> FRACTION).max(-MOST_NATS) as i16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many frames with these cross sections in turn, dBsm.
    fn of(dbsm: &[f32], frames: usize) -> Reflectivity {
        let mut r = Reflectivity::default();
        dbsm.iter().cycle().take(frames).for_each(|v| r.add((v * 2.0) as i16));
        r
    }

    fn limit(dbsm: i32) -> i32 {
        (dbsm * 2) << FRACTION
    }

    #[test]
    fn a_mean_over_frames_says_what_a_single_frame_does_not() {
        let car = of(&[16.0, -4.0], 40);
        assert!(car.is_below(limit(8)) && car.is_above(limit(4)), "{car:?}");
        assert!(!of(&[-7.0], 3).is_below(limit(20)) && !of(&[15.0], 3).is_above(limit(-20)), "three frames are few");
        assert!(of(&[-7.0], 4).is_below(limit(-6)) && of(&[15.0], 4).is_above(limit(14)));
        let none = Reflectivity::default();
        assert!(!none.is_below(limit(99)) && !none.is_above(limit(-99)) && none.evidence(limit(11)) == 0);
    }

    #[test]
    fn what_reflects_less_than_half_way_to_a_lorry_is_likelier_a_car() {
        let evidence = |dbsm| f64::from(of(&[dbsm], 20).evidence(limit(11))) / 256.0;
        // densities of cars and lorries around 7 and 15 dBsm with 4.8 dB either
        let exact = |dbsm: f64| ((dbsm - 7.0).powi(2) - (dbsm - 15.0).powi(2)) / (2.0 * 4.8 * 4.8);
        for dbsm in [10.0, 7.0, 4.0, 0.0] {
            let off = evidence(dbsm) - exact(f64::from(dbsm)).max(-4.0);
            assert!(off.abs() < 0.06, "{dbsm} dBsm: {}", evidence(dbsm));
        }
        assert_eq!([-7.0, 15.0, 30.0].map(evidence), [-4.0, 0.0, 0.0]);
    }

    #[test]
    fn a_whole_reflects_as_much_as_its_greater_part() {
        let (weak, strong) = (of(&[0.0], 20), of(&[14.0], 20));
        for (mut a, b) in
            [(weak, strong), (strong, weak), (Reflectivity::default(), strong), (strong, Default::default())]
        {
            a.join(&b);
            assert_eq!(a, strong);
        }
    }

    #[test]
    fn the_last_frames_count_and_nothing_overflows() {
        let mut r = of(&[20.0], 1000);
        (0..200).for_each(|_| r.add(-14));
        assert!(r.is_below(limit(-6)), "{r:?}");
        (0..2000).for_each(|_| r.add(i16::MAX));
        (0..2000).for_each(|_| r.add(i16::MIN));
        assert!(r.is_below(limit(-99)), "{r:?}");
    }
}
