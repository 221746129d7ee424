//! The loop of a board with hardware of its own, with drivers that are not hardware.

mod blocks;
mod own_figures;
mod requests;

use std::collections::VecDeque;

use viewshed::fixed::time::Time;
use viewshed::inputs::ars408::{Ars408, Ars408Config};
use viewshed::map::polar::PolarMap;
use viewshed::unit::Flow;
use viewshed::unit::can_bus::CanPort;
use viewshed::unit::can_service::{Answers, Tool};
use viewshed::unit::identity::{Identity, VERSION};
use viewshed::unit::reply::Said;
use viewshed::unit::roadside::{Roadside, RoadsideMemory, RoadsidePorts, RoadsideStart, RoadsideStep, SerialPort};
use viewshed::unit::serial_service;
use viewshed::unit::service::Request;
use viewshed::unit::settings::{BLOCK_LEN, Settings, SettingsCheck, SettingsSlots, StoredSettings};
use viewshed::unit::timing::CycleCounter;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Epoch, Message, Received};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer, stuff};
use viewshed::wire::status::{Reason, ResetCause, Status, UnitState};

use crate::common::{SmallSender, SmallState, gantry};

const SENSOR: u8 = 0;
const ADDRESSES: Addresses = Addresses::STANDARD;
/// What the controllers divide.
const CAN_CLOCK_HZ: u32 = 24_000_000;
/// Milliseconds between the radar's scans.
const SCAN_MS: u64 = 66;

/// A controller with three mailboxes, of which one a millisecond leaves.
#[derive(Default)]
struct Bus {
    incoming: VecDeque<CanFrame>,
    /// When they came, where that is known.
    came: VecDeque<Time>,
    arrived: Option<Time>,
    mailboxes: VecDeque<CanFrame>,
    /// Nobody acknowledges.
    stuck: bool,
    off: bool,
    silent: bool,
    lost: u32,
    aborted: usize,
    /// What is aborted takes its room until after the next frame was to be sent.
    slow: bool,
    aborting: bool,
}

impl CanPort for Bus {
    fn receive(&mut self) -> Option<CanFrame> {
        self.arrived = self.came.pop_front();
        self.incoming.pop_front()
    }
    fn arrived(&self) -> Option<Time> {
        self.arrived
    }
    fn send(&mut self, frame: &CanFrame) -> bool {
        assert!(!self.silent && !self.off, "a silent controller does not send");
        let room = self.mailboxes.len() < 3 && !std::mem::take(&mut self.aborting);
        if room {
            self.mailboxes.push_back(*frame);
        }
        room
    }
    fn abort(&mut self) {
        self.aborted += self.mailboxes.len();
        self.aborting = self.slow;
        self.mailboxes.clear();
    }
    fn bus_off(&mut self) -> bool {
        self.off
    }
    fn start(&mut self, silent: bool) {
        (self.silent, self.off) = (silent, false);
        self.mailboxes.clear();
    }
    fn waiting(&mut self) -> usize {
        self.mailboxes.len()
    }
    fn take_lost(&mut self) -> u32 {
        std::mem::take(&mut self.lost)
    }
}

#[derive(Default)]
struct Line {
    incoming: VecDeque<u8>,
    sent: Vec<u8>,
    /// Bit rates it was changed to.
    bauds: Vec<u32>,
}

impl SerialPort for Line {
    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        let came = self.incoming.len().min(buffer.len());
        buffer.iter_mut().zip(self.incoming.drain(..came)).for_each(|(to, from)| *to = from);
        came
    }

    fn set_baud(&mut self, baud: u32) {
        self.bauds.push(baud);
    }
}

impl serial_service::SerialLine for Line {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.sent.extend_from_slice(bytes);
        true
    }
}

/// Slots, and how often one was erased.
struct InRam([[u8; BLOCK_LEN]; 2], usize);

impl SettingsSlots for InRam {
    fn slot(&self, slot: usize) -> &[u8] {
        self.0.get(slot).map_or(&[], |slot| slot)
    }
    fn write(&mut self, slot: usize, block: &[u8]) {
        self.1 += 1;
        self.0[slot][..block.len()].copy_from_slice(block);
    }
}

type Far = Receiver<1, 40, 2>;
type Unit = Roadside<'static, SmallState, SmallSender, Ars408<64>>;

/// A board, the radar and the receivers at the far ends of its lines.
struct World {
    ports: RoadsidePorts<Bus, Bus, Line, InRam>,
    unit: Unit,
    /// Milliseconds since the start.
    ms: u64,
    radar: Option<u16>,
    bus: Far,
    line: Far,
    unstuffer: Unstuffer,
    answers: Answers,
    said: Vec<Said>,
    /// When a status came: bus, serial line.
    statuses: [Vec<u64>; 2],
    last: Option<RoadsideStep>,
    frames_done: usize,
    serial_bytes: usize,
    replies: Vec<Vec<u8>>,
    /// Milliseconds every scan takes to be worked up, and what is left of them.
    work_ms: u64,
    busy_ms: u64,
}

fn at(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

fn settings() -> Settings {
    Settings::of(gantry(6.0, 0.0))
}

impl World {
    fn new(blocks: [[u8; BLOCK_LEN]; 2]) -> Self {
        // a program's statics
        let memory = RoadsideMemory {
            parameters: Box::leak(Box::new(None)),
            state: Box::leak(Box::new(SmallState::new())),
            map: Box::leak(Box::new(PolarMap::NOWHERE)),
            broadcast: Box::leak(Box::new(None::<SmallSender>)),
            serial: Box::leak(Box::new(None)),
        };
        let mut ports = RoadsidePorts {
            radar: Bus::default(),
            broadcast: Bus::default(),
            serial: Line::default(),
            slots: InRam(blocks, 0),
        };
        let stored =
            StoredSettings::read(&ports.slots, SettingsCheck::of::<SmallState, SmallSender>().on_can(CAN_CLOCK_HZ));
        let identity = Identity { board: "a-board", chip: 7, is_bench: false, grid: [50, 40] };
        let cycles = Some(CycleCounter { count: own_figures::count, hz: 1000 });
        let start = RoadsideStart { identity, epoch: Epoch::new(3), stored, reset_cause: ResetCause::Watchdog, cycles };
        let unit = Unit::start(start, memory, Ars408::new(Ars408Config::sensor(SENSOR)), at(0), &mut ports);
        assert!(ports.radar.silent && ports.broadcast.silent, "until the bit rate is proven");
        let far = || Far::new([SENSOR], ADDRESSES, ReceiverLimits::DEFAULT);
        Self {
            ports,
            unit,
            ms: 0,
            radar: Some(0),
            bus: far(),
            line: far(),
            unstuffer: Unstuffer::new(),
            answers: Answers::new(SENSOR, Medium::Can(ADDRESSES)),
            said: Vec::new(),
            statuses: [Vec::new(), Vec::new()],
            last: None,
            frames_done: 0,
            serial_bytes: 0,
            replies: Vec::new(),
            work_ms: 0,
            busy_ms: 0,
        }
    }

    fn with_settings() -> Self {
        Self::new([settings().to_block(1), [0xFF; BLOCK_LEN]])
    }

    /// A millisecond.
    fn step(&mut self) -> RoadsideStep {
        self.step_hearing(&mut |_| {})
    }

    /// A millisecond, with what leaves on the bus.
    fn step_hearing(&mut self, heard: &mut dyn FnMut(&CanFrame)) -> RoadsideStep {
        let before = self.ms;
        self.ms += 1 + std::mem::take(&mut self.busy_ms);
        for ms in (before + 1..=self.ms).filter(|ms| ms.is_multiple_of(SCAN_MS)) {
            let Some(counter) = &mut self.radar else { break };
            self.busy_ms = self.work_ms;
            if self.ports.radar.incoming.len() > 30 {
                self.ports.radar.lost += 13;
                continue;
            }
            self.ports.radar.came.extend([at(ms); 13]);
            *counter = counter.wrapping_add(1);
            let [high, low] = counter.to_be_bytes();
            let frame = |id, bytes: &[u8]| CanFrame::classic(CanId::Standard(id), bytes).unwrap();
            // 12 clusters 51 m away
            self.ports.radar.incoming.push_back(frame(0x600, &[12, 0, high, low, 0x10]));
            for k in 0..12 {
                self.ports.radar.incoming.push_back(frame(0x701, &[k, 0x55, 0xF1, 0xCD, 0x6C, 0x20, 0x02, 0x94]));
            }
        }
        if self.ms <= 8 {
            // others on the broadcast bus
            self.ports.broadcast.incoming.push_back(CanFrame::classic(CanId::Standard(0x100), &[]).unwrap());
        }
        let now = at(self.ms);
        let step = self.unit.step(now, &mut self.ports);
        self.last = Some(step);
        self.frames_done += usize::from(step.frame_done);
        if !self.ports.broadcast.stuck
            && let Some(frame) = self.ports.broadcast.mailboxes.pop_front()
        {
            heard(&frame);
            self.said.extend(self.answers.take(&frame));
            let message = Received::from_frame(&frame, &ADDRESSES).unwrap().message;
            self.statuses[0].extend((message == Message::Status).then_some(self.ms));
            let _ = self.bus.frame(now, &frame);
        }
        let bytes = std::mem::take(&mut self.ports.serial.sent);
        self.serial_bytes += bytes.len();
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let (taken, message) = self.unstuffer.push(rest);
            rest = &rest[taken..];
            let Some(message) = message else { continue };
            let status = Received::from_bytes(message).is_ok_and(|m| m.message == Message::Status);
            self.statuses[1].extend(status.then_some(self.ms));
            let _ = self.line.message(now, message);
            // kinds of answers begin at 128; maps, headers and the status have message numbers below 32
            self.replies.extend(message.get(3).filter(|kind| **kind > 128).map(|_| message.to_vec()));
        }
        step
    }

    fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| assert_eq!(self.step().flow, Flow::Continue));
    }

    fn statuses_since(&self, from: u64) -> [Vec<u64>; 2] {
        self.statuses.each_ref().map(|all| all.iter().copied().filter(|ms| *ms > from).collect())
    }

    /// What the receivers got of the sender's status: bus, serial line.
    fn status(&self) -> [Status; 2] {
        [&self.bus, &self.line].map(|far| *far.sensor(SENSOR).unwrap().status().unwrap())
    }

    /// Cells said to be visible on each line.
    fn visible(&self) -> [usize; 2] {
        [&self.bus, &self.line].map(|far| {
            let map = far.map(SENSOR, at(self.ms));
            (0..40).map(|azimuth| (0..50).filter(|range| map.cell(azimuth, *range).visible()).count()).sum()
        })
    }

    fn ask(&mut self, request: Request<'_>) {
        let mut stuffed = [0; MOST_STUFFED];
        let length = stuff(request.message(SENSOR, 0).bytes(), &mut stuffed).unwrap();
        self.ports.serial.incoming.extend(&stuffed[..length]);
    }
}

#[test]
fn scans_in_are_the_same_map_out_on_both_lines() {
    let mut world = World::with_settings();
    world.run(3000);
    let [bus, line] = world.visible();
    assert!(bus > 1000 && bus == line, "{bus} {line}");
    for status in world.status() {
        assert_eq!((status.state, status.reason), (UnitState::Ok, Reason::None));
        assert_eq!((status.reset_cause, status.firmware), (ResetCause::Watchdog, VERSION));
        assert_eq!((status.radar_lost, status.bus_off, status.dropped), (0, 0, 0));
        assert!((2..=3).contains(&status.uptime_s));
    }
    assert_eq!(world.last.unwrap().state, UnitState::Ok);
    println!("serial line: {} bytes a second", world.serial_bytes / 3);
    assert!(world.serial_bytes / 3 < 9000, "within 115 200 baud: {}", world.serial_bytes / 3);
}

#[test]
fn only_a_frame_feeds_the_watchdog() {
    let mut world = World::with_settings();
    world.run(660);
    // ten scans, and the times without one between them
    assert!((10..=20).contains(&world.frames_done), "{}", world.frames_done);
    let mut world = World::with_settings();
    world.radar = None;
    world.run(1000);
    assert_eq!(world.frames_done, 20, "a radar that is gone is no reason for a reset");
    // a loop that turns while its timer stands still
    let fed = (0..1000).filter(|_| world.unit.step(at(1000), &mut world.ports).frame_done).count();
    assert_eq!(fed, 0);
}

#[test]
fn a_radar_that_stops_ends_the_map_and_the_status_goes_on() {
    let mut world = World::with_settings();
    world.run(2000);
    assert!(world.visible().iter().all(|cells| *cells > 1000));
    world.radar = None;
    world.run(1000);
    assert_eq!(world.visible(), [0, 0]);
    for status in world.status() {
        assert_eq!((status.state, status.reason), (UnitState::Blind, Reason::RadarSilent));
    }
    world.run(2000);
    for times in world.statuses_since(3000) {
        assert!(times.len() >= 4 && times.windows(2).all(|w| w[1] - w[0] <= 500), "{times:?}");
    }
    world.radar = Some(500);
    world.run(3000);
    assert!(world.visible().iter().all(|cells| *cells > 1000), "and it comes back");
}

#[test]
fn frames_lost_before_the_loop_are_told() {
    let mut world = World::with_settings();
    world.run(1000);
    world.ports.radar.lost = 5;
    world.run(2000);
    assert_eq!(world.status().map(|s| s.radar_lost), [5, 5]);
    // and without scans as well
    world.radar = None;
    world.run(1000);
    assert_eq!(world.status().map(|s| s.radar_lost), [5, 5]);
}

#[test]
fn a_bus_off_is_told_on_the_other_line_and_ends() {
    let mut world = World::with_settings();
    world.run(2000);
    world.ports.broadcast.off = true;
    world.run(80);
    let far = world.line.sensor(SENSOR).unwrap().status().copied();
    world.run(300);
    let status = world.status()[1];
    assert_eq!((status.bus_off, far.unwrap().bus_off), (1, 0), "the status of the moment it is sent");
    assert!(world.ports.broadcast.silent, "back after 100 ms, listening first");
    world.ports.broadcast.incoming.extend([CanFrame::classic(CanId::Standard(0x100), &[]).unwrap(); 8]);
    world.run(2000);
    assert_eq!(world.status().map(|s| (s.state, s.bus_off)), [(UnitState::Ok, 1); 2]);
    assert!(world.visible()[0] > 1000);
    // twice more: now it stays away for 400 ms
    for _ in 0..2 {
        world.ports.broadcast.off = true;
        world.run(210);
    }
    world.run(150);
    let status = world.status()[1];
    assert_eq!((status.state, status.reason, status.bus_off), (UnitState::Degraded, Reason::BusOff, 3));
}

#[test]
fn what_nobody_acknowledges_is_taken_back_and_never_sent_late() {
    let mut world = World::with_settings();
    world.run(1500);
    world.ports.broadcast.stuck = true;
    world.run(400);
    assert!(world.ports.broadcast.aborted >= 3, "{}", world.ports.broadcast.aborted);
    let status = world.status()[1];
    assert_eq!((status.state, status.reason), (UnitState::Degraded, Reason::BusOverload), "reported on the other line");
    assert!(world.visible()[1] > 1000, "which is not held up");
    world.ports.broadcast.stuck = false;
    world.run(1000);
    assert!(world.visible()[0] > 1000);
    assert!(world.status()[0].dropped > 0);
}

#[test]
fn what_is_taken_back_is_counted_also_where_its_room_is_not_free_at_once() {
    let dropped = |from, slow| {
        let mut world = World::with_settings();
        world.run(1500 + from);
        (world.ports.broadcast.stuck, world.ports.broadcast.slow) = (true, slow);
        let until = world.ms + 500;
        while world.ports.broadcast.aborted == 0 && world.ms < until {
            world.step();
        }
        assert!(world.ports.broadcast.aborted > 0);
        world.ports.broadcast.stuck = false;
        world.run(700);
        world.status()[0].dropped
    };
    let mut most = 0;
    for from in (0..SCAN_MS).step_by(7) {
        let (fast, slow) = (dropped(from, false), dropped(from, true));
        assert!(slow >= fast && fast >= 1, "{slow} after {fast}, from {from} ms on");
        most = most.max(fast);
    }
    assert!(most >= 3, "{most}: a whole controller full");
}

#[test]
fn without_settings_both_lines_say_so_and_take_a_block() {
    let mut broken = settings().to_block(4);
    broken[40] ^= 1;
    for over_can in [false, true] {
        let mut world = World::new([broken, [0xFF; BLOCK_LEN]]);
        world.run(2000);
        assert_eq!(world.last.unwrap().state, UnitState::Fault);
        for times in world.statuses_since(0) {
            assert!(times.len() >= 4 && times.windows(2).all(|w| w[1] - w[0] <= 500), "{times:?}");
        }
        assert_eq!(world.status().map(|s| (s.state, s.reason)), [(UnitState::Fault, Reason::Configuration); 2]);
        assert_eq!(world.visible(), [0, 0]);
        assert_eq!(world.frames_done, 40, "the safe state is no reason for a reset");
        // said once the bus was proven, not into the void before
        assert!(world.said.contains(&Said::Started(None)), "{:?}", world.said);
        assert!(world.said.iter().any(|said| matches!(said, Said::Refused(r) if r.reason == 4)), "{:?}", world.said);

        let block = settings().to_block(0);
        let mut tool = Tool::new(SENSOR, Medium::Can(ADDRESSES));
        if over_can {
            world.ports.broadcast.incoming.extend(tool.write(&block));
        } else {
            world.ask(Request::Write(&block));
        }
        world.run(200);
        assert_eq!(over_can, world.said.contains(&Said::Written(1)), "{:?}", world.said);
        let newest = Settings::newest([world.ports.slots.slot(0), world.ports.slots.slot(1)], |_| Ok(()));
        assert_eq!(newest.map(|n| n.settings), Ok(settings()));
        if over_can {
            world.ports.broadcast.incoming.extend(tool.restart());
        } else {
            world.ask(Request::Restart);
        }
        assert!((0..10).any(|_| world.step().flow == Flow::Restart));
        // the controller is reset
        let mut world = World::new(world.ports.slots.0);
        world.run(2000);
        assert!(world.visible().iter().all(|cells| *cells > 1000));
    }
}

#[test]
fn work_that_takes_longer_than_the_time_between_scans_is_told() {
    for (work_ms, reported) in [(60, false), (70, true)] {
        let mut world = World::with_settings();
        world.run(1000);
        world.work_ms = work_ms;
        world.run(300);
        let overrun = world.status().iter().all(|s| (s.state, s.reason) == (UnitState::Degraded, Reason::Overrun));
        assert_eq!(overrun, reported, "{work_ms} ms: {:?}", world.status());
        world.work_ms = 0;
        world.run(2500);
        assert_eq!(world.last.unwrap().state, UnitState::Ok);
    }
}

#[test]
fn a_bus_too_narrow_is_told_on_both_lines_and_ends() {
    let mut world = World::with_settings();
    world.run(1500);
    world.ports.broadcast.stuck = true;
    world.run(400);
    world.ports.broadcast.stuck = false;
    world.run(500);
    let overloaded = (UnitState::Degraded, Reason::BusOverload);
    assert!(world.status().iter().all(|s| (s.state, s.reason) == overloaded), "{:?}", world.status());
    world.run(2000);
    assert!(
        world.status().iter().all(|s| (s.state, s.reason) == (UnitState::Ok, Reason::None)),
        "{:?}",
        world.status()
    );
}
