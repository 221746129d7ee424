//! Comparing a controller's answer with the one the library gives here.

use anyhow::{Result, bail, ensure};
use viewshed::bench::record::{Closing, FrameRecord, Opening, RECORD_LEN, Record};
use viewshed::bench::stage::Stage;
use viewshed::map::polar::PolarGeometry;

use super::image::Image;
use crate::geometry::azimuths;

/// What came out of a run.
#[derive(Debug, Clone)]
pub struct Checked {
    pub opening: Opening,
    pub closing: Closing,
    pub frames: usize,
    /// Frames whose maps have the same fingerprint.
    pub equal: usize,
    pub first_difference: Option<usize>,
    /// Instructions of each frame by stage; empty where they are not counted.
    pub instructions: Vec<[u32; Stage::COUNT]>,
    pub difference: Option<Difference>,
    /// The image that ran.
    pub image: Option<Image>,
}

/// The first frame that differs, cell by cell. Rows are azimuths, from right to left.
#[derive(Debug, Clone)]
pub struct Difference {
    pub frame: usize,
    pub ranges: usize,
    /// Outer edges of the first and last azimuth, radians.
    pub azimuth_rad: [f64; 2],
    /// The first azimuth that is narrower than the others, the first behind them, how many times.
    pub narrow: [u8; 3],
    pub cell_m: f64,
    /// Grade and occupancy of every cell, here and there.
    pub host: Vec<[u8; 2]>,
    pub board: Vec<[u8; 2]>,
    pub visible_from: u8,
}

/// Reads an answer and compares its fingerprints.
///
/// # Errors
/// An answer that is not one, or that does not reach the end of the job.
pub fn compare(answer: &[u8], here: &[u8], scans: usize) -> Result<Checked> {
    let records = records(answer);
    let expected = fingerprints(here);
    let Some(Record::Opening(opening)) = records.first().copied() else { bail!("the controller refused the job") };
    let Some(Record::Closing(closing)) = records.last().copied() else { bail!("the controller's answer breaks off") };
    let frames: Vec<FrameRecord> = records
        .iter()
        .filter_map(|r| match r {
            Record::Frame(f) => Some(*f),
            _ => None,
        })
        .collect();
    ensure!(closing.reason == 0, "the controller stopped after {} frames, reason {}", closing.frames, closing.reason);
    let [used, there] = closing.stack;
    ensure!(
        there == 0 || used < there,
        "the stack of {there} bytes was used to its end, and what lies beyond it overwritten"
    );
    ensure!(frames.len() == scans, "{} scans sent, {} frames answered", scans, frames.len());
    let differs = |(frame, expected): &(&FrameRecord, &u64)| frame.fingerprint != **expected;
    let first_difference = frames.iter().zip(&expected).position(|pair| differs(&pair));
    let equal = frames.iter().zip(&expected).filter(|pair| !differs(pair)).count();
    Ok(Checked {
        opening,
        closing,
        frames: frames.len(),
        equal,
        first_difference,
        instructions: if opening.ticks_per_256 > 0 {
            frames.iter().map(|f| instructions(f, &opening)).collect()
        } else {
            Vec::new()
        },
        difference: None,
        image: None,
    })
}

/// Instructions of a frame by stage; the counter counts.
fn instructions(frame: &FrameRecord, opening: &Opening) -> [u32; Stage::COUNT] {
    let ticks_per_256 = u64::from(opening.ticks_per_256.max(1));
    frame.ticks.map(|ticks| u32::try_from(u64::from(ticks) * 256 / ticks_per_256).unwrap_or(u32::MAX))
}

/// Instructions of the estimator, a frame each, in a stream of traces.
pub fn traced(traces: &[u8]) -> Vec<u32> {
    let mut opening = None;
    let mut frames = Vec::new();
    for record in records(traces) {
        match record {
            Record::Opening(new) => opening = Some(new).filter(|new| new.ticks_per_256 > 0),
            Record::Frame(frame) => frames.extend(opening.as_ref().map(|opening| {
                let stages = instructions(&frame, opening);
                stages[..Stage::ESTIMATOR].iter().sum::<u32>()
            })),
            _ => {}
        }
    }
    frames
}

fn fingerprints(answer: &[u8]) -> Vec<u64> {
    let fingerprint = |r: Record| if let Record::Frame(f) = r { Some(f.fingerprint) } else { None };
    records(answer).into_iter().filter_map(fingerprint).collect()
}

fn records(answer: &[u8]) -> Vec<Record> {
    let mut rest = answer;
    let mut all = Vec::new();
    while let Some((bytes, after)) = rest.split_first_chunk::<RECORD_LEN>() {
        let Some(record) = Record::from_bytes(bytes) else { break };
        rest = after;
        if let Record::Map { cells, .. } = record {
            let bytes = 2 * cells.map(usize::from).iter().product::<usize>();
            rest = rest.get(bytes..).unwrap_or(&[]);
        }
        all.push(record);
    }
    all
}

/// The map of a frame in both answers.
///
/// # Errors
/// One of them does not have it.
pub fn difference(answer: &[u8], here: &[u8], frame: usize, geometry: &PolarGeometry) -> Result<Difference> {
    let (Some((ranges, board)), Some((_, host))) = (dumped(answer, frame), dumped(here, frame)) else {
        bail!("the map of frame {frame} was not sent")
    };
    Ok(Difference::new(frame, ranges, geometry, host, board))
}

impl Difference {
    /// Of two maps of the same geometry.
    pub fn new(frame: usize, ranges: usize, geometry: &PolarGeometry, host: Vec<[u8; 2]>, board: Vec<[u8; 2]>) -> Self {
        let azimuth_rad = azimuths::ends_rad(geometry.azimuth_origin, geometry.azimuth_span);
        let cell_m = f64::from(geometry.cell_cm) / 100.0;
        Self { frame, ranges, azimuth_rad, narrow: geometry.narrow.to_bytes(), cell_m, host, board, visible_from: 128 }
    }
}

/// Range cells, and every cell of the map of a frame.
fn dumped(answer: &[u8], wanted: usize) -> Option<(usize, Vec<[u8; 2]>)> {
    let mut rest = answer;
    while let Some((bytes, after)) = rest.split_first_chunk::<RECORD_LEN>() {
        rest = after;
        if let Record::Map { frame, cells } = Record::from_bytes(bytes)? {
            let [ranges, azimuths] = cells.map(usize::from);
            let (grades, after) = rest.split_at_checked(ranges * azimuths)?;
            let occupancy = after.get(..ranges * azimuths)?;
            let cells = grades.iter().zip(occupancy).map(|(g, o)| [*g, *o]).collect();
            return (frame as usize == wanted).then_some((ranges, cells));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewshed::frame::health::Condition;

    fn answer(fingerprints: &[u64], reason: u8) -> Vec<u8> {
        let opening = Opening { shape: [2, 1, 1, 4], ticks_per_256: 512, bytes: [0; 3] };
        let mut records = vec![Record::Opening(opening)];
        for (k, &fingerprint) in fingerprints.iter().enumerate() {
            let (frame, ticks) = (k as u32, [2, 4, 6, 8, 10, 12, 14, 16]);
            records.push(Record::Frame(FrameRecord {
                frame,
                condition: Condition::Healthy,
                used: 0,
                fingerprint,
                ticks,
            }));
        }
        records.push(Record::Closing(Closing { reason, frames: fingerprints.len() as u32, stack: [0; 2] }));
        records.iter().flat_map(Record::to_bytes).collect()
    }

    #[test]
    fn the_first_difference_is_found_and_ticks_become_instructions() {
        let checked = compare(&answer(&[1, 2, 9, 4], 0), &answer(&[1, 2, 3, 4], 0), 4).unwrap();
        assert_eq!((checked.frames, checked.equal, checked.first_difference), (4, 3, Some(2)));
        assert_eq!(checked.instructions[0], [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(compare(&answer(&[1, 2], 0), &answer(&[1, 2], 0), 2).unwrap().first_difference, None);
    }

    #[test]
    fn an_answer_that_is_none_is_an_error() {
        let error = |bytes: &[u8], scans| compare(bytes, &answer(&[1, 2], 0), scans).unwrap_err().to_string();
        assert!(error(b"", 2).contains("refused"));
        assert!(error(&answer(&[1], 0), 2).contains("2 scans sent, 1 frames answered"));
        assert!(error(&answer(&[1, 2], 3), 2).contains("reason 3"));
        let whole = answer(&[1, 2], 0);
        assert!(error(&whole[..whole.len() - 1], 2).contains("breaks off"));
    }
}
