//! Flaws of the input, counted by kind with the place of the first.

use std::collections::BTreeMap;
use std::fmt;

/// One kind of flaw: how often it came and where it came first.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Problem {
    pub topic: String,
    pub what: String,
    pub count: u64,
    /// Message time of the first, nanoseconds.
    pub first_time_ns: i64,
}

/// Topics of what is said of all points of a recording, and of its mount.
pub const POINTS: &str = "points";
pub const MOUNT: &str = "mount";

/// All flaws found in one recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Problems(BTreeMap<(String, String), (u64, i64)>);

impl Problems {
    pub fn add(&mut self, topic: &str, what: impl Into<String>, time_ns: i64) {
        self.add_many(topic, what, time_ns, 1);
    }

    pub fn add_many(&mut self, topic: &str, what: impl Into<String>, time_ns: i64, count: u64) {
        if count > 0 {
            self.0.entry((topic.to_owned(), what.into())).or_insert((0, time_ns)).0 += count;
        }
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Causes before what follows from them: what a mount seems to be comes of detections, of which all may be wrong.
    pub fn iter(&self) -> impl Iterator<Item = Problem> + '_ {
        let mut all: Vec<_> = self.0.iter().collect();
        all.sort_by_key(|((topic, _), _)| match topic.as_str() {
            POINTS => 0,
            MOUNT => 2,
            _ => 1,
        });
        all.into_iter().map(|((topic, what), &(count, first_time_ns))| Problem {
            topic: topic.clone(),
            what: what.clone(),
            count,
            first_time_ns,
        })
    }

    /// How often a flaw whose description contains `what` was found.
    pub fn count(&self, what: &str) -> u64 {
        self.0.iter().filter(|((_, w), _)| w.contains(what)).map(|(_, (n, _))| n).sum()
    }
}

impl Problem {
    /// The problem in words, its time counted from the start of the recording.
    pub fn since(&self, start_ns: i64) -> String {
        let seconds = self.first_time_ns.saturating_sub(start_ns) as f64 * 1e-9;
        // of a scan some comes before it is whole
        let first = if seconds < 0.0 {
            format!("{:.3} s before the first frame", -seconds)
        } else {
            format!("at {seconds:.3} s")
        };
        format!("{}: {} ({}x, first {first})", self.topic, self.what, self.count)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.since(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_time_is_negative() {
        let at = |first_time_ns| {
            Problem { topic: "a".into(), what: "b".into(), count: 2, first_time_ns }.since(1_000_000_000)
        };
        assert_eq!(at(1_500_000_000), "a: b (2x, first at 0.500 s)");
        assert_eq!(at(998_000_000), "a: b (2x, first 0.002 s before the first frame)");
    }

    #[test]
    fn causes_stand_before_what_follows_from_them() {
        let mut problems = Problems::default();
        for topic in [MOUNT, "/radar/points", POINTS, "zoo"] {
            problems.add(topic, "wrong", 0);
        }
        let topics: Vec<String> = problems.iter().map(|p| p.topic).collect();
        assert_eq!(topics, [POINTS, "/radar/points", "zoo", MOUNT]);
    }
}
