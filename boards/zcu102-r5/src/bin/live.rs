//! An ARS408's frames in over CAN, the frames of the map out on the same bus; settings from `job.bin`.
#![no_std]
#![no_main]

use semihosting::process::exit;
use static_cell::{ConstStaticCell, StaticCell};
use viewshed::can_bus::BusKeeper;
use viewshed::can_session::CanSession;
use viewshed::inputs::ars408::Config;
use viewshed::pil::job::Job;
use viewshed::time::Time;
use viewshed::unit::{Unit, bench_sender};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::{Addresses, Epoch};
use zcu102_r5::can::Can;
use zcu102_r5::profile::{Map, Parameters, Sender, State};
use zcu102_r5::semihost::Files;

/// Clock of the CAN controllers, by the boot loader's default.
const CAN_CLOCK_HZ: u32 = 100_000_000;

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new());
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static SENDER: StaticCell<Sender> = StaticCell::new();

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let Some(mut files) = Files::open() else { exit(2) };
    let Ok(job) = Job::read(&mut files) else { exit(1) };
    let Ok(parameters) = Parameters::new(&job.settings.sensor, &job.settings.radar_3d()) else { exit(1) };
    let Some(timing) = job.settings.radar_bus.timing(CAN_CLOCK_HZ) else { exit(1) };
    let (Some(state), Some(map)) = (STATE.try_take(), MAP.try_take()) else { exit(4) };
    let medium = Medium::Can(Addresses::STANDARD);
    let sender = bench_sender(&job.settings, &parameters, medium, Epoch::new(1), Time::from_micros(0));
    let Some(sender) = sender.and_then(|s| SENDER.try_init(s)) else { exit(1) };

    let mut unit = Unit::new(&parameters, state, map, sender);
    let mut session = CanSession::<256>::new(Config::sensor(0));
    let mut can = Can::new(timing);
    let mut keeper = BusKeeper::start(&job.settings.radar_bus, &mut can);
    loop {
        keeper.poll(session.now(), &mut can);
        let Some(frame) = keeper.receive(&mut can) else { continue };
        session.bench_frame(&frame, &mut unit);
        while let Some(frame) = unit.next_frame(session.now()) {
            if !keeper.send(&frame, &mut can) {
                break;
            }
        }
    }
}
