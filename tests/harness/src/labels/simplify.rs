//! Few points instead of many: Douglas-Peucker in time, in metres.
//!
//! # References
//! Douglas, Peucker, *Algorithms for the reduction of the number of points required to represent a digitized line*,
//! 1973; here the error of a point is the distance to where the simplified line is at the same time.

use super::tracks::LabelPoint;

/// Which of `count` points stay, the fewest, chosen greedily; first and last always. Without those between `a` and `b`,
/// `wrong(a, b, k)` tells how wrong `k` is; up to 1 it may be left out.
pub fn kept(count: usize, wrong: &dyn Fn(usize, usize, usize) -> f64) -> Vec<usize> {
    let Some(last) = count.checked_sub(1) else { return Vec::new() };
    let mut kept = vec![false; count];
    (kept[0], kept[last]) = (true, true);
    let mut spans = vec![(0, last)];
    while let Some((a, b)) = spans.pop() {
        let farthest = (a + 1..b).map(|k| (k, wrong(a, b, k))).max_by(|x, y| x.1.total_cmp(&y.1));
        if let Some((k, wrong)) = farthest
            && wrong > 1.0
        {
            kept[k] = true;
            spans.extend([(a, k), (k, b)]);
        }
    }
    (0..count).filter(|k| kept[*k]).collect()
}

/// Distance of `p` from where the line from `a` to `b` is at its time.
pub fn error(a: LabelPoint, b: LabelPoint, p: LabelPoint) -> f64 {
    let f = (p.time_s - a.time_s) / (b.time_s - a.time_s);
    (a.x_m + f * (b.x_m - a.x_m) - p.x_m).hypot(a.y_m + f * (b.y_m - a.y_m) - p.y_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simplify(points: &[LabelPoint], tolerance_m: f64) -> Vec<LabelPoint> {
        let wrong = |a: usize, b: usize, k: usize| error(points[a], points[b], points[k]) / tolerance_m;
        kept(points.len(), &wrong).into_iter().map(|k| points[k]).collect()
    }

    fn points(all: &[[f64; 3]]) -> Vec<LabelPoint> {
        all.iter().map(|p| (*p).into()).collect()
    }

    #[test]
    fn constant_speed_needs_two_points_and_a_stop_one_more_at_each_end() {
        let at = |k: f64| [k, (4.0 * k).min(20.0), 0.0];
        let stop: Vec<[f64; 3]> = (0..20).map(|k| at(f64::from(k))).collect();
        let few = simplify(&points(&stop), 0.1);
        assert_eq!(few, points(&[[0.0, 0.0, 0.0], [5.0, 20.0, 0.0], [19.0, 20.0, 0.0]]));
        assert_eq!(simplify(&few[..2], 0.1), few[..2]);
        assert!(simplify(&[], 1.0).is_empty());
    }

    #[test]
    fn nothing_that_is_left_out_was_farther_than_the_tolerance() {
        let wave: Vec<LabelPoint> =
            (0..400).map(|k| f64::from(k) * 0.1).map(|t| [t, 20.0 * t, 3.0 * t.sin()].into()).collect();
        let few = simplify(&wave, 0.5);
        assert!((10..60).contains(&few.len()), "{} points", few.len());
        for p in &wave {
            let next = few.partition_point(|q| q.time_s < p.time_s).max(1);
            assert!(error(few[next - 1], few[next], *p) <= 0.5);
        }
    }
}
