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

    pub fn iter(&self) -> impl Iterator<Item = Problem> + '_ {
        self.0.iter().map(|((topic, what), &(count, first_time_ns))| Problem {
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
        format!("{}: {} ({}x, first at {seconds:.3} s)", self.topic, self.what, self.count)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.since(0))
    }
}
