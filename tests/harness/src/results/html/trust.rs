//! What has to be known before anybody relies on the figures.

use super::escaped;
use crate::evaluation::replay::Replay;

/// Fewer trajectories than this make wide intervals.
const FEW_TRACKS: usize = 30;

/// One line of HTML each, those of this recording first.
pub fn lines(replay: &Replay) -> Vec<String> {
    let (recording, summary) = (&replay.recording, &replay.summary);
    let mut lines = Vec::new();
    if recording.sensor.synthetic {
        lines.push(
            "<strong>The recording is synthetic.</strong> Its figures show that the method works in the world of a simulator, not \
             how well it does on a road."
                .into(),
        );
    }
    match &recording.truth {
        None => lines.push(
            "<strong>Nothing was compared with anything.</strong> Pictures of a map do not say whether it is right."
                .into(),
        ),
        Some(truth) => {
            if summary.objects < FEW_TRACKS {
                lines.push(format!(
                    "<strong>Only {} trajectories were counted.</strong> Look at the intervals, not at the figures alone.",
                    summary.objects
                ));
            }
            if let Some(beside) = &truth.beside {
                lines.push(format!(
                    "<strong>Labels are somebody's</strong> ({}): what nobody labelled does not exist for these figures, and {} of \
                     {} objects have the size of their class, {} the heading of their path.",
                    escaped(&beside.file),
                    beside.sized_by_class,
                    truth.tracks.len(),
                    beside.turned_by_path
                ));
            }
        }
    }
    if recording.sensor.frames_independent {
        lines.push("<strong>Frames are single.</strong> The estimator starts anew at each and knows of no vehicle from before.".into());
    }
    if recording.sensor.platform_moving {
        lines.push(
            "<strong>The sensor moves.</strong> Doppler was not compared, and what stands is not known to stand."
                .into(),
        );
    }
    if !recording.problems.is_empty() {
        lines.push(
            "<strong>The input had problems.</strong> <a href=\"#notes\">They are listed</a>, with what was assumed."
                .into(),
        );
    }
    lines.extend(
        [
            "<strong>Flat road.</strong> Visibility is judged 1 m above a plane, unless another height was set. On a crest or in a dip \
             the map is wrong.",
            "<strong>The mount must be right.</strong> Half a degree of pitch or 0.2 m of height can cost points of FVR; \
             <code>--mount-error</code> measures it.",
            "<strong>Vehicles that nobody has detected hide nothing.</strong> A truck that enters the view inside another's shadow is \
             not in the map, and neither is what was never seen moving.",
            "<strong>Motorways and queues are what it is good at.</strong> At crossings more of what is blocked is called visible.",
            "<strong>Lengths are learnt from reflections</strong>, over a second or so. A radar that sees only the near end of a truck \
             makes it short, and what its far end hides is called visible.",
            "<strong>A detected vehicle is one with a detection in its box.</strong> An object counts as visible where any cell \
             under it is.",
        ]
        .map(str::to_owned),
    );
    lines
}
