//! Cell-wise rates: the map compared with exact lines of sight wherever traffic passes.

use serde::Serialize;

use super::counts::rate;
use super::curve::Grades;

/// Cell-time-steps by truth and by the map's bit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct CellCounts {
    pub blocked: u64,
    pub blocked_visible: u64,
    pub clear: u64,
    pub clear_not_visible: u64,
}

impl CellCounts {
    pub fn add(&mut self, in_sight: bool, visible: bool) {
        if in_sight {
            self.clear += 1;
            self.clear_not_visible += u64::from(!visible);
        } else {
            self.blocked += 1;
            self.blocked_visible += u64::from(visible);
        }
    }

    /// Visible and blocked / blocked.
    pub fn fvr(&self) -> Option<f64> {
        rate(self.blocked_visible, self.blocked)
    }

    /// Not visible and clear / clear.
    pub fn fir(&self) -> Option<f64> {
        rate(self.clear_not_visible, self.clear)
    }
}

impl std::ops::AddAssign for CellCounts {
    fn add_assign(&mut self, o: Self) {
        self.blocked += o.blocked;
        self.blocked_visible += o.blocked_visible;
        self.clear += o.clear;
        self.clear_not_visible += o.clear_not_visible;
    }
}

impl std::ops::Mul<u64> for CellCounts {
    type Output = Self;

    fn mul(self, n: u64) -> Self {
        Self {
            blocked: self.blocked * n,
            blocked_visible: self.blocked_visible * n,
            clear: self.clear * n,
            clear_not_visible: self.clear_not_visible * n,
        }
    }
}

/// The road cells of one frame, as an estimator's map has them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CellTally {
    pub counts: CellCounts,
    /// Cells by the map's grade, in sight and blocked.
    pub grades: Grades,
}

impl CellTally {
    /// `grade` is `None` where the map knows nothing.
    pub fn add(&mut self, in_sight: bool, visible: bool, grade: Option<u8>) {
        self.counts.add(in_sight, visible);
        self.grades.add(in_sight, grade);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_visible_cell_behind_a_truck_is_false_visible_and_an_unknown_clear_one_false_invisible() {
        let mut tally = CellTally::default();
        tally.add(false, true, Some(200));
        tally.add(false, false, Some(10));
        tally.add(true, false, None);
        assert_eq!((tally.counts.fvr(), tally.counts.fir()), (Some(0.5), Some(1.0)));
    }

    #[test]
    fn no_blocked_cell_leaves_no_rate() {
        let mut counts = CellCounts::default();
        counts.add(true, true);
        assert_eq!((counts.fvr(), counts.fir()), (None, Some(0.0)));
    }
}
