//! How well the sensor repeats an azimuth: its noise, as fixtures show it.
//!
//! A data sheet's figure is a worst case, or nobody has it. Yet what is assumed decides how far from a vehicle its
//! detections are looked for, how wide they are expected to lie, and how far behind them its middle is. A unit on a pole sees
//! the same posts, signs and walls in every frame: what lies at the same range and does not move is the same thing, and
//! two measurements of its azimuth differ by noise alone, with twice its variance. Half of these differences are below
//! 0.95 standard deviations, and a median cares little for the few pairs that are of two things.
//!
//! A pair counts where nothing else was reported within a metre of its range, in either frame. The estimate starts at the
//! configured noise and goes up or down by a small part of itself with each pair: by 1/32 at first, by 1/256 from the
//! 769th on, which keeps it within some 5 % (one standard deviation). It stays between a quarter of the configured noise, for a
//! sensor that puts out the same azimuth again and again has a filter, and that noise itself. Without fixtures the
//! configured noise stays.
//!
//! **Vehicles** are wider than posts and turn: their echo wanders (glint). So half of what fixtures show is added; more than
//! configured is never assumed. Radar-3d alone uses it, for places and obstacles; the evidence of fixtures, whose
//! tables are made once, keeps the configured noise. Elevation is not learnt: with less noise assumed, cars are taken for tall
//! more often.
//!
//! # Cost
//! 1.5 kB.

use crate::fixed::math;
use crate::fixed::trig::Direction;
use crate::frame::by_range::{ByRange, MOST_AROUND};
use crate::frame::reflection::Reflection;
use crate::sensor::noise::Noise;

/// Within this of another's range nobody can tell the two apart, centimetres.
const ALONE_CM: i32 = 100;
/// Nearer than this a thing is as wide as the noise, centimetres.
const NEAR_CM: i32 = 1000;
/// Places for the last frame's fixtures, one for each metre of range; what lies farther has none.
const SLOTS: usize = 256;
/// Range that one of them stands for, centimetres: no more than one fixture lies in it.
const SLOT_CM: i32 = ALONE_CM;
/// Median of the difference of two measurements over their standard deviation, 2^-14: 0.6745 times the root of two.
const MEDIAN: i32 = 15_628;
/// Bits of the estimate below 2^-16 rad.
const FRACTION: u32 = 8;
/// The first steps are a part of 2^-5 of the estimate, the last of 2^-8; each but the last are taken so often.
const STEPS: (u16, u16) = (5, 8);
const PAIRS_A_STEP: u16 = 256;
/// The least estimate is so much less than the configured noise, as a power of two; the greatest is that noise.
const LEAST: u32 = 2;
/// Noise of vehicles over that of fixtures.
const MARGIN: (i32, i32) = (3, 2);

/// The last frame's fixtures, and what pairs of them have shown.
#[derive(Debug, Clone)]
pub struct Repeatability {
    fixtures: [Repeater; SLOTS],
    /// Standard deviation of the azimuth, 2^-24 rad; 0 until there was a pair.
    azimuth: i32,
    pairs: u16,
}

/// A detection that does not move and has its range for itself; at no range where there is none.
#[derive(Debug, Clone, Copy)]
struct Repeater {
    ground_cm: u16,
    sight: Direction,
}

impl Repeater {
    // all zero: a static that holds it needs no place in an image
    const NONE: Self = Self { ground_cm: 0, sight: Direction { x: 0, y: 0 } };
}

impl Default for Repeatability {
    fn default() -> Self {
        Self::new()
    }
}

impl Repeatability {
    /// Has seen nothing.
    pub const fn new() -> Self {
        Self { fixtures: [Repeater::NONE; SLOTS], azimuth: 0, pairs: 0 }
    }

    /// The configured noise, its azimuth as fixtures have shown it, with the margin.
    pub fn noise(&self, configured: &Noise) -> Noise {
        let shown = (self.azimuth >> FRACTION) * MARGIN.0 / MARGIN.1;
        Noise {
            azimuth: if self.azimuth == 0 { configured.azimuth } else { shown.min(configured.azimuth) },
            ..*configured
        }
    }

    /// Compares a frame's fixtures with the last frame's.
    pub fn compare<const D: usize>(&mut self, reflections: &[Reflection], by_range: &ByRange<D>, configured: &Noise) {
        let mut fixtures = [Repeater::NONE; SLOTS];
        let unmoving = 2 * configured.radial_velocity_cm_s;
        for r in reflections {
            let ground = i32::from(r.ground_cm);
            if ground < NEAR_CM
                || i32::from(r.radial_velocity_cm_s).abs() > unmoving
                || !is_alone(r, reflections, by_range)
            {
                continue;
            }
            let Some(place) = fixtures.get_mut(slot(ground)) else { continue };
            *place = Repeater { ground_cm: r.ground_cm, sight: r.sight };
            if let Some(before) = self.before(ground) {
                self.learn(difference(before.sight, r.sight), configured.azimuth);
            }
        }
        self.fixtures = fixtures;
    }

    /// The one fixture that the last frame had at this range; `None` where it had none or two.
    fn before(&self, ground_cm: i32) -> Option<&Repeater> {
        let at = slot(ground_cm);
        let around = self.fixtures.get(at.saturating_sub(1)..self.fixtures.len().min(at + 2))?;
        let same = |f: &&Repeater| f.ground_cm > 0 && (i32::from(f.ground_cm) - ground_cm).abs() <= ALONE_CM;
        let mut same = around.iter().filter(same);
        same.next().filter(|_| same.next().is_none())
    }

    /// Takes the difference of two azimuths, 2^-16 rad, where so much is configured.
    fn learn(&mut self, difference: i32, configured: i32) {
        let configured = configured << FRACTION;
        if self.azimuth == 0 {
            self.azimuth = configured;
        }
        let median = math::mul_shift(self.azimuth, MEDIAN, 14 + FRACTION);
        let shift = u32::from((STEPS.0 + self.pairs / PAIRS_A_STEP).min(STEPS.1));
        let step = (self.azimuth >> shift).max(1);
        let off = if difference > median { step } else { -step };
        self.azimuth = (self.azimuth + off).max(configured >> LEAST).min(configured); // `clamp` could panic
        self.pairs = self.pairs.saturating_add(1);
    }
}

#[allow(clippy::cast_sign_loss)] // not negative
fn slot(ground_cm: i32) -> usize {
    (ground_cm.max(0) / SLOT_CM) as usize
}

/// Whether nothing else lies within a metre of its range.
fn is_alone<const D: usize>(r: &Reflection, reflections: &[Reflection], by_range: &ByRange<D>) -> bool {
    let ground = i32::from(r.ground_cm);
    let around = by_range.between(ground - ALONE_CM, ground + ALONE_CM);
    let close = |i: u16| {
        let other = reflections.get(usize::from(i)).map_or(ground, |o| i32::from(o.ground_cm));
        (other - ground).abs() <= ALONE_CM
    };
    // a crowd is looked at no longer
    around.len() <= MOST_AROUND && around.iter().filter(|p| close(p.index)).nth(1).is_none()
}

/// Angle between two lines of sight, 2^-16 rad, as its tangent; for a right one and above the greatest.
fn difference(a: Direction, b: Direction) -> i32 {
    let product = |p: i16, q: i16| i32::from(p) * i32::from(q);
    let (sine, cosine) = (product(a.x, b.y) - product(a.y, b.x), product(a.x, b.x) + product(a.y, b.y));
    // of unit vectors both are at most 2^28
    if cosine < 1 << 14 { i32::MAX } else { (sine.abs() << 2) / (cosine >> 14) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::math::length;
    use crate::sensor::noise::NoiseConfig;
    use std::vec::Vec;

    /// Numbers that are normally distributed, nearly: sums of twelve even ones.
    struct Dice(u64);

    impl Dice {
        fn normal(&mut self) -> f64 {
            let mut even = || {
                self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 40) as f64 / f64::from(1 << 24)
            };
            (0..12).map(|_| even()).sum::<f64>() - 6.0
        }
    }

    fn configured() -> Noise {
        NoiseConfig::default().noise().unwrap()
    }

    /// At a range in metres and a bearing in degrees.
    fn at(range_m: f64, bearing_deg: f64, radial_velocity_cm_s: i16) -> Reflection {
        let (sin, cos) = bearing_deg.to_radians().sin_cos();
        let (x_cm, y_cm) = ((range_m * 100.0 * cos) as i32, (range_m * 100.0 * sin) as i32);
        Reflection {
            x_cm,
            y_cm,
            ground_cm: length(x_cm, y_cm) as u16,
            sight: Direction { x: (16_384.0 * cos).round() as i16, y: (16_384.0 * sin).round() as i16 },
            radial_velocity_cm_s,
            across_cm: 1,
            height_cm: None,
            rcs_half_dbsm: None,
        }
    }

    /// Shows so many frames, and gives the estimate in degrees.
    fn shown(frames: usize, mut frame: impl FnMut(&mut Dice) -> Vec<Reflection>) -> f64 {
        let (mut repeatability, mut dice) = (Repeatability::new(), Dice(1));
        for _ in 0..frames {
            let reflections = frame(&mut dice);
            repeatability.compare(&reflections, &ByRange::<32>::sort(&reflections, 22_500), &configured());
        }
        (f64::from(repeatability.azimuth) / f64::from(1 << 24)).to_degrees()
    }

    /// Posts from 20 to 160 m, on both sides of the sensor's axis.
    fn posts(dice: &mut Dice, noise_deg: f64) -> Vec<Reflection> {
        (2..=16)
            .map(|k| at(10.0 * f64::from(k), f64::from(k * 37 % 100) - 50.0 + noise_deg * dice.normal(), 0))
            .collect()
    }

    #[test]
    fn posts_show_the_noise_of_the_azimuth() {
        for noise_deg in [0.15, 0.25, 0.4] {
            let shown = shown(200, |dice| posts(dice, noise_deg));
            assert!((shown / noise_deg - 1.0).abs() < 0.15, "{shown} of {noise_deg} degrees");
        }
    }

    #[test]
    fn the_estimate_starts_at_the_configured_noise_and_comes_near_within_300_pairs() {
        assert_eq!(shown(1, |dice| posts(dice, 0.1)), 0.0, "no pair yet");
        let first = shown(2, |dice| posts(dice, 0.15));
        assert!((0.3..0.5).contains(&first), "{first} degrees");
        let later = shown(21, |dice| posts(dice, 0.15));
        assert!((0.12..0.2).contains(&later), "{later} degrees");
    }

    #[test]
    fn it_stays_between_a_quarter_of_what_is_configured_and_that() {
        assert!((shown(400, |dice| posts(dice, 0.0)) - 0.125).abs() < 0.002);
        assert!((shown(400, |dice| posts(dice, 2.0)) - 0.5).abs() < 0.02);
    }

    #[test]
    fn a_stray_pair_in_ten_changes_little() {
        let shown = shown(400, |dice| {
            let mut posts = posts(dice, 0.2);
            if let Some(post) = posts.iter_mut().find(|_| dice.normal() > 0.5) {
                *post = at(20.0, 40.0 * dice.normal(), 0);
            }
            posts
        });
        assert!((0.18..0.24).contains(&shown), "{shown} degrees");
    }

    #[test]
    fn what_moves_is_near_or_has_company_at_its_range_shows_nothing() {
        type Seen = fn(f64) -> Vec<Reflection>;
        let steady: [(&str, Seen); 4] = [
            ("a vehicle", |b| [at(50.0, b, 40)].into()),
            ("near", |b| [at(9.0, b, 0)].into()),
            ("two at one range", |b| [at(50.0, b, 0), at(50.9, 30.0, 0)].into()),
            ("beside one that moves", |b| [at(50.0, b, 0), at(49.2, 30.0, 2000)].into()),
        ];
        for (name, frame) in steady {
            assert_eq!(shown(50, |dice| frame(0.1 * dice.normal())), 0.0, "{name}");
        }
        assert!(
            shown(50, |dice| [at(50.0, 0.1 * dice.normal(), 28), at(51.2, 30.0, 0)].into()) > 0.0,
            "slow enough, alone"
        );
        // two a metre and a half apart, and one between them the next time
        let mut frames = [&[50.0][..], &[49.3, 50.8]];
        let between = shown(2, |_| {
            frames.swap(0, 1);
            frames[0].iter().map(|range| at(*range, 0.0, 0)).collect()
        });
        assert_eq!(between, 0.0);
    }

    #[test]
    fn vehicles_are_taken_to_scatter_half_as_much_again_but_no_more_than_configured() {
        let configured = configured();
        let of = |share: f64| {
            let azimuth = (f64::from(configured.azimuth << FRACTION) * share) as i32;
            let noise = Repeatability { azimuth, ..Repeatability::new() }.noise(&configured);
            assert_eq!(Noise { azimuth: configured.azimuth, ..noise }, configured, "all else as configured");
            f64::from(noise.azimuth) / f64::from(configured.azimuth)
        };
        assert!((of(0.4) - 0.6).abs() < 0.01);
        assert_eq!(of(0.8), 1.0);
        assert_eq!(of(0.0), 1.0, "nothing shown");
    }
}
