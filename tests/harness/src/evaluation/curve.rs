//! The trade-off between false visible and false invisible as the threshold on the grade moves.
//!
//! # Model
//! At threshold t something is visible iff its grade is known and >= t. FVR falls with t, FIR rises;
//! t = 0 calls everything known visible, t = 256 nothing. A sensor's map with one setting is one
//! point; choosing at random between two settings reaches every point of the chord between theirs,
//! so what can be had is the lower convex hull of all settings ([`Envelope`]).

use std::ops::{Deref, DerefMut};

use serde::Serialize;

/// Grades 0..=255, and one place for unknown.
pub const GRADE_SLOTS: usize = 257;

/// How often each grade was given where the truth says visible, and where it says not.
///
/// Truth: detected or not for objects, in sight or blocked for cells.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Grades {
    pub positive: Slots,
    pub negative: Slots,
}

/// A count for each grade. Of frames most are empty, and take no memory.
#[derive(Debug, Clone, Default)]
pub struct Slots(Option<Box<[u64; GRADE_SLOTS]>>);

impl Deref for Slots {
    type Target = [u64; GRADE_SLOTS];

    fn deref(&self) -> &Self::Target {
        self.0.as_deref().unwrap_or(&[0; GRADE_SLOTS])
    }
}

impl DerefMut for Slots {
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.0.get_or_insert_with(|| Box::new([0; GRADE_SLOTS]))
    }
}

impl PartialEq for Slots {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Eq for Slots {}

impl Grades {
    /// `grade` is `None` where unknown: not visible at any threshold.
    pub fn add(&mut self, truth: bool, grade: Option<u8>) {
        let slots = if truth { &mut self.positive } else { &mut self.negative };
        slots[grade.map_or(GRADE_SLOTS - 1, usize::from)] += 1;
    }

    pub fn add_times(&mut self, other: &Self, n: u64) {
        for (mine, theirs) in [(&mut self.positive, &other.positive), (&mut self.negative, &other.negative)] {
            if theirs.0.is_none() {
                continue;
            }
            mine.iter_mut().zip(theirs.iter()).for_each(|(a, b)| *a += b * n);
        }
    }

    pub fn is_empty(&self) -> bool {
        self.positive.iter().chain(self.negative.iter()).all(|&n| n == 0)
    }

    /// The grades in use, sparsely: slot (positive first, then negative) and count.
    pub fn sparse(&self) -> Vec<(u16, u64)> {
        (0_u16..).zip(self.positive.iter().chain(self.negative.iter()).copied()).filter(|&(_, n)| n > 0).collect()
    }

    pub fn add_sparse(&mut self, sparse: &[(u16, u64)], n: u64) {
        for &(slot, count) in sparse {
            let slot = usize::from(slot);
            match slot.checked_sub(GRADE_SLOTS) {
                None => self.positive[slot] += count * n,
                Some(slot) => self.negative[slot] += count * n,
            }
        }
    }
}

/// One setting of the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Visible from this grade on, 0 to 256.
    pub threshold: u16,
    pub fvr: f64,
    pub fir: f64,
}

/// The curve over all thresholds, only where it moves; empty where a rate has nothing to divide by.
pub fn trade_off(grades: &Grades) -> Vec<CurvePoint> {
    let total = |slots: &[u64; GRADE_SLOTS]| slots.iter().sum::<u64>();
    let (positives, negatives) = (total(&grades.positive), total(&grades.negative));
    if positives == 0 || negatives == 0 {
        return Vec::new();
    }
    let unknown = GRADE_SLOTS - 1;
    let mut visible_negatives = negatives - grades.negative[unknown];
    let mut hidden_positives = grades.positive[unknown];
    let mut points: Vec<CurvePoint> = Vec::new();
    for threshold in 0..GRADE_SLOTS {
        if let Some(below) = threshold.checked_sub(1) {
            visible_negatives -= grades.negative[below];
            hidden_positives += grades.positive[below];
        }
        let fvr = visible_negatives as f64 / negatives as f64;
        let fir = hidden_positives as f64 / positives as f64;
        if points.last().is_none_or(|p| (p.fvr, p.fir) != (fvr, fir)) {
            points.push(CurvePoint { threshold: threshold as u16, fvr, fir });
        }
    }
    points
}

/// Lower convex hull of points (FIR, FVR), the two trivial maps included: all visible (0, 1) and
/// nothing visible (1, 0).
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope(Vec<(f64, f64)>);

impl Envelope {
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut points: Vec<_> = points.into_iter().chain([(0.0, 1.0), (1.0, 0.0)]).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut hull: Vec<(f64, f64)> = Vec::new();
        for p in points {
            while let [.., a, b] = hull[..] {
                // b above or on the chord from a to p
                if (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) <= 0.0 {
                    hull.pop();
                } else {
                    break;
                }
            }
            // of points under one another the lowest came first
            if hull.last().is_none_or(|last| last.0 < p.0) {
                hull.push(p);
            }
        }
        Self(hull)
    }

    /// FVR to be had at this FIR, by interpolation.
    pub fn fvr_at(&self, fir: f64) -> f64 {
        let next = self.0.partition_point(|p| p.0 < fir);
        match (next.checked_sub(1).map(|i| self.0[i]), self.0.get(next)) {
            (Some(a), Some(&b)) => a.1 + (fir - a.0) / (b.0 - a.0) * (b.1 - a.1),
            (None, Some(&b)) => b.1,
            (Some(a), None) => a.1,
            (None, None) => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grades_that_were_never_given_take_no_memory() {
        let mut grades = Grades::default();
        grades.add_times(&Grades::default(), 3);
        assert!(grades.is_empty() && grades.positive.0.is_none() && grades.negative.0.is_none());
        grades.add(true, Some(200));
        assert_eq!((grades.positive[200], grades.positive[0], grades.negative[200]), (1, 0, 0));
        assert!(grades.negative.0.is_none() && grades != Grades::default());
    }

    #[test]
    fn a_higher_threshold_never_makes_more_visible() {
        let mut grades = Grades::default();
        for k in 0..1000_u32 {
            let grade = (k.wrapping_mul(2_654_435_761) >> 20) % 300;
            grades.add(k % 3 != 0, u8::try_from(grade).ok());
        }
        let curve = trade_off(&grades);
        assert!(curve.len() > 100);
        for pair in curve.windows(2) {
            assert!(pair[1].threshold > pair[0].threshold);
            assert!(pair[1].fvr <= pair[0].fvr && pair[1].fir >= pair[0].fir);
        }
        let last = curve.last().unwrap();
        assert_eq!((last.fvr, last.fir), (0.0, 1.0));
        assert!(curve[0].fvr < 1.0, "unknown is not visible at threshold 0 either");
    }

    #[test]
    fn the_curve_counts_at_and_above_the_threshold() {
        let mut grades = Grades::default();
        grades.add(true, Some(100));
        grades.add(true, Some(200));
        grades.add(false, Some(100));
        grades.add(false, Some(0));
        let at = |t: u16| *trade_off(&grades).iter().rev().find(|p| p.threshold <= t).unwrap();
        assert_eq!((at(0).fvr, at(0).fir), (1.0, 0.0));
        assert_eq!((at(100).fvr, at(100).fir), (0.5, 0.0));
        assert_eq!((at(101).fvr, at(101).fir), (0.0, 0.5));
        assert_eq!((at(255).fvr, at(255).fir), (0.0, 1.0));
    }

    #[test]
    fn without_undetected_objects_there_is_no_curve() {
        let mut grades = Grades::default();
        grades.add(true, Some(1));
        assert!(trade_off(&grades).is_empty());
    }

    #[test]
    fn sparse_grades_are_the_same_grades() {
        let mut grades = Grades::default();
        for (truth, grade) in [(true, Some(0)), (true, None), (false, Some(255)), (false, None), (false, None)] {
            grades.add(truth, grade);
        }
        let (mut dense, mut sparse) = (Grades::default(), Grades::default());
        dense.add_times(&grades, 3);
        sparse.add_sparse(&grades.sparse(), 3);
        assert_eq!(dense, sparse);
        assert_eq!(dense.negative[256], 6);
    }

    #[test]
    fn the_envelope_joins_two_ends_and_drops_what_lies_above() {
        let envelope = Envelope::new([(0.0, 0.8), (0.6, 0.04), (0.3, 0.9), (0.0, 0.9)]);
        assert_eq!(envelope.fvr_at(0.0), 0.8);
        assert!((envelope.fvr_at(0.3) - 0.42).abs() < 1e-12);
        assert!((envelope.fvr_at(0.8) - 0.02).abs() < 1e-12);
        assert_eq!(envelope.fvr_at(1.0), 0.0);
        // alone, only the trivial maps remain
        assert!((Envelope::new([]).fvr_at(0.25) - 0.75).abs() < 1e-12);
    }
}
