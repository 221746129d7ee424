//! A roadside unit on hardware of its own: a radar's CAN bus in, another bus and a serial line out.
//!
//! This is the loop of such a board without its drivers. A `main` sets up clocks and pins, calls
//! [`Roadside::step`] a thousand times a second with a hardware timer's time, feeds the watchdog where
//! [`RoadsideStep::frame_done`] says so, and resets the controller where the flow says restart.
//!
//! # Model
//! ```text
//! serial line, broadcast bus -> requests -> slots of the configuration block
//! radar's bus -> scans -> unit -> map -+-> frames -> broadcast bus
//!                                      +-> messages -> serial line
//! ```
//! *Frame.* One is done when a scan, or 50 ms without one, became a map and what was due of it was handed
//! to the drivers. Only this feeds a watchdog: a loop that turns without a timer, or hangs in any of the
//! stages, is reset. A radar that stops is no reason for a reset; the map runs out and that is sent.
//!
//! *The radar.* Where the block says so an ARS408 is set to send clusters or objects, until it reads that back, and told that
//! it stands.
//!
//! *Late frames.* A frame that still lies in a mailbox when its map is too old is taken back.
//!
//! *Safe state.* Without a block that holds there is no unit, only a status on both lines that says so. The
//! buses are then only listened to until their bit rate is proven.
//!
//! *Bit rate of the serial line.* It is [`UnitConfig::SERVICE_BAUD`] at every start, and the configured one
//! [`UnitConfig::SERVICE_S`] later unless a request came until then.
//!
//! # Limits
//! 64 frames of each bus and 64 bytes of the serial line a step. Three mailboxes. While a block is written
//! the loop stands still, on parts with large sectors for seconds: the map ends and comes back. No more frames of the
//! broadcast bus are taken in that step.

mod faulty;
mod outbox;
mod reset;

use crate::fixed::time::Time;
use crate::inputs::Feed;
use crate::inputs::ars408::upkeep::Ars408Upkeep;
use crate::unit::can_bus::{BusKeeper, BusState, CanPort};
use crate::unit::can_service::{CanService, CanServiceConfig};
use crate::unit::identity::{Identity, VERSION};
use crate::unit::sender::start_stored;
use crate::unit::serial_service::{Asked, SerialLine, SerialService};
use crate::unit::settings::{Settings, SettingsSlots, StoredSettings, UnitConfig};
use crate::unit::timing::{CycleCounter, Timing};
use crate::unit::{Flow, InUnit, MapSender, Unit};
use crate::wire::broadcast::{BroadcastConfig, Medium};
use crate::wire::frame::CanFrame;
use crate::wire::message::{Addresses, Epoch};
use crate::wire::serial::{MOST_STUFFED, Unstuffer};
use crate::wire::status::{Reason, ResetCause, Status, UnitState};

pub use faulty::FaultySlots;
use outbox::Outbox;
pub use reset::ResetFlags;

/// Frames of a bus taken in a step.
const MOST_FRAMES: usize = 64;
/// Bytes of the serial line taken in a step.
const MOST_BYTES: usize = 64;
/// Messages sent on the serial line in a step.
const MOST_MESSAGES: usize = 64;
/// Time without a scan after which the map's age is looked at, microseconds.
const IDLE_US: u64 = 50_000;

/// The serial line, as a board offers it; no call waits. It begins at [`UnitConfig::SERVICE_BAUD`].
pub trait SerialPort: SerialLine {
    /// Takes bytes that came; how many.
    fn receive(&mut self, buffer: &mut [u8]) -> usize;
    /// Goes on at another bit rate; one the part cannot make leaves it where it is.
    fn set_baud(&mut self, baud: u32);
}

/// The drivers.
#[derive(Debug)]
pub struct RoadsidePorts<R, B, L, S> {
    /// The radar's bus.
    pub radar: R,
    /// The bus maps go out on.
    pub broadcast: B,
    /// The integrator's line, on which maps go out as well.
    pub serial: L,
    /// Where blocks are kept.
    pub slots: S,
}

/// What a start needs to know.
#[derive(Debug, Clone, Copy)]
pub struct RoadsideStart {
    /// Which program on which chip.
    pub identity: Identity,
    /// One that was not used lately.
    pub epoch: Epoch,
    /// The block to run with, or why there is none.
    pub stored: StoredSettings,
    /// Why the controller started.
    pub reset_cause: ResetCause,
    /// What frames are timed with, where the controller has it.
    pub cycles: Option<CycleCounter>,
}

/// The pieces of memory a unit works in.
#[derive(Debug)]
pub struct RoadsideMemory<'u, E: InUnit, S> {
    /// The estimator's tables.
    pub parameters: &'u mut Option<E::Parameters>,
    /// The estimator's state.
    pub state: &'u mut E,
    /// Its result.
    pub map: &'u mut E::Map,
    /// The sender on the broadcast bus.
    pub broadcast: &'u mut Option<S>,
    /// The sender on the serial line.
    pub serial: &'u mut Option<S>,
}

/// What a step led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RoadsideStep {
    /// Whether a frame was done: the only thing that feeds the watchdog.
    pub frame_done: bool,
    /// Whether the controller is to be reset.
    pub flow: Flow,
    /// What a status output shows.
    pub state: UnitState,
}

/// A unit and its second sender.
#[derive(Debug)]
struct Maps<'u, E: InUnit, S> {
    unit: Unit<'u, E, S>,
    serial: &'u mut S,
}

/// The loop's state: estimator, sender, and the decoder of the radar's frames.
#[derive(Debug)]
pub struct Roadside<'u, E: InUnit, S, F> {
    reset_cause: ResetCause,
    unstuffer: Unstuffer,
    service: SerialService,
    can_service: CanService,
    maps: Option<Maps<'u, E, S>>,
    radar: F,
    /// What the radar is sent.
    upkeep: Option<Ars408Upkeep>,
    timing: Option<Timing>,
    radar_bus: BusKeeper,
    broadcast_bus: BusKeeper,
    outbox: Outbox,
    /// The last scan or look at the map's age.
    looked: Time,
    /// When the last step began, if a scan was worked up in it.
    worked: Option<Time>,
    /// Frames of the radar lost between its bus and the loop.
    lost: u32,
    started: Time,
    /// Bit rate the serial line has yet to change to.
    baud: Option<u32>,
}

impl<'u, E: InUnit, S: MapSender<E::Map>, F: Feed<Piece = CanFrame, Input = E::Input>> Roadside<'u, E, S, F> {
    /// Starts, and puts both controllers on their buses.
    pub fn start<R: CanPort, B: CanPort, L: SerialPort, P: SettingsSlots>(
        start: RoadsideStart,
        memory: RoadsideMemory<'u, E, S>,
        radar: F,
        now: Time,
        ports: &mut RoadsidePorts<R, B, L, P>,
    ) -> Self {
        let RoadsideStart { identity, stored, .. } = start;
        let config = stored.unit();
        let service = SerialService::start((config.sensor, identity), start.epoch, now, stored, &mut ports.serial);
        let medium = Medium::Can(Addresses::STANDARD);
        let asked = CanServiceConfig { identity, ..CanServiceConfig::new(config.sensor, medium) };
        let can_service = CanService::start(asked, start.epoch, now, start.stored);
        let [radar_bus, broadcast_bus] = start.stored.buses();
        let settings = start.stored.settings();
        let maps = settings.and_then(|settings| maps(&start, settings, &ports.slots, memory, now));
        Self {
            reset_cause: start.reset_cause,
            unstuffer: Unstuffer::new(),
            service,
            can_service,
            maps,
            radar,
            upkeep: config.configure_radar.settings().map(|wanted| Ars408Upkeep::new(config.radar_id, wanted)),
            timing: start.cycles.map(Timing::new),
            radar_bus: BusKeeper::start(&radar_bus, &mut ports.radar),
            broadcast_bus: BusKeeper::start(&broadcast_bus, &mut ports.broadcast),
            outbox: Outbox::new(),
            looked: now,
            worked: None,
            lost: 0,
            started: now,
            baud: (config.serial_baud != UnitConfig::SERVICE_BAUD).then_some(config.serial_baud),
        }
    }

    /// Takes what came, and sends what is due.
    pub fn step<R: CanPort, B: CanPort, L: SerialPort, P: SettingsSlots>(
        &mut self,
        now: Time,
        ports: &mut RoadsidePorts<R, B, L, P>,
    ) -> RoadsideStep {
        let mut flow = self.serve(now, &mut ports.serial, &mut ports.slots);
        self.radar_bus.poll(now, &mut ports.radar);
        self.broadcast_bus.poll(now, &mut ports.broadcast);
        for _ in 0..MOST_FRAMES {
            let Some(frame) = self.broadcast_bus.receive(&mut ports.broadcast) else { break };
            if self.can_service.take(&frame, &mut ports.slots) == Some(Flow::Restart) {
                flow = Flow::Restart;
            }
            // the watchdog does not wait for more than one request to be written
            if self.can_service.has_written() {
                break;
            }
        }
        let frame_done = self.receive(now, &mut ports.radar);
        self.look_after(now, &mut ports.radar);
        self.transmit(now, ports);
        let state = match &mut self.maps {
            Some(maps) => {
                talk(now, maps, &mut ports.serial);
                maps.unit.broadcast().status_mut().state
            }
            None => {
                self.service.say_safe(now, self.safe_status(), &mut ports.serial);
                UnitState::Fault
            }
        };
        RoadsideStep { frame_done, flow, state }
    }

    /// Takes the integrator's requests on the serial line. The time is the controller's own here, nobody sets it.
    fn serve(&mut self, now: Time, line: &mut impl SerialPort, slots: &mut impl SettingsSlots) -> Flow {
        let over = now.since(self.started).is_some_and(|us| us >= u64::from(UnitConfig::SERVICE_S) * 1_000_000);
        if let Some(baud) = self.baud.take_if(|_| over) {
            line.set_baud(baud);
        }
        let mut buffer = [0; MOST_BYTES];
        let came = line.receive(&mut buffer);
        let mut rest = buffer.get(..came).unwrap_or(&[]);
        while !rest.is_empty() {
            let (taken, message) = self.unstuffer.push(rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            let Some(asked) = message.and_then(|m| self.service.take(m, slots, line)) else { continue };
            // somebody is at work at this bit rate
            self.baud = None;
            match (asked, &self.timing) {
                (Asked::Restart, _) => return Flow::Restart,
                (Asked::Timing, Some(timing)) => self.service.tell(timing.took(), line),
                _ => {}
            }
        }
        Flow::Continue
    }

    /// Takes the radar's frames; whether a scan, or a time without one, was worked up.
    fn receive(&mut self, now: Time, port: &mut impl CanPort) -> bool {
        if let (Some(began), Some(maps)) = (self.worked.take(), &mut self.maps) {
            maps.unit.took(now, now.since(began).unwrap_or(0));
        }
        let mut scanned = false;
        self.lost = self.lost.saturating_add(port.take_lost());
        for _ in 0..MOST_FRAMES {
            let Some(frame) = self.radar_bus.receive(port) else { break };
            if let Some(upkeep) = &mut self.upkeep {
                upkeep.take(&frame);
            }
            let Some(maps) = &mut self.maps else { continue };
            let before = maps.unit.frames();
            // it may have waited while the map before was made
            let came = port.arrived().filter(|came| *came <= now).unwrap_or(now);
            let timing = &mut self.timing;
            maps.unit.take_timed(&mut self.radar, &frame, came, &mut |event| {
                if let Some(timing) = timing {
                    timing.event(event);
                }
            });
            scanned = maps.unit.frames() != before;
            if scanned {
                // what was sent of the map before has to leave first
                break;
            }
        }
        // a clock that stepped back is looked at, too
        let due = now.since(self.looked).is_none_or(|us| us >= IDLE_US);
        if !scanned && !due {
            return false;
        }
        self.looked = now;
        self.worked = scanned.then_some(now);
        if let Some(maps) = &mut self.maps {
            if !scanned {
                maps.unit.wait(&mut self.radar, now);
            }
            self.complete_status(now);
        }
        true
    }

    /// Sends the radar its settings until it reads them back, and that it stands.
    fn look_after(&mut self, now: Time, port: &mut impl CanPort) {
        let Some(upkeep) = &mut self.upkeep else { return };
        // what has no room now is due again
        if self.radar_bus.state() != BusState::Active {
            return;
        }
        while let Some(frame) = upkeep.poll(now) {
            self.radar_bus.send(&frame, port);
        }
        if let (Some(maps), true) = (&mut self.maps, upkeep.disagrees(now)) {
            maps.unit.degrade(now, Reason::RadarConfiguration);
        }
    }

    /// Offers the map to the second sender and completes the status of both.
    fn complete_status(&mut self, now: Time) {
        let bus_off = self.bus_off();
        let off = [&self.radar_bus, &self.broadcast_bus].iter().any(|k| matches!(k.state(), BusState::Off(_)));
        let radar_lost = self.radar.lost().saturating_add(self.lost);
        let reset_cause = self.reset_cause;
        let Some(maps) = &mut self.maps else { return };
        if off {
            maps.unit.degrade(now, Reason::BusOff);
        }
        if maps.serial.take_overload() {
            maps.unit.degrade(now, Reason::BusOverload);
        }
        let status = maps.unit.broadcast().status_mut();
        status.reset_cause = reset_cause;
        status.firmware = VERSION;
        status.bus_off = bus_off;
        status.radar_lost = u16::try_from(radar_lost).unwrap_or(u16::MAX);
        status.frame_times = self.timing.as_ref().map_or_else(Default::default, Timing::frame_times);
        let first = *status;
        let second = maps.serial.status_mut();
        *second = Status { uptime_s: second.uptime_s, dropped: second.dropped, ..first };
        if let Some(measured) = maps.unit.offered() {
            // the same one again is refused
            maps.serial.offer(measured, maps.unit.map());
        }
    }

    /// Hands the driver what is due on the broadcast bus.
    fn transmit<R, B: CanPort, L, P: SettingsSlots>(&mut self, now: Time, ports: &mut RoadsidePorts<R, B, L, P>) {
        // nothing is taken from a unit that cannot be sent
        if self.broadcast_bus.state() != BusState::Active {
            return;
        }
        let port = &mut ports.broadcast;
        let late = self.outbox.take_back(now, port);
        if let Some(maps) = &mut self.maps {
            maps.unit.broadcast().count_dropped(late);
        }
        if !self.outbox.flush(&mut self.broadcast_bus, port) {
            return;
        }
        let safe = self.safe_status();
        let answer = self.can_service.next_frame(now, &ports.slots);
        let (frame, deadline) = match &mut self.maps {
            Some(maps) => {
                let sender = maps.unit.broadcast();
                (answer.or_else(|| sender.next_frame(now)), sender.deadline())
            }
            None => (answer.or_else(|| self.can_service.next_status(now, safe)), None),
        };
        if let Some(frame) = frame {
            self.outbox.send(frame, deadline, now, &mut self.broadcast_bus, port);
        }
    }

    /// The controller's part of the status in the safe state.
    fn safe_status(&self) -> Status {
        let reset_cause = self.reset_cause;
        Status { reset_cause, firmware: VERSION, bus_off: self.bus_off(), ..Status::starting(0) }
    }

    fn bus_off(&self) -> u16 {
        self.radar_bus.bus_off().saturating_add(self.broadcast_bus.bus_off())
    }
}

/// Makes the unit and its senders in the memory there is; none where a setting cannot be worked with. Apart,
/// so that what this takes of the stack is free again before the first scan.
#[inline(never)]
fn maps<'u, E: InUnit, S: MapSender<E::Map>>(
    start: &RoadsideStart,
    settings: &Settings,
    slots: &impl SettingsSlots,
    memory: RoadsideMemory<'u, E, S>,
    now: Time,
) -> Option<Maps<'u, E, S>> {
    let header = settings.build_at::<E>(&StoredSettings::place(slots).ok()?, memory.parameters).ok()?;
    let parameters = memory.parameters.as_ref()?;
    let start_one = |medium, sender: &mut Option<S>| {
        let (stale_ms, max_delay_ms) = (settings.unit.stale_ms(), settings.unit.max_delay_ms);
        let usual = BroadcastConfig::new(settings.unit.sensor, medium);
        let config = BroadcastConfig { stale_ms, max_delay_ms, ..usual };
        start_stored(sender, (config, header), settings, slots, start.epoch, now)
    };
    let lacking = start_one(Medium::Can(Addresses::STANDARD), memory.broadcast);
    start_one(Medium::Serial, memory.serial);
    let mut unit = Unit::new(parameters, memory.state, memory.map, memory.broadcast.as_mut()?);
    if let Some(reason) = lacking {
        unit.lacks(reason);
    }
    Some(Maps { unit, serial: memory.serial.as_mut()? })
}

/// Hands the driver what is due on the serial line.
fn talk<E: InUnit, S: MapSender<E::Map>>(now: Time, maps: &mut Maps<'_, E, S>, line: &mut impl SerialLine) {
    let mut stuffed = [0; MOST_STUFFED];
    for _ in 0..MOST_MESSAGES {
        let Some(message) = maps.serial.next_line(now, &mut stuffed).and_then(|n| stuffed.get(..n)) else { return };
        if !line.send(message) {
            maps.serial.count_dropped(1);
        }
    }
}
