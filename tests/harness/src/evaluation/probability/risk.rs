//! What the library's threshold for an accepted risk comes to on samples.

use serde::Serialize;
use viewshed::probability::{Counted, Probability, Threshold};

use crate::evaluation::counts::rate;
use crate::evaluation::curve::{GRADE_SLOTS, Grades};

/// The library's threshold for a risk, of samples that were counted here.
pub fn keeping(risk: f64, fitted: &Grades) -> Threshold {
    let mut counted: Counted = [[0; 2]; 256];
    for (p, both) in counted.iter_mut().enumerate() {
        *both = [fitted.positive[p], fitted.negative[p]];
    }
    Threshold::keeping(risk, &counted)
}

/// What a threshold gives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Kept {
    /// Of what was called visible, the share that was not detected.
    pub risk: Option<f64>,
    /// Of all, the share that was called visible.
    pub visible_share: Option<f64>,
    /// Of what was detected, the share that was not called visible.
    pub fir: Option<f64>,
}

impl Kept {
    pub fn of(threshold: Threshold, grades: &Grades) -> Self {
        let sum = |slots: &[u64; GRADE_SLOTS]| -> (u64, u64) {
            let visible = |slot: usize| threshold.visible(u8::try_from(slot).ok().map(Probability::from_raw));
            let seen = slots.iter().enumerate().filter(|(slot, _)| visible(*slot)).map(|(_, n)| n).sum();
            (seen, slots.iter().sum())
        };
        let ((detected, all_detected), (missed, all_missed)) = (sum(&grades.positive), sum(&grades.negative));
        Self {
            risk: rate(missed, missed + detected),
            visible_share: rate(missed + detected, all_missed + all_detected),
            fir: rate(all_detected - detected, all_detected),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 at p = 50 of which 5 missed, 10 at 150 with 2 missed, 20 at 250 with 1 missed; 4 unknown, 2 of them missed.
    fn counted() -> Grades {
        let mut grades = Grades::default();
        for (p, samples, missed) in [(Some(50), 10, 5), (Some(150), 10, 2), (Some(250), 20, 1), (None, 4, 2)] {
            (0..samples).for_each(|k| grades.add(k >= missed, p));
        }
        grades
    }

    #[test]
    fn the_threshold_is_that_of_the_samples() {
        assert_eq!(keeping(0.099, &counted()), Threshold::From(250));
        assert_eq!(keeping(0.2, &counted()), Threshold::Everything, "what is unknown does not count");
    }

    #[test]
    fn a_risk_is_of_what_is_called_visible_and_the_rate_of_what_was_detected() {
        let kept = Kept::of(Threshold::From(150), &counted());
        assert_eq!((kept.risk, kept.visible_share), (Some(0.1), Some(30.0 / 44.0)));
        assert_eq!(kept.fir, Some(7.0 / 34.0), "5 of p = 50 and 2 unknown of 34 detected");
        let all = Kept::of(Threshold::Everything, &counted());
        assert_eq!((all.risk, all.fir), (Some(0.2), Some(2.0 / 34.0)), "unknown is never visible");
        let none = Kept::of(Threshold::Nothing, &counted());
        assert_eq!((none.risk, none.visible_share, none.fir), (None, Some(0.0), Some(1.0)));
    }
}
