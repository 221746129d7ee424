//! Which detections stay where there are too many: the strongest, but of one place fewer and fewer.
//!
//! A road full of vehicles gives more detections than a list of 256, or of 128, has room for. The strongest are then many of the vehicles that are near,
//! and of those far away none is left; what nobody has detected hides nothing, so the map calls visible what lies behind
//! them. The tenth detection of a bonnet tells less than the first of a car behind it. So each detection that came before
//! from the same place, some 2 m wide and 2.5 m deep, makes the next of that place count for 32 dB less. Strength still counts
//! between places: false alarms, each in a place of its own, would otherwise be kept before anything else.
//!
//! # Model
//! Places are bins of range and of arc, range times azimuth, so they are as large far away as near. They are told apart by a
//! hash of 1024 values: two places that share one are thinned as one; within 150 m and 60 degrees to either side these are 30 m apart at least.
//! A detection's priority depends on what came before it and not on how long a list is, so a unit whose list fills while a frame arrives
//! keeps the same as one that sees the whole frame first, where all of them pass the gate: an input's list comes before the gate, the frame's
//! (`scan.rs`) after it.
//! What has neither signal-to-noise ratio nor cross section counts as 16 dB.
//!
//! # Cost
//! 1 kB of the stack while a frame is thinned, and nothing where the list is long enough. In each input 1 kB and a byte an entry, and
//! the priority of every detection.

use crate::frame::detection::Detection;

/// Values that bins are told apart by.
const BINS: usize = 1024;
/// Depth of a bin, 2^8 cm.
const DEPTH_SHIFT: u32 = 8;
/// Width of a bin: 2^21 is an arc of 2 m, in centimetres times 2^-16 turns.
const WIDTH_SHIFT: u32 = 21;
/// What each detection before it in the same bin takes off a detection's strength, half dB.
const COST_HALF_DB: i32 = 64;
/// Strength of what has none, half dB.
const UNKNOWN_HALF_DB: i16 = 32;
/// Strength of priority 0, half dB.
const LEAST_HALF_DB: i16 = -96;

/// How many detections of a frame fell into each bin so far.
#[derive(Debug, Clone)]
pub struct Thinning([u8; BINS]);

impl Thinning {
    /// Before a frame's first detection.
    pub const NEW: Self = Self([0; BINS]);

    /// The priority of the next detection of the frame, in steps of half a dB above -48 dB: its strength less what those
    /// before it in its bin take off. Strengths below -48 dB and above 79.5 dB count as these.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    pub fn priority(&mut self, d: &Detection) -> u8 {
        let strength = d.strength().unwrap_or(UNKNOWN_HALF_DB);
        let step = strength.saturating_sub(LEAST_HALF_DB).clamp(0, u8::MAX.into());
        let Some(before) = self.0.get_mut(bin(d)) else { return 0 };
        let left = i32::from(step) - COST_HALF_DB * i32::from(*before);
        *before = before.saturating_add(1);
        left.max(0) as u8
    }
}

/// The bin a detection falls into.
#[allow(clippy::cast_sign_loss)] // bits of a hash
fn bin(d: &Detection) -> usize {
    let (range, azimuth) = (i32::from(d.range_cm), i32::from(d.azimuth.raw()));
    let key = (((range >> DEPTH_SHIFT) << 16) ^ (((range * azimuth) >> WIDTH_SHIFT) & 0xffff)) as u32;
    // Fibonacci hashing: the highest bits of the product with 2^32 over the golden ratio
    (key.wrapping_mul(2_654_435_769) >> (u32::BITS - BINS.ilog2())) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use std::vec::Vec;

    fn at(range_m: f32, azimuth_deg: f32, snr_db: Option<i16>) -> Detection {
        Detection {
            range_cm: (range_m * 100.0) as u16,
            azimuth: Angle::from_degrees(azimuth_deg),
            elevation: None,
            radial_velocity_cm_s: 0,
            rcs_half_dbsm: None,
            snr_half_db: snr_db.map(|db| 2 * db),
            marked: false,
        }
    }

    fn priorities(detections: &[Detection]) -> Vec<u8> {
        let mut thinning = Thinning::NEW;
        detections.iter().map(|d| thinning.priority(d)).collect()
    }

    #[test]
    fn each_before_it_from_its_place_takes_32_db_off() {
        assert_eq!(priorities(&[at(50.0, 3.0, Some(40)); 5]), [176, 112, 48, 0, 0]);
    }

    #[test]
    fn what_came_from_another_place_takes_nothing_off() {
        let places = [(50.0, 3.0), (54.0, 3.0), (50.0, 6.0), (50.0, -3.0), (150.0, 1.0), (150.0, 2.0)];
        let got = priorities(&places.map(|(range, azimuth)| at(range, azimuth, Some(40))));
        assert_eq!(got, [176; 6]);
    }

    /// Least and greatest of what lies between two detections of one place, metres, from steps of 5 cm along one axis.
    fn side_m(step: impl Fn(f32) -> Detection) -> (f32, f32) {
        let bins: Vec<usize> = (0..2000).map(|i| bin(&step(i as f32 * 0.05))).collect();
        let mut ends: Vec<usize> = (1..bins.len()).filter(|i| bins[*i] != bins[i - 1]).collect();
        ends.pop();
        let sides = ends.windows(2).map(|w| (w[1] - w[0]) as f32 * 0.05);
        sides.fold((f32::MAX, 0.0), |(least, most), side| (least.min(side), most.max(side)))
    }

    #[test]
    fn a_place_is_as_wide_far_away_as_near() {
        let (least, most) = side_m(|m| at(20.0 + m, 0.0, None));
        assert!(least > 2.4 && most < 2.7, "depth {least} to {most}");
        for range in [40.0, 150.0] {
            let (least, most) = side_m(|m| at(range, ((m - 50.0) / range).to_degrees(), None));
            assert!(least > 1.8 && most < 2.2, "width {least} to {most} at {range} m");
        }
    }

    #[test]
    fn bins_that_share_a_value_are_far_apart() {
        let mut found: Vec<Vec<[f32; 2]>> = std::vec![Vec::new(); BINS];
        for range_m in (0..58).map(|k| 2.56 * (k as f32 + 0.5)) {
            let half = (range_m * 60_f32.to_radians() / 2.01) as i16;
            for angle in (-half..=half).map(|k| 2.01 * (f32::from(k) + 0.5) / range_m) {
                found[bin(&at(range_m, angle.to_degrees(), None))].push([range_m * angle.cos(), range_m * angle.sin()]);
            }
        }
        let pairs = found.iter().flat_map(|bins| bins.iter().enumerate().map(|(k, a)| (a, &bins[..k])));
        let apart = pairs.flat_map(|(a, others)| others.iter().map(|b| (a[0] - b[0]).hypot(a[1] - b[1])));
        let nearest = apart.filter(|m| *m > 2.1).fold(f32::MAX, f32::min);
        assert!(nearest > 30.0, "{nearest} m");
    }

    #[test]
    fn extremes_have_a_priority_and_what_has_no_strength_counts_as_16_db() {
        let strengths = [i16::MIN, -97, -96, 159, 160, i16::MAX];
        let one = |s| priorities(&[Detection { snr_half_db: Some(s), ..at(50.0, 3.0, None) }])[0];
        assert_eq!(strengths.map(one), [0, 0, 0, 255, 255, 255]);
        assert_eq!(priorities(&[at(50.0, 3.0, None)]), [128]);
        for (range_cm, azimuth) in [(u16::MAX, i16::MIN), (u16::MAX, i16::MAX), (1, 0)] {
            let all =
                priorities(&[Detection { range_cm, azimuth: Angle::from_raw(azimuth), ..at(1.0, 0.0, Some(10)) }; 300]);
            assert_eq!(all[..2], [116, 52]);
            assert!(all[2..].iter().all(|p| *p == 0), "nor does a count begin anew");
        }
    }
}
