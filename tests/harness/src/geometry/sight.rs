//! Exact lines of sight past boxes, on the slice plane and in space.
//!
//! Both bounds are analytic: the part of a convex target that convex shadows leave uncovered.
//! A target never hides itself.

use super::polygon::{Convex, Point, uncovered, uncovered_area};
use super::pose::SensorPose;
use super::solid::{Solid, clipped};

/// Uncovered area from which a target counts as in sight: 1 mm x 1 mm.
const VISIBLE_AREA: f64 = 1e-6;

/// Nearest height difference to the sensor that a shadow is still projected from, metres.
const GRAZING: f64 = 0.01;

/// The shadow a box casts on the plane at `height_m`: every point of the plane whose line to the
/// sensor passes through the box. `None` where the box reaches no such line.
pub fn shadow(sensor: [f64; 3], solid: &Solid, height_m: f64) -> Option<Convex> {
    let [sx, sy, sz] = sensor;
    // a plane through the sensor itself has no projection centre off it: look from just above
    let sz = if (sz - height_m).abs() < 2.0 * GRAZING { height_m + 2.0 * GRAZING } else { sz };
    let (lo, hi) = if sz > height_m { (height_m, sz - GRAZING) } else { (sz + GRAZING, height_m) };
    let (z0, z1) = (solid.bottom().max(lo), solid.top().min(hi));
    if z0 > z1 {
        return None;
    }
    let mut points = Vec::with_capacity(8);
    for z in [z0, z1] {
        let stretch = (sz - height_m) / (sz - z);
        for [x, y] in solid.footprint() {
            points.push([sx + (x - sx) * stretch, sy + (y - sy) * stretch]);
        }
    }
    Some(Convex::hull(points))
}

/// Whether some point of the target's footprint, taken at the shadows' height, is in sight.
pub fn footprint_in_sight<'a>(target: &Solid, shadows: impl IntoIterator<Item = &'a Convex>) -> bool {
    uncovered_area(Convex::hull(target.footprint().to_vec()), shadows) > VISIBLE_AREA
}

/// Whether some point of the target box is in sight past all `others`.
///
/// Boxes are projected on an image plane at unit distance, facing the target. Two disjoint convex
/// bodies have one order in depth along every line they share, so each other box either covers its
/// outline or none of it.
pub fn box_in_sight<'a>(sensor: [f64; 3], target: &Solid, others: impl IntoIterator<Item = &'a Solid>) -> bool {
    let toward = SensorPose::new(sensor, (target.center[1] - sensor[1]).atan2(target.center[0] - sensor[0]), 0.0, 0.0);
    let Some(outline) = outline(&toward, target) else { return true };
    let covers: Vec<Convex> = others
        .into_iter()
        .filter(|other| may_overlap(sensor, other, target) && in_front(sensor, other, target))
        .filter_map(|other| self::outline(&toward, other))
        .collect();
    // tangents: 1e-6 m^2 seen from 1 km
    uncovered_area(outline, &covers) > VISIBLE_AREA * 1e-6
}

/// Whether two boxes can lie in one direction at all, judged from the circles around their footprints.
fn may_overlap(sensor: [f64; 3], a: &Solid, b: &Solid) -> bool {
    let seen = |s: &Solid| {
        let (dx, dy) = (s.center[0] - sensor[0], s.center[1] - sensor[1]);
        let (distance, radius) = (dx.hypot(dy), 0.5 * s.size[0].hypot(s.size[1]));
        (distance > radius).then(|| (dy.atan2(dx), (radius / distance).asin()))
    };
    let (Some((to_a, half_a)), Some((to_b, half_b))) = (seen(a), seen(b)) else { return true };
    let turn = (to_a - to_b + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
    turn.abs() <= half_a + half_b + 1e-6
}

/// Projection of a box on the image plane at unit distance (left and up), clipped to what lies ahead of
/// the sensor.
pub fn outline(toward: &SensorPose, solid: &Solid) -> Option<Convex> {
    const AHEAD: f64 = 0.05;
    let corners: Vec<[f64; 3]> = [solid.bottom(), solid.top()]
        .iter()
        .flat_map(|&z| solid.footprint().map(|[x, y]| toward.to_sensor([x, y, z])))
        .collect();
    let mut points: Vec<Point> = Vec::with_capacity(16);
    let image = |v: [f64; 3]| [v[1] / v[0], v[2] / v[0]];
    for (i, &a) in corners.iter().enumerate() {
        if a[0] >= AHEAD {
            points.push(image(a));
        }
        for &b in &corners[i + 1..] {
            if (a[0] < AHEAD) != (b[0] < AHEAD) {
                let t = (AHEAD - a[0]) / (b[0] - a[0]);
                points.push(image([AHEAD, a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])]));
            }
        }
    }
    (points.len() >= 3).then(|| Convex::hull(points))
}

/// What is seen of one object on the image plane at unit distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncovered {
    /// Index of the object.
    pub object: usize,
    /// Least and greatest left and up of what is seen.
    pub low: Point,
    pub high: Point,
    /// Seen share of its outline, what lies outside of the frame included.
    pub share: f64,
}

/// What is seen of each object past all others and past `screens`, within a frame of the image plane.
pub fn uncovered_outlines(toward: &SensorPose, objects: &[Solid], screens: &[Solid], frame: &Convex) -> Vec<Uncovered> {
    let all: Vec<(Solid, Option<Convex>)> = objects.iter().chain(screens).map(|s| (*s, outline(toward, s))).collect();
    let seen = |object: usize| {
        let (solid, outline) = &all[object];
        let outline = outline.clone()?;
        let whole = outline.area();
        let covers = all.iter().enumerate().filter_map(|(i, (other, cover))| {
            (i != object && cover.is_some() && in_front(toward.position, other, solid)).then_some(cover.as_ref()?)
        });
        let pieces: Vec<Convex> =
            uncovered(outline, covers).iter().map(|p| p.within(frame)).filter(|p| p.area() > 0.0).collect();
        let visible: f64 = pieces.iter().map(Convex::area).sum();
        let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (low, high) = pieces
            .iter()
            .flat_map(Convex::corners)
            .fold(none, |(low, high), [x, y]| ([low[0].min(*x), low[1].min(*y)], [high[0].max(*x), high[1].max(*y)]));
        (visible > 1e-9).then(|| Uncovered { object, low, high, share: (visible / whole).min(1.0) })
    };
    (0..objects.len()).filter_map(seen).collect()
}

/// Share of an upright column from the road to `height_m` that is in sight past boxes that stand on the road.
pub fn column_in_sight<'a>(
    sensor: [f64; 3],
    at: Point,
    height_m: f64,
    solids: impl IntoIterator<Item = &'a Solid>,
) -> f64 {
    let hidden = solids.into_iter().filter_map(|solid| {
        let (near, far) = crossing(solid, [sensor[0], sensor[1]], at)?;
        let above = solid.top() - sensor[2];
        // the highest line to the column that the box still stops
        Some(sensor[2] + (above / near.max(1e-6)).max(above / far.max(1e-6)))
    });
    1.0 - hidden.fold(0.0, f64::max).clamp(0.0, height_m) / height_m
}

/// Parts of the way from one place to another at which a footprint is entered and left.
fn crossing(solid: &Solid, from: Point, to: Point) -> Option<(f64, f64)> {
    let (a, b) = (solid.local(from), solid.local(to));
    let way = [b[0] - a[0], b[1] - a[1]];
    let ends = clipped(a, way, [solid.size[0] / 2.0, solid.size[1] / 2.0], [0.0, 1.0]);
    ends.filter(|(enter, leave)| enter < leave)
}

/// Whether `a` lies before `b` as seen from the sensor: the sensor is on `a`'s side of a plane
/// that parts the two. Boxes that overlap (labels do) are ordered by distance.
pub fn in_front(sensor: [f64; 3], a: &Solid, b: &Solid) -> bool {
    let eye = [sensor[0], sensor[1]];
    let interval = |solid: &Solid, axis: Point| {
        solid
            .footprint()
            .iter()
            .map(|c| c[0] * axis[0] + c[1] * axis[1])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
    };
    let mut best: Option<(f64, bool)> = None;
    for yaw in [a.yaw_rad, b.yaw_rad] {
        for axis in [[yaw.cos(), yaw.sin()], [-yaw.sin(), yaw.cos()]] {
            let (a0, a1) = interval(a, axis);
            let (b0, b1) = interval(b, axis);
            let e = eye[0] * axis[0] + eye[1] * axis[1];
            // signed gap and the plane in its middle
            let (gap, middle, a_below) =
                if b0 - a1 > a0 - b1 { (b0 - a1, (a1 + b0) / 2.0, true) } else { (a0 - b1, (b1 + a0) / 2.0, false) };
            if gap >= 0.0 && best.is_none_or(|(g, _)| gap > g) {
                best = Some((gap, (e < middle) == a_below));
            }
        }
    }
    match best {
        Some((_, front)) => front,
        None => {
            let d = |s: &Solid| (s.center[0] - eye[0]).hypot(s.center[1] - eye[1]);
            d(a) < d(b)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(x: f64, y: f64, l: f64, w: f64, h: f64) -> Solid {
        Solid { center: [x, y, h / 2.0], yaw_rad: 0.0, size: [l, w, h] }
    }

    const GANTRY: [f64; 3] = [0.0, 0.0, 6.0];

    #[test]
    fn a_truck_shadows_as_far_as_similar_triangles_say() {
        // rear top edge at 60 m, 4 m high: the ray falls 2 m in 60 m, so it is at 1 m after 150 m
        let truck = solid(55.0, 0.0, 10.0, 2.5, 4.0);
        let s = shadow(GANTRY, &truck, 1.0).unwrap();
        assert!(s.contains([149.0, 0.0]) && !s.contains([151.0, 0.0]));
        assert!(!s.contains([49.0, 0.0]), "in front of the truck is clear");
        assert!(s.contains([100.0, 2.0]) && !s.contains([100.0, 3.0]));
    }

    #[test]
    fn something_lower_than_the_plane_shadows_nothing_on_it() {
        assert!(shadow(GANTRY, &solid(50.0, 0.0, 1.0, 1.0, 0.9), 1.0).is_none());
    }

    #[test]
    fn something_higher_than_the_sensor_shadows_without_end() {
        let s = shadow([0.0, 0.0, 3.5], &solid(50.0, 0.0, 10.0, 2.5, 4.0), 1.0).unwrap();
        assert!(s.contains([5_000.0, 0.0]));
    }

    #[test]
    fn a_sensor_below_the_plane_sees_over_low_and_not_past_high_boxes() {
        let bumper = [0.0, 0.0, 0.6];
        let car = shadow(bumper, &solid(20.0, 0.0, 4.0, 2.0, 1.5), 1.0).unwrap();
        assert!(car.contains([90.0, 0.0]), "the car reaches above the line");
        // a 0.5 m kerb stays below every rising line
        assert!(shadow(bumper, &solid(20.0, 0.0, 4.0, 2.0, 0.5), 1.0).is_none());
    }

    #[test]
    fn a_column_shows_what_is_above_the_line_over_a_truck() {
        let truck = solid(55.0, 0.0, 10.0, 2.5, 4.0);
        let share = |x, y| column_in_sight(GANTRY, [x, y], 4.0, [&truck]);
        // the line over the top at 60 m falls 2 m in 60: at 90 m it is at 3 m, at 150 m at 1 m
        assert!((share(90.0, 0.0) - 0.25).abs() < 1e-9 && (share(150.0, 0.0) - 0.75).abs() < 1e-9);
        assert_eq!((share(49.0, 0.0), share(200.0, 0.0), share(90.0, 3.0)), (1.0, 1.0, 1.0));
        let low = column_in_sight([0.0, 0.0, 2.0], [90.0, 0.0], 4.0, [&truck]);
        assert_eq!(low, 0.0, "from below its top nothing is seen behind");
    }

    #[test]
    fn a_partly_covered_footprint_is_in_sight_and_a_covered_one_is_not() {
        let truck = solid(50.0, 0.0, 10.0, 2.5, 4.0);
        let shadows = [shadow(GANTRY, &truck, 1.0).unwrap()];
        assert!(!footprint_in_sight(&solid(70.0, 0.0, 4.5, 1.8, 1.5), &shadows));
        assert!(footprint_in_sight(&solid(70.0, 1.5, 4.5, 1.8, 1.5), &shadows));
        assert!(footprint_in_sight(&solid(140.0, 0.0, 4.5, 1.8, 1.5), &shadows));
    }

    #[test]
    fn a_box_shows_its_top_over_a_lower_one() {
        let car = solid(40.0, 0.0, 4.5, 1.8, 1.5);
        let truck = solid(48.0, 0.0, 10.0, 2.5, 4.0);
        assert!(box_in_sight(GANTRY, &truck, [&car]));
        assert!(box_in_sight(GANTRY, &car, [&truck]), "what stands behind hides nothing");
        assert!(!box_in_sight(GANTRY, &solid(62.0, 0.0, 4.5, 1.8, 1.5), [&truck]));
    }

    #[test]
    fn depth_order_holds_for_a_long_box_beside_a_short_one() {
        // the truck's centre is farther than the car's, yet the truck stands between sensor and car
        let truck = Solid { center: [30.0, 3.0, 2.0], yaw_rad: 0.0, size: [50.0, 2.5, 4.0] };
        let car = solid(18.0, 6.5, 4.0, 1.8, 1.5);
        assert!(!box_in_sight([0.0, 0.0, 3.0], &car, [&truck]));
        assert!(box_in_sight([0.0, 0.0, 3.0], &truck, [&car]));
    }

    #[test]
    fn analytic_sight_agrees_with_many_points() {
        // deterministic scatter of boxes; 41 x 41 points per footprint as the plain reference
        let mut seed = 1_u64;
        let mut next = |lo: f64, hi: f64| {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            lo + (hi - lo) * ((seed >> 33) as f64 / (1_u64 << 31) as f64)
        };
        let (mut differ, mut hidden, total) = (0, 0, 300);
        for _ in 0..total {
            let target = Solid {
                center: [next(80.0, 120.0), next(-5.0, 5.0), 0.75],
                yaw_rad: next(-3.0, 3.0),
                size: [4.5, 1.8, 1.5],
            };
            let shadows: Vec<Convex> = (0..4)
                .filter_map(|_| {
                    let s = Solid {
                        center: [next(30.0, 70.0), next(-6.0, 6.0), 2.0],
                        yaw_rad: next(-3.0, 3.0),
                        size: [12.0, 2.5, 4.0],
                    };
                    shadow(GANTRY, &s, 1.0)
                })
                .collect();
            let exact = footprint_in_sight(&target, &shadows);
            let sampled = (0..41 * 41).any(|k| {
                let p = target.global([(f64::from(k % 41) / 40.0 - 0.5) * 4.5, (f64::from(k / 41) / 40.0 - 0.5) * 1.8]);
                !shadows.iter().any(|s| s.contains(p))
            });
            hidden += usize::from(!exact);
            differ += usize::from(exact != sampled);
        }
        assert!(hidden > 20, "the scatter must hide some: {hidden}");
        assert!(differ <= 2, "{differ} of {total} differ");
    }
}
