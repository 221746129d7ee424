//! Pairs of road and image points to the homography between them: the normalised direct linear transform.
//!
//! # Model
//! A point (x, y) of the road plane is seen at `(h1 . p, h2 . p) / h3 . p` with p = (x, y, 1). Both sets are moved
//! to their centre and scaled to a mean distance of the root of two; in such coordinates the last entry is not
//! zero, because the middle of what the camera sees lies ahead of it, and the other eight follow from least
//! squares. In double precision: this runs once, and normal equations square the condition.
//!
//! # References
//! R. Hartley, A. Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, section 4.4.

use crate::camera::points::{CalibrationError, LEAST_PAIRS, PointPair};
use crate::fixed::math;

/// Road plane (metres) to image (pixels).
pub(crate) type Homography = [[f64; 3]; 3];

/// Smallest over mean spread of points that do not lie on a line: 1 cm beside a line of 10 m.
const LINE: f64 = 1e-6;

/// Smallest share of a pivot that is left when all earlier unknowns are taken out of it.
const SINGULAR: f64 = 1e-10;

/// Moves points to their centre and scales them.
#[derive(Debug, Clone, Copy)]
struct Normal {
    center: [f64; 2],
    scale: f64,
}

impl Normal {
    /// Of these points; `None` where they lie on a line.
    fn of(points: impl Iterator<Item = [f64; 2]> + Clone) -> Option<Self> {
        let count = points.clone().fold(0.0, |n, _| n + 1.0);
        let sum = points.clone().fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
        let center = sum.map(|s| s / count);
        let offsets = points.map(|[x, y]| [x - center[0], y - center[1]]);
        let [xx, xy, yy] = offsets.clone().fold([0.0; 3], |[xx, xy, yy], [x, y]| [xx + x * x, xy + x * y, yy + y * y]);
        let distance: f64 = offsets.map(|[x, y]| math::sqrt_double(x * x + y * y)).sum::<f64>() / count;
        let spread = (xx + yy) * (xx + yy) / 4.0;
        let flat = xx * yy - xy * xy <= LINE * spread;
        (!flat && distance > 0.0).then(|| Self { center, scale: math::sqrt_double(2.0) / distance })
    }

    fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.center[0]) * self.scale, (y - self.center[1]) * self.scale]
    }
}

/// The homography of four or more pairs, of no particular scale; positive where the camera looks.
pub(crate) fn fit(pairs: &[PointPair]) -> Result<Homography, CalibrationError> {
    if pairs.len() < LEAST_PAIRS {
        return Err(CalibrationError::TooFewPoints { points: pairs.len() });
    }
    let road = |p: &PointPair| p.road_m.map(f64::from);
    let image = |p: &PointPair| p.image_px.map(f64::from);
    if let Some(index) = pairs.iter().position(|p| p.road_m.iter().chain(&p.image_px).any(|v| !v.is_finite())) {
        return Err(CalibrationError::NotFinite { index });
    }
    let from = Normal::of(pairs.iter().map(road)).ok_or(CalibrationError::RoadPointsOnALine)?;
    let to = Normal::of(pairs.iter().map(image)).ok_or(CalibrationError::ImagePointsOnALine)?;
    let mut matrix = [[0.0; 8]; 8];
    let mut right = [0.0; 8];
    for pair in pairs {
        let ([x, y], [u, v]) = (from.apply(road(pair)), to.apply(image(pair)));
        add([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u, &mut matrix, &mut right);
        add([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v, &mut matrix, &mut right);
    }
    let [a, b, c, d, e, f, g, h] = solve(matrix, right).ok_or(CalibrationError::Degenerate)?;
    // out of the image's normal coordinates, then into the road's
    let third = [g, h, 1.0];
    let row = |row: [f64; 3], center: f64| {
        let [p, q, r] = [0, 1, 2].map(|k| pick(&row, k) / to.scale + center * pick(&third, k));
        [p, q, r]
    };
    let rows = [row([a, b, c], to.center[0]), row([d, e, f], to.center[1]), third];
    Ok(rows.map(|[p, q, r]| {
        let (p, q) = (p * from.scale, q * from.scale);
        [p, q, r - p * from.center[0] - q * from.center[1]]
    }))
}

fn pick(row: &[f64; 3], k: usize) -> f64 {
    row.get(k).copied().unwrap_or(0.0)
}

/// Adds one equation to the normal equations.
fn add(row: [f64; 8], value: f64, matrix: &mut [[f64; 8]; 8], right: &mut [f64; 8]) {
    for ((line, sum), own) in matrix.iter_mut().zip(right).zip(row) {
        line.iter_mut().zip(row).for_each(|(m, other)| *m += own * other);
        *sum += own * value;
    }
}

/// Solves symmetric positive equations (Cholesky without roots); `None` where they leave something open.
fn solve<const N: usize>(matrix: [[f64; N]; N], right: [f64; N]) -> Option<[f64; N]> {
    let mut lower = [[0.0; N]; N];
    let mut pivots = [0.0; N];
    for (i, row) in matrix.iter().enumerate() {
        let mut own = [0.0; N];
        for (j, ((value, other), pivot)) in row.iter().zip(&lower).zip(&pivots).enumerate().take(i) {
            let known: f64 = own.iter().zip(other).zip(&pivots).take(j).map(|((a, b), pivot)| a * b * pivot).sum();
            *own.get_mut(j)? = (value - known) / pivot;
        }
        let known: f64 = own.iter().zip(&pivots).take(i).map(|(a, pivot)| a * a * pivot).sum();
        let all = *row.get(i)?;
        let left = all - known;
        // a NaN is refused as well
        let determined = left > SINGULAR * all;
        if !determined {
            return None;
        }
        *pivots.get_mut(i)? = left;
        *lower.get_mut(i)? = own;
    }
    let mut x = right;
    for (i, row) in lower.iter().enumerate() {
        let known: f64 = row.iter().zip(&x).take(i).map(|(a, x)| a * x).sum();
        *x.get_mut(i)? -= known;
    }
    for (i, pivot) in pivots.iter().enumerate().rev() {
        let below = lower.iter().zip(&x).skip(i + 1);
        let known: f64 = below.map(|(row, x)| row.get(i).copied().unwrap_or(0.0) * x).sum();
        let own = x.get_mut(i)?;
        *own = *own / pivot - known;
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(h: &Homography, [x, y]: [f64; 2]) -> [f64; 2] {
        let of = |row: [f64; 3]| row[0] * x + row[1] * y + row[2];
        [of(h[0]) / of(h[2]), of(h[1]) / of(h[2])]
    }

    fn pair([x, y]: [f64; 2], [u, v]: [f64; 2]) -> PointPair {
        PointPair { road_m: [x as f32, y as f32], image_px: [u as f32, v as f32] }
    }

    const TRUE: Homography = [[960.0, -1600.0, 100.0], [540.0, 3.0, 9900.0], [1.0, 0.02, 0.6]];

    fn pairs(road: &[[f64; 2]]) -> std::vec::Vec<PointPair> {
        road.iter().map(|p| pair(*p, seen(&TRUE, *p))).collect()
    }

    #[test]
    fn exact_points_give_their_homography_back() {
        let h = fit(&pairs(&[[20.0, -8.0], [20.0, 9.0], [90.0, 7.0], [110.0, -10.0], [50.0, 0.0]])).unwrap();
        for p in [[30.0, 4.0], [150.0, -12.0], [15.0, 0.0]] {
            let (got, exact) = (seen(&h, p), seen(&TRUE, p));
            assert!((got[0] - exact[0]).abs() < 0.01 && (got[1] - exact[1]).abs() < 0.01, "{got:?} {exact:?}");
        }
        assert!(h[2][0] * 50.0 + h[2][2] > 0.0, "ahead is positive");
    }

    #[test]
    fn what_determines_nothing_is_refused_by_name() {
        use CalibrationError::*;
        let few = pairs(&[[20.0, -8.0], [20.0, 9.0], [90.0, 7.0]]);
        assert_eq!(fit(&few), Err(TooFewPoints { points: 3 }));
        let line = pairs(&[[20.0, -8.0], [30.0, -6.0], [40.0, -4.0], [50.0, -2.0], [90.0, 6.0]]);
        assert_eq!(fit(&line), Err(RoadPointsOnALine));
        let mut flat = pairs(&[[20.0, -8.0], [20.0, 9.0], [90.0, 7.0], [110.0, -10.0]]);
        flat.iter_mut().for_each(|p| p.image_px[1] = 2.0 * p.image_px[0]);
        assert_eq!(fit(&flat), Err(ImagePointsOnALine));
        let three_on_a_line = pairs(&[[20.0, -8.0], [40.0, -8.0], [90.0, -8.0], [90.0, 7.0]]);
        assert_eq!(fit(&three_on_a_line), Err(Degenerate));
        let twice = pairs(&[[20.0, -8.0], [20.0, -8.0], [90.0, 7.0], [110.0, -10.0]]);
        assert_eq!(fit(&twice), Err(Degenerate));
        let mut nan = pairs(&[[20.0, -8.0], [20.0, 9.0], [90.0, 7.0], [110.0, -10.0]]);
        nan[2].road_m[1] = f32::NAN;
        assert_eq!(fit(&nan), Err(NotFinite { index: 2 }));
    }
}
