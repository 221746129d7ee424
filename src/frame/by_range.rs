//! A frame's reflections in bins of range, so that one looks only at those around a place.

use crate::frame::reflection::Reflection;

/// Bins of range.
const BINS: usize = 128;
/// Reflections around one that are looked at: a crowd is a cluster long before.
pub const MOST_AROUND: usize = 32;

/// Where a reflection is, centimetres in the levelled frame, and its place in the scan.
#[derive(Debug, Clone, Copy)]
pub struct Located {
    /// Along the levelled frame's axis.
    pub x_cm: i32,
    /// To its left.
    pub y_cm: i32,
    /// Its place in the scan.
    pub index: u16,
}

/// The places of up to `D` reflections, nearest bin first, in order of arrival within a bin.
pub struct ByRange<const D: usize> {
    places: [Located; D],
    /// Where each bin begins in `places`, and where the last ends.
    begins: [u16; BINS + 1],
    bin_cm: i32,
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // bins and lists are short
impl<const D: usize> ByRange<D> {
    /// Sorts by counting: two passes over the reflections.
    pub fn sort(reflections: &[Reflection], limit_cm: i32) -> Self {
        let mut sorted = Self {
            places: [Located { x_cm: 0, y_cm: 0, index: 0 }; D],
            begins: [0; BINS + 1],
            bin_cm: (limit_cm / BINS as i32).max(1),
        };
        for r in reflections {
            let bin = sorted.bin(i32::from(r.ground_cm));
            if let Some(n) = sorted.begins.get_mut(bin + 1) {
                *n += 1;
            }
        }
        let mut sum = 0;
        for n in &mut sorted.begins {
            sum += *n;
            *n = sum;
        }
        let mut next = sorted.begins;
        for (i, r) in reflections.iter().enumerate() {
            let Some(at) = next.get_mut(sorted.bin(i32::from(r.ground_cm))) else { continue };
            if let Some(slot) = sorted.places.get_mut(usize::from(*at)) {
                *slot = Located { x_cm: r.x_cm, y_cm: r.y_cm, index: i as u16 };
            }
            *at += 1;
        }
        sorted
    }

    fn bin(&self, ground_cm: i32) -> usize {
        (ground_cm.max(0) / self.bin_cm.max(1)).min(BINS as i32 - 1) as usize
    }

    /// All reflections between two distances, and some around them.
    pub fn between(&self, from_cm: i32, to_cm: i32) -> &[Located] {
        let begin = self.begins.get(self.bin(from_cm)).copied().unwrap_or(0);
        let end = self.begins.get(self.bin(to_cm) + 1).copied().unwrap_or(0);
        self.places.get(usize::from(begin)..usize::from(end)).unwrap_or(&[])
    }

    /// Whether so many of the reflections that count, itself included, lie no farther than `reach_cm` from reflection
    /// `r` on either axis. Looks at no more than [`MOST_AROUND`] of them.
    pub fn is_one_of(&self, many: usize, reach_cm: i32, r: &Reflection, counts: impl Fn(usize) -> bool) -> bool {
        let ground = i32::from(r.ground_cm);
        // what is no farther on either axis is no farther than 3/2 of it along the ground
        let reach_along = 3 * reach_cm / 2;
        let around = self.between(ground - reach_along, ground + reach_along).iter().take(MOST_AROUND);
        // one comparison for both sides
        let (corner, side) = ((r.x_cm - reach_cm, r.y_cm - reach_cm), 2 * reach_cm.unsigned_abs());
        let within = |v: i32, corner: i32| v.wrapping_sub(corner).cast_unsigned() <= side;
        let mut close =
            around.filter(|p| within(p.y_cm, corner.1) && within(p.x_cm, corner.0) && counts(usize::from(p.index)));
        many == 0 || close.nth(many - 1).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::trig::Direction;
    use std::vec::Vec;

    #[test]
    fn a_reflection_is_one_of_those_that_lie_close_to_it_and_count() {
        let at = |x_cm: i32, y_cm: i32| Reflection {
            x_cm,
            y_cm,
            ground_cm: crate::fixed::math::length(x_cm, y_cm) as u16,
            sight: Direction::AHEAD,
            radial_velocity_cm_s: 0,
            across_cm: 1,
            height_cm: None,
            rcs_half_dbsm: None,
        };
        // the fourth is as far away as the others, in another direction
        let all = [at(3000, 4000), at(3290, 4000), at(3000, 3710), at(4000, 3000), at(3000, 4310)];
        let sorted = ByRange::<8>::sort(&all, 22_500);
        let is_one_of = |many, i: usize| sorted.is_one_of(many, 300, &all[i], |_| true);
        assert!(is_one_of(3, 0) && !is_one_of(4, 0));
        assert!(is_one_of(1, 3) && !is_one_of(2, 3));
        assert!(!is_one_of(2, 4), "3.1 m from the first");
        assert!(!sorted.is_one_of(3, 300, &all[0], |i| i != 2), "one that does not count");
    }

    #[test]
    fn every_reflection_in_the_interval_is_found_once() {
        let ranges = [5_000, 19_999, 300, 5_100, 22_400, 40_000, 12_000];
        let reflections: Vec<Reflection> = ranges
            .iter()
            .map(|&ground_cm: &u16| Reflection {
                x_cm: i32::from(ground_cm),
                y_cm: 0,
                ground_cm,
                sight: Direction::AHEAD,
                radial_velocity_cm_s: 0,
                across_cm: 1,
                height_cm: None,
                rcs_half_dbsm: None,
            })
            .collect();
        let sorted = ByRange::<8>::sort(&reflections, 22_500);
        let indices = |from, to| -> Vec<u16> { sorted.between(from, to).iter().map(|p| p.index).collect() };
        let all = indices(0, 50_000);
        assert_eq!(all.len(), 7);
        assert_eq!(all[0], 2);
        let near = indices(4_000, 6_000);
        assert!(near.contains(&0) && near.contains(&3) && !near.contains(&1), "{near:?}");
        assert_eq!(sorted.between(30_000, 31_000).len(), 2, "what is beyond the limit is in the last bin");
    }
}
