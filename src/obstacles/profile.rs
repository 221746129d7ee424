//! Where along its heading an obstacle reflects: a fading histogram whose ends are its length.
//!
//! Reflection points sit at bumpers, axles and corners. Counted in the moving frame of their
//! obstacle they draw its outline within seconds, and a stray detection is outvoted.

/// Bins of the histogram.
pub const BINS: usize = 48;
/// Length of a bin, centimetres.
pub const BIN_CM: i32 = 50;
/// Bins that hold one end of a vehicle: its bumper, lamps and nearest axle.
const END_BINS: usize = 5;
/// Shortest and longest outline of a car that shows both its ends, bins: 2.5 to 6 m.
const CAR_BINS: [i32; 2] = [5, 12];
/// Narrowest and widest gap between cars taken for one vehicle, bins: 1.5 m, which is less than what they keep when they
/// stand, for noise fills a part of it, to 7 m, which is what still joins two parts.
const GAP_BINS: [i32; 2] = [3, 14];
/// One hit, in the histogram's unit.
pub const HIT: i32 = 64;

/// Largest content of a bin; the whole histogram is halved when one passes it.
const FULL: i32 = 0x7FFF;

/// Hits along the heading, centred on the anchor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Profile {
    bins: [u16; BINS],
}

/// Rear and front end relative to the anchor, centimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Rear end.
    pub rear_cm: i32,
    /// Front end.
    pub front_cm: i32,
}

impl Extent {
    /// Distance between the ends.
    pub fn length_cm(&self) -> i32 {
        self.front_cm - self.rear_cm
    }

    /// Middle between the ends.
    pub fn middle_cm(&self) -> i32 {
        (self.front_cm + self.rear_cm) / 2
    }

    /// How far a place lies beyond either end; 0 between them.
    pub fn beyond_cm(&self, along_cm: i32) -> i32 {
        (along_cm - self.front_cm).max(self.rear_cm - along_cm).max(0)
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // 48 bins of at most 2^15
impl Profile {
    /// No hits.
    pub const EMPTY: Self = Self { bins: [0; BINS] };

    /// Counts a hit; outside the histogram nothing happens.
    pub fn add(&mut self, along_cm: i32) {
        self.pour(along_cm, HIT);
    }

    fn pour(&mut self, along_cm: i32, amount: i32) {
        let bin = along_cm.div_euclid(BIN_CM) + BINS as i32 / 2;
        let Some(slot) = usize::try_from(bin).ok().and_then(|b| self.bins.get_mut(b)) else { return };
        let sum = i32::from(*slot) + amount;
        *slot = sum.min(0xFFFF) as u16;
        if sum > FULL {
            for b in &mut self.bins {
                *b /= 2;
            }
        }
    }

    /// Where the hits have their centre, centimetres; `None` without any.
    pub fn mean_cm(&self) -> Option<i32> {
        let (mut total, mut moment) = (0, 0);
        for (hits, bin) in self.bins.iter().zip(-(BINS as i32) / 2..) {
            total += i32::from(*hits);
            moment += i32::from(*hits) * bin;
        }
        Some((moment * BIN_CM).checked_div(total)? + BIN_CM / 2)
    }

    /// Fades every bin by a factor in 2^-16.
    pub fn fade(&mut self, factor: i32) {
        let factor = factor.clamp(0, 1 << 16).unsigned_abs();
        for b in &mut self.bins {
            *b = ((u32::from(*b) * factor) >> 16) as u16;
        }
    }

    /// The outermost places with enough support: a group of `END_BINS` bins with at least `min_hits`
    /// (of [`HIT`]) and at least `share` (2^-8) of all hits, and in it two neighbours with half of
    /// that. Young profiles get by with 40 % of what they have.
    pub fn extent(&self, min_hits: i32, share: i32) -> Option<Extent> {
        let sum = |part: &[u16]| part.iter().map(|b| i32::from(*b)).sum::<i32>();
        // most bins are empty
        let begin = self.bins.iter().position(|b| *b > 0)?;
        let end = self.bins.iter().rposition(|b| *b > 0)? + 1;
        let held = self.bins.get(begin..end).unwrap_or(&[]);
        let total = sum(held);
        let needed = min_hits.min(total * 2 / 5).max((total * share) >> 8).max(1);
        let group = |i: usize| self.bins.get(i..i + END_BINS).unwrap_or(&[]);
        // the first group's last bin, and the last group's first
        let first = (begin + filling(held.iter(), needed)?).saturating_sub(END_BINS - 1);
        let last = end.checked_sub(1 + filling(held.iter().rev(), needed)?)?.min(BINS - END_BINS);
        let first = first + group(first).windows(2).position(|p| 2 * sum(p) >= needed)?;
        let last = last + group(last).windows(2).rposition(|p| 2 * sum(p) >= needed)?;
        Some(Extent { rear_cm: self.centre_of_pair(first), front_cm: self.centre_of_pair(last) })
    }

    /// Whether an outline falls into parts that are all as long as a car, with gaps between them that are as wide as
    /// cars leave. A car may show its ends alone, so a gap within one tells nothing; the first place that is too far behind a
    /// car's front to be its rear is the next car's. Bins with less than a tenth of the mean are empty.
    pub fn is_a_row_of_cars(&self, extent: &Extent) -> bool {
        let bin = |along: i32| usize::try_from(along.div_euclid(BIN_CM) + BINS as i32 / 2).unwrap_or(0);
        let held = self.bins.get(bin(extent.rear_cm)..=bin(extent.front_cm).min(BINS - 1)).unwrap_or(&[]);
        let (total, count) = (held.iter().map(|b| i32::from(*b)).sum::<i32>(), held.len() as i32);
        let mut filled = (0..).zip(held).filter(|(_, b)| i32::from(**b) * 10 * count >= total).map(|(i, _)| i);
        let Some(mut begin) = filled.next() else { return false };
        let (mut end, mut cars) = (begin, 0);
        let is_car = |begin: i32, end: i32| end + 1 - begin >= CAR_BINS[0];
        for i in filled {
            if i - begin >= CAR_BINS[1] {
                if !is_car(begin, end) || !(GAP_BINS[0]..=GAP_BINS[1]).contains(&(i - end - 1)) {
                    return false;
                }
                cars += 1;
                begin = i;
            }
            end = i;
        }
        cars > 0 && is_car(begin, end)
    }

    /// Centre of gravity of the bins `i` and `i + 1`, centimetres from the anchor.
    fn centre_of_pair(&self, i: usize) -> i32 {
        let [a, b] = match self.bins.get(i..i + 2) {
            Some(&[a, b]) => [i32::from(a), i32::from(b)],
            _ => [1, 1],
        };
        (i as i32 - BINS as i32 / 2) * BIN_CM + BIN_CM / 2 + b * BIN_CM / (a + b).max(1)
    }

    /// Moves the anchor forward by whole bins.
    pub fn shift(&mut self, bins: i32) {
        let mut moved = [0; BINS];
        for (i, to) in moved.iter_mut().enumerate() {
            let from = i as i32 + bins;
            *to = usize::try_from(from).ok().and_then(|f| self.bins.get(f)).copied().unwrap_or(0);
        }
        self.bins = moved;
    }

    /// Adds another profile whose anchor lies `offset_cm` ahead of this one's.
    pub fn merge(&mut self, other: &Self, offset_cm: i32) {
        for (i, &amount) in other.bins.iter().enumerate() {
            if amount > 0 {
                let along = (i as i32 - BINS as i32 / 2) * BIN_CM + BIN_CM / 2 + offset_cm;
                self.pour(along, i32::from(amount));
            }
        }
    }
}

/// Place of the bin with which `END_BINS` neighbours first hold enough.
fn filling<'a>(bins: impl Iterator<Item = &'a u16> + Clone, needed: i32) -> Option<usize> {
    let mut leaving = bins.clone();
    let mut held = 0;
    bins.enumerate().position(|(i, b)| {
        if i >= END_BINS {
            held -= leaving.next().map_or(0, |b| i32::from(*b));
        }
        held += i32::from(*b);
        held >= needed
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn profile(hits: &[(i32, usize)]) -> Profile {
        let mut p = Profile::EMPTY;
        for &(along, n) in hits {
            for _ in 0..n {
                p.add(along);
            }
        }
        p
    }

    #[test]
    fn a_car_is_as_long_as_its_bumpers_are_apart() {
        let e = profile(&[(-230, 20), (210, 30)]).extent(96, 13).unwrap();
        assert!((e.rear_cm + 225).abs() <= 25 && (e.front_cm - 225).abs() <= 25, "{e:?}");
        assert_eq!(e.beyond_cm(e.front_cm + 70), 70);
        assert_eq!(e.beyond_cm(e.rear_cm - 30), 30);
        assert_eq!(e.beyond_cm(0), 0);
    }

    #[test]
    fn its_centre_is_where_most_of_it_reflects() {
        assert_eq!(Profile::EMPTY.mean_cm(), None);
        let mean = |hits: &[(i32, usize)]| profile(hits).mean_cm().unwrap();
        assert!((mean(&[(-600, 30), (600, 10)]) + 300).abs() <= 25, "three of four at the rear");
        assert!((mean(&[(-600, 10), (600, 30)]) - 300).abs() <= 25, "at the front");
        let full: Vec<(i32, usize)> = (0..24).map(|k| (1175 - k * 50, 511)).collect();
        assert!((mean(&full) - 600).abs() <= 25, "as many as there is room for");
    }

    fn row(places: &[i32]) -> bool {
        let hits: Vec<(i32, usize)> = places.iter().map(|x| (*x, 40)).collect();
        let whole = Extent { rear_cm: places[0], front_cm: *places.last().unwrap() };
        let (all, with_a_stray) = (profile(&hits), profile(&[&hits[..], &[(0, 1)]].concat()));
        assert_eq!(all.is_a_row_of_cars(&whole), with_a_stray.is_a_row_of_cars(&whole), "one stray fills no gap");
        all.is_a_row_of_cars(&whole)
    }

    #[test]
    fn a_row_of_cars_is_parts_as_long_as_cars_with_gaps_as_between_cars() {
        let two_cars = [-610, -500, -390, -260, -160, 160, 260, 390, 500, 610];
        assert!(row(&two_cars), "3.2 m apart");
        let three = [-1010, -900, -790, -660, -260, -150, -30, 90, 200, 520, 640, 750, 860];
        assert!(row(&three));
        assert!(row(&[-710, -690, -240, -210, 240, 260, 690, 710]), "four ends, as far apart as a car's: two cars");
        assert!(!row(&[-710, -690, -240, -210, 240, 260]), "two ends and one");
        assert!(!row(&[-610, -500, -390, -260, -160, -30, 90, 160, 260, 390, 500, 610]), "it reflects all along");
        assert!(!row(&[-610, -560, 560, 610]), "a lorry that shows only its ends");
        assert!(!row(&[-810, -700, -590, -460, 360, 460, 590, 700]), "8 m apart");
        assert!(!row(&[-610, -500, -390, -260, -160, 160, 210]), "a trailer and what draws it");
        assert!(!row(&[-1010, -900, -790, -660, -540, -430, -300, -190, 160, 260, 390, 500, 610]), "8.5 m and a car");
        assert!(!row(&[-230, -100, 20, 130, 230]), "one car");
    }

    #[test]
    fn a_stray_hit_does_not_lengthen() {
        let e = profile(&[(-230, 20), (210, 30), (900, 1)]).extent(96, 13).unwrap();
        assert!(e.front_cm < 300, "{e:?}");
    }

    #[test]
    fn a_young_profile_has_an_extent_at_once() {
        assert!(profile(&[(0, 1)]).extent(96, 13).is_some());
        assert_eq!(Profile::EMPTY.extent(96, 13), None);
    }

    #[test]
    fn shifting_moves_the_anchor_forward() {
        let mut p = profile(&[(200, 10)]);
        p.shift(4);
        let e = p.extent(96, 13).unwrap();
        assert!(e.middle_cm().abs() <= 25, "{e:?}");
    }

    #[test]
    fn merging_places_the_other_ahead() {
        let mut p = profile(&[(0, 10)]);
        p.merge(&profile(&[(0, 10)]), 600);
        let e = p.extent(96, 13).unwrap();
        assert!((e.length_cm() - 600).abs() <= 50, "{e:?}");
    }

    #[test]
    fn a_full_bin_halves_all_and_keeps_the_shape() {
        let mut p = profile(&[(-230, 300), (210, 700)]);
        p.fade(60_000);
        let e = p.extent(96, 13).unwrap();
        assert!((e.length_cm() - 440).abs() <= 50, "{e:?}");
    }
}
