//! Instants of a recording: what its unit says frame by frame, what a receiver on a bus has of it, and what the labels
//! say of both.

use anyhow::Result;
use viewshed::map::polar::PolarGeometry;
use viewshed::probability::Quantiser;
use viewshed::wire::message::Addresses;

use super::broadcast::Receiving;
use super::instant::{Box3, Cells, Instant, Sample, Shown, mount};
use super::instants::Instants;
use crate::bus::listening::Listening;
use crate::bus::logged::Logged;
use crate::bus::traffic::{BUSES, Bus, Maps, Traffic};
use crate::estimators::{self, Estimator, PolarCells};
use crate::evaluation::Settings;
use crate::evaluation::counts::{Counts, Outcome};
use crate::evaluation::replay::{Replay, visit};
use crate::evaluation::sensor_set::newest;
use crate::geometry::pose::SensorPose;
use crate::recording::can_log::{Content, Line};
use crate::recording::{Frame, RadarDetection, Recording};

/// The bus that a receiver is shown on.
const BUS: Bus = BUSES[2];
/// Its sender's number.
const SENSOR: u8 = 1;

/// Finds every instant of a recording, at the frames of its first radar; labels are compared with that one's map. With a
/// table its cells have their probabilities, and the receiver's the levels that are sent of them.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn fill(
    instants: &Instants,
    radars: &[Recording],
    settings: &Settings,
    table: Option<&(Quantiser, PolarGeometry)>,
) -> Result<()> {
    let Some((recording, others)) = radars.split_first() else { return Ok(()) };
    let mut others = others.iter().map(|other| Beside::new(other, settings)).collect::<Result<Vec<_>>>()?;
    let mut shown_one = [estimators::own(recording, &settings.estimators)?];
    let own_name = shown_one[0].name().to_owned();
    let name = if others.is_empty() { own_name.clone() } else { recording.sensor.name.clone() };
    let mut running = vec![estimators::own(recording, &settings.estimators)?];
    let frames = recording.frames.len();
    instants.say(format!("comparing {frames} frames with the labels"));
    // the figures have no intervals here
    let evaluation = crate::evaluation::Options { bootstrap: 0, ..settings.evaluation.clone() };
    let replay = Replay::new(recording.clone(), &mut running, &evaluation, &|| ());
    instants.say("sending the maps over a bus");
    let mut received = receiver(recording, settings, table.map(|(quantiser, _)| quantiser))?;
    instants.say(format!("{frames} frames"));
    let all: Vec<usize> = (0..frames).collect();
    let start = recording.frames.first().map_or(0, |f| f.time_ns);
    let mut outcome = Ok(());
    visit(recording, &mut shown_one, &all, |k, _, estimator| {
        let (Some(frame), Some(polar)) = (recording.frames.get(k), estimator.polar()) else { return };
        let (own, shares) = shown(&name, recording, &polar);
        let own = match table {
            Some((quantiser, grid)) => own.with_probabilities(|azimuth, range| {
                let cell = (polar.cell)(azimuth, range);
                quantiser.table().in_cell(grid, polar.azimuths, cell.grade, [azimuth, range])
            }),
            None => own,
        };
        let mut counts = Counts::default();
        let objects = recording.truth.as_ref().map(|truth| truth.at(frame.time_ns)).unwrap_or_default();
        let mut boxes = Vec::new();
        for object in &objects {
            let track = recording.truth.as_ref().and_then(|truth| truth.tracks.get(object.track));
            let judged = replay.judged(&own_name, k, object.track);
            if let Some((visible, detected)) = judged {
                counts.add(visible, detected);
            }
            boxes.push(Box3 {
                name: track.map(|track| format!("{} {}", track.class, track.id)),
                outcome: judged.map(|(visible, detected)| Outcome::of(visible, detected).name().to_owned()),
                ..Box3::of(&object.solid)
            });
        }
        let next_ns = recording.frames.get(k + 1).map_or(frame.time_ns + 66_000_000, |next| next.time_ns);
        let at_receiver = received.as_mut().and_then(|received| received.until(next_ns - 1_000_000));
        let small = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        let height_m = settings.evaluation.slice_height_m;
        let mut detections = placed(&recording.pose, frame, height_m);
        let mut obstacles: Vec<Box3> = estimator.obstacles().iter().map(Box3::of).collect();
        let mut maps: Vec<Shown> = [Some(own), at_receiver].into_iter().flatten().collect();
        for other in &mut others {
            maps.push(other.at(frame.time_ns));
            if let Some(now) = other.now(frame.time_ns) {
                detections.extend(placed(&other.recording.pose, now, height_m));
                obstacles.extend(other.estimator.obstacles().iter().map(Box3::of));
            }
        }
        let instant = Instant {
            number: k,
            sample: Sample {
                time_s: frame.time_ns.saturating_sub(start) as f64 * 1e-9,
                detections: frame.detections.len(),
                tv: small(counts.tv),
                fv: small(counts.fv),
                ti: small(counts.ti),
                fi: small(counts.fi),
                ..shares
            },
            maps,
            detections,
            boxes,
            obstacles,
            senders: Vec::new(),
            counters: estimator.counters().into_iter().map(|(what, n)| (what.to_owned(), n)).collect(),
        };
        if outcome.is_ok() {
            outcome = instants.add(instant);
        }
    });
    outcome?;
    instants.end(format!("{frames} frames"));
    Ok(())
}

/// A map as an estimator has it.
fn shown(name: &str, recording: &Recording, polar: &PolarCells<'_>) -> (Shown, Sample) {
    let cells = Cells {
        azimuths: polar.azimuths,
        ranges: polar.ranges,
        azimuth_rad: polar.azimuth_rad,
        narrow: polar.narrow,
        cell_m: polar.cell_m,
        mount: mount(&recording.pose),
    };
    Shown::new(name, cells, |azimuth, range| (polar.cell)(azimuth, range))
}

/// Detections on the road, with their radial velocities.
fn placed(pose: &SensorPose, frame: &Frame, height_m: f64) -> Vec<[f32; 3]> {
    let place = |d: &RadarDetection| {
        let [x, y, _] = d.road_position(pose, height_m);
        [x as f32, y as f32, d.radial_velocity_mps]
    };
    frame.detections.iter().map(place).collect()
}

/// Another radar of the same recording.
struct Beside<'r> {
    recording: &'r Recording,
    estimator: Box<dyn Estimator>,
    /// Frames it was given.
    taken: usize,
}

impl<'r> Beside<'r> {
    fn new(recording: &'r Recording, settings: &Settings) -> Result<Self> {
        Ok(Self { recording, estimator: estimators::own(recording, &settings.estimators)?, taken: 0 })
    }

    /// Its frame at a time; `None` where it is silent.
    fn now(&self, time_ns: i64) -> Option<&'r Frame> {
        newest(self.recording, time_ns).and_then(|k| self.recording.frames.get(k))
    }

    /// Its map at a time, unknown where it is silent.
    fn at(&mut self, time_ns: i64) -> Shown {
        while let Some(frame) = self.recording.frames.get(self.taken).filter(|frame| frame.time_ns <= time_ns) {
            self.estimator.step(frame);
            self.taken += 1;
        }
        let name = &self.recording.sensor.name;
        let map = self.estimator.polar().map(|polar| shown(name, self.recording, &polar).0);
        let Some(map) = map else { return Shown::nothing(name, mount(&self.recording.pose)) };
        if self.now(time_ns).is_some() { map } else { Shown { bytes: None, ..map } }
    }
}

/// A receiver of what the recording's unit would send.
struct Received {
    receiving: Receiving,
    lines: std::iter::Peekable<std::vec::IntoIter<Line>>,
}

/// `None` where frames are single: what is sent of one does not fit to the next.
fn receiver(recording: &Recording, settings: &Settings, table: Option<&Quantiser>) -> Result<Option<Received>> {
    if recording.sensor.frames_independent || recording.frames.is_empty() {
        return Ok(None);
    }
    let maps = Maps::new(recording, &settings.estimators, table, &|| ())?;
    let traffic = Traffic::new(&maps, BUS, None, SENSOR, None)?;
    let line = |sent: &crate::bus::traffic::Sent| {
        let time_ns =
            i64::try_from(sent.at.micros()).unwrap_or(i64::MAX / 1000) * 1000 + (sent.duration_s * 1e9) as i64;
        Some(Line { time_ns, interface: BUS.name.to_owned(), content: Content::Data(sent.frame?) })
    };
    let lines: Vec<Line> = traffic.sent.iter().filter_map(line).collect();
    let listening = Listening::new(Addresses::STANDARD, None);
    Ok(Some(Received { receiving: Receiving::new(listening), lines: lines.into_iter().peekable() }))
}

impl Received {
    /// What the receiver shows at a time.
    fn until(&mut self, time_ns: i64) -> Option<Shown> {
        while let Some(line) = self.lines.next_if(|line| line.time_ns <= time_ns) {
            self.receiving.take(&Logged::Frame(line));
        }
        self.receiving.listening.pass(time_ns);
        self.receiving.maps(|_| format!("receiver, {}", BUS.name)).into_iter().next().map(|(shown, _)| shown)
    }
}
