//! Radar scans in over UART0, protected maps out over UART1, what each frame cost over UART2.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use mps2_an386::SHAPE;
use mps2_an386::profile::QuantisedSender as Sender;
use mps2_an386::profile::State as Radar3d;
use mps2_an386::profile::supervised::{Map, Parameters, State};
use mps2_an386::stack;
use mps2_an386::timer::{TICKS_PER_256, Timer};
use mps2_an386::uart::{PATIENCE, Uart};
use static_cell::{ConstStaticCell, StaticCell};
use viewshed::bench::flash::Flash;
use viewshed::bench::record::{Closing, Opening, Record, Tracer};
use viewshed::bench::start_stored;
use viewshed::unit::identity::Identity;
use viewshed::unit::serial_service::SerialLine;
use viewshed::unit::session::SerialSession;
use viewshed::unit::settings::{SettingsCheck, StoredSettings};
use viewshed::unit::transmitter::Transmitter;
use viewshed::unit::{Flow, Unit};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::Epoch;

/// The emulator has no number of its own: letters of the board's name.
const CHIP: u32 = 0x4D50_5332;

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new(Radar3d::new()));
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static SENDER: StaticCell<Option<Sender>> = StaticCell::new();
// the emulated board has none: memory of the test bench takes its place
#[unsafe(link_section = ".bench")]
static FLASH: StaticCell<Flash> = StaticCell::new();

struct Lines {
    maps: (Transmitter, Uart),
    traces: (Transmitter, Uart),
    timer: Timer,
}

impl Lines {
    fn record(&mut self, record: &Record) {
        let (transmitter, uart) = &mut self.traces;
        transmitter.send(uart, &record.to_bytes());
    }
}

impl SerialLine for Lines {
    fn send(&mut self, bytes: &[u8]) -> bool {
        let (transmitter, uart) = &mut self.maps;
        transmitter.send(uart, bytes)
    }
}

/// Apart, so that what this takes of the stack is free again.
#[inline(never)]
fn stored(flash: &Flash) -> StoredSettings {
    StoredSettings::read(flash, SettingsCheck::of::<State, Sender>())
}

/// As above.
#[inline(never)]
fn session(epoch: Epoch, stored: StoredSettings, lines: &mut Lines) -> SerialSession<{ Radar3d::DETECTIONS }> {
    let grid = [Radar3d::RANGES as u8, Radar3d::AZIMUTHS as u8];
    let identity = Identity { board: "mps2-an386", chip: CHIP, is_bench: true, grid };
    SerialSession::start(stored.unit().sensor, identity, epoch, stored, lines)
}

#[entry]
fn main() -> ! {
    let radar = Uart::start(0);
    let out = |number| (Transmitter::new(PATIENCE), Uart::start(number));
    let mut lines = Lines { maps: out(1), traces: out(2), timer: Timer::start() };
    let mut starts = 0;
    let (Some(state), Some(map), Some(sender)) = (STATE.try_take(), MAP.try_take(), SENDER.try_init(None)) else {
        semihosting::process::exit(4)
    };
    let Some(flash) = FLASH.try_init(Flash::ERASED) else { semihosting::process::exit(4) };

    loop {
        let epoch = flash.start();
        starts += 1;
        lines.record(&Record::Opening(Opening::of::<State>(SHAPE, TICKS_PER_256)));
        let mut tracer = Tracer::default();
        let stored = stored(flash);
        let mut session = session(epoch, stored, &mut lines);
        let mut parameters: Option<Parameters> = None;
        let now = session.now();
        let lacking = start_stored::<State, _>(&mut parameters, sender, (&stored, &*flash), Medium::Serial, epoch, now);
        let mut unit = parameters.as_ref().zip(sender.as_mut()).map(|(p, sender)| Unit::new(p, state, map, sender));
        if let Some((unit, reason)) = unit.as_mut().zip(lacking) {
            unit.lacks(reason);
        }

        loop {
            let Some(byte) = radar.read() else { continue };
            let mut trace = |event, lines: &mut Lines| {
                if let Some(frame) = tracer.event(event, lines.timer.ticks()) {
                    lines.record(&Record::Frame(frame));
                }
            };
            if session.take(&[byte], &mut unit, flash, &mut lines, &mut trace) == Flow::Restart {
                break;
            }
        }
        lines.record(&Record::Closing(Closing { reason: 0, frames: starts, stack: stack::used() }));
    }
}
