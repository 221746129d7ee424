//! An ARS408's frames and the integrator's in over CAN, the frames of the map out on the same bus.
#![no_std]
#![no_main]

use emulated::semihost::HostFile;
use semihosting::process::exit;
use static_cell::{ConstStaticCell, StaticCell};
use viewshed::bench::can::CanBench;
use viewshed::bench::files::{FlashFile, answer};
use viewshed::bench::record::{Closing, Record};
use viewshed::bench::start_stored;
use viewshed::inputs::ars408::Ars408Config;
use viewshed::unit::can_bus::BusKeeper;
use viewshed::unit::can_service::{CanService, CanServiceConfig};
use viewshed::unit::identity::Identity;
use viewshed::unit::settings::StoredSettings;
use viewshed::unit::{Flow, Unit};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::Addresses;
use zcu102_r5::can::Can;
use zcu102_r5::profile::State as Radar3d;
use zcu102_r5::profile::supervised::{Ars408, CHECK, Map, Parameters, Sender, State};
use zcu102_r5::stack;

/// The radar's own number on this bench, whatever the block says.
const RADAR: u8 = 0;
/// The emulator has no number of its own: letters of the board's name.
const CHIP: u32 = 0x5A43_5531;
/// Identifiers of this installation: sensor 0's begin at 0x400.
const MEDIUM: Medium = Medium::Can(Addresses::STANDARD);
/// Clock of the CAN controllers, by the boot loader's default.
const CAN_CLOCK_HZ: u32 = 100_000_000;

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new(Radar3d::new()));
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static SENDER: StaticCell<Option<Sender>> = StaticCell::new();

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let (Some(state), Some(map), Some(sender)) = (STATE.try_take(), MAP.try_take(), SENDER.try_init(None)) else {
        exit(4)
    };
    let mut flash = FlashFile::<HostFile>::open();
    let grid = [Radar3d::RANGES as u8, Radar3d::AZIMUTHS as u8];
    let identity = Identity { board: "zcu102-r5", chip: CHIP, is_bench: true, grid };
    let mut session = CanBench::new(Ars408::new(Ars408Config::sensor(RADAR)));
    let (mut starts, mut has_time) = (0, false);

    loop {
        let epoch = flash.start();
        starts += 1;
        let stored = StoredSettings::read(&flash, CHECK.on_can(CAN_CLOCK_HZ));
        let [bus, _] = stored.buses();
        let Some(timing) = bus.timing(CAN_CLOCK_HZ) else { exit(1) };
        let mut can = Can::new(timing);
        let mut keeper = BusKeeper::start(&bus, &mut can);
        while !has_time {
            has_time = session.clock(&mut keeper, &mut can);
        }
        // answers without a gap: time comes in steps here
        let sensor = stored.unit().sensor;
        let config = CanServiceConfig { gap_us: 0, identity, ..CanServiceConfig::new(sensor, MEDIUM) };
        let mut service = CanService::start(config, epoch, session.now(), stored);
        let mut parameters: Option<Parameters> = None;
        let _ = start_stored::<State, _>(&mut parameters, sender, (&stored, &flash), MEDIUM, epoch, session.now());
        let mut unit = parameters.as_ref().zip(sender.as_mut()).map(|(p, sender)| Unit::new(p, state, map, sender));

        while session.turn((&mut keeper, &mut can), &mut service, &mut unit, &mut flash) == Flow::Continue {}
        answer::<HostFile>(&Record::Closing(Closing { reason: 0, frames: starts, stack: stack::used() }));
    }
}
