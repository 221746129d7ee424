//! Labels by hand: tracks a person draws, the boxes they mean, their file, and tracks the machine offers.
//!
//! In the order of the data: a [`tracks`] polyline says where the near face of a vehicle was, [`near_face`] makes box
//! centres of it, [`file`](mod@file) keeps both as `NAME.labels.csv`. [`proposals`] offers tracks found in the radar's
//! detections, to be accepted, mended or rejected; [`follow`](proposals::follow) mends from a click. [`person`] plays the
//! one who does that, and [`judged`] counts its actions and judges the labels. What is found for proposals tells the
//! [`lanes`] of a site, too.

pub mod file;
pub mod judged;
pub mod lanes;
pub mod near_face;
pub mod person;
pub mod proposals;
pub mod tracks;

use crate::recording::Recording;

/// What labels depend on beside what is drawn: where the sensor stands, and the recording's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Site {
    /// Sensor in the road frame, metres.
    pub sensor: [f64; 2],
    /// Time of the first radar frame, from which the times of labels count.
    pub start_ns: i64,
    /// Time of the last radar frame.
    pub end_ns: i64,
}

impl Site {
    pub fn of(recording: &Recording) -> Self {
        let [x, y, _] = recording.pose.position;
        let time = |frame: Option<&crate::recording::Frame>| frame.map_or(0, |f| f.time_ns);
        Self { sensor: [x, y], start_ns: time(recording.frames.first()), end_ns: time(recording.frames.last()) }
    }
}
