//! From an accepted risk to a threshold on the probability.
//!
//! # Model
//! Risk = P(not detected | called visible): of the vehicles that stand where the map says visible, the share that is
//! missed. Called visible is what has p >= threshold. The threshold for a risk is the least whose risk was not above it
//! among the samples of fitting, each judged by a table that was fitted without it. It is not the FVR, which is of those that were missed.

use serde::Serialize;

use crate::evaluation::counts::rate;
use crate::evaluation::curve::{GRADE_SLOTS, Grades};

/// What to call visible so that a risk is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Threshold {
    /// Everything known: even so the risk is kept.
    Everything,
    /// What has at least this probability, in 1/255.
    From(u8),
    /// Nothing: no threshold keeps the risk.
    Nothing,
}

impl Threshold {
    /// The least that keeps the risk among these samples.
    pub fn keeping(risk: f64, fitted: &Grades) -> Self {
        let (mut visible, mut missed) = (0, 0);
        let mut found = Self::Nothing;
        let lowest = (0..GRADE_SLOTS - 1).find(|&p| fitted.positive[p] + fitted.negative[p] > 0);
        for p in (0..GRADE_SLOTS - 1).rev() {
            let samples = fitted.positive[p] + fitted.negative[p];
            visible += samples;
            missed += fitted.negative[p];
            if samples > 0 && missed as f64 <= risk * visible as f64 {
                found = if Some(p) == lowest { Self::Everything } else { Self::From(p as u8) };
            }
        }
        found
    }

    /// Whether a probability is called visible; unknown never is.
    pub fn visible(self, p: Option<u8>) -> bool {
        match self {
            Self::Everything => p.is_some(),
            Self::From(least) => p.is_some_and(|p| p >= least),
            Self::Nothing => false,
        }
    }

    /// In words, after "visible is".
    pub fn said(self) -> String {
        match self {
            Self::Everything => "everything known: it keeps the risk as it is".into(),
            Self::From(p) => format!("what has p >= {:.3}", f64::from(p) / 255.0),
            Self::Nothing => "nothing: no threshold keeps the risk".into(),
        }
    }
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
            let visible = |slot: usize| threshold.visible(u8::try_from(slot).ok());
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
    fn the_threshold_is_the_least_that_keeps_the_risk() {
        // 1/20, 3/30, 8/40 from the top down
        let of = |risk| Threshold::keeping(risk, &counted());
        assert_eq!((of(0.04), of(0.05), of(0.099)), (Threshold::Nothing, Threshold::From(250), Threshold::From(250)));
        assert_eq!((of(0.1), of(0.199)), (Threshold::From(150), Threshold::From(150)));
        assert_eq!(of(0.2), Threshold::Everything);
        assert_eq!(Threshold::keeping(0.5, &Grades::default()), Threshold::Nothing);
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
