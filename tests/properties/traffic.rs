//! Random frames: detections of any value, and things that move so that they are followed.

use proptest::prelude::*;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;

use crate::setup::Setup;

/// A frame as the sensor delivers it.
#[derive(Debug, Clone)]
pub struct Frame {
    pub now: Time,
    pub fault: bool,
    pub detections: Vec<Detection>,
}

/// A detection of any value a decoder could deliver.
pub fn any_detection() -> impl Strategy<Value = Detection> {
    let half_db = || proptest::option::of(prop_oneof![3 => -40..120_i16, 1 => any::<i16>()]);
    (
        any::<u16>(),
        any::<i16>(),
        proptest::option::of(any::<i16>()),
        prop_oneof![4 => -7000..=7000_i16, 1 => any::<i16>()],
        half_db(),
        half_db(),
    )
        .prop_map(|(range_cm, azimuth, elevation, radial_velocity_cm_s, rcs_half_dbsm, snr_half_db)| Detection {
            range_cm,
            azimuth: Angle::from_raw(azimuth),
            elevation: elevation.map(Angle::from_raw),
            radial_velocity_cm_s,
            rcs_half_dbsm,
            snr_half_db,
            marked: false,
        })
}

/// A detection drawn into the field of view, or a degree or metre beyond either side.
fn drawn_in(d: Detection, setup: &Setup) -> Detection {
    let v = &setup.sensor.field_of_view;
    let within = |a: Angle, low: f32, high: f32| {
        let part = f32::from(a.raw()) / 65536.0 + 0.5;
        Angle::from_degrees(low - 1.0 + (high - low + 2.0) * part)
    };
    let range_m = v.range_min_m - 1.0 + (v.range_max_m - v.range_min_m + 2.0) * f32::from(d.range_cm) / 65535.0;
    Detection {
        range_cm: (range_m * 100.0).max(1.0) as u16,
        azimuth: within(d.azimuth, v.azimuth_min_deg, v.azimuth_max_deg),
        elevation: d.elevation.map(|e| within(e, v.elevation_min_deg, v.elevation_max_deg)),
        ..d
    }
}

/// Something that keeps its radial speed: a first detection and how far its others lie apart.
#[derive(Debug, Clone, Copy)]
struct Mover {
    first: Detection,
    spacing_cm: i16,
    count: u8,
}

impl Mover {
    fn detections(self, seconds: f64) -> impl Iterator<Item = Detection> {
        let way = f64::from(self.first.radial_velocity_cm_s) * seconds;
        (0..self.count).map(move |k| {
            let range = f64::from(self.first.range_cm) + way + f64::from(self.spacing_cm) * f64::from(k);
            Detection { range_cm: range.clamp(1.0, 65_535.0) as u16, ..self.first }
        })
    }
}

fn movers() -> impl Strategy<Value = Vec<Mover>> {
    // many of them close to the boresight, where range says how far they got
    let mover = (any_detection(), 0..6_u32, -400..400_i16, 1..8_u8).prop_map(|(d, narrow, spacing_cm, count)| {
        let azimuth = Angle::from_raw(d.azimuth.raw() >> narrow);
        Mover { first: Detection { azimuth, snr_half_db: None, rcs_half_dbsm: None, ..d }, spacing_cm, count }
    });
    proptest::collection::vec(mover, 0..6)
}

/// Microseconds to the next frame, or a moment the clock jumps to.
#[derive(Debug, Clone, Copy)]
enum Next {
    After(u64),
    At(u64),
}

fn next() -> impl Strategy<Value = Next> {
    prop_oneof![
        12 => (40_000..120_000_u64).prop_map(Next::After),
        1 => (0..3_u64).prop_map(Next::After),
        2 => (0..70_000_000_u64).prop_map(Next::After),
        1 => any::<u64>().prop_map(Next::At),
    ]
}

/// Frames for a setup: things that move through, strays, faults, gaps and jumps of the clock.
pub fn frames(setup: &Setup, most: usize) -> impl Strategy<Value = Vec<Frame>> + use<> {
    let setup = *setup;
    let strays = proptest::collection::vec((any_detection(), proptest::bool::weighted(0.8)), 0..40);
    let frame = (next(), proptest::bool::weighted(0.05), proptest::bool::weighted(0.15), strays);
    (any::<u64>(), movers(), proptest::collection::vec(frame, 1..most)).prop_map(move |(start, mut movers, frames)| {
        let (mut now, mut seconds) = (start >> 1, 0.0);
        movers.iter_mut().for_each(|m| m.first = drawn_in(m.first, &setup));
        let frames = frames.into_iter().map(|(next, fault, empty, strays)| {
            match next {
                Next::After(micros) => {
                    now = now.saturating_add(micros);
                    seconds += micros as f64 * 1e-6;
                }
                Next::At(moment) => now = moment,
            }
            let strays = strays.into_iter().map(|(d, inside)| if inside { drawn_in(d, &setup) } else { d });
            let moving = movers.iter().flat_map(|m| m.detections(seconds));
            let detections = if empty { Vec::new() } else { moving.chain(strays).collect() };
            Frame { now: Time::from_micros(now), fault, detections }
        });
        frames.collect()
    })
}

/// A vehicle that drives about in the field of view: where it is at first, as parts of range and width, and its velocity, m/s.
#[derive(Debug, Clone, Copy)]
struct Drive {
    at: [f64; 2],
    velocity: [f64; 2],
}

impl Drive {
    /// What is detected of it: so many standard deviations off in range, azimuth and speed.
    fn detection(&self, setup: &Setup, seconds: f64, off: [f64; 3]) -> Detection {
        let (view, noise) = (&setup.sensor.field_of_view, &setup.sensor.noise);
        let [right, left] = [view.azimuth_min_deg, view.azimuth_max_deg].map(|a| f64::from(a).to_radians());
        let (range, azimuth) = (self.at[0] * f64::from(view.range_max_m), right + self.at[1] * (left - right));
        let [vx, vy] = self.velocity;
        let (x, y) = (range * azimuth.cos() + vx * seconds, range * azimuth.sin() + vy * seconds);
        let distance = x.hypot(y);
        let range = distance + off[0] * f64::from(noise.range_m);
        let azimuth = y.atan2(x) + off[1] * f64::from(noise.azimuth_deg).to_radians();
        let radial = (x * vx + y * vy) / distance.max(1.0) + off[2] * f64::from(noise.radial_velocity_mps);
        Detection {
            range_cm: (range * 100.0).clamp(1.0, 65_535.0) as u16,
            azimuth: Angle::from_radians(azimuth as f32),
            elevation: None,
            radial_velocity_cm_s: (radial * 100.0) as i16,
            rcs_half_dbsm: None,
            snr_half_db: None,
            marked: false,
        }
    }
}

/// Frames of vehicles that drive about, each detected twice in each of them, with as much noise as the setup says.
pub fn drives(setup: &Setup, most: usize) -> impl Strategy<Value = Vec<Frame>> + use<> {
    let setup = *setup;
    let speed = || prop_oneof![1 => Just(0.0), 1 => -3.0..3.0_f64, 2 => -30.0..30.0_f64];
    let drive = ([0.1..1.0_f64, 0.0..1.0_f64], [speed(), speed()]).prop_map(|(at, velocity)| Drive { at, velocity });
    let off = proptest::collection::vec([-2.0..2.0_f64, -2.0..2.0_f64, -2.0..2.0_f64], 12);
    let frame = (prop_oneof![6 => 40_000..120_000_u64, 1 => 0..1_000_000_u64], off);
    let drives = proptest::collection::vec(drive, 1..6);
    (drives, proptest::collection::vec(frame, 2..most)).prop_map(move |(drives, frames)| {
        let (mut now, mut seconds) = (1_000_000, 0.0);
        let frames = frames.into_iter().map(|(micros, off)| {
            now += micros;
            seconds += micros as f64 * 1e-6;
            let twice = drives.iter().chain(&drives).zip(off);
            let detections = twice.map(|(drive, off)| drive.detection(&setup, seconds, off)).collect();
            Frame { now: Time::from_micros(now), fault: false, detections }
        });
        frames.collect()
    })
}

/// As many detections as wanted, of any value within the field of view, from a seed.
pub fn crowd(setup: &Setup, seed: u64, count: usize) -> Vec<Detection> {
    let mut state = seed | 1;
    let mut random = move || {
        // Marsaglia's xorshift
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let d = |bits: u64| Detection {
        range_cm: bits as u16,
        azimuth: Angle::from_raw((bits >> 16) as i16),
        elevation: (bits & 3 != 0).then(|| Angle::from_raw((bits >> 20) as i16)),
        radial_velocity_cm_s: ((bits >> 24) % 14_000) as i16 - 7000,
        rcs_half_dbsm: None,
        snr_half_db: Some(((bits >> 40) % 100) as i16),
        marked: false,
    };
    (0..count).map(|_| drawn_in(d(random()), setup)).collect()
}
