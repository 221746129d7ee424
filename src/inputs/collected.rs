//! The detections of a scan under way, or the boxes of a picture, each with the sensor's own number for it.

use heapless::Vec;

use crate::camera::boxes::ImageBox;
use crate::frame::detection::Detection;

/// What is collected.
pub trait Entry: Copy {
    /// The weakest are dropped from a full list.
    fn strength(&self) -> i32;
}

impl Entry for Detection {
    fn strength(&self) -> i32 {
        i32::from(Detection::strength(self))
    }
}

/// Of a picture too full the smallest go: what is small hides little.
impl Entry for ImageBox {
    fn strength(&self) -> i32 {
        self.area()
    }
}

/// Up to `N` detections or boxes, the strongest of those offered.
#[derive(Debug, Clone)]
pub(crate) struct Collected<const N: usize, T = Detection> {
    detections: Vec<T, N, u16>,
    /// The radar's numbers in the same order; `None` of what is not to be kept.
    numbers: Vec<Option<u16>, N, u16>,
}

/// What became of a detection offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Added {
    /// There was room.
    Kept,
    /// There was none: the weakest of all was dropped.
    Full,
}

impl<const N: usize, T: Entry> Collected<N, T> {
    pub(crate) const fn new() -> Self {
        Self { detections: Vec::new(), numbers: Vec::new() }
    }

    pub(crate) fn clear(&mut self) {
        self.detections.clear();
        self.numbers.clear();
    }

    /// Takes a detection; in a full list it replaces the weakest if it is stronger.
    pub(crate) fn add(&mut self, number: u16, detection: T) -> Added {
        if self.detections.push(detection).is_ok() {
            let _ = self.numbers.push(Some(number));
            return Added::Kept;
        }
        let weakest = self.detections.iter().enumerate().min_by_key(|(_, d)| Entry::strength(*d));
        if let Some((place, weakest)) = weakest
            && Entry::strength(weakest) < Entry::strength(&detection)
            && let (Some(d), Some(n)) = (self.detections.get_mut(place), self.numbers.get_mut(place))
        {
            (*d, *n) = (detection, Some(number));
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

    /// Marks a detection as not to be kept.
    pub(crate) fn reject(&mut self, place: usize) {
        if let Some(number) = self.numbers.get_mut(place) {
            *number = None;
        }
    }

    /// Drops what was rejected; the order stays.
    pub(crate) fn finish(&mut self) {
        let mut numbers = self.numbers.iter();
        self.detections.retain(|_| numbers.next().is_some_and(Option::is_some));
        self.numbers.retain(Option::is_some);
    }

    pub(crate) fn get_mut(&mut self, place: usize) -> Option<&mut T> {
        self.detections.get_mut(place)
    }

    pub(crate) fn detections(&self) -> &[T] {
        &self.detections
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::angle::Angle;
    use std::vec::Vec as StdVec;

    fn detection(snr: i16) -> Detection {
        Detection {
            range_cm: 1000,
            azimuth: Angle::ZERO,
            elevation: None,
            radial_velocity_cm_s: 0,
            rcs_half_dbsm: None,
            snr_half_db: Some(snr),
        }
    }

    fn strengths<const N: usize>(c: &Collected<N>) -> StdVec<i16> {
        c.detections().iter().map(Detection::strength).collect()
    }

    #[test]
    fn the_strongest_stay_under_their_numbers() {
        let mut c = Collected::<3>::new();
        let added: StdVec<Added> =
            [(7, 20), (8, 50), (9, 30), (10, 10), (11, 60)].map(|(n, s)| c.add(n, detection(s))).into();
        assert_eq!(added, [Added::Kept, Added::Kept, Added::Kept, Added::Full, Added::Full]);
        assert_eq!(strengths(&c), [60, 50, 30]);
        assert_eq!((c.place(11, 0), c.place(9, 0), c.place(7, 0)), (Some(0), Some(2), None));
    }

    #[test]
    fn the_rejected_go_and_the_rest_keeps_its_order() {
        let mut c = Collected::<8>::new();
        for (n, s) in [(1, 10), (2, 20), (3, 30), (4, 40)] {
            c.add(n, detection(s));
        }
        c.reject(0);
        c.reject(2);
        assert_eq!(c.place(1, 0), None);
        c.finish();
        assert_eq!(strengths(&c), [20, 40]);
        assert_eq!(c.place(4, 0), Some(1));
    }
}
