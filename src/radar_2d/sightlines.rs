//! Lines of sight over a Cartesian grid: each azimuth's occupied ranges as a row of bits.
//!
//! # Model
//! An occupied cell sets its range on every ray that passes through it. Runs of set bits are the
//! objects a ray meets. Cells up to the end of the *last* run were reached by the radar, so one
//! reading calls them visible; behind the *first* run nothing is certain, so the other stops there.
//! Between the two lies the grade: the share of the ray's runs that are still to come,
//! `grade = 255 (n - k) / n` behind the k-th of n runs. A threshold at its ends is either reading.

use crate::fixed::angle::Angle;
use crate::fixed::bits::RangeBits;
use crate::fixed::math;
use crate::fixed::trig;
use crate::map::azimuths::Narrow;
use crate::map::polar::PolarGeometry;
use crate::map::query::Footprint;
use crate::sensor::field_of_view::Limits;
use crate::sensor::mount::Levelling;

/// Grade of a place behind every run.
const BLOCKED: u8 = 1;

/// Range cells of a ray.
const RANGES: usize = RangeBits::CAPACITY;

/// `N` rays over the azimuths in view, one cell to a bit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sightlines<const N: usize> {
    rays: [RangeBits; N],
}

/// Where the rays point, and how wide a cell is on them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fan {
    origin: Angle,
    /// Rays to 2^-16 turn, 2^-16.
    scale: i32,
    span: i32,
    side_cm: i32,
    /// Half a cell's width by range, 2^-8 rays.
    half_widths: [u16; RANGES],
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // ray and range indices
impl Fan {
    /// `rays` from the right to the left limit of the field of view, and a little beyond, as a
    /// tilted sensor's limits shift on the ground; cells of `side_cm`.
    pub fn new(view: &Limits, rays: usize, side_cm: i32) -> Self {
        let spare = Angle::from_degrees(3.0);
        let origin = view.azimuth[0] - spare;
        let span = i32::from((view.azimuth[1] + spare - origin).raw() as u16).max(1);
        let mut half_widths = [0; RANGES];
        for (range, half) in half_widths.iter_mut().enumerate() {
            // between half the side and half the diagonal
            let angle = math::atan2(0.6, range as f32 + 0.5) / core::f32::consts::TAU * 65536.0;
            *half = math::round_i32(angle * 256.0 * rays as f32 / span as f32).clamp(1, 65_535) as u16;
        }
        Self { origin, scale: (rays as i32 * 65_536) / span, span, side_cm, half_widths }
    }

    /// Corners of the area the rays cover: the sensor and points along the far arc.
    pub fn outline(&self, range_cm: i32) -> impl Iterator<Item = (i32, i32)> + use<> {
        const STEPS: i32 = 32;
        let (origin, span) = (self.origin, self.span);
        core::iter::once((0, 0)).chain((0..=STEPS).map(move |i| {
            let d = trig::direction(origin + Angle::from_raw((span * i / STEPS) as i16));
            ((i32::from(d.x) * range_cm) >> 14, (i32::from(d.y) * range_cm) >> 14)
        }))
    }

    /// Range cell of a place in the levelled frame, and its place among the rays, 2^-8 rays.
    #[inline]
    fn locate(&self, x_cm: i32, y_cm: i32) -> (usize, i32) {
        let bearing = i32::from((trig::bearing(x_cm, y_cm) - self.origin).raw());
        ((math::length(x_cm, y_cm) / self.side_cm) as usize, (bearing * self.scale) >> 8)
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

    /// Puts an occupied cell at a place of the levelled frame in the way.
    #[inline]
    pub fn block(&mut self, x_cm: i32, y_cm: i32, fan: &Fan) {
        let (range, place) = fan.locate(x_cm, y_cm);
        let Some(&half) = fan.half_widths.get(range) else { return };
        let half = i32::from(half);
        let first = ((place - half) >> 8).max(0) as usize;
        let end = (((place + half) >> 8) + 1).clamp(0, N as i32) as usize;
        if let Some(rays) = self.rays.get_mut(first..end) {
            for bits in rays {
                bits.set(range);
            }
        }
    }

    /// Graded visibility of a place, 1 to 255.
    pub fn grade(&self, x_cm: i32, y_cm: i32, fan: &Fan) -> u8 {
        let (here, place) = fan.locate(x_cm, y_cm);
        usize::try_from(place >> 8).map_or(BLOCKED, |ray| self.grade_on(ray, here))
    }

    /// The least grade of an area; blocked if a part of it lies on no ray.
    pub fn least_grade(&self, area: &Footprint, levelling: &Levelling, fan: &Fan) -> u8 {
        let geometry = PolarGeometry {
            levelling: *levelling,
            cell_cm: fan.side_cm,
            azimuth_origin: fan.origin,
            azimuth_span: fan.span as u16,
            narrow: Narrow::NONE,
        };
        let mut least = u8::MAX;
        let complete = geometry.touched(area, RANGES, N, |ray, near, far| {
            // the scale from bearings to rays is rounded
            for ray in ray.saturating_sub(1)..=ray + 1 {
                least = (near..=far).fold(least, |least, here| least.min(self.grade_on(ray, here)));
            }
        });
        if complete { least } else { BLOCKED }
    }

    /// Graded visibility of a range cell on a ray.
    fn grade_on(&self, ray: usize, here: usize) -> u8 {
        let Some(bits) = self.rays.get(ray) else { return BLOCKED };
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
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fan() -> Fan {
        let degrees = Angle::from_degrees;
        let view = Limits {
            azimuth: [degrees(-60.0), degrees(60.0)],
            elevation: [degrees(-16.0), degrees(16.0)],
            range_cm: [300, 20_000],
        };
        Fan::new(&view, 360, 100)
    }

    #[test]
    fn behind_the_first_of_two_objects_is_half_visible() {
        let (mut s, f) = (Sightlines::<360>::new(), fan());
        s.block(5_050, 50, &f);
        s.block(9_050, 50, &f);
        let grade = |x: i32| s.grade(x, 50, &f);
        assert_eq!((grade(3_050), grade(5_050), grade(7_050), grade(9_050), grade(12_050)), (255, 255, 127, 127, 1));
        assert_eq!(s.grade(12_050, 3_050, &f), 255, "another ray");
        assert_eq!(s.rays[f.locate(9_050, 50).1 as usize >> 8].last(), Some(90));
    }

    #[test]
    fn left_blocks_left() {
        let (mut s, f) = (Sightlines::<360>::new(), fan());
        s.block(3_000, 2_000, &f);
        assert_eq!(s.grade(6_000, 4_000, &f), 1);
        assert_eq!(s.grade(6_000, -4_000, &f), 255);
    }

    #[test]
    fn a_near_cell_covers_as_many_rays_as_it_is_wide() {
        let (mut s, f) = (Sightlines::<360>::new(), fan());
        s.block(1_050, 50, &f);
        let covered = (0..360).filter(|ray| s.rays[*ray].last().is_some()).count();
        // 1.2 m at 10.5 m are 6.5 degrees of 126 on 360 rays
        assert!((17..=21).contains(&covered), "{covered}");
    }
}
