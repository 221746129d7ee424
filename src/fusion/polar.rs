//! A fused map in polar cells around a place of one's choice, as maps are sent.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::trig;
use crate::map::polar::{PolarGeometry, PolarMap};
use crate::map::{Visibility, VisibilityMap};
use crate::sensor::config::{ConfigError, within};
use crate::sensor::mount::Mount;

/// Least grade of a visible cell, and least occupancy of an occupied one.
const THRESHOLD: u8 = 128;

/// An unknown map of `A` azimuths by `R` ranges around a place that stands for a sensor: a mount, the right and the left edge of all
/// azimuths from its heading in degrees, and the length of a cell in metres. Its [`Header`](crate::wire::header::Header) is made of
/// the same mount.
///
/// # Errors
/// A mount that cannot be, edges beyond half a turn or in the wrong order, cells outside 0.25 to 10 m.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within limits
pub fn polar<const R: usize, const A: usize>(
    mount: &Mount,
    azimuth_deg: [f32; 2],
    cell_m: f32,
) -> Result<PolarMap<R, A>, ConfigError> {
    let [right, left] = azimuth_deg;
    let right = within("azimuth_deg[0]", right, -180.0, 179.0)?;
    let left = within("azimuth_deg[1]", left, right + 1.0, 180.0)?;
    let cell = within("cell_m", cell_m, 0.25, 10.0)?;
    let span = math::round_i32((left - right) * (65536.0 / 360.0)).clamp(1, i32::from(u16::MAX));
    let geometry = PolarGeometry {
        levelling: mount.levelling()?,
        cell_cm: math::round_i32(cell * 100.0),
        azimuth_origin: Angle::from_degrees(right),
        azimuth_span: span as u16,
    };
    Ok(PolarMap::unknown(geometry, THRESHOLD, THRESHOLD))
}

/// Fills a polar map of [`polar`]: each cell has what is known at its middle, the nearest cell and never a better one.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // cell numbers; angles wrap
pub fn fill<const R: usize, const A: usize>(map: &mut PolarMap<R, A>, with: &(impl VisibilityMap + ?Sized)) {
    let geometry = *map.geometry();
    for azimuth in 0..A {
        let half_widths = i64::from(geometry.azimuth_span) * (2 * azimuth as i64 + 1);
        let turn = half_widths.checked_div(2 * A as i64).unwrap_or(0);
        let direction = trig::direction(geometry.azimuth_origin + Angle::from_raw(turn as i16));
        let Some((grades, occupancy)) = map.rows_mut(azimuth) else { continue };
        for (range, (grade, occupied)) in (0_i32..).zip(grades.iter_mut().zip(occupancy)) {
            let distance = (geometry.cell_cm * (2 * range + 1) / 2).min(1 << 16);
            let along = |component: i16| (i32::from(component) * distance) >> 14;
            let state = with.at(geometry.levelling.unplace(along(direction.x), along(direction.y)));
            *grade = match state.visibility {
                Visibility::Unknown => 0,
                Visibility::Invisible => state.grade.clamp(1, THRESHOLD - 1),
                Visibility::Visible => state.grade.max(THRESHOLD),
            };
            *occupied = if state.occupied { u8::MAX } else { state.occupancy.min(THRESHOLD - 1) };
        }
    }
}
