//! A fused map in polar cells around a place of one's choice, as maps are sent.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig;
use crate::map::azimuths::Narrow;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::{CellState, Visibility, VisibilityMap};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::mount::Mount;

/// Least grade of a visible cell, and least occupancy of an occupied one.
const THRESHOLD: u8 = 128;

/// Most places of a cell that are looked at, along it and across.
const MOST_PLACES: i32 = 8;

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

/// Fills a polar map of [`polar`]: each cell has the worst of what is known at up to 8 by 8 places in it, a metre or
/// more apart, and is occupied if any of them is. So it is never better than what it covers.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // cell numbers; angles wrap
pub fn fill<const R: usize, const A: usize>(map: &mut PolarMap<R, A>, with: &(impl VisibilityMap + ?Sized)) {
    let geometry = *map.geometry();
    let along = (geometry.cell_cm / 100).clamp(1, MOST_PLACES);
    let (narrow, span) = (geometry.narrow, i64::from(geometry.azimuth_span));
    let units = i64::from(narrow.units(A).max(1)) << 8;
    for azimuth in 0..A {
        let [right, left] = [azimuth, azimuth + 1].map(|edge| i64::from(narrow.unit((edge as i32) << 8)));
        let Some((grades, occupancy)) = map.rows_mut(azimuth) else { continue };
        for (range, (grade, occupied)) in (0_i32..).zip(grades.iter_mut().zip(occupancy)) {
            let far = geometry.cell_cm * (range + 1);
            // the arc of a cell at its far end, metres: a turn is 65 536 steps, and 6.28 times the distance
            let arc = i64::from(far) * span * (left - right) / (10_430 * 100 * units);
            let across = i32::try_from(arc + 1).unwrap_or(MOST_PLACES).clamp(1, MOST_PLACES);
            let (mut worst, mut any) = (None::<CellState>, false);
            for k in 0..across {
                let steps = span * (i64::from(2 * across) * right + i64::from(2 * k + 1) * (left - right));
                let turn = steps / (i64::from(2 * across) * units);
                let direction = trig::direction(geometry.azimuth_origin + Angle::from_raw(turn as i16));
                for l in 0..along {
                    let distance = geometry.cell_cm * range + geometry.cell_cm * (2 * l + 1) / (2 * along);
                    let part = |component: i16| (i32::from(component) * distance) >> 14;
                    let state = with.at(geometry.levelling.unplace(part(direction.x), part(direction.y)));
                    any |= state.occupied;
                    if worst.is_none_or(|worst| (state.visibility, state.grade) < (worst.visibility, worst.grade)) {
                        worst = Some(state);
                    }
                }
            }
            let state = worst.unwrap_or(CellState::UNKNOWN);
            *grade = match state.visibility {
                Visibility::Unknown => 0,
                Visibility::Invisible => state.grade.clamp(1, THRESHOLD - 1),
                Visibility::Visible => state.grade.max(THRESHOLD),
            };
            *occupied = if any { u8::MAX } else { state.occupancy.min(THRESHOLD - 1) };
        }
    }
}
