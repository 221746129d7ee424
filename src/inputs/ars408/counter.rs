//! Scans that were lost, from the radar's measurement counter.
//!
//! The counter does not advance by one a scan: two sensors' worth of cycles, or the cycles between
//! two outputs, give other steps. The usual step is learnt.

/// Follows a measurement counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct MeasurementCounter {
    last: Option<u16>,
    /// How far it usually advances; 0 until learnt.
    step: u16,
    /// The last advance, and how often in a row.
    advance: u16,
    run: u16,
}

/// How a count follows the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Advance {
    /// The first one, or the next.
    Next,
    /// The same again.
    Same,
    /// So many in between are missing.
    Lost(u16),
    /// It started over: the radar did.
    Restarted,
}

/// A step is taken for usual when it came this often in a row,
const LEARN_AFTER: u16 = 2;
/// and a longer one than the usual, which losses look like, when it came this often.
const LENGTHEN_AFTER: u16 = 16;
/// Steps beyond this are restarts.
const FARTHEST: u16 = 4096;

impl MeasurementCounter {
    pub(crate) const NEW: Self = Self { last: None, step: 0, advance: 0, run: 0 };

    pub(crate) fn follow(&mut self, count: u16) -> Advance {
        let Some(last) = self.last.replace(count) else { return Advance::Next };
        let advance = count.wrapping_sub(last);
        if advance == 0 {
            return Advance::Same;
        }
        self.run = if advance == self.advance { self.run.saturating_add(1) } else { 1 };
        self.advance = advance;
        if advance > FARTHEST {
            return Advance::Restarted;
        }
        let shorter = self.step == 0 || advance < self.step;
        if (shorter && self.run >= LEARN_AFTER) || self.run >= LENGTHEN_AFTER {
            self.step = advance;
        }
        match advance.checked_div(self.step) {
            None | Some(0 | 1) => Advance::Next,
            Some(steps) => Advance::Lost(steps - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advances(counts: &[u16]) -> std::vec::Vec<Advance> {
        let mut counter = MeasurementCounter::NEW;
        counts.iter().map(|c| counter.follow(*c)).collect()
    }

    #[test]
    fn the_step_is_learnt_and_losses_are_told_by_it() {
        use Advance::*;
        assert_eq!(
            advances(&[100, 102, 104, 106, 110, 112, 112, 120]),
            [Next, Next, Next, Next, Lost(1), Next, Same, Lost(3)]
        );
        assert_eq!(advances(&[65_534, 0, 2, 6]), [Next, Next, Next, Lost(1)], "across the wrap");
        assert_eq!(advances(&[500, 501, 502, 0, 1]), [Next, Next, Next, Restarted, Next]);
    }

    #[test]
    fn a_step_learnt_from_losses_is_corrected() {
        let mut counter = MeasurementCounter::NEW;
        for count in [0, 4, 8, 12] {
            counter.follow(count);
        }
        for count in [14, 16, 18] {
            counter.follow(count);
        }
        assert_eq!(counter.follow(22), Advance::Lost(1));
        // and a radar set to a longer cycle is not taken to lose scans for ever
        for i in 1..40 {
            counter.follow(22 + 4 * i);
        }
        assert_eq!(counter.follow(22 + 160), Advance::Next);
    }
}
