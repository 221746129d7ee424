//! Comparing a controller's answer with what the library computes here.

use anyhow::{Result, bail, ensure};
use viewshed::pil::fingerprint::Fingerprint;
use viewshed::pil::record::{Closing, FrameRecord, Opening, RECORD_LEN, Record};
use viewshed::polar::PolarMap;
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::stage::Stage;

use super::image::Image;
use super::scans::Scan;

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
    pub cell_m: f64,
    /// Grade and occupancy of every cell, here and there.
    pub host: Vec<[u8; 2]>,
    pub board: Vec<[u8; 2]>,
    pub visible_from: u8,
}

/// Fingerprints of all maps.
pub fn fingerprints<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Radar3d<R, A, E, W, N, D>,
    parameters: &Radar3dParameters<R, A, E>,
    scans: &[Scan],
) -> Vec<u64> {
    let mut all = Vec::with_capacity(scans.len());
    every_map(state, parameters, scans, |_, map| all.push(Fingerprint::of_map(map).value()));
    all
}

fn every_map<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Radar3d<R, A, E, W, N, D>,
    parameters: &Radar3dParameters<R, A, E>,
    scans: &[Scan],
    mut visit: impl FnMut(usize, &PolarMap<R, A>),
) {
    let mut map = Box::new(parameters.map());
    *state = Radar3d::new();
    for (k, scan) in scans.iter().enumerate() {
        if scan.reset {
            state.reset();
            map.forget();
        }
        state.process(parameters, scan.time, &scan.detections, false, &mut map);
        visit(k, &map);
    }
}

/// Reads an answer and compares its fingerprints.
///
/// # Errors
/// An answer that is not one, or that does not reach the end of the job.
pub fn compare(answer: &[u8], expected: &[u64], scans: usize) -> Result<Checked> {
    let records = records(answer);
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
    ensure!(frames.len() == scans, "{} scans sent, {} frames answered", scans, frames.len());
    let differs = |(frame, expected): &(&FrameRecord, &u64)| frame.fingerprint != **expected;
    let first_difference = frames.iter().zip(expected).position(|pair| differs(&pair));
    let equal = frames.iter().zip(expected).filter(|pair| !differs(pair)).count();
    let instructions = |f: &FrameRecord| {
        f.ticks.map(|t| u32::try_from(u64::from(t) * 256 / u64::from(opening.ticks_per_256)).unwrap_or(u32::MAX))
    };
    Ok(Checked {
        opening,
        closing,
        frames: frames.len(),
        equal,
        first_difference,
        instructions: if opening.ticks_per_256 > 0 { frames.iter().map(instructions).collect() } else { Vec::new() },
        difference: None,
        image: None,
    })
}

fn records(answer: &[u8]) -> Vec<Record> {
    let mut rest = answer;
    let mut all = Vec::new();
    while let Some((bytes, behind)) = rest.split_first_chunk::<RECORD_LEN>() {
        let Some(record) = Record::from_bytes(bytes) else { break };
        rest = behind;
        if let Record::Map { cells, .. } = record {
            let bytes = 2 * cells.map(usize::from).iter().product::<usize>();
            rest = rest.get(bytes..).unwrap_or(&[]);
        }
        all.push(record);
    }
    all
}

/// The map of a frame, here and as the controller sent it.
///
/// # Errors
/// The controller did not send it.
pub fn difference<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Radar3d<R, A, E, W, N, D>,
    parameters: &Radar3dParameters<R, A, E>,
    scans: &[Scan],
    frame: usize,
    answer: &[u8],
) -> Result<Option<Difference>> {
    let Some(sent) = dumped(answer, frame, R * A) else { bail!("the controller did not send frame {frame}") };
    let board: Vec<[u8; 2]> = (0..R * A).map(|k| [sent[k], sent[R * A + k]]).collect();
    let mut found = None;
    every_map(state, parameters, &scans[..=frame], |k, map| {
        if k == frame {
            let geometry = map.geometry();
            let right = f64::from(geometry.azimuth_origin.radians());
            let span = f64::from(geometry.azimuth_span) / 65536.0 * std::f64::consts::TAU;
            let rows = |a| map.grades(a).into_iter().flatten().zip(map.occupancy(a).into_iter().flatten());
            found = Some(Difference {
                frame,
                ranges: R,
                azimuth_rad: [right, right + span],
                cell_m: f64::from(geometry.cell_cm) / 100.0,
                host: (0..A).flat_map(rows).map(|(g, o)| [*g, *o]).collect(),
                board: board.clone(),
                visible_from: map.visible_from(),
            });
        }
    });
    Ok(found)
}

fn dumped(answer: &[u8], wanted: usize, cells: usize) -> Option<&[u8]> {
    let mut rest = answer;
    while let Some((bytes, behind)) = rest.split_first_chunk::<RECORD_LEN>() {
        rest = behind;
        if let Record::Map { frame, .. } = Record::from_bytes(bytes)? {
            return rest.get(..2 * cells).filter(|_| frame as usize == wanted);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewshed::health::Condition;

    fn answer(fingerprints: &[u64], reason: u8) -> Vec<u8> {
        let opening = Opening { shape: [2, 1, 1, 4], ticks_per_256: 512, bytes: [0; 3] };
        let mut records = vec![Record::Opening(opening)];
        for (k, &fingerprint) in fingerprints.iter().enumerate() {
            let (frame, ticks) = (k as u32, [2, 4, 6, 8, 10, 12, 14]);
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
        let checked = compare(&answer(&[1, 2, 9, 4], 0), &[1, 2, 3, 4], 4).unwrap();
        assert_eq!((checked.frames, checked.equal, checked.first_difference), (4, 3, Some(2)));
        assert_eq!(checked.instructions[0], [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(compare(&answer(&[1, 2], 0), &[1, 2], 2).unwrap().first_difference, None);
    }

    #[test]
    fn an_answer_that_is_none_is_an_error() {
        let error = |answer: &[u8], scans| compare(answer, &[1, 2], scans).unwrap_err().to_string();
        assert!(error(b"", 2).contains("refused"));
        assert!(error(&answer(&[1], 0), 2).contains("2 scans sent, 1 frames answered"));
        assert!(error(&answer(&[1, 2], 3), 2).contains("reason 3"));
        let whole = answer(&[1, 2], 0);
        assert!(error(&whole[..whole.len() - 1], 2).contains("breaks off"));
    }
}
