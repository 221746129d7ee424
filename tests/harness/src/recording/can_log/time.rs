//! Times as logs write them: with a sign or without, with a decimal point or comma, since the start, since 1970 or since
//! the line before.

use super::split_at_letter;

/// Lines at the begin of a log that show what its times count from.
pub const SHOWN: usize = 20_000;

/// No pause between two lines is as long: times above are since a start, seconds.
const LONGEST_PAUSE_S: i64 = 1_000_000;

/// Seconds with or without a fraction, of any number of digits each, in nanoseconds.
pub fn seconds(text: &str) -> Option<i64> {
    decimal(text, 9)
}

/// Microseconds, with or without a fraction, in nanoseconds.
pub fn microseconds(text: &str) -> Option<i64> {
    decimal(text, 3)
}

/// A decimal number times ten to the power of `digits`; what is smaller is cut off.
fn decimal(text: &str, digits: u32) -> Option<i64> {
    plain(text, digits).or_else(|| of_any_form(text, digits))
}

/// A number as nearly all logs have it: a few digits, a point and no more digits than are asked for.
fn plain(text: &str, digits: u32) -> Option<i64> {
    let (whole, fraction) = split_at_letter(text, b'.')?;
    let number = |part: &str| -> Option<i64> {
        let digit = |b: u8| b.is_ascii_digit().then(|| i64::from(b - b'0'));
        part.bytes().try_fold(0, |sum, b| Some(10 * sum + digit(b)?))
    };
    let missing = digits.checked_sub(u32::try_from(fraction.len()).ok()?)?;
    let few = (1..=10).contains(&whole.len()) && !fraction.is_empty() && digits <= 9;
    // at most 10^19 / 10: within 63 bits with nine digits behind the point only up to 9.2 * 10^9
    let whole = number(whole).filter(|whole| few && *whole < 9_000_000_000)?;
    Some(whole * 10_i64.pow(digits) + number(fraction)? * 10_i64.pow(missing))
}

fn of_any_form(text: &str, digits: u32) -> Option<i64> {
    // as python prints what is near 0, and spreadsheets what is large
    if let Some((number, power)) = text.split_once(['e', 'E']) {
        let (power, number): (i32, f64) = (power.parse().ok()?, number.replace(',', ".").parse().ok()?);
        let value = number * 10_f64.powi(power) * 10_f64.powi(digits as i32);
        return (value.abs() < 9e18).then_some(value.round() as i64);
    }
    let (negative, text) = match text.strip_prefix(['-', '\u{2212}']) {
        Some(rest) => (true, rest),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = text.split_once(['.', ',']).unwrap_or((text, "0"));
    let are_digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    if !are_digits(whole) || !are_digits(fraction) {
        return None;
    }
    let fraction = fraction.bytes().chain(std::iter::repeat(b'0')).take(digits as usize);
    let fraction = fraction.fold(0_i64, |sum, digit| 10 * sum + i64::from(digit - b'0'));
    let value = whole.parse::<i64>().ok()?.checked_mul(10_i64.checked_pow(digits)?)?.checked_add(fraction)?;
    Some(if negative { -value } else { value })
}

/// What times count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stamps {
    /// Each is since the line before.
    pub differences: bool,
    now: i64,
}

impl Stamps {
    pub fn new(differences: bool) -> Self {
        Self { differences, now: 0 }
    }

    /// What a log says that has these times.
    pub fn of(times: &[i64]) -> Self {
        Self::new(are_differences(times))
    }

    /// The time of a line that bears this one. Lines whose frame cannot be read pass time, too.
    pub fn at(&mut self, time_ns: i64) -> i64 {
        if !self.differences {
            return time_ns;
        }
        self.now = self.now.saturating_add(time_ns);
        self.now
    }
}

/// Whether times are since the line before (`-t d`). Then they go back again and again, and far behind the greatest of
/// those before: what is out of order in a log of absolute times goes back by a little of what the log lasts, or seldom.
fn are_differences(times: &[i64]) -> bool {
    if times.iter().any(|time| *time < 0 || *time > LONGEST_PAUSE_S * 1_000_000_000) {
        return false;
    }
    let back = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let forward = times.windows(2).filter(|pair| pair[1] > pair[0]).count();
    if times.len() < 8 {
        return match times.first() {
            Some(0) => back > 0,
            _ => back >= 2 && forward > 0,
        };
    }
    // the newest first, which goes back only
    if back < 3.max(times.len() / 500) || 20 * forward < back {
        return false;
    }
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    let [min, middle, max] = [0, sorted.len() / 2, sorted.len() - 1].map(|at| sorted[at]);
    // most pauses are short against the longest; of times that run half lie before the middle
    let seldom = back < times.len() / 20;
    if seldom && 10 * (middle - min) > max - min {
        return false;
    }
    let (mut top, mut behind) = (i64::MIN, 0_i128);
    for time in times {
        top = top.max(*time);
        behind += i128::from(top - time);
    }
    5 * behind > i128::from(max - min) * times.len() as i128
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_every_country_writes_them() {
        for (text, expected) in [
            ("1.5", Some(1_500_000_000)),
            ("1,5", Some(1_500_000_000)),
            ("-1.5", Some(-1_500_000_000)),
            ("-0,25", Some(-250_000_000)),
            ("\u{2212}0.25", Some(-250_000_000)),
            ("+2", Some(2_000_000_000)),
            ("0000000001.0000000019", Some(1_000_000_001)),
            ("1e-05", Some(10_000)),
            ("1,70E+03", Some(1_700_000_000_000)),
            ("", None),
            ("-", None),
            (".5", None),
            ("5.", None),
            ("5.-1", None),
            ("1.000,5", None),
            ("1e400", None),
            ("99999999999999999999.1", None),
            ("9999999999.9", None),
        ] {
            assert_eq!(seconds(text), expected, "{text}");
        }
        assert_eq!((microseconds("12"), microseconds("-12.5"), microseconds("x")), (Some(12_000), Some(-12_500), None));
    }

    /// Times of `scans` scans of `entries` lines 0.3 ms apart, every 70 ms, in milliseconds times 10.
    fn scans(scans: i64, entries: i64) -> Vec<i64> {
        (0..scans).flat_map(|scan| (0..entries).map(move |entry| 700 * scan + 3 * entry)).collect()
    }

    #[test]
    fn times_since_the_line_before_are_told_from_those_that_are_out_of_order() {
        for (count, entries) in [(30, 40), (4, 10), (30, 2), (300, 1)] {
            let absolute: Vec<i64> = scans(count, entries);
            let lines = absolute.len();
            let differences: Vec<i64> =
                absolute.iter().zip([&0].into_iter().chain(&absolute)).map(|(time, before)| time - before).collect();
            // of one line a scan all are equal
            assert_eq!(are_differences(&differences), entries > 1, "{count} of {entries}");
            let halves = [&absolute[lines / 2..], &absolute[..lines / 2]].concat();
            let newest_first: Vec<i64> = absolute.iter().rev().copied().collect();
            let by_scan: Vec<i64> =
                absolute.chunks(entries as usize).flat_map(|scan| scan.iter().rev()).copied().collect();
            let by_four: Vec<i64> = absolute.chunks(4).flat_map(|four| four.iter().rev()).copied().collect();
            for (what, times) in [
                ("in order", absolute),
                ("halves", halves),
                ("newest first", newest_first),
                ("within a scan", by_scan),
                ("by four", by_four),
            ] {
                assert!(!are_differences(&times), "{what}, {count} scans of {entries}");
            }
        }
    }

    #[test]
    fn differences_are_added_up() {
        let mut stamps = Stamps::of(&[70, 1, 69, 2, 68]);
        assert_eq!([70, 1, 69, 2, 68].map(|time| stamps.at(time)), [70, 71, 140, 142, 210]);
        let mut stamps = Stamps::of(&[1500, 1570, 1499]);
        assert_eq!([1500, 1570, 1499].map(|time| stamps.at(time)), [1500, 1570, 1499], "a clock that stepped back");
    }
}
