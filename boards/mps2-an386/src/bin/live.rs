//! Radar scans in over UART0, protected maps out over UART1, what each frame cost over UART2.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use mps2_an386::profile::{Map, Parameters, Sender, State};
use mps2_an386::timer::Timer;
use mps2_an386::uart::Uart;
use static_cell::ConstStaticCell;
use viewshed::pil::record::{FrameRecord, Record};
use viewshed::session::{Flow, Line, Session, Slots};
use viewshed::settings::BLOCK_LEN;
use viewshed::unit::{Unit, bench_sender};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::Epoch;

const SENSOR: u8 = 0;
const MOST_DETECTIONS: usize = if cfg!(feature = "small") { 176 } else { 256 };

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new());
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static SENDER: ConstStaticCell<Option<Sender>> = ConstStaticCell::new(None);

/// In place of flash, which the emulated board has not.
struct InRam([[u8; BLOCK_LEN]; 2]);

impl Slots for InRam {
    fn slot(&self, slot: usize) -> &[u8] {
        self.0.get(slot).map_or(&[], |s| s)
    }

    fn write(&mut self, slot: usize, block: &[u8; BLOCK_LEN]) {
        if let Some(place) = self.0.get_mut(slot) {
            *place = *block;
        }
    }
}

struct Lines {
    maps: Uart,
    traces: Uart,
    timer: Timer,
}

impl Line for Lines {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.maps.write(bytes)
    }

    fn ticks(&mut self) -> u32 {
        self.timer.ticks()
    }

    fn trace(&mut self, record: &FrameRecord) {
        self.traces.write(&Record::Frame(*record).to_bytes());
    }
}

#[entry]
fn main() -> ! {
    let radar = Uart::start(0);
    let mut lines = Lines { maps: Uart::start(1), traces: Uart::start(2), timer: Timer::start() };
    let mut slots = InRam([[0xFF; BLOCK_LEN]; 2]);
    let (Some(state), Some(map), Some(sender)) = (STATE.try_take(), MAP.try_take(), SENDER.try_take()) else {
        semihosting::process::exit(4)
    };

    let mut epoch = Epoch::new(0);
    loop {
        epoch = epoch.next();
        let mut session = Session::<MOST_DETECTIONS>::start(SENSOR, &slots, &mut lines);
        let settings = session.settings();
        let parameters = settings.and_then(|s| Parameters::new(&s.sensor, &s.radar_3d()).ok());
        let medium = Medium::Serial;
        *sender = settings.zip(parameters.as_ref()).and_then(|(s, p)| bench_sender(s, p, medium, epoch, session.now()));
        let mut unit = parameters.as_ref().zip(sender.as_mut()).map(|(p, sender)| Unit::new(p, state, map, sender));

        loop {
            let Some(byte) = radar.read() else { continue };
            if session.take(&[byte], &mut unit, &mut slots, &mut lines) == Flow::Restart {
                break;
            }
        }
    }
}
