//! Lines of several points in the plane: cut, smoothed, straightened.

type Point = [f64; 2];

/// Unit vector from one place to another.
pub fn direction(a: Point, b: Point) -> Point {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let long = dx.hypot(dy).max(1e-9);
    [dx / long, dy / long]
}

/// The part from its first to its last place within so far of a place.
pub fn within(points: &[Point], from: Point, reach_m: f64) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::new();
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        // where along the segment the circle is entered and left
        let d = [b[0] - a[0], b[1] - a[1]];
        let f = [a[0] - from[0], a[1] - from[1]];
        let (square, half) = (d[0] * d[0] + d[1] * d[1], f[0] * d[0] + f[1] * d[1]);
        let rest = half * half - square * (f[0] * f[0] + f[1] * f[1] - reach_m * reach_m);
        if square == 0.0 || rest <= 0.0 {
            continue;
        }
        let (enter, leave) = ((-half - rest.sqrt()) / square, (-half + rest.sqrt()) / square);
        let (enter, leave) = (enter.max(0.0), leave.min(1.0));
        if enter >= leave {
            continue;
        }
        let at = |t: f64| [a[0] + t * d[0], a[1] + t * d[1]];
        if kept.is_empty() {
            kept.push(at(enter));
        }
        kept.push(at(leave));
    }
    kept
}

/// Which of `count` points stay, the fewest, chosen greedily; first and last always. Without those between `a` and `b`,
/// `wrong(a, b, k)` tells how wrong `k` is; up to 1 it may be left out.
///
/// # References
/// Douglas, Peucker, *Algorithms for the reduction of the number of points required to represent a digitized line*, 1973.
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

/// Without points that lie within so far of the way between others.
pub fn straightened(points: &[Point], tolerance_m: f64) -> Vec<Point> {
    let aside = |a: usize, b: usize, k: usize| {
        let [x, y] = direction(points[a], points[b]);
        ((points[k][0] - points[a][0]) * y - (points[k][1] - points[a][1]) * x).abs() / tolerance_m
    };
    kept(points.len(), &aside).into_iter().map(|k| points[k]).collect()
}

/// Without points closer than this to the one before.
pub fn spaced(points: Vec<Point>, least_m: f64) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::new();
    for p in points {
        if kept.last().is_none_or(|last| (last[0] - p[0]).hypot(last[1] - p[1]) >= least_m) {
            kept.push(p);
        }
    }
    kept
}

/// Places every `step_m` along it.
fn resampled(points: &[Point], step_m: f64) -> Vec<Point> {
    let mut all: Vec<Point> = points.first().copied().into_iter().collect();
    // how far the next place is into the segment
    let mut next_m = step_m;
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let long = (b[0] - a[0]).hypot(b[1] - a[1]);
        while next_m <= long && long > 0.0 {
            all.push([a[0] + (b[0] - a[0]) * next_m / long, a[1] + (b[1] - a[1]) * next_m / long]);
            next_m += step_m;
        }
        next_m -= long;
    }
    all
}

/// Each place, every `step_m`, is the mean of those up to `reach_m` before and after it; towards the ends of fewer, as
/// many to either side, so that ends stay.
pub fn smoothed(points: &[Point], step_m: f64, reach_m: f64) -> Vec<Point> {
    let all = resampled(points, step_m);
    let reach = (reach_m / step_m) as usize;
    let mean = |k: usize| {
        let side = reach.min(k).min(all.len() - 1 - k);
        let near = &all[k - side..=k + side];
        [0, 1].map(|i| near.iter().map(|p| p[i]).sum::<f64>() / near.len() as f64)
    };
    (0..all.len()).map(mean).collect()
}

/// The longest part that does not cross itself.
pub fn uncrossed(points: &[Point]) -> &[Point] {
    let long = |part: &[Point]| part.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).sum::<f64>();
    let mut best = &points[..points.len().min(1)];
    for begin in 0..points.len() {
        let crosses =
            |end: &usize| (begin..end - 2).any(|k| cross([points[k], points[k + 1]], [points[end - 1], points[*end]]));
        let end = (begin + 3..points.len()).find(crosses).unwrap_or(points.len());
        let part = &points[begin..end];
        if long(part) > long(best) {
            best = part;
        }
    }
    best
}

/// Whether two segments cross or touch.
fn cross(a: [Point; 2], b: [Point; 2]) -> bool {
    let side = |[p, q]: [Point; 2], r: Point| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    side(a, b[0]) * side(a, b[1]) <= 0.0 && side(b, a[0]) * side(b, a[1]) <= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_cut_to_the_circle() {
        let cut = within(&[[-100.0, 0.0], [0.0, 0.0], [100.0, 0.0]], [0.0, 30.0], 50.0);
        assert_eq!(cut, [[-40.0, 0.0], [0.0, 0.0], [40.0, 0.0]]);
        assert!(within(&[[-100.0, 0.0], [100.0, 0.0]], [0.0, 60.0], 50.0).is_empty());
    }

    #[test]
    fn what_wobbles_becomes_straight_and_a_bend_stays_where_it_is() {
        let wobbly: Vec<Point> = (0..=100).map(|k| [f64::from(k), 0.4 * f64::from(k % 4 - 2)]).collect();
        let smooth = smoothed(&wobbly, 1.0, 10.0);
        assert!(smooth[5..90].iter().all(|p| p[1].abs() < 0.3), "{smooth:?}");
        assert_eq!((smooth[0], straightened(&smooth[5..90], 0.3).len()), (wobbly[0], 2));
        let bend: Vec<Point> =
            (0..=90).map(|k| f64::from(k).to_radians().sin_cos()).map(|(s, c)| [20.0 * c, 20.0 * s]).collect();
        for [x, y] in smoothed(&bend, 1.0, 4.0) {
            assert!((x.hypot(y) - 20.0).abs() < 0.2, "({x}, {y})");
        }
        assert!(straightened(&bend, 0.2).len() > 4);
        assert_eq!(smoothed(&[], 1.0, 4.0), Vec::<Point>::new());
    }

    #[test]
    fn of_a_line_that_crosses_itself_the_longest_part_that_does_not_is_left() {
        let looped = [[0.0, 0.0], [30.0, 0.0], [30.0, 10.0], [20.0, 10.0], [20.0, -5.0]];
        assert_eq!(uncrossed(&looped), &looped[..4]);
        let straight = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        assert_eq!(uncrossed(&straight), &straight);
        assert_eq!(uncrossed(&[]), &[] as &[Point]);
    }
}
