//! What the clock of a recording does: steps back, stands still, leaps; and what becomes of the frames around it.
//!
//! Every frame is judged at the time it bears. Estimators start over where that leaps (more than their reset gap) or runs
//! backwards, so that no map outlives the recording's own time. What is counted here is told with the results.

use super::Frame;
use super::problems::Problems;

/// A pause that is no loss of a few frames, seconds.
const GAP_S: f64 = 10.0;

const TOPIC: &str = "clock";

/// Adds steps back, equal times and gaps to the problems, each kind once with its number and extent.
pub fn check(frames: &[Frame], problems: &mut Problems) {
    let Some(start) = frames.first().map(|f| f.time_ns) else { return };
    let passed = |pair: &[Frame]| pair[1].time_ns.saturating_sub(pair[0].time_ns) as f64 * 1e-9;
    let (mut back, mut gaps, mut equal) = (Vec::new(), Vec::new(), Vec::new());
    for (k, pair) in frames.windows(2).enumerate() {
        match passed(pair) {
            s if s < 0.0 => back.push((k + 1, -s)),
            0.0 => equal.push(k + 1),
            s if s >= GAP_S => gaps.push((k + 1, s)),
            _ => {}
        }
    }
    let longest = |all: &[(usize, f64)]| all.iter().map(|(_, s)| *s).fold(0.0, f64::max);
    let at = |k: usize| frames[k].time_ns;
    if let Some(&(first, _)) = back.first() {
        let after = frames.len() - first;
        let before_start = frames[first..].iter().filter(|f| f.time_ns < start).count();
        let early = match before_start {
            0 => String::new(),
            n => format!(", {n} of them, which lie before the first frame, are left out as warm-up"),
        };
        let what = format!(
            "the clock steps back, by {} at most; the maps start over there, and the {after} frames after it are judged at their own times{early}",
            spoken(longest(&back))
        );
        problems.add_many(TOPIC, what, at(first), back.len() as u64);
    }
    if let Some(&(first, _)) = gaps.first() {
        let what = format!(
            "no frames for {} at most; the maps start over after it, and what follows is judged from its first frame on",
            spoken(longest(&gaps))
        );
        problems.add_many(TOPIC, what, at(first), gaps.len() as u64);
    }
    if let Some(&first) = equal.first() {
        let what = "a frame bears the time of the one before; the maps start over there, and both are judged";
        problems.add_many(TOPIC, what, at(first), equal.len() as u64);
    }
}

/// `12.5 s`, `3 min 20 s`, `2 h 5 min`.
fn spoken(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..=119 => format!("{seconds:.1} s"),
        120..=7199 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(seconds: &[f64]) -> Vec<String> {
        let frame = |s: &f64| Frame {
            time_ns: (s * 1e9) as i64,
            detections: Vec::new(),
            refused: 0,
            unwanted: Vec::new(),
            fault: false,
        };
        let frames: Vec<Frame> = seconds.iter().map(frame).collect();
        let mut problems = Problems::default();
        check(&frames, &mut problems);
        problems.iter().map(|p| p.since(frames[0].time_ns)).collect()
    }

    #[test]
    fn a_clock_that_runs_is_not_mentioned() {
        assert_eq!(told(&[0.0, 0.1, 0.2, 5.0]), [""; 0], "frames that are lost are counted elsewhere");
        assert_eq!(told(&[]), [""; 0]);
    }

    #[test]
    fn a_step_back_says_what_becomes_of_the_frames_after_it() {
        let text = told(&[10.0, 10.1, 6.0, 10.2]).join("");
        assert!(text.contains("steps back, by 4.1 s at most"), "{text}");
        assert!(text.contains("the 2 frames after it are judged") && text.contains("1 of them"), "{text}");
        assert!(!told(&[10.0, 10.5, 10.2, 10.6]).join("").contains("of them"));
    }

    #[test]
    fn a_gap_of_minutes_is_told_with_its_length_and_where_it_is() {
        let text = told(&[0.0, 0.1, 200.1, 200.2, 240.0]).join("");
        assert!(text.contains("no frames for 3 min 20 s at most") && text.contains("2x, first at 200.100 s"), "{text}");
        assert!(told(&[0.0, 8000.0]).join("").contains("2 h 13 min"));
    }

    #[test]
    fn equal_times_are_counted() {
        assert!(told(&[0.0, 0.1, 0.1, 0.1]).join("").contains("start over there, and both are judged (2x"));
    }
}
