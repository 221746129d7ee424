//! How azimuths divide a view: columns from right to left, those of one stretch narrower than the others.
//!
//! # Model
//! A radar beside a road looks 60 degrees to each side, and the far road lies within ten: there a degree is metres, and
//! nearly all vehicles are. Columns of a stretch may so be narrower, a whole number of times, in the same memory.
//! Everything is counted in *units*, the width of a narrow column: another column has as many as the stretch is times
//! narrower. From bearings to units and back is one multiplication and one division, as with columns that are all
//! alike; from units to columns is a sum. Where all are alike a unit is a column.
//!
//! With 4 times as many columns per degree within ten degrees, the shadow of a car 150 m away has an edge right to 1 m instead of
//! 2.6, and the columns beside are 1.5 degrees wide, 1.6 m at 60 m.
//!
//! Twice as many columns all over would do little more, for twice the memory and more than a message carries.

use crate::fixed::angle::Angle;

/// Columns of a stretch that are narrower than the others, a whole number of times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Narrow {
    /// The first of them, from the right.
    first: u8,
    /// The first one behind them.
    end: u8,
    /// How many of them are as wide as one of the others, less one: a map of no sensor is zeros, which cost no flash.
    beyond_one: u8,
}

/// How far to each side of where the far road lies columns are narrow: ten degrees, 2^-16 turn.
const HALF_WIDTH: i32 = 1820;

/// Most times narrower, so that places of all columns on the wire fit into 32 bits.
const MOST_TIMES: u8 = 4;

impl Narrow {
    /// All are alike.
    pub const NONE: Self = Self { first: 0, end: 0, beyond_one: 0 };

    /// Four times narrower within ten degrees of where the far road lies, from the first column's right edge.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // at most 255 columns
    pub(crate) fn towards(far_road: Angle, span: u16, columns: usize) -> Self {
        let (span, columns) = (i32::from(span).max(1), columns.min(255) as i32);
        let times = i32::from(MOST_TIMES);
        let edge = |side: i32| (i32::from(far_road.raw()) + side * HALF_WIDTH).max(0).min(span);
        let (right, left) = (edge(-1), edge(1));
        // a stretch of w has n columns if w / n, times over, is what the others have of the rest
        let wide = left - right;
        let number = rounded(wide * columns * times, span + (times - 1) * wide);
        let units = (columns - number) * times + number;
        let first = rounded(right * units, times * span).min(columns - number);
        if number == 0 || number >= columns {
            return Self::NONE;
        }
        Self { first: first as u8, end: (first + number) as u8, beyond_one: MOST_TIMES - 1 }
    }

    /// That of three numbers as a header has them; none if no sender says these of so many columns.
    pub fn from_bytes([first, end, times]: [u8; 3], columns: u8) -> Option<Self> {
        let holds = first < end && end <= columns && (2..=MOST_TIMES).contains(&times);
        holds.then(|| Self { first, end, beyond_one: times.saturating_sub(1) })
    }

    /// First column, first one behind, how many times narrower.
    pub fn to_bytes(self) -> [u8; 3] {
        [self.first, self.end, self.beyond_one.saturating_add(1)]
    }

    /// Units of so many columns together.
    pub fn units(self, columns: usize) -> i32 {
        self.unit(i32::try_from(columns).unwrap_or(0) << 8) >> 8
    }

    /// From 2^-8 columns to 2^-8 units.
    pub fn unit(self, place: i32) -> i32 {
        let [first, end] = self.limits();
        // `clamp` can panic
        let within = place.max(first).min(end) - first;
        (place - within) * self.times() + within
    }

    /// From 2^-8 units to 2^-8 columns, rounded down.
    pub fn place(self, unit: i32) -> i32 {
        let [first, end] = self.limits();
        let times = self.times();
        let within = (unit - first * times).max(0).min(end - first);
        (unit - within).div_euclid(times) + within
    }

    fn times(self) -> i32 {
        i32::from(self.beyond_one) + 1
    }

    fn limits(self) -> [i32; 2] {
        [i32::from(self.first) << 8, i32::from(self.end.max(self.first)) << 8]
    }
}

fn rounded(numerator: i32, denominator: i32) -> i32 {
    (numerator + denominator / 2) / denominator.max(1)
}

/// The columns of a view. Grid and map round alike.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Columns {
    /// Width of all together, 2^-16 turn.
    pub span: u16,
    /// How many they are.
    pub number: usize,
    /// Which are narrower.
    pub narrow: Narrow,
}

impl Columns {
    /// All alike.
    pub fn even(span: u16, number: usize) -> Self {
        Self { span, number, narrow: Narrow::NONE }
    }

    /// Place of a bearing, 2^-8 units from the first one's right edge; negative or beyond the last one's left edge
    /// outside.
    #[inline]
    pub fn unit(self, from_origin: Angle) -> i32 {
        i32::from(from_origin.raw()) * (self.narrow.units(self.number) * 64) / (i32::from(self.span) / 4).max(1)
    }

    /// The same in 2^-8 columns.
    #[inline]
    pub fn place(self, from_origin: Angle) -> i32 {
        self.narrow.place(self.unit(from_origin))
    }

    /// The column of a bearing; none outside.
    #[inline]
    pub fn column(self, from_origin: Angle) -> Option<usize> {
        usize::try_from(self.place(from_origin) >> 8).ok().filter(|column| *column < self.number)
    }

    /// The column of a bearing, that of the nearer edge outside: a map of a pitched sensor reaches beyond its view's
    /// edges.
    pub fn nearest(self, from_origin: Angle) -> usize {
        let last = self.number.saturating_sub(1);
        self.column(from_origin).unwrap_or(if from_origin.raw() < 0 { 0 } else { last })
    }

    /// Bearing of a place of 2^-8 columns, from the first one's right edge.
    #[allow(clippy::cast_possible_truncation)] // at most a turn; angles wrap
    pub fn bearing(self, place: i32) -> Angle {
        let units = (self.narrow.units(self.number) * 64).max(1);
        Angle::from_raw((self.narrow.unit(place) * (i32::from(self.span) / 4) / units) as i16)
    }

    /// Bearing of a column's middle, from the first one's right edge, to the last bit.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // at most a turn; angles wrap
    pub fn middle(self, column: usize) -> Angle {
        let place = i32::try_from(column).map_or(0, |column| column << 8 | 128);
        let turns = i64::from(self.narrow.unit(place)) * i64::from(self.span);
        let units = i64::from(self.narrow.units(self.number)) << 8;
        Angle::from_raw(turns.checked_div(units).unwrap_or(0) as u16 as i16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const SPAN: u16 = 22_211; // 122 degrees

    fn columns(far_road_deg: f32) -> Columns {
        // from 61 degrees to the right on
        let narrow = Narrow::towards(Angle::from_degrees(far_road_deg + 61.0), SPAN, 120);
        Columns { span: SPAN, number: 120, narrow }
    }

    /// Degrees from the sensor's heading.
    fn degrees(angle: Angle) -> f32 {
        angle.radians().to_degrees() - 61.0
    }

    #[test]
    fn columns_are_four_times_narrower_within_ten_degrees_of_the_far_road_and_fill_the_view() {
        for far_road in [-45.0, -20.0, 0.0, 7.0, 45.0_f32] {
            let c = columns(far_road);
            let edges: Vec<f32> = (0..=120).map(|k| degrees(c.bearing(k << 8))).collect();
            assert!((edges[0] + 61.0).abs() < 0.02 && (edges[120] - 61.0).abs() < 0.02, "{far_road}: {edges:?}");
            let widths: Vec<f32> = edges.windows(2).map(|e| e[1] - e[0]).collect();
            let unit = 122.0 / c.narrow.units(120) as f32;
            let [first, end, times] = c.narrow.to_bytes();
            for (k, width) in (0..).zip(&widths) {
                let expected = if (first..end).contains(&k) { unit } else { 4.0 * unit };
                assert!((width - expected).abs() < 0.02, "{far_road}, {k}: {width} degrees, not {expected}");
            }
            assert_eq!(times, 4);
            let [right, left] = [first, end].map(|k| edges[usize::from(k)]);
            // whole columns beside them: half of one, 1.5 degrees wide, and of one within
            assert!(
                (right - (far_road - 10.0)).abs() < 0.9 && (left - (far_road + 10.0)).abs() < 0.9,
                "{right} {left}"
            );
        }
    }

    #[test]
    fn a_far_road_at_the_edge_of_the_view_or_beyond_takes_what_there_is() {
        let c = columns(-58.0);
        let [first, end, _] = c.narrow.to_bytes();
        assert_eq!(first, 0);
        assert!((degrees(c.bearing(i32::from(end) << 8)) + 48.0).abs() < 0.9);
        let c = columns(60.0);
        assert_eq!(c.narrow.to_bytes()[1], 120);
        assert_eq!(columns(80.0).narrow, Narrow::NONE);
        // a view that is all far road
        assert_eq!(Narrow::towards(Angle::from_degrees(9.0), 3277, 64), Narrow::NONE);
    }

    #[test]
    fn bearings_lie_in_the_column_whose_edges_are_around_them() {
        for far_road in [-45.0, 0.0, 7.0, 59.0_f32] {
            let c = columns(far_road);
            for raw in (0..SPAN).step_by(7) {
                let bearing = Angle::from_raw(raw as i16);
                let column = c.column(bearing).unwrap();
                let edges = [column, column + 1].map(|k| c.bearing((k as i32) << 8).raw() as u16);
                assert!(edges[0] <= raw + 1 && raw <= edges[1] + 1, "{far_road}: {raw} in column {column}, {edges:?}");
                assert!((c.place(c.bearing(c.place(bearing))) - c.place(bearing)).abs() <= 8);
            }
            for k in 0..120 {
                assert_eq!(c.column(c.middle(k)), Some(k), "middles stay in their column");
                assert!((c.middle(k) - c.bearing((k as i32) << 8 | 128)).raw().abs() <= 4);
            }
            assert_eq!((c.column(Angle::from_raw(-9)), c.nearest(Angle::from_raw(-9))), (None, 0));
            assert_eq!(c.nearest(Angle::from_raw(SPAN as i16 + 9)), 119);
        }
    }

    #[test]
    fn columns_that_are_alike_are_where_they_always_were() {
        let c = Columns::even(SPAN, 120);
        for raw in (-3000..25_000_i32).step_by(11) {
            let expected = raw * (120 * 64) / (i32::from(SPAN) / 4);
            assert_eq!(c.place(Angle::from_raw(raw as i16)), expected);
        }
        for k in 0..120 {
            assert_eq!(i32::from(c.bearing(k * 256).raw()), k * 256 * (i32::from(SPAN) / 4) / (120 * 64));
            assert_eq!(u64::from(c.middle(k as usize).raw() as u16), (2 * k as u64 + 1) * u64::from(SPAN) / 240);
        }
    }

    #[test]
    fn what_no_sender_says_is_none() {
        for bytes in [[5, 5, 4], [6, 5, 4], [0, 121, 4], [0, 5, 1], [0, 5, 0], [0, 5, 5]] {
            assert_eq!(Narrow::from_bytes(bytes, 120), None, "{bytes:?}");
        }
        let widest = Narrow::from_bytes([0, 1, 4], 128).unwrap();
        let c = Columns { span: 32_768, number: 128, narrow: widest };
        // the largest numbers there are fit
        assert_eq!(c.column(Angle::from_raw(i16::MAX)), Some(127));
        assert_eq!(c.bearing(128 << 8).raw() as u16, 32_768);
    }
}
