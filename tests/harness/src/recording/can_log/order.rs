//! The order of time in a log: how far its lines are from it, and what brings them into it.
//!
//! Tools that sort by bus, join files, write from several threads or show the newest first leave lines that are right and
//! in a wrong order. A step back may also be a clock that was set: then the lines are in order and their times are not.
//! The two are told apart by whether the times of the parts overlap.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::Line;

/// Lines that are farther from their place than this are of another part of the log, nanoseconds.
const LOCAL_NS: i64 = 2_000_000_000;

/// Where hardly any line is out of order, a step back of this is one of the clock or between parts, nanoseconds.
const STEP_NS: i64 = 20_000_000;

/// A pause that another part of the log may fill, nanoseconds: more than from one scan to the next.
const PAUSE_NS: i64 = 150_000_000;

/// Stretches that are kept apart.
const MOST_SPANS: usize = 100_000;

/// What is known of the times of one bus.
#[derive(Debug, Clone, Default)]
pub struct Track {
    pub lines: u64,
    pub min: i64,
    pub max: i64,
    /// Steps back of any size, and forward.
    back: u64,
    forward: u64,
    /// Lines behind the latest so far.
    behind: u64,
    first: i64,
    last: i64,
    coarse: Parts,
    fine: Parts,
}

/// Parts between steps back of at least some size.
#[derive(Debug, Clone, Default)]
struct Parts {
    count: u64,
    /// First and last time of each stretch of a part without a pause.
    spans: Vec<[i64; 2]>,
    /// The latest time of this part.
    top: i64,
    /// How far behind the latest of its part a line comes, at most.
    lag: i64,
}

impl Parts {
    fn see(&mut self, time: i64, step: i64) {
        if self.count == 0 || time < self.top.saturating_sub(step) {
            self.count += 1;
            self.top = time;
            self.add([time, time]);
            return;
        }
        self.lag = self.lag.max(self.top.saturating_sub(time));
        self.top = self.top.max(time);
        match self.spans.last_mut() {
            Some([first, last]) if time <= last.saturating_add(PAUSE_NS) => {
                (*first, *last) = ((*first).min(time), (*last).max(time));
            }
            _ => self.add([time, time]),
        }
    }

    fn add(&mut self, span: [i64; 2]) {
        let spans = self.spans.len();
        match self.spans.last_mut() {
            Some([first, last]) if spans >= MOST_SPANS => {
                (*first, *last) = ((*first).min(span[0]), (*last).max(span[1]));
            }
            _ => self.spans.push(span),
        }
    }

    /// Whether two stretches share more than `step` of time.
    fn overlap(&self, step: i64) -> bool {
        let mut spans = self.spans.clone();
        spans.sort_unstable();
        let mut top = i64::MIN;
        spans.iter().any(|[first, last]| {
            let within = *first < top.saturating_sub(step);
            top = top.max(*last);
            within
        })
    }
}

impl Track {
    pub fn see(&mut self, time: i64) {
        if self.lines == 0 {
            (self.min, self.max, self.first, self.last) = (time, time, time, time);
        }
        self.lines += 1;
        self.back += u64::from(time < self.last);
        self.behind += u64::from(time < self.max);
        self.forward += u64::from(time > self.last);
        (self.min, self.max, self.last) = (self.min.min(time), self.max.max(time), time);
        self.coarse.see(time, LOCAL_NS);
        self.fine.see(time, STEP_NS);
    }

    /// All of it lies in the order of time.
    fn is_sorted(&self) -> bool {
        self.back == 0
    }

    /// Times fall from line to line, but for a few.
    pub fn falls(&self) -> bool {
        self.back > 9 * self.forward && self.lines > 2 && self.last < self.first
    }

    /// Parts where the times step back far; or at all, where they do so seldom and stay there: single lines are late.
    fn parts(&self) -> (&Parts, i64) {
        let seldom = self.back <= 2.max(self.lines / 2000) && self.behind > 4 * self.back;
        let few = seldom && self.fine.count < 64;
        if few { (&self.fine, STEP_NS) } else { (&self.coarse, LOCAL_NS) }
    }

    /// What brings the lines into order.
    fn order(&self) -> Order {
        let (parts, step) = self.parts();
        match parts.count {
            0 | 1 => Order::Near { lag: parts.lag, step },
            n if parts.overlap(step) && n < self.lines / 20 => Order::ClockSet { lag: parts.lag, step },
            _ => Order::Parts,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    /// Lines are at most `lag` behind their place.
    Near { lag: i64, step: i64 },
    /// The clock was set back, by more than `step`.
    ClockSet { lag: i64, step: i64 },
    /// Parts of the log, or all lines, are in another order than that of time.
    Parts,
}

/// What is known of the times of a log.
#[derive(Debug, Clone, Default)]
pub struct Survey {
    pub all: Track,
    pub buses: BTreeMap<String, Track>,
}

/// How a log is to be read, so that the lines of each bus come in the order of time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Plan {
    /// As it stands.
    AsItIs,
    /// Held back until none that belongs before can come: all together or, where buses have clocks of their own, by bus.
    HeldBack { together: bool },
    /// All lines are to be sorted.
    Sorted,
}

/// What is wrong with the order of one bus.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Disorder {
    /// Lines that step back, and by how much at most.
    Near(u64, i64),
    NewestFirst,
    /// Parts.
    Parts(u64),
    /// Times it was set.
    ClockSet(u64),
}

impl Survey {
    pub fn see(&mut self, line: &Line) {
        self.all.see(line.time_ns);
        match self.buses.get_mut(&line.interface) {
            Some(track) => track.see(line.time_ns),
            None => self.buses.entry(line.interface.clone()).or_default().see(line.time_ns),
        }
    }

    pub fn plan(&self) -> Plan {
        let orders = || self.buses.values().map(Track::order);
        if orders().any(|order| order == Order::Parts) {
            return Plan::Sorted;
        }
        if self.all.is_sorted() {
            return Plan::AsItIs;
        }
        // where each bus is in order, whatever lies between two buses is their clocks'
        let each = self.buses.values().all(Track::is_sorted);
        match self.all.order() {
            Order::Near { .. } => Plan::HeldBack { together: true },
            _ if each => Plan::AsItIs,
            _ => Plan::HeldBack { together: false },
        }
    }

    /// What is to be said of each bus.
    pub fn disorders(&self) -> Vec<(&str, Disorder)> {
        let of = |(name, track): (&'_ String, &'_ Track)| -> Option<Disorder> {
            let _ = name;
            match track.order() {
                _ if track.is_sorted() => None,
                _ if track.falls() => Some(Disorder::NewestFirst),
                Order::Near { lag, .. } => Some(Disorder::Near(track.back, lag)),
                Order::ClockSet { .. } => Some(Disorder::ClockSet(track.parts().0.count.saturating_sub(1))),
                Order::Parts => Some(Disorder::Parts(track.parts().0.count)),
            }
        };
        self.buses.iter().filter_map(|(name, track)| Some((name.as_str(), of((name, track))?))).collect()
    }

    /// The lines come in the order of a list whose newest is on top.
    fn falls(&self) -> bool {
        self.all.falls() || (!self.buses.is_empty() && self.buses.values().all(Track::falls))
    }

    /// All lines of a log, in order.
    pub fn sort(&self, lines: &mut [Line]) {
        if self.falls() {
            lines.reverse();
        }
        lines.sort_by_key(|line| line.time_ns);
    }

    /// Holds lines back as the plan says.
    pub fn held_back(&self, together: bool) -> HeldBack {
        let queue = |track: &Track| match track.order() {
            Order::Near { lag, step } | Order::ClockSet { lag, step } => Queue::new(lag, step, self.falls()),
            Order::Parts => Queue::new(0, LOCAL_NS, false),
        };
        if together {
            return HeldBack { all: Some(queue(&self.all)), buses: BTreeMap::new() };
        }
        HeldBack { all: None, buses: self.buses.iter().map(|(name, track)| (name.clone(), queue(track))).collect() }
    }
}

/// Lines that wait for those before them.
pub struct HeldBack {
    all: Option<Queue>,
    buses: BTreeMap<String, Queue>,
}

impl HeldBack {
    pub fn push(&mut self, line: Line, out: &mut dyn FnMut(&Line)) {
        match self.all.as_mut().or_else(|| self.buses.get_mut(&line.interface)) {
            Some(queue) => queue.push(line, out),
            None => out(&line),
        }
    }

    /// There is no more.
    pub fn end(mut self, out: &mut dyn FnMut(&Line)) {
        self.all.iter_mut().chain(self.buses.values_mut()).for_each(|queue| queue.flush(out));
    }
}

struct Queue {
    lag: i64,
    step: i64,
    newest_first: bool,
    top: i64,
    count: i64,
    heap: BinaryHeap<Reverse<Waiting>>,
}

struct Waiting {
    key: (i64, i64),
    line: Line,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

impl Queue {
    fn new(lag: i64, step: i64, newest_first: bool) -> Self {
        Self { lag, step, newest_first, top: i64::MIN, count: 0, heap: BinaryHeap::new() }
    }

    fn push(&mut self, line: Line, out: &mut dyn FnMut(&Line)) {
        if line.time_ns < self.top.saturating_sub(self.step) {
            self.flush(out);
            self.top = line.time_ns;
        }
        self.top = self.top.max(line.time_ns);
        self.count += 1;
        let key = (line.time_ns, if self.newest_first { -self.count } else { self.count });
        self.heap.push(Reverse(Waiting { key, line }));
        // of those of one time the last may still come
        let due = self.top.saturating_sub(self.lag).saturating_sub(i64::from(self.newest_first));
        while self.heap.peek().is_some_and(|Reverse(first)| first.key.0 <= due) {
            if let Some(Reverse(first)) = self.heap.pop() {
                out(&first.line);
            }
        }
    }

    fn flush(&mut self, out: &mut dyn FnMut(&Line)) {
        while let Some(Reverse(first)) = self.heap.pop() {
            out(&first.line);
        }
    }
}
