//! Time in pieces of one length, in which what is observed is summed up.

use crate::fixed::time::Time;

/// The running window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    length_us: u64,
    began: Option<Time>,
}

impl Window {
    pub(super) const fn of_ms(length_ms: u16) -> Self {
        Self { length_us: 1000 * length_ms as u64, began: None }
    }

    /// Whether the window is over; the next one has begun then. So has one at the first time, and where time steps
    /// back, of which the one before says nothing.
    pub(super) fn is_over(&mut self, now: Time) -> bool {
        let since = self.began.and_then(|began| now.since(began));
        let over = since.is_some_and(|us| us >= self.length_us);
        if over || since.is_none() {
            self.began = Some(now);
        }
        over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_over_after_its_length_and_begins_anew_where_time_steps_back() {
        let mut window = Window::of_ms(500);
        let mut over = |ms: u64| window.is_over(Time::from_micros(1000 * ms));
        assert!(!over(1000), "the first time begins one");
        assert!(!over(1499) && over(1500) && !over(1600));
        assert!(over(2700), "late");
        assert!(!over(900) && !over(1399) && over(1400), "time stepped back");
    }
}
