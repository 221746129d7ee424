//! Scans of a radar out of the messages that bring them: put in order, joined where one scan comes in several, repeats
//! dropped.
//!
//! # Method
//! *Order.* An MCAP file promises none. Where measurement times run backwards, messages are sorted by the times they were
//! logged at if these are in order; times that are exchanged between neighbours though logged in order are sorted, too. A
//! clock that steps back is neither: long pieces then overlap in time, and frames stay as they are.
//!
//! *Joining.* The period is learnt: the gap that half of the time between messages is made of. Messages within
//! `TOGETHER` of it after the first are its scan, if they have the first one's frame and were logged close to it, and if
//! this is the rule in the recording; messages of one stamp always are.
//!
//! *Places without a point.* Clouds of one fixed size have NaN or zero where there is nothing. In clouds whose size
//! follows their points that is a measurement that failed.

use super::points::{NOT_A_RANGE, NOT_FINITE, Points};
use super::problems::Problems;
use super::{Frame, RadarDetection};

/// Part of the period within which messages are of one scan.
const TOGETHER: f64 = 0.2;

/// Stamps that go on more rarely are rounded, perhaps to seconds, or have pauses between: then only messages of one stamp
/// are of one scan, and only if they are logged together.
const SLOWEST_NS: f64 = 250_000_000.0;

/// Part of the period between log times within which they are.
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
    let period = period(&messages);
    let mut groups: Vec<Vec<Message>> = Vec::new();
    let near_ns = period
        .filter(|period| period.ns <= SLOWEST_NS && is_rule(&messages, period.ns))
        .map_or(0.0, |period| TOGETHER * period.ns);
    for message in messages {
        match groups.last_mut().filter(|group| of_one_scan(&group[0], &message, period, near_ns)) {
            Some(group) => group.push(message),
            None => groups.push(vec![message]),
        }
    }
    let frames: Vec<Frame> = groups.into_iter().map(|group| joined(group, topic, problems)).collect();
    refuse_single_points(&frames, topic)?;
    refuse_interleaved(&frames, topic)?;
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
        let ([first, .., last], [start, .., end]) = (before, after) else { return false };
        let (from, to) = (first.time_ns.max(start.time_ns), last.time_ns.min(end.time_ns));
        let within = |m: &&Message| (from..=to).contains(&m.time_ns);
        // the same times again are the same messages again
        let new =
            after.iter().filter(within).filter(|m| before.binary_search_by_key(&m.time_ns, |b| b.time_ns).is_err());
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

/// What is learnt of a topic's times.
#[derive(Debug, Clone, Copy)]
struct Period {
    /// Between scans.
    ns: f64,
    /// Within which the messages of a scan are logged.
    logged_ns: f64,
}

/// The gaps that half of the time between messages is made of.
fn period(messages: &[Message]) -> Option<Period> {
    let of = |time: fn(&Message) -> i64| {
        let gap = |pair: &[Message]| time(&pair[1]).saturating_sub(time(&pair[0]));
        let mut gaps: Vec<i64> = messages.windows(2).map(gap).filter(|gap| (1..=PAUSE_NS).contains(gap)).collect();
        gaps.sort_unstable();
        let half = gaps.iter().sum::<i64>() / 2;
        let mut passed = 0;
        let found = gaps.into_iter().find(|gap| {
            passed += gap;
            passed >= half
        });
        found.map(|gap| gap as f64)
    };
    let ns = of(|m| m.time_ns)?;
    if ns <= SLOWEST_NS {
        return Some(Period { ns, logged_ns: ns });
    }
    let ns = ns.min(of(|m| m.logged_ns).unwrap_or(ns));
    Some(Period { ns, logged_ns: LOGGED_TOGETHER * ns })
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

/// Whether a message is of the scan that another began; stamps nearer than `near_ns` are of one.
fn of_one_scan(first: &Message, message: &Message, period: Option<Period>, near_ns: f64) -> bool {
    let Some(period) = period.filter(|_| first.frame_id == message.frame_id) else { return false };
    let apart = |a: i64, b: i64| a.saturating_sub(b).saturating_abs() as f64;
    let (stamps, logged) = (apart(message.time_ns, first.time_ns), apart(message.logged_ns, first.logged_ns));
    (stamps == 0.0 || stamps < near_ns) && logged < period.logged_ns
}

/// One frame of the messages of a scan.
fn joined(group: Vec<Message>, topic: &str, problems: &mut Problems) -> Frame {
    let time_ns = group.first().map_or(0, |m| m.time_ns);
    let mut frame = Frame { time_ns, detections: Vec::new(), refused: 0, unwanted: Vec::new(), fault: false };
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

/// Refuses scans whose pieces come too far apart to be joined: what stands is found again only some messages later.
fn refuse_interleaved(frames: &[Frame], topic: &str) -> Result<(), String> {
    /// Pieces of a scan, at most.
    const MOST_PIECES: usize = 6;
    const MOST_COMPARED: usize = 60;
    if frames.len() < LEAST_MESSAGES {
        return Ok(());
    }
    let (mut all, mut again) = (0_usize, [0_usize; 2 * MOST_PIECES]);
    let starts = frames.len() - again.len();
    for k in (0..starts).step_by(starts.div_ceil(MOST_COMPARED).max(1)) {
        for d in frames[k].detections.iter().take(MOST_COMPARED) {
            let stands = |other: &RadarDetection| {
                (other.range_m - d.range_m).abs() < 0.5 && (other.azimuth_rad - d.azimuth_rad).abs() < 0.02
            };
            all += 1;
            for (count, later) in again.iter_mut().zip(&frames[k + 1..]) {
                *count += usize::from(later.detections.iter().any(stands));
            }
        }
    }
    let is_period = |pieces: &usize| {
        let (found, twice) = (again[pieces - 1], again[2 * pieces - 1]);
        2 * found >= all && 2 * twice >= all && again[..pieces - 1].iter().all(|between| 3 * between < found)
    };
    match (2..=MOST_PIECES).find(is_period).filter(|_| all >= LEAST_MESSAGES) {
        None => Ok(()),
        Some(pieces) => Err(format!(
            "each scan seems to come in {pieces} messages of {topic} that are too far apart to be joined: what stands is found again only in every {pieces}th. Send one message a scan, or give all points of a scan one stamp"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: i64 = 66_000_000;
    const MS: i64 = 1_000_000;

    fn detection(range_m: f32) -> RadarDetection {
        RadarDetection {
            range_m,
            azimuth_rad: 0.01 * range_m,
            elevation_rad: None,
            radial_velocity_mps: 0.0,
            rcs_dbsm: None,
            snr_db: None,
        }
    }

    fn message(time_ns: i64, logged_ns: i64, detections: &[RadarDetection]) -> Message {
        let points = Points { detections: detections.to_vec(), ..Points::default() };
        Message { time_ns, logged_ns, frame_id: "radar".into(), points }
    }

    /// One message a scan, of six points.
    fn plain() -> Vec<Message> {
        let points = |k: i64| (0..6).map(|n| detection(20.0 + 10.0 * n as f32 + 0.01 * k as f32)).collect::<Vec<_>>();
        (0..120).map(|k| message(PERIOD_NS * k, PERIOD_NS * k + 9 * MS, &points(k))).collect()
    }

    /// Every scan in pieces of so many points, stamped and logged so much apart.
    fn in_pieces(points: usize, stamped_ns: i64, logged_ns: i64) -> Vec<Message> {
        let split = |m: Message| {
            let pieces: Vec<_> = m.points.detections.chunks(points).map(<[_]>::to_vec).collect();
            let at =
                |(k, piece): (i64, Vec<_>)| message(m.time_ns + stamped_ns * k, m.logged_ns + logged_ns * k, &piece);
            (0..).zip(pieces).map(at).collect::<Vec<_>>()
        };
        plain().into_iter().flat_map(split).collect()
    }

    fn twice(messages: Vec<Message>, logged_ns: i64) -> Vec<Message> {
        let both = |m: Message| [m.clone(), Message { logged_ns: m.logged_ns + logged_ns, ..m }];
        messages.into_iter().flat_map(both).collect()
    }

    fn read(messages: Vec<Message>) -> (Vec<Frame>, Vec<String>) {
        let mut problems = Problems::default();
        let frames = assembled(messages, "/points", &mut problems).unwrap();
        (frames, problems.iter().map(|p| format!("{} {}x", p.what, p.count)).collect())
    }

    #[test]
    fn scans_are_the_same_however_messages_bring_them() {
        let (expected, nothing) = read(plain());
        assert_eq!((expected.len(), nothing.len()), (120, 0));
        let mut swapped = plain();
        swapped.chunks_mut(2).for_each(<[_]>::reverse);
        let mut shuffled = plain();
        shuffled.chunks_mut(4).for_each(|four| four.rotate_left(1));
        let mut unlogged = swapped.clone();
        unlogged.iter_mut().for_each(|m| m.logged_ns = 0);
        // logged as they came, with exchanged stamps
        let mut stamps = swapped.clone();
        (0..).zip(&mut stamps).for_each(|(k, m)| m.logged_ns = PERIOD_NS * k);
        let mut halves = plain();
        halves.rotate_left(50);
        let newest_first: Vec<Message> = plain().into_iter().rev().collect();
        for (how, messages, said) in [
            ("swapped", swapped, "not in the order of time"),
            ("shuffled", shuffled, "not in the order of time"),
            ("halves", halves, "not in the order of time"),
            ("newest first", newest_first, "not in the order of time"),
            ("swapped, no log times", unlogged, "in the order of their stamps"),
            ("stamps exchanged", stamps, "in the order of their stamps"),
            ("two pieces of one stamp", in_pieces(3, 0, MS), "joined by their times 120x"),
            ("three pieces", in_pieces(2, 2 * MS, 4 * MS), "joined by their times 120x"),
            ("a point a message", in_pieces(1, 0, 1000), "joined by their times 120x"),
            ("a point a message, half a millisecond apart", in_pieces(1, MS / 2, MS / 2), "joined by their times 120x"),
            ("a point a message, logged as it is measured", in_pieces(1, 0, 11 * MS), "joined by their times 120x"),
            ("each twice", twice(plain(), MS), "repeats another of the same scan, dropped 120x"),
            ("pieces twice", twice(in_pieces(3, MS, MS), 0), "repeats another of the same scan, dropped 240x"),
        ] {
            let (frames, problems) = read(messages);
            assert_eq!(frames.len(), 120, "{how}: {problems:?}");
            assert!(frames == expected, "{how}");
            assert!(problems.iter().any(|p| p.contains(said)), "{how}: {problems:?}");
        }
    }

    #[test]
    fn what_is_one_message_a_scan_stays() {
        let jitter = |k: i64| [0, 11, -9, 4, -12, 7][(k % 6) as usize] * MS;
        let moved = |shift: &dyn Fn(i64) -> i64| -> Vec<Message> {
            let at = |(k, m): (i64, Message)| Message {
                time_ns: m.time_ns + shift(k),
                logged_ns: m.logged_ns + shift(k),
                ..m
            };
            (0..).zip(plain()).map(at).collect()
        };
        let mut coarse = plain();
        coarse.iter_mut().for_each(|m| m.time_ns -= m.time_ns % 1_000_000_000);
        for (how, messages) in [
            ("jitter", moved(&jitter)),
            ("two frames that come together once", moved(&|k| if k == 60 { -60 * MS } else { 0 })),
            (
                "a frame in three lost",
                plain().into_iter().enumerate().filter(|(k, _)| k % 3 > 0).map(|(_, m)| m).collect(),
            ),
            ("bursts with pauses", moved(&|k| k / 12 * 1_900 * MS)),
            ("short bursts with pauses", moved(&|k| k / 5 * 1_900 * MS)),
            ("stamps of whole seconds", coarse),
            ("an hour's pause", moved(&|k| k / 60 * 3_600_000 * MS)),
            ("a clock that steps back by 2 s", moved(&|k| if k >= 60 { -2_010 * MS } else { 0 })),
        ] {
            let (n, times): (usize, Vec<i64>) = (messages.len(), messages.iter().map(|m| m.time_ns).collect());
            let (frames, problems) = read(messages);
            assert_eq!((frames.len(), problems), (n, vec![]), "{how}");
            assert_eq!(frames.iter().map(|f| f.time_ns).collect::<Vec<_>>(), times, "{how}");
        }
    }

    #[test]
    fn single_points_that_come_evenly_are_refused() {
        let error = assembled(in_pieces(1, 11 * MS, 11 * MS), "/points", &mut Problems::default()).unwrap_err();
        assert!(error.contains("one point each") && error.contains("91 times a second"), "{error}");
        // a lone reflector of a fast radar stands still
        let lone = (0..500).map(|k| message(10 * MS * k, 10 * MS * k, &[detection(20.0)])).collect();
        assert!(assembled(lone, "/points", &mut Problems::default()).is_ok());
    }

    #[test]
    fn pieces_too_far_apart_to_be_joined_are_refused() {
        for (points, pieces, apart_ms) in [(3, 2, 25), (3, 2, 33), (2, 3, 22)] {
            let messages = in_pieces(points, apart_ms * MS, apart_ms * MS);
            let error = assembled(messages, "/points", &mut Problems::default()).unwrap_err();
            assert!(error.contains(&format!("come in {pieces} messages of /points")), "{error}");
        }
        // found now and then
        let some = plain().into_iter().enumerate().map(|(k, mut m)| {
            m.points.detections.retain(|d| (d.range_m as usize + 7 * k) % 5 > 1);
            m
        });
        assert!(assembled(some.collect(), "/points", &mut Problems::default()).is_ok());
    }

    #[test]
    fn places_without_a_point_are_refused_measurements_only_where_the_size_follows_the_points() {
        let blank = |nan: u64, zero: u64, size: usize| {
            let mut messages = plain();
            for (k, m) in messages.iter_mut().enumerate() {
                m.points.detections.truncate(size.min(6) - k % 3);
                let taken = m.points.detections.len() as u64;
                let fill = size as u64 - taken;
                (m.points.not_finite, m.points.blank_nan) = (nan * fill, nan * fill);
                (m.points.not_a_range, m.points.blank_zero) = (zero * fill, zero * fill);
            }
            messages
        };
        for (nan, zero) in [(1, 0), (0, 1)] {
            let (frames, problems) = read(blank(nan, zero, 64));
            assert!(frames.iter().all(|f| f.refused == 0 && !f.detections.is_empty()), "{problems:?}");
            assert!(problems[0].contains("place without a point"), "{problems:?}");
            let mut varies = blank(nan, zero, 64);
            varies[7].points.detections.pop();
            assert!(read(varies).0.iter().all(|f| f.refused > 0));
        }
        let mut none = blank(1, 0, 64);
        none.iter_mut().for_each(|m| {
            m.points.detections.clear();
            (m.points.not_finite, m.points.blank_nan) = (64, 64);
        });
        assert!(
            read(none).0.iter().all(|f| f.refused == 64),
            "not one point in all: the radar or its driver is broken"
        );
    }
}
