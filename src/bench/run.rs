//! The controller's side: scans in, estimator, records out.

use super::fingerprint::{Fingerprint, Rows};
use super::job::{Job, JobEntry, JobError, ScanBuffer};
use super::record::{Closing, Opening, Record, Tracer};
use super::stage::Stage;
use crate::estimator::Estimator;
use crate::inputs::Frame;
use crate::unit::{MapSender, Unit};
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

/// Runs a job to the end of its stream; the last record says how it ended. `shape` is that of the opening record.
///
/// # Errors
/// A stream that breaks off or holds a scan that does not fit.
pub fn run<E, S, T, const B: usize>(
    bench: &mut impl Bench,
    job: &Job,
    shape: [usize; 4],
    unit: &mut Unit<'_, E, S>,
    scan: &mut ScanBuffer<B, T>,
) -> Result<(), JobError>
where
    E: Estimator<Input = [T], Map: Rows>,
    S: MapSender<E::Map>,
    T: JobEntry,
{
    bench.write(&Record::Opening(Opening::of::<E>(shape, bench.ticks_per_256())).to_bytes());
    let mut line = [0; MOST_STUFFED];
    let mut tracer = Tracer::default();
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
        let mut done = None;
        let frame =
            Frame { measured: head.time, input: scan.detections(), incomplete: false, status: head.fault.into() };
        unit.frame(&frame, &mut |event| done = tracer.event(event, bench.ticks()));
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
        if let Some(mut record) = done {
            if let Some(ticks) = record.ticks.get_mut(Stage::Broadcast as usize) {
                *ticks = sending.wrapping_add(*ticks);
            }
            record.fingerprint = fingerprint.value();
            bench.write(&Record::Frame(record).to_bytes());
        }
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
fn dump<M: Rows>(bench: &mut impl Bench, frame: u32, map: &M) {
    let [_, rows] = M::SHAPE;
    bench.write(&Record::Map { frame, cells: M::SHAPE.map(|cells| cells as u16) }.to_bytes());
    for row in 0..rows {
        bench.write(map.row(row).map_or(&[], |(grades, _)| grades));
    }
    for row in 0..rows {
        bench.write(map.row(row).map_or(&[], |(_, occupancy)| occupancy));
    }
}
