//! How busy a bus is.

use serde::Serialize;

use super::traffic::{LEAP_US, Traffic};

/// Shares of a bus, 0 to 1.
#[derive(Debug, Clone, Serialize)]
pub struct Load {
    pub name: &'static str,
    /// Of all windows of a second.
    pub load_median: f64,
    /// The worst window of a second.
    pub load_worst: f64,
    /// Every frame counts, status and header too.
    pub frames_per_scan: f64,
    /// Data bytes; on a serial line all of them.
    pub bytes_per_scan: f64,
}

/// Time before the first map, in which a sender is quiet, microseconds.
const QUIET_US: u64 = 400_000;

impl Load {
    pub fn new(traffic: &Traffic) -> Self {
        let begin = traffic.sent.first().map_or(0, |s| s.at.micros()) + QUIET_US;
        let sent: Vec<(u64, f64)> =
            traffic.sent.iter().map(|s| (s.at.micros(), s.duration_s)).filter(|(at, _)| *at >= begin).collect();
        let counted = traffic.sent.iter().filter(|s| s.at.micros() >= begin);
        let (frames, bytes) = counted.fold((0, 0), |(n, b), s| (n + 1, b + s.bytes.len()));
        // a leap of the clock is no time in which the bus was free
        let parts = sent.chunk_by(|a, b| b.0.checked_sub(a.0).is_some_and(|pause| pause <= LEAP_US));
        let mut windows: Vec<f64> = parts.flat_map(windows).collect();
        windows.sort_by(f64::total_cmp);
        let per_scan = |n: usize| n as f64 / traffic.scans.max(1) as f64;
        Self {
            name: traffic.bus.name,
            load_median: windows.get(windows.len() / 2).copied().unwrap_or(0.0),
            load_worst: windows.last().copied().unwrap_or(0.0),
            frames_per_scan: per_scan(frames),
            bytes_per_scan: per_scan(bytes),
        }
    }
}

const WINDOW_US: u64 = 1_000_000;

/// Between the beginnings of two windows, microseconds.
const STEP_US: u64 = 1000;

/// The load of windows of a second, one every millisecond up to the last frame: windows that begin with
/// frames would count dense seconds more often. None of less than a second: a part of a window is no load.
fn windows(sent: &[(u64, f64)]) -> Vec<f64> {
    let (Some((first, _)), Some((last, _))) = (sent.first(), sent.last()) else { return Vec::new() };
    let (mut from, mut to, mut busy) = (0, 0, 0.0);
    let mut windows = Vec::new();
    for begin in (*first..=(*last).saturating_sub(WINDOW_US)).step_by(STEP_US as usize) {
        while let Some((_, more)) = sent.get(to).filter(|(at, _)| *at < begin + WINDOW_US) {
            busy += more;
            to += 1;
        }
        while let Some((_, less)) = sent.get(from).filter(|(at, _)| *at < begin) {
            busy -= less;
            from += 1;
        }
        windows.push(busy);
    }
    windows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_hold_what_begins_within_a_second() {
        // a frame of 10 ms every 100 ms, and a burst in the third second
        let mut sent: Vec<(u64, f64)> = (0..50).map(|k| (k * 100_000, 0.01)).collect();
        sent.extend((0..20).map(|k| (2_500_000 + k * 1000, 0.01)));
        sent.sort_by_key(|s| s.0);
        let windows = windows(&sent);
        assert!((windows[0] - 0.1).abs() < 1e-9);
        let worst = windows.iter().copied().fold(0.0, f64::max);
        assert!((worst - 0.3).abs() < 1e-9, "{worst}");
    }

    #[test]
    fn less_than_a_second_has_no_load() {
        let sent = |last: u64| windows(&[(5_000_000, 0.01), (last, 0.01)]);
        assert_eq!(sent(5_999_999), Vec::<f64>::new());
        assert_eq!(sent(6_000_000).len(), 1);
    }

    #[test]
    fn a_dense_second_counts_as_often_as_any_other() {
        // nine seconds of a frame every 100 ms, one second of a hundred
        let mut sent: Vec<(u64, f64)> = (0..100).map(|k| (k * 100_000, 0.001)).collect();
        sent.extend((0..900).map(|k| (5_000_000 + k * 1000, 0.001)));
        sent.sort_by_key(|s| s.0);
        // a leap of the clock is no time in which the bus was free
        let parts = sent.chunk_by(|a, b| b.0.checked_sub(a.0).is_some_and(|pause| pause <= LEAP_US));
        let mut windows: Vec<f64> = parts.flat_map(windows).collect();
        windows.sort_by(f64::total_cmp);
        assert!((windows[windows.len() / 2] - 0.01).abs() < 1e-9, "the median is of the quiet seconds");
    }
}
