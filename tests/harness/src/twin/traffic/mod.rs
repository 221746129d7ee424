//! Where every vehicle is at any instant, whatever file it comes from.
//!
//! Two kinds of files: SUMO's floating car data ([`fcd_xml`], [`fcd_csv`]) and trajectories as CSV in the
//! form of labels ([`trajectories`]). Both are read streaming, plain or gzip; what never comes near the
//! sensor within the time of the recording is not kept. [`read()`] tells the kinds apart.
//!
//! # Model
//! Between two rows of a vehicle its centre follows a cubic through the rows around (finite-difference
//! tangents, Catmull and Rom 1974), so that speed is continuous; its heading turns the short way. A row is
//! missing where the next comes later than [`LONGEST_GAP_S`]: the vehicle is another one after it. So it is where it comes
//! faster than [`FASTEST_MPS`] to the next: SUMO teleports vehicles that block others.
//!
//! # Limits
//! The road is flat: heights in the file are not read.

pub mod fcd_csv;
pub mod fcd_xml;
pub mod frame;
pub mod net;
pub mod opened;
pub mod trajectories;
pub mod types;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::geometry::solid::Solid;
use frame::RoadFrame;
use types::{Kind, VehicleTypes};

/// Time between two rows of one vehicle beyond which it is not followed, seconds.
pub const LONGEST_GAP_S: f64 = 2.5;

/// What comes faster from one row to the next does not drive there, m/s.
pub const FASTEST_MPS: f64 = 100.0;

/// Coordinates that all lie this close together are degrees, not metres.
const LEAST_EXTENT: f64 = 1.0;

/// Rows are kept for this long before and after the recording, so that every vehicle has neighbours.
const MARGIN_S: f64 = LONGEST_GAP_S;

/// Files that together say where vehicles are.
#[derive(Debug, Clone, Default)]
pub struct Source {
    /// FCD (XML or CSV) or trajectories (CSV), plain or gzip.
    pub path: PathBuf,
    /// SUMO files with `vType` elements.
    pub types: Vec<PathBuf>,
    /// SUMO net, for its offset.
    pub net: Option<PathBuf>,
    /// Origin and heading of the road frame in the file's coordinates.
    pub frame: RoadFrame,
}

/// The part of the traffic that is kept.
#[derive(Debug, Clone, Copy)]
pub struct Region {
    pub from_s: f64,
    pub to_s: f64,
    /// Road frame, metres.
    pub center: [f64; 2],
    pub radius_m: f64,
}

/// One vehicle at one instant, as a file has it.
#[derive(Debug, Clone)]
pub struct Row {
    pub time_s: f64,
    pub id: String,
    pub kind: Kind,
    /// A person, whose names are others than vehicles' in SUMO.
    pub is_person: bool,
    /// x and y as they stand in the file.
    pub written: [f64; 2],
    /// Middle of the footprint, road frame, metres.
    pub center: [f64; 2],
    /// From +x, counter-clockwise, radians.
    pub heading_rad: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    time_s: f64,
    center: [f64; 2],
    heading_rad: f64,
}

/// A vehicle with its way.
#[derive(Debug, Clone)]
pub struct Vehicle {
    pub id: String,
    pub kind: Kind,
    samples: Vec<Sample>,
}

/// A vehicle at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    pub solid: Solid,
    /// Road frame, m/s.
    pub velocity: [f64; 2],
}

/// All vehicles that come near.
#[derive(Debug, Clone, Default)]
pub struct Traffic {
    pub vehicles: Vec<Vehicle>,
    /// Vehicles that jump: who first, when, by how many metres in how many seconds; and how often in all.
    pub jumps: Option<(Jump, u64)>,
}

/// A vehicle that is elsewhere in its next row, farther than it can drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Jump {
    pub id: String,
    pub time_s: f64,
    pub way_m: f64,
    pub passed_s: f64,
}

/// Reads the vehicles that come within a region.
///
/// # Errors
/// Names the file and the line or element: a file that cannot be read or is cut off, a value that is no
/// finite number, a type nobody defines, a time that runs backwards. And where nothing comes near: what the file covers.
pub fn read(source: &Source, region: &Region) -> Result<Traffic> {
    let types = VehicleTypes::read(&source.types)?;
    let mut frame = source.frame;
    if let Some(net) = &source.net {
        frame.net_offset = frame::net_offset(net)?;
    }
    let mut collected = Collector::new(*region);
    let mut reader = opened::open(&source.path)?;
    if opened::begins_with(&mut reader, b"<").with_context(|| source.path.display().to_string())? {
        fcd_xml::read(reader, &source.path, &types, &frame, &mut collected)?;
    } else {
        let (mut text, heading) = opened::first_line(reader).with_context(|| source.path.display().to_string())?;
        if fcd_csv::is_heading(&heading) {
            fcd_csv::read(&mut text, &source.path, &types, &frame, &mut collected)?;
        } else if trajectories::is_heading(&heading) {
            trajectories::read(&mut text, &source.path, &frame, &mut collected)?;
        } else {
            bail!(
                "{}, line 1: `{}` begins neither SUMO's FCD (XML or CSV) nor trajectories (CSV: {})",
                source.path.display(),
                heading.chars().take(80).collect::<String>(),
                trajectories::COLUMNS
            );
        }
    }
    collected.finish(&source.path)
}

/// Rows on their way to vehicles.
#[derive(Debug)]
pub struct Collector {
    region: Region,
    /// By whether they are persons, and their id.
    open: BTreeMap<(bool, String), Vehicle>,
    closed: Vec<(bool, Vehicle)>,
    /// How often an id was taken up again after a gap.
    again: BTreeMap<(bool, String), u32>,
    jumps: Option<(Jump, u64)>,
    /// When and where each was last, near or not.
    last: BTreeMap<(bool, String), (f64, [f64; 2])>,
    /// Rows that come too late after the one before of their vehicle, and the shortest such time.
    late: (u64, f64),
    /// Least and greatest coordinates as the file has them, and the ids of the first two vehicles.
    extent: [[f64; 2]; 2],
    ids: Vec<String>,
    rows: u64,
    times_s: [f64; 2],
    nearest_m: f64,
}

impl Collector {
    pub fn new(region: Region) -> Self {
        Self {
            region,
            open: BTreeMap::new(),
            closed: Vec::new(),
            again: BTreeMap::new(),
            jumps: None,
            last: BTreeMap::new(),
            late: (0, f64::INFINITY),
            extent: [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]],
            ids: Vec::new(),
            rows: 0,
            times_s: [f64::INFINITY, f64::NEG_INFINITY],
            nearest_m: f64::INFINITY,
        }
    }

    /// Whether rows of this time can matter.
    pub fn wants(&self, time_s: f64) -> bool {
        (self.region.from_s - MARGIN_S..=self.region.to_s + MARGIN_S).contains(&time_s)
    }

    /// Takes one row; rows of one vehicle come in the order of time.
    ///
    /// # Errors
    /// Two rows of one vehicle at one time, or one earlier than the one before.
    pub fn add(&mut self, row: Row) -> Result<()> {
        self.rows += 1;
        self.extent = [0, 1].map(|end| {
            [0, 1].map(|k| {
                if end == 0 { row.written[k].min(self.extent[0][k]) } else { row.written[k].max(self.extent[1][k]) }
            })
        });
        if self.ids.len() < 2 && !self.ids.contains(&row.id) && !row.is_person {
            self.ids.push(row.id.clone());
        }
        self.times_s = [self.times_s[0].min(row.time_s), self.times_s[1].max(row.time_s)];
        if !self.wants(row.time_s) {
            return Ok(());
        }
        let away = (row.center[0] - self.region.center[0]).hypot(row.center[1] - self.region.center[1]);
        self.nearest_m = self.nearest_m.min(away);
        self.note_jump(&row);
        if away > self.region.radius_m {
            return Ok(());
        }
        let sample = Sample { time_s: row.time_s, center: row.center, heading_rad: row.heading_rad };
        let key = (row.is_person, row.id.clone());
        let Some(known) = self.open.get_mut(&key) else {
            self.open.insert(key, Vehicle { id: row.id, kind: row.kind, samples: vec![sample] });
            return Ok(());
        };
        let last = known.samples[known.samples.len() - 1];
        let passed_s = row.time_s - last.time_s;
        ensure!(
            passed_s > 0.0,
            "time runs from {} s to {} s; rows of one vehicle must come in the order of time",
            last.time_s,
            row.time_s
        );
        let way_m = (row.center[0] - last.center[0]).hypot(row.center[1] - last.center[1]);
        if passed_s > LONGEST_GAP_S {
            self.late = (self.late.0 + 1, self.late.1.min(passed_s));
        } else if way_m <= FASTEST_MPS * passed_s {
            known.samples.push(sample);
            return Ok(());
        }
        let times = self.again.entry(key.clone()).or_insert(1);
        *times += 1;
        let id = format!("{}#{times}", row.id);
        let next = Vehicle { id, kind: row.kind, samples: vec![sample] };
        if let Some(before) = self.open.insert(key, next) {
            self.closed.push((row.is_person, before));
        }
        Ok(())
    }

    /// Counts a row that is farther from the one before than its vehicle can drive, if one of them is near.
    fn note_jump(&mut self, row: &Row) {
        let now = (row.time_s, row.center);
        let Some((time_s, center)) = self.last.insert((row.is_person, row.id.clone()), now) else { return };
        let (passed_s, way_m) = (row.time_s - time_s, (row.center[0] - center[0]).hypot(row.center[1] - center[1]));
        let is_near =
            |[x, y]: [f64; 2]| (x - self.region.center[0]).hypot(y - self.region.center[1]) <= self.region.radius_m;
        let jumps = passed_s > 0.0 && passed_s <= LONGEST_GAP_S && way_m > FASTEST_MPS * passed_s;
        if jumps && (is_near(center) || is_near(row.center)) {
            let first = Jump { id: row.id.clone(), time_s: row.time_s, way_m, passed_s };
            self.jumps.get_or_insert((first, 0)).1 += 1;
        }
    }

    /// Refuses coordinates that are degrees: two vehicles do not stand within a metre.
    fn refuse_degrees(&self, path: &Path) -> Result<()> {
        let [[left, down], [right, up]] = self.extent;
        let is_near = right - left < LEAST_EXTENT && up - down < LEAST_EXTENT;
        let on_earth = left.min(right) >= -180.0 && right <= 180.0 && down >= -90.0 && up <= 90.0;
        ensure!(
            self.ids.len() < 2 || !is_near || !on_earth,
            "{}: all its vehicles lie within a metre of ({left:.4}, {down:.4}): these are degrees, longitude and latitude, as SUMO's --fcd-output.geo writes; write metres, without that option",
            path.display()
        );
        Ok(())
    }

    fn finish(mut self, path: &Path) -> Result<Traffic> {
        let Region { from_s, to_s, center: [x, y], radius_m } = self.region;
        ensure!(self.rows > 0, "{}: it holds no vehicle at all", path.display());
        self.refuse_degrees(path)?;
        self.closed.extend(self.open.into_iter().map(|((person, _), vehicle)| (person, vehicle)));
        let names: BTreeSet<String> =
            self.closed.iter().filter(|(person, _)| !person).map(|(_, v)| v.id.clone()).collect();
        let named = |(person, vehicle): (bool, Vehicle)| {
            let id =
                if person && names.contains(&vehicle.id) { format!("{} (person)", vehicle.id) } else { vehicle.id };
            Vehicle { id, ..vehicle }
        };
        let mut closed: Vec<Vehicle> = self.closed.into_iter().map(named).collect();
        closed.retain(|v| v.samples.len() > 1);
        closed.sort_by(|a, b| a.id.cmp(&b.id));
        if closed.is_empty() {
            let [first, last] = self.times_s;
            let (late, apart_s) = self.late;
            ensure!(
                late == 0,
                "{}: rows of one vehicle are {apart_s:.1} s apart and more, and {LONGEST_GAP_S} s is the most between which it is followed: write them more often, `sumo --fcd-output FILE --device.fcd.period 0.5`",
                path.display()
            );
            let near = if self.nearest_m.is_finite() {
                format!("the nearest stays {:.0} m away", self.nearest_m)
            } else {
                "it has no row of that time".to_owned()
            };
            bail!(
                "{}: an empty scene: no vehicle within {radius_m:.0} m of ({x:.0}, {y:.0}) from {from_s} s to {to_s} s; {near}, its times are {first} s to {last} s. Check from_s, origin and heading of the scene's traffic.",
                path.display()
            );
        }
        Ok(Traffic { vehicles: closed, jumps: self.jumps })
    }
}

impl Traffic {
    /// Every vehicle at an instant, with its index.
    pub fn at(&self, time_s: f64) -> impl Iterator<Item = (usize, Pose)> {
        self.vehicles.iter().enumerate().filter_map(move |(k, v)| Some((k, v.at(time_s)?)))
    }
}

impl Traffic {
    /// Keeps of every vehicle the time from its first to its last row that matters, one row more at both ends.
    pub fn keep(&mut self, matters: impl Fn([f64; 2]) -> bool) {
        for vehicle in &mut self.vehicles {
            let place = |s: &Sample| matters(s.center);
            let (first, last) = (vehicle.samples.iter().position(place), vehicle.samples.iter().rposition(place));
            match first.zip(last) {
                Some((first, last)) => {
                    vehicle.samples.truncate(last + 2);
                    vehicle.samples.drain(..first.saturating_sub(1));
                }
                None => vehicle.samples.clear(),
            }
        }
        self.vehicles.retain(|v| v.samples.len() > 1);
    }
}

impl Vehicle {
    /// When its last row is.
    pub fn ends_s(&self) -> Option<f64> {
        self.samples.last().map(|s| s.time_s)
    }

    /// Pose between the first and the last row.
    pub fn at(&self, time_s: f64) -> Option<Pose> {
        let s = &self.samples;
        let next = s.partition_point(|p| p.time_s <= time_s).min(s.len() - 1);
        let before = next.checked_sub(1)?;
        let (a, b) = (s[before], s[next]);
        if !(a.time_s..=b.time_s).contains(&time_s) {
            return None;
        }
        let dt = b.time_s - a.time_s;
        let f = (time_s - a.time_s) / dt;
        let slope = |k: usize, axis: usize| {
            let (i, j) = (k.saturating_sub(1), (k + 1).min(s.len() - 1));
            (s[j].center[axis] - s[i].center[axis]) / (s[j].time_s - s[i].time_s)
        };
        let along = [0, 1].map(|axis| {
            let (p, q) = (a.center[axis], b.center[axis]);
            let (u, v) = (slope(before, axis) * dt, slope(next, axis) * dt);
            // cubic Hermite and its derivative
            let (c2, c3) = (3.0 * (q - p) - 2.0 * u - v, 2.0 * (p - q) + u + v);
            (p + f * (u + f * (c2 + f * c3)), (u + f * (2.0 * c2 + f * 3.0 * c3)) / dt)
        });
        let turn = (b.heading_rad - a.heading_rad + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
            - std::f64::consts::PI;
        let size = self.kind.size;
        Some(Pose {
            solid: Solid { center: [along[0].0, along[1].0, size[2] / 2.0], yaw_rad: a.heading_rad + f * turn, size },
            velocity: [along[0].1, along[1].1],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::Class;

    const REGION: Region = Region { from_s: 0.0, to_s: 10.0, center: [0.0, 0.0], radius_m: 100.0 };

    fn row(time_s: f64, x: f64) -> Row {
        let kind = Kind { class: Class::Car, size: [4.0, 2.0, 1.5] };
        Row { time_s, id: "a".into(), kind, is_person: false, written: [x, 1.0], center: [x, 1.0], heading_rad: 0.0 }
    }

    fn collect(rows: impl IntoIterator<Item = Row>) -> Result<Traffic> {
        let mut c = Collector::new(REGION);
        for r in rows {
            c.add(r)?;
        }
        c.finish(Path::new("f"))
    }

    #[test]
    fn a_braking_vehicle_follows_its_parabola_between_rows() {
        // 20 m/s, braking with 4 m/s^2; rows every half second
        let x = |t: f64| -50.0 + 20.0 * t - 2.0 * t * t;
        let traffic = collect((0..9).map(|k| row(f64::from(k) * 0.5, x(f64::from(k) * 0.5)))).unwrap();
        for k in 5..35 {
            let t = f64::from(k) * 0.1;
            let pose = traffic.vehicles[0].at(t).unwrap();
            assert!((pose.solid.center[0] - x(t)).abs() < 1e-9, "{t}");
            assert!((pose.velocity[0] - (20.0 - 4.0 * t)).abs() < 1e-9, "{t}");
        }
        assert!(traffic.vehicles[0].at(-0.01).is_none() && traffic.vehicles[0].at(4.01).is_none());
        assert!(traffic.vehicles[0].at(0.0).is_some() && traffic.vehicles[0].at(4.0).is_some());
    }

    #[test]
    fn a_long_gap_makes_two_vehicles_of_one_id() {
        let traffic = collect([0.0, 0.5, 1.0, 6.0, 6.5].map(|t| row(t, t))).unwrap();
        let ids: Vec<&str> = traffic.vehicles.iter().map(|v| v.id.as_str()).collect();
        assert_eq!(ids, ["a", "a#2"]);
        assert_eq!(traffic.at(3.0).count(), 0);
    }

    #[test]
    fn a_vehicle_is_kept_without_gaps_from_first_to_last_time_it_matters() {
        let mut traffic = collect((0..20).map(|k| row(f64::from(k) * 0.5, f64::from(k)))).unwrap();
        traffic.keep(|[x, _]| x == 5.0 || x == 9.0);
        let vehicle = &traffic.vehicles[0];
        assert!(vehicle.at(3.5).is_some(), "between the two it is known too");
        assert!(
            vehicle.at(2.0).is_some()
                && vehicle.at(1.9).is_none()
                && vehicle.at(5.0).is_some()
                && vehicle.at(5.1).is_none()
        );
        traffic.keep(|_| false);
        assert!(traffic.vehicles.is_empty());
    }

    #[test]
    fn what_never_comes_near_is_said_with_what_there_is() {
        let far = collect([row(1.0, 500.0), row(1.5, 510.0)]).unwrap_err().to_string();
        assert!(far.contains("empty scene") && far.contains("500 m away"), "{far}");
        let late = collect([row(100.0, 0.0), row(100.5, 1.0)]).unwrap_err().to_string();
        assert!(late.contains("100 s to 100.5 s"), "{late}");
        assert!(collect([]).unwrap_err().to_string().contains("no vehicle at all"));
    }

    #[test]
    fn what_jumps_does_not_drive_and_is_told() {
        // a lorry at 40 m/s drives, one that is 400 m on in half a second does not
        let xs = [-60.0, -40.0, -20.0, 60.0, 80.0, 100.0];
        let traffic = collect(xs.iter().enumerate().map(|(k, x)| row(k as f64 * 0.5, *x))).unwrap();
        let ids: Vec<&str> = traffic.vehicles.iter().map(|v| v.id.as_str()).collect();
        assert_eq!((ids, traffic.at(1.25).count()), (vec!["a", "a#2"], 0));
        let (jump, n) = traffic.jumps.unwrap();
        assert_eq!((jump.id.as_str(), jump.time_s, jump.way_m, jump.passed_s, n), ("a", 1.5, 80.0, 0.5, 1));
        assert_eq!(collect((0..6).map(|k| row(f64::from(k) * 0.5, 20.0 * f64::from(k)))).unwrap().jumps, None);
        // away, and not to be seen again
        let gone = collect([(0.0, 0.0), (0.5, 10.0), (1.0, 410.0), (1.5, 420.0)].map(|(t, x)| row(t, x))).unwrap();
        assert_eq!((gone.vehicles.len(), gone.jumps.map(|(jump, n)| (jump.way_m, n))), (1, Some((400.0, 1))));
    }

    #[test]
    fn a_person_may_be_called_like_a_vehicle() {
        let both = (0..4).flat_map(|k| {
            let one = row(f64::from(k) * 0.5, f64::from(k));
            [Row { is_person: true, center: [5.0, 5.0], ..one.clone() }, one]
        });
        let traffic = collect(both).unwrap();
        let ids: Vec<&str> = traffic.vehicles.iter().map(|v| v.id.as_str()).collect();
        assert_eq!(ids, ["a", "a (person)"]);
    }

    #[test]
    fn degrees_and_rows_too_far_apart_are_named() {
        let geo = (0..6).map(|k| {
            let written = [13.33 + 1e-4 * f64::from(k), 52.5];
            // headings and lengths put the middles metres apart
            let center = [written[0] + if k % 2 == 0 { -2.3 } else { 2.3 }, written[1]];
            Row { id: format!("{}", k % 2), written, center, ..row(f64::from(k / 2) * 0.5, 0.0) }
        });
        assert!(collect(geo).unwrap_err().to_string().contains("degrees, longitude and latitude"));
        // one vehicle that stands is none of that
        assert!(collect((0..4).map(|k| row(f64::from(k) * 0.5, 0.0))).is_ok());
        let slow = collect([0.0, 5.0].map(|t| row(t, t))).unwrap_err().to_string();
        assert!(slow.contains("5.0 s apart and more, and 2.5 s is the most"), "{slow}");
    }

    #[test]
    fn time_running_backwards_is_an_error() {
        let error = collect([row(1.0, 0.0), row(0.5, 0.0)]).unwrap_err().to_string();
        assert!(error.contains("1 s to 0.5 s"), "{error}");
    }
}
