//! Bytes of a TI mmWave radar in, scans out.

mod frames;
mod framing;
mod points;
mod random;
mod real;
mod session;

use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::ti::{Flaw, Ti, TiConfig, TiDialect, TiFamily, TiOutcome};

/// What came out, in short.
#[derive(Debug, Clone, PartialEq)]
pub enum Got {
    Learnt(TiFamily),
    /// Number, detections, missing.
    Scan(u32, Vec<Detection>, u16),
    Broken(Flaw),
}

/// Everything that comes of bytes cut into chunks.
pub fn feed<const N: usize>(radar: &mut Ti<N>, bytes: &[u8], chunk: usize) -> Vec<Got> {
    let mut got = Vec::new();
    for (i, mut rest) in bytes.chunks(chunk).enumerate() {
        while !rest.is_empty() {
            let (taken, outcome) = radar.push(rest, Time::from_micros(i as u64));
            assert!(taken > 0);
            rest = &rest[taken..];
            got.extend(match outcome {
                TiOutcome::Taken => None,
                TiOutcome::Learnt(family) => Some(Got::Learnt(family)),
                TiOutcome::Scan(s) => Some(Got::Scan(s.number, s.detections.to_vec(), s.missing)),
                TiOutcome::Broken(flaw) => Some(Got::Broken(flaw)),
            });
        }
    }
    got
}

pub fn radar(family: TiFamily) -> Ti<64> {
    Ti::new(TiConfig { family: Some(family), dialect: TiDialect::USUAL })
}
