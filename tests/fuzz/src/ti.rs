//! Any bytes from a TI mmWave radar: no panic, and chunks make no difference.
//!
//! The first byte says which header is set, and how bytes are chunked. A byte 0xB5 stands for the
//! magic word, 0xB6 for a header that announces a frame of the length and items behind it.

use viewshed::fixed::time::Time;
use viewshed::inputs::ti::{Entries, PolarPoints, Ti, TiAngleUnit, TiConfig, TiDialect, TiFamily, TiOutcome};

const MAGIC: [u8; 8] = [2, 1, 4, 3, 6, 5, 8, 7];

fn stream(bytes: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    let mut bytes = bytes.iter();
    while let Some(byte) = bytes.next() {
        match byte {
            0xB5 => stream.extend(MAGIC),
            0xB6 => {
                let mut next = || u32::from(*bytes.next().unwrap_or(&0));
                let (length, items, points, version) = (next() * 4, next() & 7, next(), next() & 3);
                let words = [version << 24, length, 0, items, 0, points, items, 0];
                stream.extend(MAGIC);
                stream.extend(words.iter().flat_map(|w| w.to_le_bytes()));
            }
            other => stream.push(*other),
        }
    }
    stream
}

fn outcomes(config: TiConfig, bytes: &[u8], chunk: usize) -> Vec<String> {
    let mut radar = Ti::<8>::new(config);
    let mut got = Vec::new();
    for mut rest in bytes.chunks(chunk) {
        while !rest.is_empty() {
            let (taken, outcome) = radar.push(rest, Time::from_micros(5));
            assert!(taken > 0);
            rest = &rest[taken..];
            if let TiOutcome::Scan(scan) = outcome {
                assert!(scan.detections.len() <= 8 && scan.detections.iter().all(|d| d.range_cm > 0));
            }
            if outcome != TiOutcome::Taken {
                got.push(format!("{outcome:?}"));
            }
        }
    }
    got
}

/// One input.
pub fn run(bytes: &[u8]) {
    let Some((how, bytes)) = bytes.split_first() else { return };
    let bytes = stream(bytes);
    let dialect = TiDialect {
        angles: if how & 8 == 0 { TiAngleUnit::Radians } else { TiAngleUnit::Degrees },
        polar_points: if how & 16 == 0 { PolarPoints::Flat } else { PolarPoints::Raised },
        has_elevation: how & 32 == 0,
        doppler_step_mps: (how & 64 == 0).then_some(0.1),
        entries: if how & 128 == 0 { Entries::Points } else { Entries::Targets },
    };
    let config = TiConfig { family: TiFamily::ALL.get(usize::from(how & 7)).copied(), dialect };
    assert_eq!(outcomes(config, &bytes, 1), outcomes(config, &bytes, 61));
}
