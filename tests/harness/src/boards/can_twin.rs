//! The live program of the boards on a CAN bus, run here: the same frames in, the frames it has to send.

use std::iter::Peekable;
use std::mem;

use viewshed::bench::can::{CanBench, TIME_ID};
use viewshed::bench::flash::Flash;
use viewshed::bench::start_stored;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::ars408::Ars408Config;
use viewshed::unit::can_bus::{BusKeeper, CanPort};
use viewshed::unit::can_service::{CanService, CanServiceConfig};
use viewshed::unit::identity::Identity;
use viewshed::unit::profile::reference::State as Radar3d;
use viewshed::unit::profile::reference::supervised::{Ars408, CHECK, Map as PolarMap, Parameters, Sender, State};
use viewshed::unit::settings::{Settings, StoredSettings};
use viewshed::unit::{Flow, Unit};
use viewshed::wire::frame::{CanFrame, CanId};

use super::Profile;
use super::listener::{MEDIUM, Map, SENSOR};
use super::scans::Scan;
use crate::recording::can_log::Line;

/// What the emulated board calls its chip.
const CHIP: u32 = 0x5A43_5531;

/// Time of a script's first step.
const FIRST_US: u64 = 1_000_000;

/// What comes over the bus at a time.
#[derive(Debug, Clone)]
pub struct Step {
    pub time: Time,
    pub frames: Vec<CanFrame>,
}

impl Step {
    /// The frame of the time, and the others.
    pub fn all(&self) -> impl Iterator<Item = CanFrame> {
        let time = CanFrame::classic(TIME_ID, &self.time.micros().to_be_bytes());
        time.into_iter().chain(self.frames.iter().copied())
    }
}

/// What a unit sends at a step.
#[derive(Debug, Clone)]
pub struct Sent {
    pub time: Time,
    pub frames: Vec<CanFrame>,
    /// The maps among them; a scan that was not complete is over when the next one begins.
    pub maps: Vec<Map>,
    /// The unit's controller starts over meanwhile; what comes too early is lost.
    pub starts_over: bool,
}

/// A controller whose bus is a script.
struct Scripted<I: Iterator<Item = (usize, CanFrame)>> {
    frames: Peekable<I>,
    /// Step of the frame that was received last.
    step: usize,
    /// Nothing comes this time.
    quiet: bool,
    sent: Vec<CanFrame>,
    starts: u32,
}

impl<I: Iterator<Item = (usize, CanFrame)>> CanPort for Scripted<I> {
    fn receive(&mut self) -> Option<CanFrame> {
        if mem::take(&mut self.quiet) {
            return None;
        }
        let (step, frame) = self.frames.next()?;
        self.step = step;
        Some(frame)
    }

    fn send(&mut self, frame: &CanFrame) -> bool {
        self.sent.push(*frame);
        true
    }

    fn abort(&mut self) {}

    fn bus_off(&mut self) -> bool {
        false
    }

    fn start(&mut self, _: bool) {
        self.starts += 1;
    }
}

/// What a board with the reference grid sends, from the moment it has power.
pub fn answer(flash: &mut Flash, steps: &[Step]) -> Vec<Sent> {
    let identity = Identity { board: "zcu102-r5", chip: CHIP, is_bench: true, grid: Profile::Reference.grid() };
    let mut state = Box::new(State::new(Radar3d::new()));
    let mut map = Box::new(PolarMap::NOWHERE);
    let mut sender: Box<Option<Sender>> = Box::new(None);
    let mut session = CanBench::new(Ars408::new(Ars408Config::sensor(SENSOR)));
    let frames = steps.iter().enumerate().flat_map(|(k, step)| step.all().map(move |frame| (k, frame))).peekable();
    let mut port = Scripted { frames, step: 0, quiet: false, sent: Vec::new(), starts: 0 };
    let empty = |step: &Step| Sent { time: step.time, frames: Vec::new(), maps: Vec::new(), starts_over: false };
    let mut sent: Vec<Sent> = steps.iter().map(empty).collect();
    let mut ticked = false;
    'start: loop {
        let epoch = flash.start();
        let stored = StoredSettings::read(flash, CHECK);
        let [bus, _] = stored.buses();
        let mut keeper = BusKeeper::start(&bus, &mut port);
        while !ticked && port.frames.peek().is_some() {
            ticked = session.clock(&mut keeper, &mut port);
        }
        let config = CanServiceConfig { gap_us: 0, identity, ..CanServiceConfig::new(stored.unit().sensor, MEDIUM) };
        let mut service = CanService::start(config, epoch, session.now(), stored);
        let mut parameters: Option<Parameters> = None;
        let _ =
            start_stored::<State, _>(&mut parameters, &mut sender, (&stored, &*flash), MEDIUM, epoch, session.now());
        let sender = (*sender).as_mut();
        let mut unit = parameters.as_ref().zip(sender).map(|(p, sender)| Unit::new(p, &mut *state, &mut *map, sender));
        let mut last = None;
        // what is due at once goes out before the next frame comes
        port.quiet = true;
        while port.quiet || port.frames.peek().is_some() {
            let flow = session.turn((&mut keeper, &mut port), &mut service, &mut unit, flash);
            let Some(now) = sent.get_mut(port.step) else { continue };
            now.frames.append(&mut port.sent);
            now.starts_over |= mem::take(&mut port.starts) > 0;
            if flow == Flow::Restart {
                continue 'start;
            }
            if let Some(unit) = &mut unit {
                let deadline = unit.broadcast().deadline();
                if deadline != last {
                    last = deadline;
                    now.maps.extend(Map::offered(unit, epoch));
                }
            }
        }
        return sent;
    }
}

/// Flash that holds these settings already.
pub fn flashed(settings: &Settings) -> Flash {
    let mut flash = Flash::ERASED;
    if let Some(slot) = flash.slot_mut(0).first_chunk_mut() {
        *slot = settings.to_block(1);
    }
    flash
}

/// A recording's scans as an ARS408 in cluster mode sends them, 15 a second, the recording over and over; of
/// each scan the first so many clusters, at most 240.
pub fn clusters(scans: &[Scan], count: usize, most: usize) -> Vec<Step> {
    let step = |k: usize| {
        let scan = &scans[k % scans.len()].detections;
        let time = Time::from_micros(FIRST_US + k as u64 * 66_667);
        Step { time, frames: cluster_frames(k as u16, &scan[..scan.len().min(most.min(240))]) }
    };
    (0..count).map(step).collect()
}

/// A log's frames as they came, a step for each scan and at least every 50 ms.
pub fn log(lines: &[Line]) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    let mut first = None;
    for line in lines {
        let Some(frame) = line.frame().filter(|f| matches!(f.id, CanId::Standard(_)) && !f.fd) else { continue };
        let since = u64::try_from(line.time_ns - *first.get_or_insert(line.time_ns)).unwrap_or(0) / 1000;
        let time = Time::from_micros(FIRST_US + since);
        let scan = matches!(frame.id, CanId::Standard(id) if id & 0x70F == 0x600 || id & 0x70F == 0x60A);
        match steps.last_mut() {
            Some(step) if !scan && time.since(step.time).is_none_or(|us| us < 50_000) => step.frames.push(*frame),
            _ => steps.push(Step { time, frames: vec![*frame] }),
        }
    }
    steps
}

/// A scan as an ARS408 in cluster mode sends it.
fn cluster_frames(counter: u16, detections: &[Detection]) -> Vec<CanFrame> {
    let far = detections.len().saturating_sub(125) as u8;
    let near = detections.len() as u8 - far;
    let [high, low] = counter.to_be_bytes();
    let frame = |id, bytes: &[u8]| CanFrame::classic(CanId::Standard(id), bytes);
    let mut frames: Vec<_> = frame(0x600, &[near, far, high, low, 0x10]).into_iter().collect();
    for (k, d) in detections.iter().enumerate() {
        let (range, azimuth) = (f64::from(d.range_cm) / 100.0, f64::from(d.azimuth.radians()));
        let raw = |v: f64, step: f64, offset: f64| ((v - offset) / step).round() as u64;
        let speed = f64::from(d.radial_velocity_cm_s) / 100.0;
        let fields = [
            (k as u64, 8),
            (raw(range * azimuth.cos(), 0.2, -500.0), 13),
            (0, 1),
            (raw((range * azimuth.sin()).clamp(-102.0, 102.0), 0.2, -102.3), 10),
            (raw(speed * azimuth.cos(), 0.25, -128.0), 10),
            (raw(speed * azimuth.sin(), 0.25, -64.0), 9),
            (0, 2),
            (0, 3),
            (raw(10.0, 0.5, -64.0), 8),
        ];
        let word = fields.iter().fold(0_u64, |w, (v, bits)| w << bits | v);
        frames.extend(frame(0x701, &word.to_be_bytes()));
    }
    frames
}
