//! Points that were rejected, so many that the input and not the road is the reason.

use viewshed::frame::gate::Rejection;

use super::score::Score;
use crate::estimators::{ABSURD, DROPPED, NO_RANGE, NOT_FINITE};
use crate::recording::Recording;

/// Share of all points from which on too many are nowhere or out of view. Fields of view narrower than the
/// radar's are common, so it is no small one.
const MOST: f64 = 0.9;

/// What is probably wrong, by what most of the points were rejected for.
fn hint(reason: &str) -> &'static str {
    match reason {
        DROPPED | NOT_FINITE => "does the sensor send NaN?",
        ABSURD => "angles in degrees?",
        NO_RANGE => "ranges in another unit than metres?",
        _ if reason == Rejection::Range.name() => "ranges in another unit than metres, or a wrong field of view?",
        _ => "angles in degrees, or a wrong field of view?",
    }
}

/// Adds it to the recording's problems where most of the points were rejected.
pub fn report(recording: &mut Recording, scores: &[Score]) {
    let outside = [Rejection::Range, Rejection::Azimuth, Rejection::Elevation].map(Rejection::name);
    let all: u64 = recording.frames.iter().map(|f| f.detections.len() as u64 + f.refused).sum();
    let counted = scores.iter().map(|s| {
        let of = |(reason, _): &&(String, u64)| {
            [DROPPED, NOT_FINITE, ABSURD, NO_RANGE].contains(&reason.as_str()) || outside.contains(&reason.as_str())
        };
        let reasons: Vec<&(String, u64)> = s.counters.iter().filter(of).collect();
        (reasons.iter().map(|(_, n)| n).sum::<u64>(), reasons)
    });
    let Some((rejected, reasons)) = counted.max_by_key(|(sum, _)| *sum) else { return };
    let Some((reason, _)) = reasons.iter().max_by_key(|(_, n)| *n) else { return };
    if rejected as f64 >= MOST * all as f64 {
        let what = format!("{rejected} of {all} points rejected (most: {reason}): {}", hint(reason));
        let start = recording.frames.first().map_or(0, |f| f.time_ns);
        recording.problems.add_many("points", what, start, rejected);
    }
}
