//! Radar scans in over UART0, protected maps out over UART1, what each frame cost over UART2.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use mps2_an386::profile::{DETECTIONS, Map, Parameters, Sender, State};
use mps2_an386::timer::Timer;
use mps2_an386::uart::Uart;
use static_cell::ConstStaticCell;
use viewshed::pil::flash::Flash;
use viewshed::pil::record::{FrameRecord, Record};
use viewshed::session::{Flow, Line, Session};
use viewshed::unit::{Unit, bench_sender};
use viewshed::wire::broadcast::Medium;

const SENSOR: u8 = 0;

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new());
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static SENDER: ConstStaticCell<Option<Sender>> = ConstStaticCell::new(None);

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
    // the emulated board has none
    let mut flash = Flash::ERASED;
    let (Some(state), Some(map), Some(sender)) = (STATE.try_take(), MAP.try_take(), SENDER.try_take()) else {
        semihosting::process::exit(4)
    };

    loop {
        let epoch = flash.start();
        let mut session = Session::<DETECTIONS>::start(SENSOR, &flash, &mut lines);
        let settings = session.settings();
        let parameters = settings.and_then(|s| Parameters::new(&s.sensor, &s.radar_3d()).ok());
        let medium = Medium::Serial;
        *sender = settings.zip(parameters.as_ref()).and_then(|(s, p)| bench_sender(s, p, medium, epoch, session.now()));
        let mut unit = parameters.as_ref().zip(sender.as_mut()).map(|(p, sender)| Unit::new(p, state, map, sender));

        loop {
            let Some(byte) = radar.read() else { continue };
            if session.take(&[byte], &mut unit, &mut flash, &mut lines) == Flow::Restart {
                break;
            }
        }
    }
}
