//! Ground that is not level: heights along the road, and what of a place is in sight over them.
//!
//! Heights lie over the road's x axis, linear in between, level beyond the ends and across the road. Vehicles stand
//! upright, at the height below their middle. Sight of a place is exact; of a footprint or a box it is that of the best of
//! its points, 17 x 9 of a footprint and 9 x 9 x 5 of a box.

use anyhow::{Result, ensure};

use super::polygon::Point;
use super::solid::{Solid, clipped};

/// Steepest grade, as the library's.
const STEEPEST: f64 = 0.12;

/// Heights of the road over its length, metres in the road frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ground {
    points: Vec<[f64; 2]>,
}

impl Ground {
    /// # Errors
    /// Names the point that is no number, lies before the one before it, or behind too steep a grade.
    pub fn new(points: Vec<[f64; 2]>) -> Result<Self> {
        for (k, [x, height]) in points.iter().enumerate() {
            ensure!(x.is_finite() && height.is_finite(), "ground: point {k} is ({x}, {height}), not finite");
        }
        for (k, pair) in points.windows(2).enumerate() {
            let [[x, low], [next, high]] = [pair[0], pair[1]];
            ensure!(next >= x + 1.0, "ground: point {} at {next} m does not lie 1 m or more behind {x} m", k + 1);
            let grade = (high - low) / (next - x);
            ensure!(
                grade.abs() <= STEEPEST + 1e-9,
                "ground: before point {} the grade is {grade:.3}, above 0.12",
                k + 1
            );
        }
        Ok(Self { points })
    }

    pub fn is_level(&self) -> bool {
        self.points.is_empty()
    }

    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// The points as the library takes them, kept as long as the program runs: they are few.
    pub fn kept(&self) -> &'static [[f32; 2]] {
        self.points.iter().map(|p| p.map(|v| v as f32)).collect::<Vec<_>>().leak()
    }

    /// Height at a place along the road.
    pub fn height(&self, x: f64) -> f64 {
        self.grade_from(x).map_or(0.0, |([from, low], grade)| low + grade * (x - from))
    }

    /// Height over length at a place along the road, + where it climbs with x.
    pub fn grade(&self, x: f64) -> f64 {
        self.grade_from(x).map_or(0.0, |(_, grade)| grade)
    }

    fn grade_from(&self, x: f64) -> Option<([f64; 2], f64)> {
        let behind = self.points.partition_point(|p| p[0] <= x);
        let from = self.points[behind.saturating_sub(1).min(self.points.len().checked_sub(1)?)];
        let next = (behind > 0).then(|| self.points.get(behind)).flatten();
        Some((from, next.map_or(0.0, |next| (next[1] - from[1]) / (next[0] - from[0]))))
    }

    /// Puts what stands on level ground on this one.
    pub fn lift(&self, solid: &mut Solid) {
        solid.center[2] += self.height(solid.center[0]);
    }

    /// A place above the ground.
    pub fn above(&self, [x, y]: Point, height_m: f64) -> [f64; 3] {
        [x, y, self.height(x) + height_m]
    }

    /// Whether the ground itself lies between two places: between points it is straight, so one of them does.
    pub fn hides(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let way = to[0] - from[0];
        self.points.iter().any(|[x, height]| {
            let part = (x - from[0]) / way;
            part > 0.0 && part < 1.0 && from[2] + part * (to[2] - from[2]) < *height
        })
    }

    /// Whether a place is in sight past boxes and over the ground.
    pub fn in_sight<'a>(&self, sensor: [f64; 3], place: [f64; 3], solids: impl IntoIterator<Item = &'a Solid>) -> bool {
        !self.hides(sensor, place) && !solids.into_iter().any(|solid| blocks(solid, sensor, place))
    }

    /// Whether some point of a footprint, `height_m` above the ground below it, is in sight.
    pub fn footprint_in_sight(&self, sensor: [f64; 3], target: &Solid, height_m: f64, others: &[Solid]) -> bool {
        grid(17).any(|ahead| {
            grid(9).any(|left| {
                let at = target.global([ahead * target.size[0], left * target.size[1]]);
                self.in_sight(sensor, self.above(at, height_m), others)
            })
        })
    }

    /// Whether some point of a box is in sight.
    pub fn box_in_sight(&self, sensor: [f64; 3], target: &Solid, others: &[Solid]) -> bool {
        // the top first, which is what is seen
        grid(5).rev().any(|up| {
            let z = target.center[2] + up * target.size[2];
            grid(9).any(|ahead| {
                grid(9).any(|left| {
                    let [x, y] = target.global([ahead * target.size[0], left * target.size[1]]);
                    self.in_sight(sensor, [x, y, z], others)
                })
            })
        })
    }
}

/// So many places from -1/2 to 1/2, both included.
fn grid(count: u32) -> impl DoubleEndedIterator<Item = f64> {
    (0..count).map(move |k| f64::from(k) / f64::from(count - 1) - 0.5)
}

/// Whether a box lies across a line.
fn blocks(solid: &Solid, from: [f64; 3], to: [f64; 3]) -> bool {
    let (way, toward) = ([to[0] - from[0], to[1] - from[1]], [solid.center[0] - from[0], solid.center[1] - from[1]]);
    let aside = (way[0] * toward[1] - way[1] * toward[0]).abs();
    if aside > way[0].hypot(way[1]) * 0.5 * solid.size[0].hypot(solid.size[1]) {
        return false;
    }
    let (a, b) = (solid.local([from[0], from[1]]), solid.local([to[0], to[1]]));
    let half = [solid.size[0] / 2.0, solid.size[1] / 2.0];
    let Some((enter, leave)) = clipped(a, [b[0] - a[0], b[1] - a[1]], half, [0.0, 1.0]) else { return false };
    let height = |part: f64| from[2] + part * (to[2] - from[2]);
    let (low, high) = (height(enter).min(height(leave)), height(enter).max(height(leave)));
    enter < leave && low < solid.top() && high > solid.bottom()
}

#[cfg(test)]
mod tests {
    use super::super::sight;
    use super::*;

    const EYE: [f64; 3] = [0.0, 0.0, 6.0];

    fn ground(points: &[[f64; 2]]) -> Ground {
        Ground::new(points.to_vec()).unwrap()
    }

    fn truck(ground: &Ground, x: f64) -> Solid {
        Solid { center: ground.above([x, 0.0], 2.0), yaw_rad: 0.0, size: [10.0, 2.5, 4.0] }
    }

    #[test]
    fn heights_are_linear_between_points_and_level_beyond() {
        let g = ground(&[[0.0, 0.0], [100.0, 4.0], [200.0, 2.0]]);
        let all = [-50.0, 0.0, 50.0, 100.0, 150.0, 250.0].map(|x| (g.height(x), g.grade(x)));
        assert_eq!(all, [(0.0, 0.0), (0.0, 0.04), (2.0, 0.04), (4.0, -0.02), (3.0, -0.02), (2.0, 0.0)]);
        assert_eq!(Ground::default().height(50.0), 0.0);
    }

    #[test]
    fn a_crest_hides_what_lies_behind_it_and_a_dip_does_not() {
        // from 6 m the line over the crest (4 m at 100 m) falls 2 m in 100 m; the road falls 4 m
        let crest = ground(&[[0.0, 0.0], [100.0, 4.0], [200.0, 0.0]]);
        let seen = |g: &Ground, x: f64| g.in_sight(EYE, g.above([x, 0.0], 1.0), []);
        // 1 m above the road: 4 - 0.02 d against 5 - 0.04 d meet 50 m behind it
        assert!(seen(&crest, 149.0) && !seen(&crest, 151.0) && !seen(&crest, 199.0));
        let dip = ground(&[[0.0, 0.0], [100.0, -4.0], [200.0, 0.0]]);
        assert!((1..200).all(|x| seen(&dip, f64::from(x))));
    }

    #[test]
    fn a_truck_hides_less_of_a_road_that_climbs_and_more_of_one_that_falls() {
        let end = |grade: f64| {
            let g = ground(&[[-10.0, -10.0 * grade], [400.0, 400.0 * grade]]);
            let truck = [truck(&g, 55.0)];
            (61..400).map(f64::from).find(|x| g.in_sight(EYE, g.above([*x, 0.0], 1.0), &truck))
        };
        // level: 150 m; climbing by 4 % its top is 6.2 m high, and the line over its near edge, 50 m away, rises
        assert_eq!(end(0.0), Some(150.0));
        // 6 + (4 + 2.2 - 6) / 50 d = 0.04 d + 1
        assert_eq!(end(0.04), Some((5.0_f64 / (0.04 - 0.2 / 50.0)).ceil()));
        // 6 - (6 - 1.8) / 60 d = 1 - 0.04 d
        assert_eq!(end(-0.04), Some((5.0_f64 / (4.2 / 60.0 - 0.04)).ceil()));
    }

    #[test]
    fn on_level_ground_it_says_what_the_analytic_bounds_say() {
        let level = Ground::default();
        let mut differ = 0;
        for k in 0..400 {
            let at = |step: u32, span: f64| (f64::from(k * step % 400) / 400.0 - 0.5) * span;
            let truck =
                Solid { center: [50.0 + at(7, 30.0), at(11, 8.0), 2.0], yaw_rad: at(13, 3.0), size: [12.0, 2.5, 4.0] };
            let target =
                Solid { center: [100.0 + at(17, 60.0), at(19, 9.0), 0.8], yaw_rad: at(23, 6.0), size: [4.5, 1.8, 1.6] };
            let shadow = sight::shadow(EYE, &truck, 1.0);
            let cell = [100.0 + at(17, 60.0), at(19, 9.0)];
            let hidden = shadow.as_ref().is_some_and(|s| s.contains(cell));
            assert_eq!(level.in_sight(EYE, level.above(cell, 1.0), [&truck]), !hidden, "{truck:?} {cell:?}");
            let exact = sight::footprint_in_sight(&target, shadow.iter());
            differ += u32::from(level.footprint_in_sight(EYE, &target, 1.0, &[truck]) != exact);
            let exact = sight::box_in_sight(EYE, &target, [&truck]);
            differ += u32::from(level.box_in_sight(EYE, &target, &[truck]) != exact);
        }
        assert!(differ <= 8, "{differ} of 800: slivers between sampled points");
    }

    #[test]
    fn what_is_no_road_is_refused() {
        let error = |points: &[[f64; 2]]| Ground::new(points.to_vec()).unwrap_err().to_string();
        assert!(error(&[[0.0, 0.0], [10.0, 2.0]]).contains("before point 1 the grade is 0.200"));
        assert!(error(&[[10.0, 0.0], [0.0, 0.0]]).contains("point 1 at 0 m"));
        assert!(error(&[[f64::NAN, 0.0]]).contains("point 0"));
    }
}
