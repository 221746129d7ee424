//! Frames of an ARS408 in, scans out.

mod description;
mod entries;
mod random;
mod scans;

use viewshed::fixed::time::Time;
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Outcome};
use viewshed::wire::frame::{CanFrame, CanId};

/// A frame as `candump` writes it, `701#0755F1CD6C200294`.
pub fn frame(text: &str) -> CanFrame {
    let (id, bytes) = text.split_once('#').unwrap();
    let id = CanId::standard(u16::from_str_radix(id, 16).unwrap()).unwrap();
    let bytes: Vec<u8> =
        (0..bytes.len()).step_by(2).map(|i| u8::from_str_radix(&bytes[i..i + 2], 16).unwrap()).collect();
    CanFrame::classic(id, &bytes).unwrap()
}

/// A moment, milliseconds.
pub fn at(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

/// What a scan was, in short.
#[derive(Debug, PartialEq)]
pub struct Got {
    /// The radar's number.
    pub number: u32,
    /// Range and velocity of each detection.
    pub detections: Vec<(u16, i16)>,
    /// Announced and not arrived.
    pub missing: u16,
    /// The radar's own flag.
    pub fault: bool,
}

/// The scan an outcome holds.
pub fn got(outcome: Ars408Outcome<'_>) -> Option<Got> {
    match outcome {
        Ars408Outcome::Scan(scan) => Some(Got {
            number: scan.number,
            detections: scan.detections.iter().map(|d| (d.range_cm, d.radial_velocity_cm_s)).collect(),
            missing: scan.missing,
            fault: scan.fault,
        }),
        _ => None,
    }
}

/// The scans that come of frames, one a millisecond.
pub fn scans(radar: &mut Ars408<64>, frames: &[&str]) -> Vec<Got> {
    frames.iter().enumerate().filter_map(|(i, text)| got(radar.push(&frame(text), at(i as u64)))).collect()
}

/// Sensor 0 with room for 64.
pub fn radar() -> Ars408<64> {
    Ars408::new(Ars408Config::sensor(0))
}
