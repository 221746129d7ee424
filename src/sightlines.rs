//! Lines of sight over a Cartesian grid: each azimuth's occupied ranges as a row of bits.
//!
//! # Model
//! An occupied cell sets its range on every ray that passes through it. Runs of set bits are the
//! objects a ray meets. Cells up to the end of the *last* run were reached by the radar, so one
//! reading calls them visible; behind the *first* run nothing is certain, so the other stops there.
//! Between the two lies the grade: the share of the ray's runs that are still to come,
//! `grade = 255 (n - k) / n` behind the k-th of n runs. A threshold at its ends is either reading.

use crate::angle::Angle;
use crate::bits::RangeBits;
use crate::field_of_view::Limits;
use crate::trig;

/// Grade of a place behind every run.
const BLOCKED: u8 = 1;

/// `N` rays over the azimuths in view, 1 m to a bit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sightlines<const N: usize> {
    rays: [RangeBits; N],
}

/// Where the rays point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fan {
    origin: Angle,
    span: i32,
}

impl Fan {
    /// Rays from the right to the left limit of the field of view, and a little beyond: a tilted
    /// sensor's limits shift on the ground.
    pub fn new(view: &Limits) -> Self {
        #[allow(clippy::cast_sign_loss)] // below half a turn
        let spare = Angle::from_degrees(3.0);
        let origin = view.azimuth[0] - spare;
        Self { origin, span: i32::from((view.azimuth[1] + spare - origin).raw() as u16) }
    }

    /// Corners of the area the rays cover: the sensor and points along the far arc.
    pub fn outline(&self, range_cm: i32) -> impl Iterator<Item = (i32, i32)> + use<> {
        const STEPS: i32 = 32;
        let (origin, span) = (self.origin, self.span);
        core::iter::once((0, 0)).chain((0..=STEPS).map(move |i| {
            #[allow(clippy::cast_possible_truncation)] // a part of less than a turn
            let d = trig::direction(origin + Angle::from_raw((span * i / STEPS) as i16));
            ((i32::from(d.x) * range_cm) >> 14, (i32::from(d.y) * range_cm) >> 14)
        }))
    }

    /// Place of a bearing among `n` rays, 2^-8 rays.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // a few hundred rays
    fn place(&self, bearing: Angle, n: usize) -> i32 {
        i32::from((bearing - self.origin).raw()) * (n as i32 * 64) / (self.span / 4).max(1)
    }

    /// Width of an object on the fan, 2^-8 rays, for its half width and distance in centimetres.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // a few hundred rays
    fn half_width(&self, half_cm: i32, ground_cm: i32, n: usize) -> i32 {
        // a radian is 10430 steps of 2^-16 turn
        let angle = half_cm * 10_430 / ground_cm.max(half_cm);
        angle * (n as i32 * 64) / (self.span / 4).max(1)
    }
}

impl<const N: usize> Default for Sightlines<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // ray and range indices
impl<const N: usize> Sightlines<N> {
    /// Nothing in the way.
    pub const fn new() -> Self {
        Self { rays: [RangeBits::NONE; N] }
    }

    /// Clears every ray.
    pub fn clear(&mut self) {
        self.rays = [RangeBits::NONE; N];
    }

    /// Puts an occupied cell of `side_cm` at a place of the levelled frame in the way.
    pub fn block(&mut self, x_cm: i32, y_cm: i32, side_cm: i32, fan: &Fan) {
        let ground = ground_cm(x_cm, y_cm);
        let place = fan.place(trig::bearing(x_cm, y_cm), N);
        // between half the side and half the diagonal
        let half = fan.half_width(side_cm * 3 / 5, ground, N);
        let (first, last) = (((place - half) >> 8).max(0), ((place + half) >> 8).min(N as i32 - 1));
        for ray in first..=last {
            if let Some(bits) = self.rays.get_mut(ray as usize) {
                bits.set((ground / side_cm) as usize);
            }
        }
    }

    /// Graded visibility of a place, 1 to 255.
    pub fn grade(&self, x_cm: i32, y_cm: i32, side_cm: i32, fan: &Fan) -> u8 {
        let place = fan.place(trig::bearing(x_cm, y_cm), N) >> 8;
        let Some(bits) = usize::try_from(place).ok().and_then(|i| self.rays.get(i)) else { return BLOCKED };
        let here = (ground_cm(x_cm, y_cm) / side_cm) as usize;
        let (mut runs, mut behind, mut end) = (0_u32, 0_u32, None::<usize>);
        for r in bits.iter() {
            // cells crossed diagonally leave one bit out
            if end.is_none_or(|e| r > e + 2) {
                runs += 1;
                behind += u32::from(end.is_some_and(|e| here > e));
            }
            end = Some(r);
        }
        behind += u32::from(end.is_some_and(|e| here > e));
        ((255 * (runs - behind)).checked_div(runs).unwrap_or(255) as u8).max(BLOCKED)
    }

    /// Range cells visible on a ray when everything up to the last run is: `None` = to the limit.
    pub fn last_seen(&self, ray: usize) -> Option<usize> {
        self.rays.get(ray).and_then(|bits| bits.last())
    }
}

/// Length of a ground vector.
#[allow(clippy::cast_possible_truncation)] // no longer than the vector's sum
fn ground_cm(x_cm: i32, y_cm: i32) -> i32 {
    (i64::from(x_cm) * i64::from(x_cm) + i64::from(y_cm) * i64::from(y_cm)).unsigned_abs().isqrt() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fan() -> Fan {
        let degrees = Angle::from_degrees;
        Fan::new(&Limits {
            azimuth: [degrees(-60.0), degrees(60.0)],
            elevation: [degrees(-16.0), degrees(16.0)],
            range_cm: [300, 20_000],
        })
    }

    #[test]
    fn behind_the_first_of_two_objects_is_half_visible() {
        let (mut s, f) = (Sightlines::<480>::new(), fan());
        s.block(5_050, 50, 100, &f);
        s.block(9_050, 50, 100, &f);
        let grade = |x: i32| s.grade(x, 50, 100, &f);
        assert_eq!((grade(3_050), grade(5_050), grade(7_050), grade(9_050), grade(12_050)), (255, 255, 127, 127, 1));
        assert_eq!(s.grade(12_050, 3_050, 100, &f), 255, "another ray");
        assert_eq!(s.last_seen(f.place(trig::bearing(9_050, 50), 480) as usize >> 8), Some(90));
    }

    #[test]
    fn left_blocks_left() {
        let (mut s, f) = (Sightlines::<480>::new(), fan());
        s.block(3_000, 2_000, 100, &f);
        assert_eq!(s.grade(6_000, 4_000, 100, &f), 1);
        assert_eq!(s.grade(6_000, -4_000, 100, &f), 255);
    }
}
