//! Recordings from raw captures of a TI mmWave radar's data port.

use anyhow::{Context, Result, bail};
use viewshed::fixed::time::Time;
use viewshed::inputs::RadarScan;
use viewshed::inputs::ti::{Flaw, Ti, TiConfig, TiCounters, TiDialect, TiFamily, TiOutcome};

use super::capture::{self, Kind};
use super::problems::Problems;
use super::{Frame, ReadOptions, Recording};

/// Points of a scan that are kept.
const MOST_POINTS: usize = 1024;

/// What every frame begins with.
pub const MAGIC: [u8; 8] = [2, 1, 4, 3, 6, 5, 8, 7];

/// Bytes at the start of a file in which a frame must begin.
const WITHIN: usize = 1 << 17;

/// Time between frames of TI's own demonstrations.
pub const PERIOD_S: f64 = 0.1;

/// Time of the first frame.
const START_NS: i64 = 1_000_000_000;

/// Whether a file looks like such a capture.
pub fn is_capture(bytes: &[u8]) -> bool {
    bytes[..bytes.len().min(WITHIN)].windows(MAGIC.len()).any(|w| w == MAGIC)
}

/// Reads every frame of a capture.
///
/// # Errors
/// A kind of header that cannot be learnt, and no frame at all.
pub fn read(name: String, bytes: &[u8], options: &ReadOptions) -> Result<Recording> {
    if let Some(size) = records_of_cars(bytes) {
        let [what, remedy] = of_cars(size);
        bail!("{name}: {what}; {remedy}");
    }
    let family = match options.ti_header.or_else(|| learn(bytes)) {
        Some(family) => family,
        None => bail!(
            "{name}: the kind of header cannot be learnt: that takes three frames with items in a row. Name it with --ti-header 36, 40, 44, 48 or 52; `viewshed doctor` says what there is"
        ),
    };
    let dialect = options.ti_dialect.unwrap_or(TiDialect::USUAL);
    let mut problems = Problems::default();
    let period_s = options.frame_period_s.unwrap_or(PERIOD_S);
    if options.frame_period_s.is_none() {
        let what =
            format!("a TI capture holds no times: frames {PERIOD_S} s apart assumed; give it with --frame-period");
        problems.add("capture", what, 0);
    }
    let mut radar = Ti::<MOST_POINTS>::new(TiConfig { family: Some(family), dialect });
    let mut frames: Vec<Frame> = Vec::new();
    let mut numbers = Vec::new();
    scans(&mut radar, bytes, |scan| {
        let detections = scan.detections.iter().map(capture::detection).collect();
        numbers.push(scan.number);
        frames.push(Frame {
            time_ns: START_NS,
            detections,
            refused: scan.refused.into(),
            unwanted: scan.unwanted().iter().map(capture::detection).collect(),
            fault: scan.fault,
        });
    });
    let (times, stood) = times(&numbers, period_s);
    frames.iter_mut().zip(times).for_each(|(frame, time_ns)| frame.time_ns = time_ns);
    let what = format!("frame whose number stands still: taken {period_s} s after the one before");
    problems.add_many("capture", what, START_NS, stood as u64);
    let c = *radar.counters();
    let first = frames.first().map(|f| f.time_ns).with_context(|| {
        format!(
            "{name}: no whole frame with a header of {} bytes; `viewshed doctor` says what there is",
            family.header()
        )
    })?;
    for (what, n) in flaws(&c) {
        problems.add_many("capture", what, first, u64::from(n));
    }
    let has_elevation = frames.iter().flat_map(|f| &f.detections).any(|d| d.elevation_rad.is_some_and(|e| e != 0.0));
    if !has_elevation {
        // an antenna that measures none sends zeros
        frames.iter_mut().flat_map(|f| &mut f.detections).for_each(|d| d.elevation_rad = None);
    }
    let kind = Kind {
        name: format!("TI mmWave, header of {} bytes", family.header()),
        azimuth_deg: 60.0,
        elevation_deg: 20.0,
        range_m: [0.3, 120.0],
        has_elevation,
    };
    Ok(capture::recording(name, kind, frames, problems, options))
}

/// The family, if three frames in a row agree on it.
pub fn learn(bytes: &[u8]) -> Option<TiFamily> {
    let mut radar = Ti::<1>::new(TiConfig::LEARN);
    feed(&mut radar, bytes, |_| {});
    radar.family()
}

/// Feeds a radar with bytes; `scan` is given every scan that comes of them.
pub fn scans<const N: usize>(radar: &mut Ti<N>, bytes: &[u8], mut scan: impl FnMut(&RadarScan<'_>)) {
    feed(radar, bytes, |outcome| {
        if let TiOutcome::Scan(s) = outcome {
            scan(&s);
        }
    });
}

/// Feeds a radar with bytes; `see` is given whatever comes of them.
pub fn feed<const N: usize>(radar: &mut Ti<N>, mut bytes: &[u8], mut see: impl FnMut(TiOutcome<'_>)) {
    while !bytes.is_empty() {
        let (taken, outcome) = radar.push(bytes, Time::from_micros(0));
        see(outcome);
        bytes = &bytes[taken.clamp(1, bytes.len())..];
    }
}

/// What the decoder counted, in words. The number of a frame that came damaged is missing, too: it is told once.
pub fn flaws(c: &TiCounters) -> [(&'static str, u32); 6] {
    [
        ("frame cut short or damaged, dropped", c.broken),
        ("frame that never came, by its number", c.lost.saturating_sub(c.broken)),
        ("radar started over", c.restarts),
        ("byte outside of frames", c.stray_bytes),
        ("point with values that are none, dropped", c.no_point),
        ("point beyond what is kept, dropped", c.overflow),
    ]
}

/// A flaw in words.
pub fn flaw(flaw: Flaw) -> &'static str {
    match flaw {
        Flaw::Cut => "the next frame began before its end",
        Flaw::Header => "lengths in the header that cannot be",
        Flaw::Items => "items that do not fill the frame",
        Flaw::Records => "an item that is no whole number of points",
        Flaw::Points => "most of the points announced are not there",
    }
}

/// Sub-frames of a frame, at most.
const MOST_SUB_FRAMES: usize = 4;

/// Numbers of frames that a radar may have left out; what is farther is a restart.
const MOST_LEFT_OUT: u32 = 10_000;

/// Times of frames from their numbers, each later than the one before: sub-frames share a number, restarts begin anew, and a
/// number that stands still for more frames than there are sub-frames says nothing. How many sub-frames there are is not
/// known, so they are a quarter of a period apart. And how many frames bear a number that stood still.
fn times(numbers: &[u32], period_s: f64) -> (Vec<i64>, usize) {
    let period_ns = (period_s * 1e9) as i64;
    let (mut times, mut stood, mut next_ns) = (Vec::with_capacity(numbers.len()), 0, START_NS);
    let mut runs = numbers.chunk_by(|a, b| a == b).peekable();
    while let Some(run) = runs.next() {
        let still = run.len() > MOST_SUB_FRAMES;
        stood += if still { run.len() } else { 0 };
        let step_ns = if still { period_ns } else { period_ns / MOST_SUB_FRAMES as i64 };
        times.extend((0..run.len() as i64).map(|k| next_ns + k * step_ns));
        let lasts_ns = if still { run.len() as i64 * period_ns } else { period_ns };
        let advance = runs.peek().and_then(|next| next.first()?.checked_sub(*run.first()?));
        let left_out = advance.filter(|advance| *advance < MOST_LEFT_OUT && !still).map_or(0, |n| i64::from(n) - 1);
        next_ns += lasts_ns + left_out * period_ns;
    }
    (times, stood)
}

/// The size of the records of TI's demos for cars (medium range and ultra short range), if that is what a capture holds:
/// their item of type 1 begins with a number of records and a binary point, and they have 8 or 10 bytes each.
pub fn records_of_cars(bytes: &[u8]) -> Option<usize> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let starts = bytes.windows(MAGIC.len()).enumerate().filter(|(_, w)| *w == MAGIC).map(|(at, _)| at);
    let (mut frames, mut found) = (0_usize, [0_usize; 2]);
    for start in starts.take(200) {
        let of_header = |header: usize| {
            let (kind, length) = (word(start + header)?, word(start + header + 4)?);
            let count = word(start + header + 8)? & 0xFFFF;
            let fits = |size: usize| kind == 1 && count > 0 && length == 4 + count * size;
            [8, 10].into_iter().position(fits)
        };
        let sizes = [36, 40, 44].into_iter().find_map(of_header);
        frames += 1;
        if let Some(k) = sizes {
            found[k] += 1;
        }
    }
    let (k, n) = if found[0] >= found[1] { (0, found[0]) } else { (1, found[1]) };
    (n >= 3 && 2 * n > frames).then_some([8, 10][k])
}

/// What is said of their captures, and what to do.
pub fn of_cars(size: usize) -> [String; 2] {
    [
        format!(
            "the points are records of {size} bytes, as TI's demos for cars send them (medium range, MRR, and ultra short range, USRR), and these are not read"
        ),
        "run the out-of-box demo of the SDK or a firmware of the Radar Toolbox, whose points are read".into(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_frames_do_not_slow_time_down_and_numbers_that_stand_still_do_not_stop_it() {
        let times = |numbers: &[u32]| {
            let (times, stood) = times(numbers, 0.1);
            (times.iter().map(|time| (time - START_NS) / 1_000_000).collect::<Vec<_>>(), stood)
        };
        let running =
            |numbers: &[u32], expected: &[i64]| assert_eq!(times(numbers), (expected.to_vec(), 0), "{numbers:?}");
        running(&[1, 1, 2, 2], &[0, 25, 100, 125]);
        running(&[7, 7, 7, 7, 8, 8, 8, 8, 9], &[0, 25, 50, 75, 100, 125, 150, 175, 200]);
        // frames that never came; restarts, and a number that begins anew
        running(&[1, 2, 5, 6], &[0, 100, 400, 500]);
        running(&[90, 90, 0, 0, 1], &[0, 25, 100, 125, 200]);
        running(&[1, 2, 90_000, 90_001], &[0, 100, 200, 300]);
        running(&[], &[]);
        // more of one number than a radar has sub-frames: always, and for a while
        assert_eq!(times(&[0; 40]), ((0..40).map(|k| 100 * k).collect(), 40));
        assert_eq!(times(&[3, 3, 3, 3, 3, 3, 4, 5]), (vec![0, 100, 200, 300, 400, 500, 600, 700], 6));
        assert_eq!(
            times(&[3, 3, 3, 3, 3, 9]),
            (vec![0, 100, 200, 300, 400, 500], 5),
            "what passed meanwhile is not known"
        );
    }

    #[test]
    fn records_of_demos_for_cars_are_known_by_their_size() {
        let frame = |header: usize, size: usize, count: u16| {
            let mut bytes = MAGIC.to_vec();
            bytes.resize(header, 0);
            bytes.extend(1_u32.to_le_bytes());
            bytes.extend((4 + u32::from(count) * size as u32).to_le_bytes());
            bytes.extend([count.to_le_bytes(), 7_u16.to_le_bytes()].concat());
            bytes.resize(bytes.len() + usize::from(count) * size, 0);
            bytes
        };
        for header in [36, 40, 44] {
            for (size, expected) in [(8, Some(8)), (10, Some(10)), (12, None), (16, None)] {
                let capture: Vec<u8> = (1..9).flat_map(|count| frame(header, size, count)).collect();
                assert_eq!(records_of_cars(&capture), expected, "{header}, {size}");
            }
        }
        assert_eq!((records_of_cars(&MAGIC.repeat(9)), records_of_cars(b"")), (None, None));
    }
}
