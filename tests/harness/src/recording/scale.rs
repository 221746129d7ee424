//! The scale of velocities, told by how positions change over time.
//!
//! # Method
//! What moves is followed by positions alone over about a second: a detection, one near it in the next frame, and from
//! there on the one that lies where the two lead. A track counts if it moves more than `LEAST_WAY_M`, leaves its first
//! place empty and comes to one that was empty: rails and masts, however evenly they stand, lead nowhere. How fast its
//! range changes over the radial velocity of its detections is the scale, if most tracks agree.

use std::ops::Deref;

use super::Frame;
use super::frames::step;

/// A track that moves less is none, metres.
const LEAST_WAY_M: f64 = 3.0;

/// Nothing on a road moves faster, m/s.
const FASTEST_MPS: f64 = 70.0;

/// Radial speed from which on a track says something, m/s.
const LEAST_SPEED_MPS: f64 = 2.0;

/// How long something is followed, seconds, and over how many frames at least.
const FOLLOWED_S: f64 = 1.2;
const LEAST_FRAMES: usize = 6;

/// How far from where it should be a detection may lie: along the range, across it, and that as part of the range.
const ALONG_M: f64 = 0.5;
const ACROSS_M: f64 = 0.8;
const ACROSS_RAD: f64 = 0.012;

/// Part of the frames in which a place is found occupied by what passes.
const MOST_OCCUPIED: f64 = 0.35;

/// Frames in which tracks begin, spread over the recording, and detections of each that are followed.
const MOST_STARTS: usize = 120;
const MOST_FOLLOWED: usize = 80;

/// Tracks before anything is said.
const LEAST_TRACKS: usize = 15;

/// Speeds that are slower than this all over a recording are none, m/s.
const NOTHING_MPS: f32 = 0.01;

/// What units make of one m/s, by their names.
const UNITS: [(&str, f64); 5] =
    [("km/h", 1.0 / 3.6), ("miles an hour", 0.447_04), ("cm/s", 0.01), ("mm/s", 0.001), ("knots", 0.514_444)];

/// What positions say against velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contradiction {
    /// Velocities are 0 throughout, and this many tracks move, the fastest at this radial speed, m/s.
    NeverFilled { tracks: usize, fastest_mps: f64 },
    /// Ranges change by this times the velocity.
    Scaled { tracks: usize, factor: f64 },
}

impl Contradiction {
    /// In words, with what to do.
    pub fn told(&self) -> String {
        match *self {
            Self::NeverFilled { tracks, fastest_mps } => format!(
                "velocities are 0 throughout, though positions move at up to {fastest_mps:.0} m/s ({tracks} tracks): the driver does not fill them, so nothing that moves is told from what stands; have it fill the radial velocity, m/s"
            ),
            Self::Scaled { tracks, factor } => {
                let unit = UNITS.iter().find(|(_, unit)| (factor.abs() / unit - 1.0).abs() < 0.06);
                let (what, scale) = match unit {
                    Some((name, unit)) => (format!(", so they seem to be in {name}"), *unit),
                    None => (", so they are in another unit or scale".to_owned(), factor.abs()),
                };
                let sign = if factor < 0.0 { " and their sign with --velocity-sign approaching" } else { "" };
                format!(
                    "velocities are not in m/s: positions move at {factor:.3} times of them ({tracks} tracks){what}; convert them with --velocity-scale {scale:.4}{sign}"
                )
            }
        }
    }
}

/// A detection as it is followed: range, place in the radar's plane, velocity.
#[derive(Debug, Clone, Copy)]
struct Point {
    range: f64,
    place: [f64; 2],
    velocity: f64,
}

/// Of what moves: how fast the range changes, and the mean radial velocity of its detections.
pub struct Tracks {
    step: usize,
    taken: usize,
    start_ns: Option<i64>,
    last_s: f64,
    never_filled: bool,
    /// Frames that are gathered from one on in which tracks begin.
    open: Vec<Stretch>,
    found: Vec<(f64, f64)>,
}

/// Frames that follow one another: their times since the recording's first and their detections.
struct Stretch {
    times: Vec<f64>,
    points: Vec<Vec<Point>>,
}

impl Tracks {
    /// Of so many frames.
    pub fn new(frames: usize) -> Self {
        Self {
            step: step(frames, MOST_STARTS),
            taken: 0,
            start_ns: None,
            last_s: 0.0,
            never_filled: true,
            open: Vec::new(),
            found: Vec::new(),
        }
    }

    /// Takes the next frame, as it is and with the points that can be used.
    pub fn frame(&mut self, frame: &Frame, used: &impl Deref<Target = Frame>) {
        let still = |frame: &Frame| frame.detections.iter().all(|d| d.radial_velocity_mps.abs() < NOTHING_MPS);
        self.never_filled = self.never_filled && (still(frame) || still(used));
        let now_s = seconds(*self.start_ns.get_or_insert(frame.time_ns), frame.time_ns);
        let begins = self.taken.is_multiple_of(self.step);
        if begins || !self.open.is_empty() {
            let points = points(used);
            let (passed, found) = (now_s - self.last_s, &mut self.found);
            self.open.retain_mut(|stretch| match stretch.takes(now_s, passed) {
                Some(true) => {
                    stretch.times.push(now_s);
                    stretch.points.push(points.clone());
                    true
                }
                Some(false) => {
                    found.extend(stretch.tracks());
                    false
                }
                None => false,
            });
            if begins {
                self.open.push(Stretch { times: vec![now_s], points: vec![points] });
            }
        }
        self.last_s = now_s;
        self.taken += 1;
    }

    /// What the positions say against the velocities; `None` where they agree, or say nothing.
    pub fn end(mut self) -> Option<Contradiction> {
        self.found.extend(self.open.iter().flat_map(Stretch::tracks));
        let tracks = self.found;
        if tracks.len() < LEAST_TRACKS {
            return None;
        }
        if self.never_filled {
            let fastest_mps = tracks.iter().map(|(rate, _)| rate.abs()).fold(0.0, f64::max);
            return Some(Contradiction::NeverFilled { tracks: tracks.len(), fastest_mps });
        }
        let has_velocity = |&&(_, velocity): &&(f64, f64)| velocity.abs() > 0.05;
        let mut ratios: Vec<f64> = tracks.iter().filter(has_velocity).map(|(rate, velocity)| rate / velocity).collect();
        ratios.sort_by(f64::total_cmp);
        let factor = *ratios.get(ratios.len() / 2)?;
        let agree = ratios.iter().filter(|r| (**r / factor - 1.0).abs() < 0.1).count();
        let is_scale = (0.8..=1.25).contains(&factor);
        (!is_scale && agree >= LEAST_TRACKS && agree * 3 >= tracks.len() * 2)
            .then_some(Contradiction::Scaled { tracks: agree, factor })
    }
}

impl Stretch {
    /// Whether a frame is one of these; `None` of one of a clock by which nothing can be followed.
    fn takes(&self, now_s: f64, passed: f64) -> Option<bool> {
        let is_near = now_s - self.times[0] <= FOLLOWED_S || self.times.len() <= LEAST_FRAMES && passed <= 0.5;
        (!is_near || (0.005..=0.5).contains(&passed)).then_some(is_near)
    }

    fn tracks(&self) -> Vec<(f64, f64)> {
        let Self { times, points } = self;
        if times.len() <= LEAST_FRAMES {
            return Vec::new();
        }
        let share = points[0].len().div_ceil(MOST_FOLLOWED).max(1);
        points[0].iter().step_by(share).filter_map(|start| followed(*start, points, times)).collect()
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// A frame's detections by range.
fn points(frame: &Frame) -> Vec<Point> {
    let point = |d: &super::RadarDetection| {
        let (range, azimuth) = (f64::from(d.range_m), f64::from(d.azimuth_rad));
        // what is measured of a height is left out: it changes little on a road
        Point { range, place: [range * azimuth.cos(), range * azimuth.sin()], velocity: d.radial_velocity_mps.into() }
    };
    let mut points: Vec<Point> = frame.detections.iter().map(point).collect();
    points.sort_by(|a, b| a.range.total_cmp(&b.range));
    points
}

/// The nearest detection to a place, if it may be there.
fn at(points: &[Point], place: [f64; 2]) -> Option<Point> {
    let range = place[0].hypot(place[1]);
    let across_m = ACROSS_M.max(ACROSS_RAD * range);
    let away = |p: &Point| {
        let along = (p.range - range) / ALONG_M;
        // what is left of the distance is across
        let across = ((p.place[0] - place[0]).powi(2) + (p.place[1] - place[1]).powi(2) - (p.range - range).powi(2))
            .max(0.0)
            .sqrt()
            / across_m;
        along.hypot(across)
    };
    let from = points.partition_point(|p| p.range < range - ALONG_M);
    let to = points.partition_point(|p| p.range <= range + ALONG_M);
    let near = points[from..to].iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
    (away(near) <= 1.0).then_some(*near)
}

/// Follows a detection by every one near it in the next frame; what the best of these ways says, if it moves.
fn followed(start: Point, points: &[Vec<Point>], times: &[f64]) -> Option<(f64, f64)> {
    let first_s = times[1] - times[0];
    let reach = FASTEST_MPS * first_s + ALONG_M;
    // what stands is found again where it was, not always, and what passes is not there for long
    let stands = |place: [f64; 2]| {
        let found = points.iter().filter(|frame| at(frame, place).is_some()).count();
        found as f64 > MOST_OCCUPIED * points.len() as f64
    };
    if points[1..=2].iter().any(|frame| at(frame, start.place).is_some()) || stands(start.place) {
        return None;
    }
    let from = points[1].partition_point(|p| p.range < start.range - reach);
    let mut best: Option<(usize, f64, f64)> = None;
    for next in points[1][from..].iter().take_while(|p| p.range <= start.range + reach) {
        let step = [next.place[0] - start.place[0], next.place[1] - start.place[1]];
        if step[0].hypot(step[1]) > reach || at(&points[0], next.place).is_some() {
            continue;
        }
        let (mut way, mut hits, mut velocities) = (step.map(|v| v / first_s), 1, vec![start.velocity, next.velocity]);
        let (mut end, mut passed, mut missed) = (*next, first_s, 0);
        for (frame, time) in points.iter().zip(times).skip(2) {
            let since = time - times[0];
            let place = [0, 1].map(|k| start.place[k] + way[k] * since);
            let Some(hit) = at(frame, place) else {
                missed += 1;
                if missed > 1 {
                    break;
                }
                continue;
            };
            way = [0, 1].map(|k| (hit.place[k] - start.place[k]) / since);
            (end, passed, hits) = (hit, since, hits + 1);
            velocities.push(hit.velocity);
        }
        let moved = (end.place[0] - start.place[0]).hypot(end.place[1] - start.place[1]);
        let mean = velocities.iter().sum::<f64>() / velocities.len() as f64;
        let same = velocities.iter().all(|v| (v - mean).abs() <= 0.15 * mean.abs() + 0.3);
        let arrived = at(&points[0], end.place).is_none() && !stands(end.place);
        if hits >= LEAST_FRAMES - 1
            && moved > LEAST_WAY_M
            && moved <= FASTEST_MPS * passed
            && same
            && arrived
            && best.is_none_or(|(most, ..)| hits > most)
        {
            best = Some((hits, (end.range - start.range) / passed, mean));
        }
    }
    best.map(|(_, rate, velocity)| (rate, velocity)).filter(|(rate, _)| rate.abs() >= LEAST_SPEED_MPS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RadarDetection;

    fn contradiction(frames: &[Frame]) -> Option<Contradiction> {
        let mut tracks = Tracks::new(frames.len());
        frames.iter().for_each(|frame| tracks.frame(frame, &frame));
        tracks.end()
    }

    /// Numbers from 0 to 1, always the same.
    struct Dice(u64);

    impl Dice {
        fn roll(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f64 / f64::from(1 << 24)
        }
    }

    /// A road with rails and masts that are found in part, and vehicles of three reflections at these speeds.
    fn scene(vehicles: &[(f64, f64)], scale: f64, noise: f64) -> Vec<Frame> {
        let mut dice = Dice(7);
        let frame = |k: i64| {
            let time_s = k as f64 / 15.0;
            let mut detections = Vec::new();
            let mut add = |place: [f64; 2], velocity: f64, dice: &mut Dice, found: f64| {
                if dice.roll() > found || place[0] < 3.0 || place[0] > 200.0 {
                    return;
                }
                let (range, azimuth) = (place[0].hypot(place[1]), place[1].atan2(place[0]));
                detections.push(RadarDetection {
                    range_m: (range + noise * (dice.roll() - 0.5)) as f32,
                    azimuth_rad: (azimuth + 0.01 * noise * (dice.roll() - 0.5)) as f32,
                    elevation_rad: None,
                    radial_velocity_mps: (velocity * scale) as f32,
                    rcs_dbsm: None,
                    snr_db: None,
                });
            };
            for post in 0..45 {
                add([4.0 * f64::from(post), 9.0], 0.0, &mut dice, 0.6);
            }
            for (n, (lane, speed)) in vehicles.iter().enumerate() {
                let along = (31.0 * n as f64 + speed * time_s).rem_euclid(230.0) - 15.0;
                for (ahead, aside) in [(0.0, -0.7), (0.4, 0.7), (3.1, 0.8)] {
                    let place = [along + ahead, lane + aside];
                    add(place, speed * place[0] / place[0].hypot(place[1]), &mut dice, 0.9);
                }
            }
            Frame { time_ns: (time_s * 1e9) as i64, detections, refused: 0, unwanted: Vec::new(), fault: false }
        };
        (0..150).map(frame).collect()
    }

    const TRAFFIC: [(f64, f64); 6] =
        [(-4.0, 14.0), (-4.0, 17.0), (3.5, -15.0), (3.5, -22.0), (-7.5, 28.0), (3.5, -9.0)];

    #[test]
    fn the_scale_of_velocities_is_told_by_positions() {
        for noise in [0.0, 0.3] {
            assert_eq!(contradiction(&scene(&TRAFFIC, 1.0, noise)), None);
            for (scale, unit) in [
                (3.6, "km/h"),
                (1.0 / 0.447_04, "miles an hour"),
                (100.0, "cm/s"),
                (0.1, "another unit"),
                (-3.6, "sign with --velocity-sign approaching"),
            ] {
                let found = contradiction(&scene(&TRAFFIC, scale, noise));
                let Some(Contradiction::Scaled { factor, .. }) = found else { panic!("{scale}: {found:?}") };
                assert!((factor * scale - 1.0).abs() < 0.05, "{scale}: {found:?}");
                assert!(found.is_some_and(|f| f.told().contains(unit)), "{scale}: {found:?}");
            }
            let found = contradiction(&scene(&TRAFFIC, 0.0, noise));
            assert!(
                matches!(found, Some(Contradiction::NeverFilled { fastest_mps, .. }) if fastest_mps > 20.0),
                "{found:?}"
            );
        }
    }

    #[test]
    fn a_scene_that_stands_is_no_evidence() {
        for scale in [0.0, 1.0, 3.6] {
            assert_eq!(contradiction(&scene(&[], scale, 0.3)), None, "{scale}");
            // a queue that creeps
            assert_eq!(contradiction(&scene(&[(-4.0, 0.5), (-4.0, 0.8), (3.5, -0.3)], scale, 0.3)), None, "{scale}");
        }
    }
}
