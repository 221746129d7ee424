//! From an accepted risk to the least probability of what is called visible.
//!
//! # Model
//! Risk = P(not detected | called visible): of the vehicles that stand where the map says visible, the share that is
//! missed. Called visible is what has p >= threshold. The threshold for a risk is the least whose risk was not above it
//! among the samples of fitting, each judged by a table that was fitted without it. It is not the FVR, which is of
//! those that were missed.

use super::Probability;

/// Of the samples of fitting those detected and those missed, by p in 1/255.
pub type Counted = [[u64; 2]; 256];

/// What to call visible so that a risk is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum Threshold {
    /// Everything known: even so the risk is kept.
    Everything,
    /// What has at least this probability, in 1/255.
    From(u8),
    /// Nothing: no threshold keeps the risk.
    Nothing,
}

impl Threshold {
    /// The least that keeps the risk, 0 to 1, among these samples.
    #[allow(clippy::cast_precision_loss)] // far fewer than 2^52 samples
    pub fn keeping(risk: f64, counted: &Counted) -> Self {
        let (mut visible, mut missed_of_them) = (0_u64, 0_u64);
        let mut found = Self::Nothing;
        let lowest = counted.iter().position(|[detected, missed]| detected + missed > 0);
        for (p, [detected, missed]) in counted.iter().enumerate().rev() {
            visible += detected + missed;
            missed_of_them += missed;
            if detected + missed > 0 && missed_of_them as f64 <= risk * visible as f64 {
                let from = u8::try_from(p).map_or(Self::Nothing, Self::From);
                found = if Some(p) == lowest { Self::Everything } else { from };
            }
        }
        found
    }

    /// Whether a probability is called visible; unknown never is.
    pub fn visible(self, p: Option<Probability>) -> bool {
        match self {
            Self::Everything => p.is_some(),
            Self::From(least) => p.is_some_and(|p| p.raw() >= least),
            Self::Nothing => false,
        }
    }
}

/// In words, after "visible is".
impl core::fmt::Display for Threshold {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Everything => write!(f, "everything known: it keeps the risk as it is"),
            Self::From(p) => write!(f, "what has p >= {:.3}", f64::from(*p) / 255.0),
            Self::Nothing => write!(f, "nothing: no threshold keeps the risk"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_is_the_least_that_keeps_the_risk() {
        let mut counted: Counted = [[0; 2]; 256];
        (counted[50], counted[150], counted[250]) = ([5, 5], [8, 2], [19, 1]);
        // 1/20, 3/30, 8/40 from the top down
        let of = |risk| Threshold::keeping(risk, &counted);
        assert_eq!((of(0.04), of(0.05), of(0.099)), (Threshold::Nothing, Threshold::From(250), Threshold::From(250)));
        assert_eq!((of(0.1), of(0.199)), (Threshold::From(150), Threshold::From(150)));
        assert_eq!(of(0.2), Threshold::Everything);
        assert_eq!(Threshold::keeping(0.5, &[[0; 2]; 256]), Threshold::Nothing);
    }

    #[test]
    fn unknown_is_visible_at_no_threshold() {
        let p = |p| Some(Probability::from_raw(p));
        for threshold in [Threshold::Everything, Threshold::From(0), Threshold::Nothing] {
            assert!(!threshold.visible(None));
        }
        assert!(Threshold::From(150).visible(p(150)) && !Threshold::From(150).visible(p(149)));
        assert!(Threshold::Everything.visible(p(0)) && !Threshold::Nothing.visible(p(255)));
    }
}
