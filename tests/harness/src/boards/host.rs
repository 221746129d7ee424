//! The controller's program, run here.

use anyhow::{Context, Result};
use viewshed::bench::fingerprint::Rows;
use viewshed::bench::job::{Job, JobEntry, ScanBuffer};
use viewshed::bench::{Bench, run, start};
use viewshed::camera::boxes::ImageBox;
use viewshed::estimator::Estimator;
use viewshed::fixed::time::Time;
use viewshed::map::polar::{PolarGeometry, PolarMap};
use viewshed::radar_3d::Radar3d;
use viewshed::unit::profile::{camera, reference, small};
use viewshed::unit::settings::{Settings, SettingsCheck};
use viewshed::unit::{InUnit, MapSender, Unit};
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
    let mut memory = InMemory::new(job(settings, scans, dump));
    let geometry = match profile {
        Profile::Reference => work(&mut *Box::new(reference::State::new()), &mut memory)?,
        Profile::Small => work(&mut *Box::new(small::State::new()), &mut memory)?,
    };
    Ok((memory.answer, geometry))
}

/// The answer of a camera's program to a job.
///
/// # Errors
/// Settings the library refuses.
pub fn camera_answer(settings: &Settings, scans: &[Scan<ImageBox>]) -> Result<Vec<u8>> {
    let mut memory = InMemory::new(job(settings, scans, None));
    let mut state = Box::new(camera::State::new());
    process::<_, camera::Sender, _>(&mut *state, &mut Box::new(camera::Map::NOWHERE), camera::SHAPE, &mut memory)?;
    Ok(memory.answer)
}

fn work<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Radar3d<R, A, E, W, N, D>,
    bench: &mut InMemory,
) -> Result<PolarGeometry> {
    let mut map = Box::new(PolarMap::NOWHERE);
    process::<_, Broadcaster<A, W>, _>(state, &mut map, [R, A, E, D], bench)?;
    Ok(*map.geometry())
}

fn process<E, S, T>(state: &mut E, map: &mut E::Map, shape: [usize; 4], bench: &mut InMemory) -> Result<()>
where
    E: InUnit + Estimator<Input = [T], Map: Rows>,
    S: MapSender<E::Map>,
    T: JobEntry,
{
    let job = Job::read(bench).map_err(|e| anyhow::anyhow!("{e:?}"))?;
    SettingsCheck::of::<E, S>().settings(&job.settings)?;
    let (mut parameters, mut sender) = (None, Box::new(None::<S>));
    let (settings, epoch, now) = (Some(&job.settings), Epoch::new(0), Time::from_micros(0));
    start::<E, _>(&mut parameters, &mut sender, settings, Medium::Serial, epoch, now);
    let (parameters, sender) = parameters.as_ref().zip((*sender).as_mut()).context("a unit that was checked")?;
    let mut unit = Unit::new(parameters, state, map, sender);
    let mut scan = Box::new(ScanBuffer::<MOST_DETECTIONS, T>::new());
    run(bench, &job, shape, &mut unit, &mut scan).map_err(|e| anyhow::anyhow!("{e:?}"))
}

struct InMemory {
    job: Vec<u8>,
    read: usize,
    answer: Vec<u8>,
}

impl InMemory {
    fn new(job: Vec<u8>) -> Self {
        Self { job, read: 0, answer: Vec::new() }
    }
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
