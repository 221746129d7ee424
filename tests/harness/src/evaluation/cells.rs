//! Cell-wise rates: the map compared with exact lines of sight wherever traffic passes.

use serde::Serialize;

use super::counts::rate;

/// Cell-time-steps by truth and by the map's grade.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellCounts {
    pub blocked: u64,
    pub blocked_visible: u64,
    pub clear: u64,
    pub clear_not_visible: u64,
}

impl CellCounts {
    pub const ZERO: Self = Self { blocked: 0, blocked_visible: 0, clear: 0, clear_not_visible: 0 };

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
