//! Upright boxes: vehicles and barriers as the ground truth knows them.

use super::polygon::{Convex, Point};

/// An upright box standing anywhere in the road frame; lengths in metres, yaw in radians from +x, counter-clockwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solid {
    /// Centre of the box.
    pub center: [f64; 3],
    pub yaw_rad: f64,
    /// Length (along yaw), width, height.
    pub size: [f64; 3],
}

/// Which part of the line `start + t step`, `t` between `from` and `to`, lies within `half` of the origin on both axes
/// (Liang-Barsky). The ends are the wrong way round where none does; `None` beside an axis it is parallel to.
pub fn clipped(start: Point, step: Point, half: Point, [from, to]: [f64; 2]) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (from, to);
    for k in 0..2 {
        if step[k].abs() < 1e-12 {
            if start[k].abs() > half[k] {
                return None;
            }
            continue;
        }
        let (a, b) = ((-half[k] - start[k]) / step[k], (half[k] - start[k]) / step[k]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    Some((enter, leave))
}

impl Solid {
    /// Road-frame point in the box's own axes: along its heading, to its left.
    pub fn local(&self, p: Point) -> Point {
        let (s, c) = self.yaw_rad.sin_cos();
        let (dx, dy) = (p[0] - self.center[0], p[1] - self.center[1]);
        [c * dx + s * dy, -s * dx + c * dy]
    }

    /// Inverse of [`Solid::local`].
    pub fn global(&self, p: Point) -> Point {
        let (s, c) = self.yaw_rad.sin_cos();
        [self.center[0] + c * p[0] - s * p[1], self.center[1] + s * p[0] + c * p[1]]
    }

    /// Corners of the footprint, counter-clockwise.
    pub fn footprint(&self) -> [Point; 4] {
        let (l, w) = (self.size[0] / 2.0, self.size[1] / 2.0);
        [[l, w], [-l, w], [-l, -w], [l, -w]].map(|p| self.global(p))
    }

    pub fn bottom(&self) -> f64 {
        self.center[2] - self.size[2] / 2.0
    }

    pub fn top(&self) -> f64 {
        self.center[2] + self.size[2] / 2.0
    }

    /// Distance from a point to the footprint; 0 inside.
    pub fn footprint_distance(&self, p: Point) -> f64 {
        let [x, y] = self.local(p);
        let dx = (x.abs() - self.size[0] / 2.0).max(0.0);
        let dy = (y.abs() - self.size[1] / 2.0).max(0.0);
        dx.hypot(dy)
    }

    /// Share of the smaller footprint that two boxes have in common.
    pub fn shared(&self, other: &Self) -> f64 {
        let reach = self.size[0].hypot(self.size[1]) + other.size[0].hypot(other.size[1]);
        if (self.center[0] - other.center[0]).hypot(self.center[1] - other.center[1]) * 2.0 > reach {
            return 0.0;
        }
        let [p, q] = [self, other].map(|s| Convex::hull(s.footprint().to_vec()));
        p.within(&q).area() / p.area().min(q.area())
    }

    /// Cells (i, j) = [i, i+1) x [j, j+1) metres that share area with the footprint.
    pub fn cells(&self) -> impl Iterator<Item = (i32, i32)> {
        let corners = self.footprint();
        let span = |k: usize| {
            let lo = corners.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min);
            let hi = corners.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
            (lo.floor() as i32, hi.ceil() as i32)
        };
        let ((i0, i1), (j0, j1)) = (span(0), span(1));
        let solid = *self;
        (i0..i1).flat_map(move |i| (j0..j1).map(move |j| (i, j))).filter(move |&(i, j)| solid.overlaps_cell(i, j))
    }

    /// Separating axes of a unit cell and the turned footprint; touching is not overlapping.
    fn overlaps_cell(&self, i: i32, j: i32) -> bool {
        const EPS: f64 = 1e-9;
        let (s, c) = self.yaw_rad.sin_cos();
        let (l, w) = (self.size[0] / 2.0, self.size[1] / 2.0);
        let (dx, dy) = (i as f64 + 0.5 - self.center[0], j as f64 + 0.5 - self.center[1]);
        let (ex, ey) = (l * c.abs() + w * s.abs(), l * s.abs() + w * c.abs());
        let cell = 0.5 * (c.abs() + s.abs());
        dx.abs() < ex + 0.5 - EPS
            && dy.abs() < ey + 0.5 - EPS
            && (c * dx + s * dy).abs() < l + cell - EPS
            && (-s * dx + c * dy).abs() < w + cell - EPS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car(x: f64, y: f64, yaw: f64) -> Solid {
        Solid { center: [x, y, 0.75], yaw_rad: yaw, size: [4.0, 2.0, 1.5] }
    }

    #[test]
    fn local_axes_are_ahead_and_left() {
        let c = car(10.0, 5.0, std::f64::consts::FRAC_PI_2);
        let [ahead, left] = c.local([9.0, 8.0]);
        assert!((ahead - 3.0).abs() < 1e-12 && (left - 1.0).abs() < 1e-12);
        let back = c.global([ahead, left]);
        assert!((back[0] - 9.0).abs() < 1e-12 && (back[1] - 8.0).abs() < 1e-12);
    }

    #[test]
    fn cells_share_area_and_do_not_just_touch() {
        assert_eq!(car(2.0, 1.0, 0.0).cells().count(), 8);
        assert_eq!(car(2.5, 1.0, 0.0).cells().count(), 10);
        let turned: Vec<_> = car(0.0, 0.0, std::f64::consts::FRAC_PI_4).cells().collect();
        assert!(turned.contains(&(1, 0)) && turned.contains(&(-1, -1)) && !turned.contains(&(1, -2)));
    }

    #[test]
    fn distance_is_zero_inside() {
        let c = car(0.0, 0.0, 0.0);
        assert_eq!(c.footprint_distance([1.0, 0.5]), 0.0);
        assert!((c.footprint_distance([5.0, 5.0]) - 5.0).abs() < 1e-12);
    }
}
