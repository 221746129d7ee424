//! The detections of a scan under way, or the boxes of a picture, each with the sensor's own number for it.

use heapless::Vec;

use crate::camera::boxes::ImageBox;
use crate::frame::detection::Detection;
use crate::frame::thinning::Thinning;

/// What is collected.
pub trait Entry: Copy {
    /// What is counted of those that came before in the scan.
    type Counts: Clone + core::fmt::Debug;
    /// Before the first.
    const NO_COUNTS: Self::Counts;
    /// What decides who stays in a full list: the greatest.
    type Priority: Ord + Copy + core::fmt::Debug;

    /// Its priority, as the next to arrive.
    fn priority(&self, counts: &mut Self::Counts) -> Self::Priority;

    /// Marks it as left out by the sensor's own marks.
    fn mark(&mut self);
}

impl Entry for Detection {
    type Counts = Thinning;
    const NO_COUNTS: Thinning = Thinning::NEW;
    type Priority = u8;

    fn priority(&self, counts: &mut Thinning) -> u8 {
        counts.priority(self)
    }

    fn mark(&mut self) {
        self.marked = true;
    }
}

/// Of a picture too full the smallest go: what is small hides little.
impl Entry for ImageBox {
    type Counts = ();
    const NO_COUNTS: () = ();
    type Priority = i32;

    fn priority(&self, (): &mut ()) -> i32 {
        self.area()
    }

    /// Detectors have no such marks.
    fn mark(&mut self) {}
}

/// Up to `N` detections or boxes, those of the greatest [priority](Entry::priority), in order of arrival.
#[derive(Debug, Clone)]
pub(crate) struct Collected<const N: usize, T: Entry = Detection> {
    detections: Vec<T, N, u16>,
    /// The radar's numbers in the same order; `None` of what is left out.
    numbers: Vec<Option<u16>, N, u16>,
    priorities: Vec<T::Priority, N, u16>,
    counts: T::Counts,
}

/// What became of a detection offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Added {
    /// There was room.
    Kept,
    /// There was none: the one of the least priority was dropped, of equals the last.
    Full,
}

impl<const N: usize, T: Entry> Collected<N, T> {
    pub(crate) const fn new() -> Self {
        Self { detections: Vec::new(), numbers: Vec::new(), priorities: Vec::new(), counts: T::NO_COUNTS }
    }

    pub(crate) fn clear(&mut self) {
        self.detections.clear();
        self.numbers.clear();
        self.priorities.clear();
        self.counts = T::NO_COUNTS;
    }

    /// Takes a detection; in a full list it takes the room of the last of those of the least priority, if its own is greater.
    pub(crate) fn add(&mut self, number: u16, detection: T) -> Added {
        let priority = detection.priority(&mut self.counts);
        if !self.detections.is_full() {
            let _ = self.detections.push(detection);
            let _ = self.numbers.push(Some(number));
            let _ = self.priorities.push(priority);
            return Added::Kept;
        }
        let least = self.priorities.iter().enumerate().rev().min_by_key(|(_, priority)| **priority);
        if let Some((place, _)) = least.filter(|(_, least)| **least < priority) {
            replace(&mut self.detections, place, detection);
            replace(&mut self.numbers, place, Some(number));
            replace(&mut self.priorities, place, priority);
        }
        Added::Full
    }

    /// Where the detection of a number lies. Radars repeat their order, so the search begins at `from`.
    pub(crate) fn place(&self, number: u16, from: usize) -> Option<usize> {
        if self.numbers.get(from) == Some(&Some(number)) {
            return Some(from);
        }
        self.numbers.iter().position(|n| *n == Some(number))
    }

    /// Marks a detection as left out.
    pub(crate) fn reject(&mut self, place: usize) {
        if let Some(number) = self.numbers.get_mut(place) {
            *number = None;
        }
        if let Some(detection) = self.detections.get_mut(place) {
            detection.mark();
        }
    }

    /// Brings what was left out behind the rest, whose order stays.
    pub(crate) fn finish(&mut self) {
        let mut wanted = 0;
        for (place, number) in self.numbers.iter().enumerate() {
            if number.is_some() {
                exchange(&mut self.detections, wanted, place);
                wanted += 1;
            }
        }
    }

    /// What is not left out, once finished.
    pub(crate) fn wanted(&self) -> &[T] {
        self.detections.get(..self.numbers.iter().flatten().count()).unwrap_or(&[])
    }

    pub(crate) fn get_mut(&mut self, place: usize) -> Option<&mut T> {
        self.detections.get_mut(place)
    }

    pub(crate) fn detections(&self) -> &[T] {
        &self.detections
    }
}

/// Takes an element out; those behind it move up, and `last` comes behind them. Unlike `remove` and `push`, cannot panic.
fn replace<E>(list: &mut [E], place: usize, last: E) {
    let mut moved = last;
    for element in list.iter_mut().skip(place).rev() {
        moved = core::mem::replace(element, moved);
    }
}

/// Exchanges two elements. Unlike `swap`, cannot panic.
fn exchange<E: Copy>(list: &mut [E], a: usize, b: usize) {
    let (Some(at_a), Some(at_b)) = (list.get(a).copied(), list.get(b).copied()) else { return };
    for (place, element) in [(a, at_b), (b, at_a)] {
        if let Some(there) = list.get_mut(place) {
            *there = element;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use crate::frame::scan::tests::gathered;
    use std::vec::Vec as StdVec;

    /// Of this strength, from a place of its own.
    fn detection(snr: i16) -> Detection {
        Detection {
            range_cm: 1000 + 300 * snr.unsigned_abs(),
            azimuth: Angle::ZERO,
            elevation: None,
            radial_velocity_cm_s: 0,
            rcs_half_dbsm: None,
            snr_half_db: Some(snr),
            marked: false,
        }
    }

    fn strengths<const N: usize>(c: &Collected<N>) -> StdVec<i16> {
        c.detections().iter().filter_map(Detection::strength).collect()
    }

    #[test]
    fn the_strongest_of_places_of_their_own_stay_under_their_numbers_in_the_order_they_arrived_in() {
        let mut c = Collected::<3>::new();
        let added: StdVec<Added> =
            [(7, 20), (8, 50), (9, 30), (10, 10), (11, 60)].map(|(n, s)| c.add(n, detection(s))).into();
        assert_eq!(added, [Added::Kept, Added::Kept, Added::Kept, Added::Full, Added::Full]);
        assert_eq!(strengths(&c), [50, 30, 60]);
        assert_eq!((c.place(11, 0), c.place(9, 0), c.place(7, 0)), (Some(2), Some(1), None));
    }

    /// What a list that fills while detections arrive keeps is what one that sees them all at once does, where all pass the gate.
    #[test]
    fn a_list_that_fills_keeps_what_a_scan_of_all_keeps() {
        let mut state = 1_u32;
        let mut draw = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        for frame in 0..50 {
            let all: StdVec<Detection> = (0..20 + 5 * frame)
                .map(|_| Detection {
                    // few places, and few strengths
                    range_cm: 1000 + 250 * draw(12) as u16,
                    azimuth: Angle::from_degrees(draw(5) as f32),
                    snr_half_db: Some(20 + 10 * draw(5) as i16),
                    ..detection(0)
                })
                .collect();
            let mut collected = Collected::<32>::new();
            all.iter().for_each(|d| _ = collected.add(0, *d));
            let scan = |from: &[Detection]| StdVec::from(gathered::<32>(from).reflections());
            assert_eq!(scan(collected.detections()), scan(&all), "frame {frame}");
            assert_eq!(collected.detections().len(), all.len().min(32));
        }
    }

    #[test]
    fn the_next_scan_begins_with_empty_places() {
        let mut c = Collected::<2>::new();
        for _ in 0..2 {
            c.clear();
            [20, 20, 20, 30].iter().for_each(|s| _ = c.add(0, detection(*s)));
            assert_eq!((strengths(&c), &c.priorities[..]), (std::vec![20, 30], &[116, 126][..]));
        }
    }

    #[test]
    fn what_is_left_out_comes_behind_the_rest_which_keeps_its_order() {
        let mut c = Collected::<8>::new();
        for (n, s) in [(1, 10), (2, 20), (3, 30), (4, 40)] {
            c.add(n, detection(s));
        }
        c.reject(0);
        c.reject(2);
        assert_eq!(c.place(1, 0), None);
        c.finish();
        assert_eq!(strengths(&c)[..2], [20, 40]);
        assert_eq!(c.wanted().iter().filter_map(Detection::strength).collect::<StdVec<_>>(), [20, 40]);
        assert_eq!(c.detections().iter().map(|d| d.marked).collect::<StdVec<_>>(), [false, false, true, true]);
    }
}
