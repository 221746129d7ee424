//! Convex polygons in the plane: hull, clipping and exact subtraction.

pub type Point = [f64; 2];

/// Areas below this (square metres, or square tangents on an image plane) count as nothing.
const AREA_EPSILON: f64 = 1e-9;

/// A convex polygon, corners counter-clockwise.
#[derive(Debug, Clone, PartialEq)]
pub struct Convex(Vec<Point>);

/// An upright rectangle, to find cheaply what cannot meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    low: Point,
    high: Point,
}

impl Bounds {
    pub fn contains(&self, p: Point) -> bool {
        (0..2).all(|k| self.low[k] <= p[k] && p[k] <= self.high[k])
    }

    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

fn cross(o: Point, a: Point, b: Point) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
}

impl Convex {
    /// Convex hull (monotone chain).
    pub fn hull(mut points: Vec<Point>) -> Self {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        points.dedup();
        if points.len() < 3 {
            return Self(points);
        }
        let mut hull: Vec<Point> = Vec::with_capacity(points.len() + 1);
        for pass in 0..2 {
            let floor = hull.len();
            for k in 0..points.len() {
                let p = if pass == 0 { points[k] } else { points[points.len() - 1 - k] };
                while hull.len() >= floor + 2 && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                    hull.pop();
                }
                hull.push(p);
            }
            hull.pop();
        }
        Self(hull)
    }

    pub fn corners(&self) -> &[Point] {
        &self.0
    }

    pub fn area(&self) -> f64 {
        let c = &self.0;
        if c.len() < 3 {
            return 0.0;
        }
        (1..c.len() - 1).map(|i| cross(c[0], c[i], c[i + 1])).sum::<f64>() / 2.0
    }

    /// Least and greatest of each coordinate.
    pub fn bounds(&self) -> Bounds {
        let none = Bounds { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };
        self.0.iter().fold(none, |b, p| Bounds {
            low: [b.low[0].min(p[0]), b.low[1].min(p[1])],
            high: [b.high[0].max(p[0]), b.high[1].max(p[1])],
        })
    }

    pub fn contains(&self, p: Point) -> bool {
        self.0.len() >= 3 && self.edges().all(|(a, b)| cross(a, b, p) >= 0.0)
    }

    fn edges(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        (0..self.0.len()).map(|i| (self.0[i], self.0[(i + 1) % self.0.len()]))
    }

    /// The part to the left of the directed line a -> b (`side` = 1) or to the right (`side` = -1).
    fn clip(&self, a: Point, b: Point, side: f64) -> Self {
        let mut out = Vec::with_capacity(self.0.len() + 1);
        for (p, q) in self.edges() {
            let (dp, dq) = (side * cross(a, b, p), side * cross(a, b, q));
            if dp >= 0.0 {
                out.push(p);
            }
            if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                let t = dp / (dp - dq);
                out.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
            }
        }
        Self(out)
    }

    /// The part inside of `other`.
    pub fn within(&self, other: &Convex) -> Self {
        other.edges().fold(self.clone(), |rest, (a, b)| rest.clip(a, b, 1.0))
    }

    /// `self` without `other`, as disjoint convex pieces.
    fn minus(self, other: &Convex, pieces: &mut Vec<Convex>) {
        let mut rest = self;
        if other.area() <= AREA_EPSILON {
            pieces.push(rest);
            return;
        }
        for (a, b) in other.edges() {
            let outside = rest.clip(a, b, -1.0);
            if outside.area() > AREA_EPSILON {
                pieces.push(outside);
            }
            rest = rest.clip(a, b, 1.0);
            if rest.area() <= AREA_EPSILON {
                return;
            }
        }
    }
}

/// Area of `polygon` that no member of `covers` covers.
pub fn uncovered_area<'a>(polygon: Convex, covers: impl IntoIterator<Item = &'a Convex>) -> f64 {
    let bounds = polygon.bounds();
    let near = covers.into_iter().filter(|cover| bounds.meets(&cover.bounds()));
    uncovered(polygon, near).iter().map(Convex::area).sum()
}

/// What of `polygon` no member of `covers` covers, in disjoint convex pieces.
pub fn uncovered<'a>(polygon: Convex, covers: impl IntoIterator<Item = &'a Convex>) -> Vec<Convex> {
    let mut pieces = vec![polygon];
    for cover in covers {
        let mut next = Vec::with_capacity(pieces.len() + 2);
        for piece in pieces {
            piece.minus(cover, &mut next);
        }
        pieces = next;
        if pieces.is_empty() {
            break;
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x0: f64, y0: f64, x1: f64, y1: f64) -> Convex {
        Convex::hull(vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    }

    #[test]
    fn hull_drops_inner_points_and_turns_counter_clockwise() {
        let h = Convex::hull(vec![[0.0, 0.0], [2.0, 2.0], [1.0, 1.0], [2.0, 0.0], [0.0, 2.0], [1.0, 0.0]]);
        assert_eq!(h.corners().len(), 4);
        assert_eq!(h.area(), 4.0);
    }

    #[test]
    fn uncovered_area_is_exact() {
        let square = rect(0.0, 0.0, 10.0, 10.0);
        assert_eq!(uncovered_area(square.clone(), [&rect(-1.0, -1.0, 11.0, 11.0)]), 0.0);
        assert!((uncovered_area(square.clone(), [&rect(2.0, 2.0, 4.0, 5.0)]) - 94.0).abs() < 1e-9);
        // two overlapping covers count their union once
        let u = uncovered_area(square.clone(), [&rect(0.0, 0.0, 6.0, 10.0), &rect(4.0, 0.0, 9.0, 10.0)]);
        assert!((u - 10.0).abs() < 1e-9);
        assert_eq!(uncovered_area(square, [&rect(20.0, 0.0, 30.0, 10.0)]), 100.0);
    }

    #[test]
    fn what_lies_within_is_cut_at_the_border() {
        let square = rect(0.0, 0.0, 10.0, 10.0);
        assert_eq!(square.within(&rect(-5.0, 2.0, 5.0, 4.0)).area(), 10.0);
        assert_eq!(square.within(&rect(20.0, 0.0, 30.0, 10.0)).area(), 0.0);
    }

    #[test]
    fn points_on_the_border_are_inside() {
        let square = rect(0.0, 0.0, 1.0, 1.0);
        assert!(square.contains([0.0, 0.5]) && square.contains([0.5, 0.5]) && !square.contains([1.1, 0.5]));
    }
}
