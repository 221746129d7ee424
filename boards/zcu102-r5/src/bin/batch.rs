//! Batch mode: the estimator over every scan of a job file, a fingerprint of each map and its messages.
#![no_std]
#![no_main]

use semihosting::process::exit;
use static_cell::{ConstStaticCell, StaticCell};
use viewshed::pil::files::Files;
use viewshed::pil::job::{Job, ScanBuffer};
use viewshed::pil::{Memory, run};
use viewshed::time::Time;
use viewshed::unit::{Unit, bench_sender};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::Epoch;
use zcu102_r5::Core;
use zcu102_r5::profile::{Map, Parameters, Sender, State};
use zcu102_r5::semihost::HostFile;

/// Detections of a recorded scan, before the gate.
const MOST_DETECTIONS: usize = 16_384;

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new());
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static SENDER: StaticCell<Sender> = StaticCell::new();
#[unsafe(link_section = ".bench")]
static SCAN: ConstStaticCell<ScanBuffer<MOST_DETECTIONS>> = ConstStaticCell::new(ScanBuffer::new());

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let Some(mut files) = Files::<HostFile, _>::open(Core) else { exit(2) };
    let Ok(job) = Job::read(&mut files) else { exit(1) };
    let Ok(parameters) = Parameters::new(&job.settings.sensor, &job.settings.radar_3d()) else { exit(1) };
    let (Some(state), Some(map), Some(scan)) = (STATE.try_take(), MAP.try_take(), SCAN.try_take()) else { exit(4) };
    let sender = bench_sender(&job.settings, &parameters, Medium::Serial, Epoch::new(0), Time::from_micros(0));
    let Some(sender) = sender.and_then(|s| SENDER.try_init(s)) else { exit(1) };

    let memory = Memory { unit: Unit::new(&parameters, state, map, sender), scan };
    exit(if run(&mut files, &job, memory).is_ok() { 0 } else { 1 })
}
