//! The controller's side: scans in, estimator, records out.

use super::fingerprint::Fingerprint;
use super::job::{Job, JobError, ScanBuffer};
use super::record::{Closing, FrameRecord, Opening, Record};
use crate::map::polar::PolarMap;
use crate::stage::Stage;
use crate::unit::Unit;
use crate::wire::serial::MOST_STUFFED;

/// What a controller offers: a byte stream each way and a counter.
pub trait Bench {
    /// Reads up to as many bytes as the buffer has; 0 at the end of the stream.
    fn read(&mut self, buffer: &mut [u8]) -> usize;
    /// Writes all bytes.
    fn write(&mut self, bytes: &[u8]);
    /// Ticks of a free-running 32-bit counter that counts instructions.
    fn ticks(&mut self) -> u32;
    /// Its ticks to 256 instructions; 0 where it does not count instructions.
    fn ticks_per_256(&self) -> u32;
    /// Most bytes of stack used so far, and how many there are; zeros where nobody looked.
    fn stack(&self) -> [u32; 2];
}

/// Most messages of a frame.
const MOST_MESSAGES: usize = 400;

/// Where a run keeps its things.
pub struct Memory<
    'a,
    const R: usize,
    const A: usize,
    const E: usize,
    const W: usize,
    const N: usize,
    const D: usize,
    const B: usize,
> {
    /// Estimator, map and sender.
    pub unit: Unit<'a, R, A, E, W, N, D>,
    /// The scan at hand.
    pub scan: &'a mut ScanBuffer<B>,
}

/// Runs a job to the end of its stream; the last record says how it ended.
///
/// # Errors
/// A stream that breaks off or holds a scan that does not fit.
pub fn run<
    const R: usize,
    const A: usize,
    const E: usize,
    const W: usize,
    const N: usize,
    const D: usize,
    const B: usize,
>(
    bench: &mut impl Bench,
    job: &Job,
    memory: Memory<R, A, E, W, N, D, B>,
) -> Result<(), JobError> {
    let opening = Opening::of::<R, A, E, W, N, D>(bench.ticks_per_256());
    bench.write(&Record::Opening(opening).to_bytes());
    let Memory { mut unit, scan } = memory;
    let mut line = [0; MOST_STUFFED];
    let mut frames = 0_u32;
    let outcome = loop {
        let head = match scan.read(bench) {
            Ok(Some(head)) => head,
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        };
        if head.reset {
            unit.reset();
        }
        let mut ticks = [0; Stage::COUNT];
        let mut last = bench.ticks();
        let report = unit.scan(head.time, scan.detections(), head.fault, |stage| {
            let now = bench.ticks();
            if let Some(t) = ticks.get_mut(stage as usize) {
                *t = now.wrapping_sub(last);
            }
            last = now;
        });
        let mut fingerprint = Fingerprint::of_map(unit.map());
        let mut sending = 0_u32;
        // as many as a map can take, and status and header
        for _ in 0..MOST_MESSAGES {
            let before = bench.ticks();
            let message = unit.next_line(head.time, &mut line).and_then(|n| line.get(..n));
            sending = sending.wrapping_add(bench.ticks().wrapping_sub(before));
            let Some(message) = message else { break };
            fingerprint.bytes(message);
        }
        if let Some(t) = ticks.get_mut(Stage::Broadcast as usize) {
            *t = sending.wrapping_add(*t);
        }
        let fingerprint = fingerprint.value();
        let record = FrameRecord { frame: frames, condition: report.condition, used: report.used, fingerprint, ticks };
        bench.write(&Record::Frame(record).to_bytes());
        if job.dump == Some(frames) {
            dump(bench, frames, unit.map());
        }
        frames = frames.wrapping_add(1);
    };
    let reason = outcome.err().map_or(0, |e| e.code());
    bench.write(&Record::Closing(Closing { reason, frames, stack: bench.stack() }).to_bytes());
    outcome
}

#[allow(clippy::cast_possible_truncation)] // maps that fit a controller
fn dump<const R: usize, const A: usize>(bench: &mut impl Bench, frame: u32, map: &PolarMap<R, A>) {
    bench.write(&Record::Map { frame, cells: [R as u16, A as u16] }.to_bytes());
    for rows in [PolarMap::grades, PolarMap::occupancy] {
        for a in 0..A {
            if let Some(row) = rows(map, a) {
                bench.write(row);
            }
        }
    }
}
