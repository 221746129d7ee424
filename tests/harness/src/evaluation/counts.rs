//! TV, FV, TI, FI and the rates made of them.

use serde::Serialize;

/// Object-time-steps by visibility V and detection D.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// V = 1, D = 1
    pub tv: u64,
    /// V = 1, D = 0: an unknown blind spot
    pub fv: u64,
    /// V = 0, D = 0
    pub ti: u64,
    /// V = 0, D = 1
    pub fi: u64,
}

/// One of the four outcomes of an object-time-step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    Tv,
    Fv,
    Ti,
    Fi,
}

impl Outcome {
    pub const ALL: [Self; 4] = [Self::Tv, Self::Ti, Self::Fv, Self::Fi];

    pub fn of(visible: bool, detected: bool) -> Self {
        match (visible, detected) {
            (true, true) => Self::Tv,
            (true, false) => Self::Fv,
            (false, false) => Self::Ti,
            (false, true) => Self::Fi,
        }
    }

    /// As the paper writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tv => "TV",
            Self::Fv => "FV",
            Self::Ti => "TI",
            Self::Fi => "FI",
        }
    }
}

/// `part / whole`; `None` where there is nothing to divide by.
pub fn rate(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

impl Counts {
    pub fn add(&mut self, visible: bool, detected: bool) {
        *match Outcome::of(visible, detected) {
            Outcome::Tv => &mut self.tv,
            Outcome::Fv => &mut self.fv,
            Outcome::Ti => &mut self.ti,
            Outcome::Fi => &mut self.fi,
        } += 1;
    }

    pub fn tvr(&self) -> Option<f64> {
        rate(self.tv, self.tv + self.fi)
    }

    pub fn fir(&self) -> Option<f64> {
        rate(self.fi, self.tv + self.fi)
    }

    pub fn fvr(&self) -> Option<f64> {
        rate(self.fv, self.fv + self.ti)
    }

    pub fn tir(&self) -> Option<f64> {
        rate(self.ti, self.fv + self.ti)
    }

    /// Share of object-time-steps that were detected.
    pub fn coverage(&self) -> Option<f64> {
        rate(self.tv + self.fi, self.total())
    }

    pub fn total(&self) -> u64 {
        self.tv + self.fv + self.ti + self.fi
    }
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, o: Self) {
        self.tv += o.tv;
        self.fv += o.fv;
        self.ti += o.ti;
        self.fi += o.fi;
    }
}

impl std::ops::Mul<u64> for Counts {
    type Output = Self;

    fn mul(self, n: u64) -> Self {
        Self { tv: self.tv * n, fv: self.fv * n, ti: self.ti * n, fi: self.fi * n }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_divide_by_detected_and_undetected() {
        let c = Counts { tv: 80, fi: 20, fv: 3, ti: 7 };
        assert_eq!((c.tvr(), c.fir(), c.fvr(), c.tir()), (Some(0.8), Some(0.2), Some(0.3), Some(0.7)));
        assert_eq!(c.coverage(), Some(100.0 / 110.0));
    }

    #[test]
    fn an_empty_denominator_is_not_zero() {
        let c = Counts { tv: 1, ..Counts::default() };
        assert_eq!((c.fvr(), c.tir()), (None, None));
    }

    #[test]
    fn a_blind_spot_nobody_knows_of_is_a_false_visible() {
        let mut c = Counts::default();
        c.add(true, false);
        assert_eq!(c.fv, 1);
        c.add(false, true);
        assert_eq!(c.fi, 1);
    }
}
