//! The controller's program, run here.

use anyhow::{Context, Result};
use viewshed::bench::job::{Job, ScanBuffer};
use viewshed::bench::{Bench, run, start};
use viewshed::fixed::time::Time;
use viewshed::map::polar::PolarGeometry;
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::unit::Unit;
use viewshed::unit::profile::{reference, small};
use viewshed::unit::settings::{Settings, SettingsCheck};
use viewshed::wire::broadcast::{Broadcaster, Medium};
use viewshed::wire::message::Epoch;

use super::Profile;
use super::scans::{Scan, job};

/// Most detections of a scan before the gate.
const MOST_DETECTIONS: usize = 16_384;

/// The answer to a job, and where the cells of its maps lie.
///
/// # Errors
/// Settings the library refuses.
pub fn answer(
    profile: Profile,
    settings: &Settings,
    scans: &[Scan],
    dump: Option<usize>,
) -> Result<(Vec<u8>, PolarGeometry)> {
    let dump = dump.and_then(|frame| u32::try_from(frame).ok());
    let mut memory = InMemory { job: job(settings, scans, dump), read: 0, answer: Vec::new() };
    let geometry = match profile {
        Profile::Reference => work(&mut *Box::new(reference::State::new()), &mut memory)?,
        Profile::Small => work(&mut *Box::new(small::State::new()), &mut memory)?,
    };
    Ok((memory.answer, geometry))
}

fn work<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Radar3d<R, A, E, W, N, D>,
    bench: &mut InMemory,
) -> Result<PolarGeometry> {
    let job = Job::read(bench).map_err(|e| anyhow::anyhow!("{e:?}"))?;
    SettingsCheck::of::<Radar3d<R, A, E, W, N, D>, Broadcaster<A, W>>().settings(&job.settings)?;
    let mut parameters: Option<Radar3dParameters<R, A, E>> = None;
    let mut sender: Box<Option<Broadcaster<A, W>>> = Box::new(None);
    let (settings, epoch, now) = (Some(&job.settings), Epoch::new(0), Time::from_micros(0));
    start::<Radar3d<R, A, E, W, N, D>, _>(&mut parameters, &mut sender, settings, Medium::Serial, epoch, now);
    let (parameters, sender) = parameters.as_ref().zip((*sender).as_mut()).context("a unit that was checked")?;
    let mut map = Box::new(parameters.map());
    let geometry = *map.geometry();
    let mut unit = Unit::new(parameters, &mut *state, &mut *map, sender);
    let mut scan = Box::new(ScanBuffer::<MOST_DETECTIONS>::new());
    run(bench, &job, [R, A, E, D], &mut unit, &mut scan).map_err(|e| anyhow::anyhow!("{e:?}"))?;
    Ok(geometry)
}

struct InMemory {
    job: Vec<u8>,
    read: usize,
    answer: Vec<u8>,
}

impl Bench for InMemory {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let rest = &self.job[self.read..];
        let n = rest.len().min(buffer.len());
        buffer[..n].copy_from_slice(&rest[..n]);
        self.read += n;
        n
    }

    fn write(&mut self, bytes: &[u8]) {
        self.answer.extend_from_slice(bytes);
    }

    fn ticks(&mut self) -> u32 {
        0
    }

    fn ticks_per_256(&self) -> u32 {
        0
    }

    fn stack(&self) -> [u32; 2] {
        [0; 2]
    }
}
