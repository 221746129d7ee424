//! A fused map in polar cells around a place of one's choice, as maps are sent.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig::{self, Direction};
use crate::map::azimuths::Narrow;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::query::Footprint;
use crate::map::{CellState, Visibility, VisibilityMap, worst_in};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::mount::Mount;

/// Least grade of a visible cell, and least occupancy of an occupied one.
const THRESHOLD: u8 = 128;

/// Wider azimuths are looked at in parts, ten degrees: a rectangle around them would hold much else.
const WIDEST: i32 = 1820;

/// An unknown map of `A` azimuths by `R` ranges around a place that stands for a sensor: a mount, the right and the
/// left edge of all azimuths from its heading in degrees, and the length of a cell in metres. Its
/// [`Header`](crate::wire::header::Header) is made of the same mount.
///
/// # Errors
/// A mount that cannot be, edges in the wrong order or more than half a turn apart, cells smaller than 0.25 m, larger
/// than 10 m or, all of them together, longer than 400 m.
pub fn polar<const R: usize, const A: usize>(
    mount: &Mount,
    azimuth_deg: [f32; 2],
    cell_m: f32,
) -> Result<PolarMap<R, A>, ConfigError> {
    let (azimuth_origin, azimuth_span) = edges(azimuth_deg)?;
    let cell = within("cell_m", cell_m, 0.25, (400.0 / R as f32).min(10.0))?;
    let geometry = PolarGeometry {
        levelling: mount.levelling()?,
        cell_cm: math::round_i32(cell * 100.0),
        azimuth_origin,
        azimuth_span,
        narrow: Narrow::NONE,
    };
    Ok(PolarMap::unknown(geometry, THRESHOLD, THRESHOLD))
}

/// Right edge of a view, and its width in 2^-16 turn, from both edges in degrees, + left.
///
/// # Errors
/// Edges in the wrong order or more than half a turn apart.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within limits
pub(super) fn edges([right, left]: [f32; 2]) -> Result<(Angle, u16), ConfigError> {
    let right = within("azimuth_deg[0]", right, -180.0, 179.0)?;
    let left = within("azimuth_deg[1]", left, right + 1.0, right + 179.9)?;
    let span = math::round_i32((left - right) * (65536.0 / 360.0)).clamp(1, i32::from(u16::MAX));
    Ok((Angle::from_degrees(right), span as u16))
}

/// Fills a polar map of [`polar`]: each cell has the worst of all that is known anywhere in it, and is occupied if any of
/// it is. So it is never better than what it covers.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // cell numbers
pub fn fill<const R: usize, const A: usize>(map: &mut PolarMap<R, A>, with: &(impl VisibilityMap + ?Sized)) {
    let geometry = *map.geometry();
    let columns = geometry.columns(A);
    for azimuth in 0..A {
        let [right, left] = [azimuth, azimuth + 1].map(|edge| columns.bearing((edge << 8) as i32));
        let width = i32::from((left - right).raw() as u16);
        let Some((grades, occupancy)) = map.rows_mut(azimuth) else { continue };
        for (range, (grade, occupied)) in (0_i32..).zip(grades.iter_mut().zip(occupancy)) {
            let mut worst = None::<CellState>;
            let parts = 1 + width / WIDEST;
            for part in 0..parts {
                let end = |k: i32| i32::from(right.raw()) + width * k / parts;
                let area = covering(&geometry, [end(part), end(part + 1)], geometry.cell_cm * range);
                let state = worst_in(with, &area);
                worst = Some(worst.map_or(state, |worst| worst.worse(state)));
            }
            let state = worst.unwrap_or(CellState::UNKNOWN);
            *grade = match state.visibility {
                Visibility::Unknown => 0,
                Visibility::Invisible => state.grade.clamp(1, THRESHOLD - 1),
                Visibility::Visible => state.grade.max(THRESHOLD),
            };
            *occupied = if state.occupied { u8::MAX } else { state.occupancy.min(THRESHOLD - 1) };
        }
    }
}

/// The rectangle around a cell, or a part of it between two bearings from the first azimuth's right edge; larger by what
/// bearings and places are rounded by.
#[allow(clippy::cast_possible_truncation)] // angles wrap, components of a direction
fn covering(geometry: &PolarGeometry, [right, left]: [i32; 2], near_cm: i32) -> Footprint {
    let middle = geometry.azimuth_origin + Angle::from_raw(((right + left) / 2) as i16);
    let half = trig::direction(Angle::from_raw(((left - right) / 2 + 4) as i16));
    let part = |component: i16, distance: i32| (i32::from(component) * distance) >> 14;
    let far_cm = near_cm + geometry.cell_cm;
    // its near corners lie nearer along the middle than its near side
    let near_cm = part(half.x, near_cm);
    let grown = 4 + (far_cm >> 11);
    let (ray, at) = (trig::direction(middle), (near_cm + far_cm) / 2);
    let (x, y) = geometry.levelling.unturn(i32::from(ray.x), i32::from(ray.y));
    Footprint {
        centre: geometry.levelling.unplace(part(ray.x, at), part(ray.y, at)),
        heading: Direction { x: x as i16, y: y as i16 },
        half_length_cm: (far_cm - near_cm) / 2 + grown,
        half_width_cm: part(half.y, far_cm) + grown,
    }
}
