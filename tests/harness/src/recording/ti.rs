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
const PERIOD_S: f64 = 0.1;

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
    let mut clock = Clock::new(period_s);
    scans(&mut radar, bytes, |scan| {
        let detections = scan.detections.iter().map(capture::detection).collect();
        frames.push(Frame {
            time_ns: clock.time_ns(scan.number),
            detections,
            refused: scan.refused.into(),
            unwanted: scan.unwanted.into(),
            fault: scan.fault,
        });
    });
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

/// Times from frame numbers.
struct Clock {
    period_ns: i64,
    last: Option<Stamp>,
}

#[derive(Clone, Copy)]
struct Stamp {
    number: u32,
    /// Of the first sub-frame of the number, from which the next number counts.
    first_ns: i64,
    time_ns: i64,
}

impl Clock {
    fn new(period_s: f64) -> Self {
        Self { period_ns: (period_s * 1e9) as i64, last: None }
    }

    /// Later than the time before, whatever the number: sub-frames share one, restarts begin anew. A radar has at most four
    /// sub-frames; how many is not known from the first, so they are a quarter of a period apart.
    fn time_ns(&mut self, number: u32) -> i64 {
        let stamp = match self.last {
            None => Stamp { number, first_ns: START_NS, time_ns: START_NS },
            Some(last) => {
                let later_ns = last.time_ns + self.period_ns / 4;
                match number.checked_sub(last.number) {
                    Some(0) => Stamp { time_ns: later_ns, ..last },
                    advance => {
                        let periods = advance.filter(|advance| *advance < 10_000).unwrap_or(1);
                        let next_ns = last.first_ns + i64::from(periods) * self.period_ns;
                        // a number that stood still for more sub-frames than there are has come too far
                        let time_ns = if next_ns > last.time_ns { next_ns } else { later_ns };
                        Stamp { number, first_ns: time_ns, time_ns }
                    }
                }
            }
        };
        self.last = Some(stamp);
        stamp.time_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_frames_do_not_slow_time_down() {
        let times = |numbers: &[u32]| {
            let mut clock = Clock::new(0.1);
            numbers.iter().map(|n| (clock.time_ns(*n) - START_NS) / 1_000_000).collect::<Vec<_>>()
        };
        assert_eq!(times(&[1, 1, 2, 2]), [0, 25, 100, 125]);
        assert_eq!(times(&[7, 7, 7, 7, 8, 8, 8, 8, 9]), [0, 25, 50, 75, 100, 125, 150, 175, 200]);
        assert_eq!(times(&[1, 2, 5, 6]), [0, 100, 400, 500], "frames that never came");
        // restarts, and more of one number than a radar has
        assert_eq!(times(&[90, 90, 0, 0, 1]), [0, 25, 100, 125, 200]);
        assert_eq!(times(&[3, 3, 3, 3, 3, 3, 4, 5]), [0, 25, 50, 75, 100, 125, 150, 250]);
    }
}
