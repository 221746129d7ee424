//! The controller's program, run here.

use anyhow::{Context, Result, anyhow};
use viewshed::fixed::time::Time;
use viewshed::map::polar::PolarGeometry;
use viewshed::pil::job::{Job, ScanBuffer};
use viewshed::pil::{Bench, Memory, run};
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::unit::settings::Settings;
use viewshed::unit::{Unit, bench_sender, build};
use viewshed::wire::broadcast::Medium;
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
        Profile::Reference => work::<200, 120, 16, 7, 96, 256>(&mut memory)?,
        Profile::Small => work::<100, 64, 8, 4, 28, 176>(&mut memory)?,
    };
    Ok((memory.answer, geometry))
}

fn work<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    bench: &mut InMemory,
) -> Result<PolarGeometry> {
    let job = Job::read(bench).map_err(|e| anyhow::anyhow!("{e:?}"))?;
    let mut parameters = None::<Radar3dParameters<R, A, E>>;
    let header = build(&job.settings, &mut parameters)?;
    let parameters = parameters.context("built")?;
    let (mut state, mut map) = (Box::new(Radar3d::<R, A, E, W, N, D>::new()), Box::new(parameters.map()));
    let sender = bench_sender(header, Medium::Serial, Epoch::new(0), Time::from_micros(0));
    let mut sender = Box::new(sender.ok_or_else(|| anyhow!("maps of this sensor cannot be sent"))?);
    let geometry = *map.geometry();
    let unit = Unit::new(&parameters, &mut state, &mut map, &mut sender);
    let mut scan = Box::new(ScanBuffer::<MOST_DETECTIONS>::new());
    run(bench, &job, Memory { unit, scan: &mut scan }).map_err(|e| anyhow::anyhow!("{e:?}"))?;
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
