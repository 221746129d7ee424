//! Options that say something of another kind of file than the one that is read.

use super::{ReadOptions, Recording};

/// Kinds of files that options are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    CanLog,
    TiCapture,
    NativeCapture,
    /// MCAP, and boxes of a camera.
    Other,
}

/// The topic of what is said of them.
pub const TOPIC: &str = "options";

/// Adds the options that say nothing of this file to the recording's problems.
pub fn note(recording: &mut Recording, options: &ReadOptions, kind: Kind) {
    let (can, ti) = ("CAN logs", "captures of TI radars");
    let (of_can, of_ti) = (kind == Kind::CanLog, kind == Kind::TiCapture);
    let has_sensors = of_can || kind == Kind::NativeCapture;
    let start = recording.start_ns();
    for (option, given, applies, of) in [
        ("--interface", options.interface.is_some(), of_can, can),
        ("--radar", options.profile.is_some(), of_can, can),
        ("--cluster-states", options.wanted.is_some(), of_can, can),
        ("--sensor-id", options.sensor_id.is_some(), has_sensors, "CAN logs and captures of the native format"),
        ("--ti-header", options.ti_header.is_some(), of_ti, ti),
        ("--ti-dialect", options.ti_dialect.is_some(), of_ti, ti),
        ("--frame-period", options.frame_period_s.is_some(), of_ti, ti),
    ] {
        if given && !applies {
            recording.problems.add(TOPIC, said(option, of), start);
        }
    }
}

/// Says of an option what it is for.
pub fn said(option: &str, of: &str) -> String {
    format!("{option} is for {of}, and ignored")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::samples::made_up;

    #[test]
    fn an_option_of_another_kind_of_file_is_named() {
        let options = ReadOptions { sensor_id: Some(3), frame_period_s: Some(0.1), ..ReadOptions::default() };
        let said = |kind| {
            let mut recording = made_up::recording(1, 0);
            note(&mut recording, &options, kind);
            recording.problems.iter().map(|p| p.what).collect::<Vec<_>>()
        };
        let period = "--frame-period is for captures of TI radars, and ignored";
        assert_eq!(said(Kind::CanLog), [period]);
        assert_eq!(said(Kind::Other).len(), 2);
        assert_eq!(
            said(Kind::TiCapture),
            ["--sensor-id is for CAN logs and captures of the native format, and ignored"]
        );
    }
}
