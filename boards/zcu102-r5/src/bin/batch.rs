//! Batch mode: the estimator over every scan of a job file, a fingerprint of each map and its messages.
#![no_std]
#![no_main]

use semihosting::process::exit;
use static_cell::{ConstStaticCell, StaticCell};
use viewshed::pil::files::Files;
use viewshed::pil::job::{Job, ScanBuffer};
use viewshed::pil::{Memory, run};
use viewshed::fixed::time::Time;
use viewshed::unit::{Unit, start_bench};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::Epoch;
use zcu102_r5::Core;
use zcu102_r5::profile::{Map, Parameters, Sender, State};
use zcu102_r5::semihost::HostFile;

/// Detections of a recorded scan, before the gate.
const MOST_DETECTIONS: usize = 16_384;

static STATE: ConstStaticCell<State> = ConstStaticCell::new(State::new());
static MAP: ConstStaticCell<Map> = ConstStaticCell::new(Map::NOWHERE);
static PARAMETERS: StaticCell<Option<Parameters>> = StaticCell::new();
static SENDER: StaticCell<Option<Sender>> = StaticCell::new();
#[unsafe(link_section = ".bench")]
static SCAN: ConstStaticCell<ScanBuffer<MOST_DETECTIONS>> = ConstStaticCell::new(ScanBuffer::new());

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let Some(mut files) = Files::<HostFile, _>::open(Core) else { exit(2) };
    let Ok(job) = Job::read(&mut files) else { exit(1) };
    let (Some(state), Some(map), Some(scan)) = (STATE.try_take(), MAP.try_take(), SCAN.try_take()) else { exit(4) };
    let (Some(parameters), Some(sender)) = (PARAMETERS.try_init(None), SENDER.try_init(None)) else { exit(4) };
    start_bench(parameters, sender, Some(&job.settings), Medium::Serial, Epoch::new(0), Time::from_micros(0));
    let (Some(parameters), Some(sender)) = (parameters, sender) else { exit(1) };

    let memory = Memory { unit: Unit::new(parameters, state, map, sender), scan };
    exit(if run(&mut files, &job, memory).is_ok() { 0 } else { 1 })
}
