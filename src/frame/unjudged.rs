//! Whether points keep coming of which nothing can be concluded, since nearly all are left out.
//!
//! # Model
//! For [`WINDOW_US`] at least [`LEAST_AGAIN`] points a frame [come again](crate::frame::repeats), as what is there does and noise does
//! not, and [at most one in twenty](LET_THROUGH) is let through by the gate and the sensor's own marks. Points that were left out
//! by choice, slow ones or those of another sector, do not count. It is over when enough are let through again.

use crate::fixed::time::Time;

/// For so long points come again that cannot be judged until nothing is known, microseconds.
pub const WINDOW_US: u64 = BLOCKS as u64 * BLOCK_US;

/// So many of them a frame, in the mean.
pub const LEAST_AGAIN: u32 = 5;

/// Of so many that come again or are let through, one is let through at most.
pub const LET_THROUGH: u32 = 20;

/// Points are counted by blocks of time, microseconds each.
const BLOCK_US: u64 = 500_000;
const BLOCKS: usize = 6;
/// What is let through for so many blocks ends it.
const RECENT: usize = 2;

/// Points that came again and could not be judged, and those let through, in the last [`WINDOW_US`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unjudged {
    /// First frame of the run.
    since: Option<Time>,
    /// When the newest block began.
    begun: Time,
    /// The newest first.
    blocks: [Block; BLOCKS],
}

/// Sums over frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Block {
    frames: u16,
    passed: u16,
    again: u16,
}

impl Block {
    const NONE: Self = Self { frames: 0, passed: 0, again: 0 };

    fn and(self, other: &Self) -> Self {
        Self {
            frames: self.frames.saturating_add(other.frames),
            passed: self.passed.saturating_add(other.passed),
            again: self.again.saturating_add(other.again),
        }
    }

    fn is_let_through(&self) -> bool {
        u32::from(self.passed) * LET_THROUGH > u32::from(self.passed) + u32::from(self.again)
    }

    fn cannot_be_judged(&self) -> bool {
        self.frames > 0 && u32::from(self.again) >= u32::from(self.frames) * LEAST_AGAIN && !self.is_let_through()
    }
}

impl Unjudged {
    /// Before the first frame.
    pub const NONE: Self = Self { since: None, begun: Time::from_micros(0), blocks: [Block::NONE; BLOCKS] };

    /// Takes note of a frame: so many points were let through, and so many came again that cannot be judged.
    pub fn frame(&mut self, now: Time, passed: u32, again: u32) {
        let since = *self.since.get_or_insert(now);
        if since == now {
            self.begun = now;
        }
        // no gap is longer than two blocks
        for _ in 0..RECENT {
            if now.since(self.begun).is_some_and(|us| us >= BLOCK_US) {
                self.begun = Time::from_micros(self.begun.micros().saturating_add(BLOCK_US));
                let mut newer = Block::NONE;
                for block in &mut self.blocks {
                    core::mem::swap(block, &mut newer);
                }
            }
        }
        if let Some(newest) = self.blocks.first_mut() {
            let of = |n: u32| u16::try_from(n).unwrap_or(u16::MAX);
            *newest = newest.and(&Block { frames: 1, passed: of(passed), again: of(again) });
        }
    }

    fn sum(&self, blocks: usize) -> Block {
        self.blocks.iter().take(blocks).fold(Block::NONE, |sum, block| sum.and(block))
    }

    /// Whether it was so for the whole window.
    pub fn for_long(&self, now: Time) -> bool {
        let whole = self.since.is_some_and(|since| now.since(since).is_some_and(|us| us >= WINDOW_US));
        whole && self.sum(BLOCKS).cannot_be_judged()
    }

    /// Whether enough of them are let through again.
    pub fn is_over(&self) -> bool {
        let recent = self.sum(RECENT);
        u32::from(recent.passed) >= LEAST_AGAIN && recent.is_let_through()
    }

    /// Whether it was so in the newest block: what came then is no evidence of what is free.
    pub fn is_now(&self) -> bool {
        self.sum(1).cannot_be_judged()
    }
}

/// A world for ten minutes, through the gate, from a cold start or after ten of traffic.
#[cfg(test)]
mod tests {
    use crate::fixed::angle::Angle;
    use crate::fixed::time::Time;
    use crate::frame::detection::Detection;
    use crate::frame::gate::GateConfig;
    use crate::frame::health::{Condition, FrameStatus, Health, HealthConfig};
    use crate::frame::scan::Scan;
    use crate::frame::scan::tests::MOUNT;
    use crate::sensor::field_of_view::tests::VIEW;
    use crate::sensor::noise::NoiseConfig;
    use std::vec::Vec;

    const FRAMES: u64 = 10 * 60 * 15;

    struct World {
        gate: GateConfig,
        scan: Scan<256>,
        health: Health,
        frame: u64,
        state: u32,
    }

    impl World {
        fn new(gate: GateConfig) -> Self {
            Self { gate, scan: Scan::new(), health: Health::NEW, frame: 0, state: 11 }
        }

        /// A number from the first to the second.
        fn draw(&mut self, from: f32, to: f32) -> f32 {
            self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            from + (self.state >> 8) as f32 / 16_777_216.0 * (to - from)
        }

        fn at(range_m: f32, azimuth_deg: f32, speed_mps: f32, snr_db: f32) -> Detection {
            Detection {
                range_cm: (range_m * 100.0) as u16,
                azimuth: Angle::from_degrees(azimuth_deg),
                elevation: None,
                radial_velocity_cm_s: (speed_mps * 100.0) as i16,
                rcs_half_dbsm: None,
                snr_half_db: Some((snr_db * 2.0) as i16),
                marked: false,
            }
        }

        /// So many points at random, within a range.
        fn noise(&mut self, count: u8, to_m: f32, snr_db: f32) -> Vec<Detection> {
            let one = |w: &mut Self| Self::at(w.draw(3.0, to_m), w.draw(-60.0, 60.0), w.draw(-8.0, 8.0), snr_db);
            (0..count).map(|_| one(self)).collect()
        }

        /// Four lanes, a car each 60 m, three points of each, of which 15 % are missing, weaker by so many decibels.
        fn traffic(&mut self, weaker_db: f32) -> Vec<Detection> {
            let mut points = Vec::new();
            for (lane, speed) in [(-6.0, -28.0), (-2.0, -33.0), (2.0, 25.0), (6.0, 30.0_f32)] {
                let passed = (self.frame as f32 * 0.066 * speed).rem_euclid(60.0);
                for range in [passed, passed + 60.0, passed + 120.0] {
                    for _ in 0..3 {
                        let place = 20.0 + range + self.draw(0.0, 0.8);
                        let azimuth = (lane / place).to_degrees() + self.draw(-0.5, 0.5);
                        let snr = self.draw(8.0, 18.0) - weaker_db;
                        if self.draw(0.0, 1.0) > 0.15 {
                            points.push(Self::at(place, azimuth, speed, snr));
                        }
                    }
                }
            }
            points
        }

        /// The conditions of so many frames.
        fn run(&mut self, frames: u64, each: impl Fn(&mut Self) -> Vec<Detection>) -> Vec<Condition> {
            let gate = self.gate.gate(&VIEW.limits().unwrap()).unwrap();
            let (noise, levelling) = (NoiseConfig::default().noise().unwrap(), MOUNT.levelling().unwrap());
            let limits = HealthConfig::default().limits().unwrap();
            let mut conditions = Vec::new();
            for _ in 0..frames {
                self.frame += 1;
                let (now, all) = (Time::from_micros(self.frame * 66_000), each(self));
                let place = |d: &Detection| noise.place(d, &levelling);
                let points = self.scan.gather(now, all.iter(), FrameStatus::default(), &gate, place);
                self.health.frame(now, &points, false, &limits);
                conditions.push(self.health.condition(now, &limits));
            }
            conditions
        }
    }

    /// From a cold start and after ten minutes of traffic.
    fn twice(gate: GateConfig, frames: u64, each: impl Fn(&mut World) -> Vec<Detection>) -> [Vec<Condition>; 2] {
        let (mut cold, mut warm) = (World::new(gate), World::new(gate));
        let traffic = warm.run(FRAMES, |w| w.traffic(0.0));
        assert!(traffic.iter().all(|c| *c == Condition::Healthy), "traffic as it is");
        [cold.run(frames, &each), warm.run(frames, &each)]
    }

    fn is_never_unusable(gate: GateConfig, each: impl Fn(&mut World) -> Vec<Detection>) {
        for conditions in twice(gate, FRAMES, each) {
            let first = conditions.iter().position(|c| *c != Condition::Healthy);
            assert_eq!(first, None, "{:?}", first.map(|i| conditions[i]));
        }
    }

    #[test]
    fn noise_below_the_gate_is_no_traffic() {
        is_never_unusable(GateConfig::default(), |w| {
            // none at all for long would be a blind sensor
            let count = if w.frame % 7 == 0 { 1 } else { w.draw(0.0, 3.99) as u8 };
            w.noise(count, 200.0, 2.0)
        });
    }

    #[test]
    fn rain_is_no_traffic() {
        is_never_unusable(GateConfig::default(), |w| w.noise(20, 30.0, 2.0));
    }

    #[test]
    fn rails_and_masts_that_only_movers_are_chosen_before_are_no_traffic() {
        let rails = |w: &mut World| -> Vec<Detection> {
            (0..40_u8)
                .map(|i| {
                    let range = 20.0 + 4.0 * f32::from(i) + w.draw(-0.2, 0.2);
                    World::at(range, 15.0, w.draw(-0.3, 0.3), w.draw(0.0, 20.0))
                })
                .collect()
        };
        is_never_unusable(GateConfig { min_speed_mps: 1.0, ..GateConfig::default() }, rails);
    }

    #[test]
    fn traffic_that_is_too_weak_for_the_gate_is_no_free_road_within_five_seconds() {
        let cases = [("15 dB weaker", 15.0), ("nearly all of it", 12.8)];
        for (what, weaker_db) in cases {
            for conditions in twice(GateConfig::default(), 75, |w| w.traffic(weaker_db)) {
                assert_eq!(conditions.last(), Some(&Condition::Unusable), "{what}");
            }
        }
        // what is seen well enough is worked with
        is_never_unusable(GateConfig::default(), |w| w.traffic(8.0));
    }

    #[test]
    fn traffic_that_is_marked_or_too_fast_is_no_free_road_either() {
        let marked = |w: &mut World| w.traffic(0.0).into_iter().map(|d| Detection { marked: true, ..d }).collect();
        let fast = |w: &mut World| {
            let too_fast = |d: Detection| Detection { radial_velocity_cm_s: 9 * d.radial_velocity_cm_s, ..d };
            w.traffic(0.0).into_iter().map(too_fast).collect()
        };
        for conditions in twice(GateConfig::default(), 75, marked) {
            assert_eq!(conditions.last(), Some(&Condition::Unusable));
        }
        for conditions in twice(GateConfig::default(), 75, fast) {
            assert_eq!(conditions.last(), Some(&Condition::Unusable));
        }
    }
}
