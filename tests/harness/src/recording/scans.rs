//! Scans of a radar out of the messages that bring them: put in order, joined where one scan comes in several, repeats
//! dropped.
//!
//! # Method
//! *Order.* An MCAP file promises none. Where measurement times run backwards, messages are sorted by the times they were
//! logged at if these are in order; times that are exchanged between neighbours though logged in order are sorted, too. A
//! clock that steps back is neither: long pieces then overlap in time, and frames stay as they are.
//!
//! *Joining.* The period is learnt: the gap that half of the time between messages is made of. Messages within
//! [`TOGETHER`] of it after the first are its scan, if they have the first one's frame and were logged close to it, and if
//! this is the rule in the recording; messages of one stamp always are.
//!
//! *Places without a point.* Clouds of one fixed size have NaN or zero where there is nothing. In clouds whose size
//! follows their points that is a measurement that failed.

use super::points::{NOT_A_RANGE, NOT_FINITE, Points};
use super::problems::Problems;
use super::{Frame, RadarDetection};

/// Part of the period within which messages are of one scan.
const TOGETHER: f64 = 0.2;

/// Part of the period within which messages of one scan are logged.
const LOGGED_TOGETHER: f64 = 0.5;

/// A longer gap between messages is a pause, nanoseconds.
const PAUSE_NS: i64 = 2_000_000_000;

/// Messages of one ascending run from which on what overlaps is a clock that stepped back, not a file out of order.
const LONG_RUN: usize = 30;

/// Places that a message whose time is exchanged may be off its own.
const EXCHANGED: usize = 8;

/// Messages before something is said of all of them.
const LEAST_MESSAGES: usize = 100;

/// A message of a radar's topic.
#[derive(Debug, Clone)]
pub struct Message {
    /// Measurement time.
    pub time_ns: i64,
    pub logged_ns: i64,
    /// Of its header.
    pub frame_id: String,
    pub points: Points,
}

/// The scans of a topic's messages.
///
/// # Errors
/// One scan comes in several messages that cannot be told from the next one's.
pub fn assembled(messages: Vec<Message>, topic: &str, problems: &mut Problems) -> Result<Vec<Frame>, String> {
    let messages = in_order(messages, topic, problems);
    let messages = without_blanks(messages, topic, problems);
    note_frames(&messages, topic, problems);
    let period_ns = period(&messages);
    let mut groups: Vec<Vec<Message>> = Vec::new();
    let near = period_ns.filter(|period| is_rule(&messages, *period));
    for message in messages {
        match groups.last_mut().filter(|group| of_one_scan(&group[0], &message, period_ns, near)) {
            Some(group) => group.push(message),
            None => groups.push(vec![message]),
        }
    }
    let frames: Vec<Frame> = groups.into_iter().map(|group| joined(group, topic, problems)).collect();
    refuse_single_points(&frames, topic)?;
    Ok(frames)
}

/// Messages of several headers' frames are told: there is one mount.
fn note_frames(messages: &[Message], topic: &str, problems: &mut Problems) {
    let Some(first) = messages.first() else { return };
    for other in messages.iter().filter(|m| m.frame_id != first.frame_id) {
        let what = format!(
            "message of frame `{}` among those of `{}`: all are taken for one radar's, at the mount of the first",
            other.frame_id, first.frame_id
        );
        problems.add(topic, what, other.time_ns);
    }
}

/// How often time runs backwards.
fn steps_back(messages: &[Message]) -> u64 {
    messages.windows(2).filter(|pair| pair[1].time_ns < pair[0].time_ns).count() as u64
}

/// Messages in the order of their times, where they are not, and it is no clock that stepped back.
fn in_order(messages: Vec<Message>, topic: &str, problems: &mut Problems) -> Vec<Message> {
    let back = steps_back(&messages);
    if back == 0 || is_step_of_clock(&messages) {
        return messages;
    }
    let first = messages.windows(2).find(|pair| pair[1].time_ns < pair[0].time_ns).map_or(0, |pair| pair[1].time_ns);
    let mut order: Vec<usize> = (0..messages.len()).collect();
    order.sort_by_key(|&k| messages[k].logged_ns);
    let left = order.windows(2).filter(|pair| messages[pair[1]].time_ns < messages[pair[0]].time_ns).count() as u64;
    let mut messages = messages;
    if left < back {
        let what = "message not in the order of time in the file; all are read in the order they were logged in, as `mcap sort` would write them";
        problems.add_many(topic, what, first, back);
        messages = permuted(messages, &order);
    }
    let left = left.min(back);
    // a few are a clock's
    if left == 0 || (left as usize).saturating_mul(LONG_RUN) < messages.len() {
        return messages;
    }
    let mut order: Vec<usize> = (0..messages.len()).collect();
    order.sort_by_key(|&k| messages[k].time_ns);
    if order.iter().enumerate().all(|(to, &from)| to.abs_diff(from) <= EXCHANGED) {
        let what = "stamp earlier than that of the message before, which was logged earlier; all are read in the order of their stamps";
        problems.add_many(topic, what, first, left);
        messages = permuted(messages, &order);
    }
    messages
}

/// The messages in this order of their places.
fn permuted(messages: Vec<Message>, order: &[usize]) -> Vec<Message> {
    let mut places: Vec<Option<Message>> = messages.into_iter().map(Some).collect();
    order.iter().filter_map(|&k| places.get_mut(k).and_then(Option::take)).collect()
}

/// Whether long runs of ascending times overlap: the clock was set back while it went on measuring.
fn is_step_of_clock(messages: &[Message]) -> bool {
    let runs: Vec<&[Message]> = messages.chunk_by(|a, b| a.time_ns <= b.time_ns).collect();
    if messages.len() < LONG_RUN * runs.len() {
        return false;
    }
    let overlap = |before: &[Message], after: &[Message]| {
        let (Some(end), Some(start)) = (before.last(), after.first()) else { return false };
        let within = |m: &&Message| m.time_ns >= start.time_ns && m.time_ns <= end.time_ns;
        // the same times again are the same messages again
        let new = after.iter().filter(within).filter(|m| before.binary_search_by_key(&m.time_ns, |b| b.time_ns).is_err());
        new.count() >= 2 && before.iter().filter(within).count() >= 2
    };
    runs.windows(2).any(|pair| overlap(pair[0], pair[1]))
}

/// Takes places without a point out of what was refused, in clouds of a fixed size.
fn without_blanks(mut messages: Vec<Message>, topic: &str, problems: &mut Problems) -> Vec<Message> {
    let size = messages.first().map_or(0, |m| m.points.places());
    let is_fixed = messages.len() > 1 && messages.iter().all(|m| m.points.places() == size);
    if is_fixed && messages.iter().any(|m| !m.points.detections.is_empty()) {
        for m in &mut messages {
            let Points { blank_nan, blank_zero, not_finite, not_a_range, .. } = &mut m.points;
            *not_finite -= *blank_nan;
            *not_a_range -= *blank_zero;
            let what = "place without a point (NaN or zero throughout) in clouds of a fixed size, left out";
            problems.add_many(topic, what, m.time_ns, *blank_nan + *blank_zero);
        }
    }
    for m in &messages {
        problems.add_many(topic, NOT_FINITE, m.time_ns, m.points.not_finite);
        problems.add_many(topic, NOT_A_RANGE, m.time_ns, m.points.not_a_range);
    }
    messages
}

/// The gap that half of the time between messages is made of, by their stamps or when they were logged, whichever is
/// shorter; nanoseconds.
fn period(messages: &[Message]) -> Option<f64> {
    let of = |time: fn(&Message) -> i64| {
        let gap = |pair: &[Message]| time(&pair[1]).saturating_sub(time(&pair[0]));
        let mut gaps: Vec<i64> = messages.windows(2).map(gap).filter(|gap| (1..=PAUSE_NS).contains(gap)).collect();
        gaps.sort_unstable();
        let half = gaps.iter().sum::<i64>() / 2;
        let mut passed = 0;
        gaps.into_iter().find(|gap| {
            passed += gap;
            passed >= half
        })
    };
    let (stamps, logged) = (of(|m| m.time_ns), of(|m| m.logged_ns));
    stamps.map(|stamps| stamps.min(logged.unwrap_or(i64::MAX)) as f64)
}

/// Whether messages come in groups a period apart, many of them of several messages.
fn is_rule(messages: &[Message], period_ns: f64) -> bool {
    let mut starts: Vec<i64> = Vec::new();
    if messages.len() < 2 {
        return false;
    }
    for m in messages {
        let within = |start: &i64| (m.time_ns.saturating_sub(*start) as f64) < TOGETHER * period_ns;
        if !starts.last().is_some_and(within) {
            starts.push(m.time_ns);
        }
    }
    let apart = |pair: &[i64]| pair[1].saturating_sub(pair[0]) as f64 / period_ns;
    let regular = starts.windows(2).filter(|pair| (0.5..=2.0).contains(&apart(pair))).count();
    let joined = messages.len() - starts.len();
    joined * 10 >= starts.len() && regular * 10 >= (starts.len() - 1) * 6
}

/// Whether a message is of the scan that another began.
fn of_one_scan(first: &Message, message: &Message, period_ns: Option<f64>, near: Option<f64>) -> bool {
    let Some(period_ns) = period_ns.filter(|_| first.frame_id == message.frame_id) else { return false };
    let apart = |a: i64, b: i64| a.saturating_sub(b).saturating_abs() as f64;
    let (stamps, logged) = (apart(message.time_ns, first.time_ns), apart(message.logged_ns, first.logged_ns));
    let together = stamps == 0.0 || near.is_some_and(|period_ns| stamps < TOGETHER * period_ns);
    together && logged < LOGGED_TOGETHER * period_ns
}

/// One frame of the messages of a scan.
fn joined(group: Vec<Message>, topic: &str, problems: &mut Problems) -> Frame {
    let time_ns = group.first().map_or(0, |m| m.time_ns);
    let mut frame = Frame { time_ns, detections: Vec::new(), refused: 0, fault: false };
    let (mut taken, mut pieces): (Vec<Vec<RadarDetection>>, u64) = (Vec::new(), 0);
    for m in group {
        let Points { detections, not_finite, not_a_range, .. } = m.points;
        if taken.contains(&detections) {
            problems.add(topic, "message that repeats another of the same scan, dropped", m.time_ns);
            continue;
        }
        frame.refused += not_finite + not_a_range;
        frame.detections.extend_from_slice(&detections);
        taken.push(detections);
        pieces += 1;
    }
    if pieces > 1 {
        let what = "scan that comes in several messages, joined by their times";
        problems.add(topic, what, time_ns);
    }
    frame
}

/// Refuses messages of one point each that come too fast to be scans.
fn refuse_single_points(frames: &[Frame], topic: &str) -> Result<(), String> {
    /// Radars of traffic scan 10 to 30 times a second, nanoseconds.
    const FASTEST_NS: i64 = 12_500_000;
    let single = frames.iter().filter(|f| f.detections.len() == 1).count();
    if frames.len() < LEAST_MESSAGES || single * 10 < frames.len() * 9 {
        return Ok(());
    }
    let fast = frames.windows(2).filter(|pair| pair[1].time_ns.saturating_sub(pair[0].time_ns) < FASTEST_NS).count();
    let range = |f: &Frame| f.detections.first().map_or(0.0, |d| d.range_m);
    let elsewhere = frames.windows(2).filter(|pair| (range(&pair[0]) - range(&pair[1])).abs() > 3.0).count();
    if fast * 10 < frames.len() * 9 || elsewhere * 2 < frames.len() {
        return Ok(());
    }
    let seconds = match frames {
        [first, .., last] => last.time_ns.saturating_sub(first.time_ns) as f64 * 1e-9,
        _ => return Ok(()),
    };
    Err(format!(
        "the messages of {topic} have one point each and come {:.0} times a second: each scan is in many messages, and nothing tells where it ends. Send one message a scan, or give all points of a scan one stamp",
        frames.len() as f64 / seconds.max(1e-3)
    ))
}
