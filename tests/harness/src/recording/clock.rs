//! What the clock of a recording does: steps back, stands still, leaps; and what becomes of the frames around it.
//!
//! Every frame is judged at the time it bears. Estimators start over where that leaps (more than their reset gap) or runs
//! backwards, so that no map outlives the recording's own time. What is counted here is told with the results.

use super::problems::Problems;

/// A pause that is no loss of a few frames, seconds.
const GAP_S: f64 = 10.0;

const TOPIC: &str = "clock";

/// What the clock did from frame to frame.
#[derive(Debug, Clone, Default)]
pub struct Clock {
    start_ns: Option<i64>,
    last_ns: i64,
    back: Steps,
    /// Frames after the first step back, and those of them that lie before the first frame.
    after: usize,
    before_start: usize,
    gaps: Steps,
    equal: Steps,
}

/// Steps of one kind.
#[derive(Debug, Clone, Default)]
struct Steps {
    count: u64,
    /// Time of the frame after the first of them.
    first_ns: i64,
    longest_s: f64,
}

impl Steps {
    fn add(&mut self, time_ns: i64, seconds: f64) {
        if self.count == 0 {
            self.first_ns = time_ns;
        }
        self.count += 1;
        self.longest_s = self.longest_s.max(seconds);
    }
}

impl Clock {
    /// Takes the time of the next frame.
    pub fn frame(&mut self, time_ns: i64) {
        let Some(start_ns) = self.start_ns else {
            (self.start_ns, self.last_ns) = (Some(time_ns), time_ns);
            return;
        };
        match time_ns.saturating_sub(self.last_ns) as f64 * 1e-9 {
            s if s < 0.0 => self.back.add(time_ns, -s),
            0.0 => self.equal.add(time_ns, 0.0),
            s if s >= GAP_S => self.gaps.add(time_ns, s),
            _ => {}
        }
        self.last_ns = time_ns;
        if self.back.count > 0 {
            self.after += 1;
            self.before_start += usize::from(time_ns < start_ns);
        }
    }

    /// Adds steps back, equal times and gaps to the problems, each kind once with its number and extent.
    pub fn tell(&self, problems: &mut Problems) {
        let early = match self.before_start {
            0 => String::new(),
            n => format!(", {n} of them, which lie before the first frame, are left out as warm-up"),
        };
        let back = format!(
            "the clock steps back, by {} at most; the maps start over there, and the {} frames after it are judged at their own times{early}",
            spoken(self.back.longest_s),
            self.after
        );
        problems.add_many(TOPIC, back, self.back.first_ns, self.back.count);
        let gaps = format!(
            "no frames for {} at most; the maps start over after it, and what follows is judged from its first frame on",
            spoken(self.gaps.longest_s)
        );
        problems.add_many(TOPIC, gaps, self.gaps.first_ns, self.gaps.count);
        let equal = "a frame bears the time of the one before; the maps start over there, and both are judged";
        problems.add_many(TOPIC, equal, self.equal.first_ns, self.equal.count);
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
        let times: Vec<i64> = seconds.iter().map(|s| (s * 1e9) as i64).collect();
        let (mut clock, mut problems) = (Clock::default(), Problems::default());
        times.iter().for_each(|time_ns| clock.frame(*time_ns));
        clock.tell(&mut problems);
        problems.iter().map(|p| p.since(times[0])).collect()
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
