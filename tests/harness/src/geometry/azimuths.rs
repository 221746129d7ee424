//! Azimuths of a polar map in radians: columns from right to left, those of one stretch narrower than the others.

use std::f64::consts::TAU;

use viewshed::fixed::angle::Angle;
#[cfg(doc)]
use viewshed::map::azimuths::Narrow;

/// Right edge of the first azimuth and left edge of the last, radians, + left.
pub fn ends_rad(origin: Angle, span: u16) -> [f64; 2] {
    let right = f64::from(origin.radians());
    [right, right + f64::from(span) / 65536.0 * TAU]
}

/// Of azimuths that are all alike.
pub const EVEN: [u8; 3] = [0, 0, 1];

/// Bearing of a place among so many azimuths between these ends: 0 is the first one's right edge, 0.5 its middle.
pub fn bearing_rad([right, left]: [f64; 2], narrow: [u8; 3], azimuths: usize, place: f64) -> f64 {
    right + (left - right) * units(narrow, place) / units(narrow, azimuths as f64)
}

/// Widths of a narrow azimuth from the first one's right edge to a place, by [`Narrow::to_bytes`].
fn units(narrow: [u8; 3], place: f64) -> f64 {
    let [first, end, times] = narrow.map(f64::from);
    let within = place.clamp(first, end.max(first)) - first;
    (place - within) * times + within
}

#[cfg(test)]
mod tests {
    use viewshed::grid::axes::Axes;
    use viewshed::sensor::field_of_view::FieldOfView;
    use viewshed::sensor::ground::Ground;
    use viewshed::sensor::mount::Mount;

    use super::*;

    #[test]
    fn bearings_are_the_librarys() {
        let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };
        let view = FieldOfView {
            azimuth_min_deg: -60.0,
            azimuth_max_deg: 60.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 3.0,
            range_max_m: 200.0,
        };
        for far_road in [None, Some(-12), Some(0), Some(55)] {
            let axes = Axes::<200, 120, 16>::on(Ground::LEVEL, &mount.levelling().unwrap(), &view, 1.0, far_road);
            let axes = axes.unwrap();
            let ends = ends_rad(axes.azimuth_origin, axes.azimuth_span);
            for place in 0..=120 * 4 {
                let exact = bearing_rad(ends, axes.narrow.to_bytes(), 120, f64::from(place) / 4.0);
                let integer = f64::from(axes.azimuth_of(place * 64).radians());
                assert!((exact - integer).abs() < 2e-4, "{far_road:?} {place}: {exact} {integer}");
            }
        }
    }
}
