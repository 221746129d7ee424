//! Lanes, learnt from the traffic itself: where many drive one behind the other.
//!
//! # Model
//! Paths that run side by side within [`WITHIN_M`] in one direction are one lane; its middle is their mean, near ones
//! counting most, since a place is vaguer across the farther away it is. Lanes that most paths speak for come first;
//! what lies closer to one of them than two lanes can is none, but paths that hold two vehicles abreast.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::lane::Lane;
use super::path::Path;
use super::reflections::Instant;
use super::tracker::across_m;

/// Distance of a lane's points, metres.
const STEP_M: f64 = 2.0;
/// A path that gets this far from its start, with so many reflections, may speak for a lane.
const TRAVEL_M: f64 = 15.0;
const REFLECTIONS: usize = 40;
/// How far beside one another the paths of one lane run, metres.
const WITHIN_M: f64 = 1.2;
/// Two lanes of one direction are at least this far apart, metres.
const APART_M: f64 = 2.4;
/// Straight lanes of directions closer than this are of one road, there and back.
const ONE_ROAD_COS: f64 = 0.99;
/// Cosine of the angle up to which two headings are one direction.
const SAME_COS: f64 = 0.94;
/// Fewest paths of a lane.
const FEWEST: usize = 2;
/// Every how many points of a path are compared with a lane, and how many paths, the longest, may be its first.
const LOOK: usize = 3;
const CANDIDATES: usize = 40;
/// A lane goes on straight beyond what was driven, metres; one that is straight farther.
const BEYOND_M: f64 = 12.0;
const STRAIGHT_ON_M: f64 = 60.0;
/// A lane is straight if no point is farther from a line than this and this share of its spread, metres.
const STRAIGHT_M: f64 = 0.4;
const STRAIGHT_SPREAD: f64 = 0.8;
/// Its middle is smooth over so many points to each side.
const SMOOTH: usize = 6;

/// A path's places every [`STEP_M`], each with its spread.
pub struct Driven {
    places: Vec<([f64; 2], f64)>,
}

impl Driven {
    fn of(path: &Path, instants: &[Instant]) -> Option<Self> {
        if path.travel_m() < TRAVEL_M || path.members.len() < REFLECTIONS {
            return None;
        }
        let mut seen = path.reflections(instants).map(|(frame, r)| (frame, *r)).peekable();
        let mut places: Vec<([f64; 2], f64)> = Vec::new();
        let mut last = seen.peek()?.1;
        for (k, (_, motion)) in path.motions.iter().enumerate() {
            while let Some((_, r)) = seen.next_if(|(frame, _)| *frame <= path.first + k) {
                last = r;
            }
            let [x, y] = motion.place();
            if places.last().is_none_or(|([a, b], _)| (x - a).hypot(y - b) >= STEP_M) {
                places.push(([x, y], across_m(last.distance_m)));
            }
        }
        (places.len() > 4).then_some(Self { places })
    }

    fn length_m(&self) -> f64 {
        self.places.len() as f64 * STEP_M
    }

    fn lane(&self) -> Lane {
        Lane { points: self.places.iter().step_by(LOOK).map(|(p, _)| *p).collect(), straight: None }.longer()
    }

    /// Mean distance from a lane, near places counting most, and the share of this path that is beside it.
    fn off(&self, lane: &Lane) -> Option<(f64, f64)> {
        let (mut sum, mut weights, mut beside, mut all) = (0.0, 0.0, 0_usize, 0_usize);
        for (k, (place, spread)) in self.places.iter().enumerate().step_by(LOOK) {
            all += 1;
            let Some(b) = lane.beside(*place) else { continue };
            let near = |k: usize| self.places.get(k).map_or(*place, |p| p.0);
            let [from, to] = [near(k.saturating_sub(1)), near(k + 1)];
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            if b.left_m.abs() > 6.0 || dx * b.heading[0] + dy * b.heading[1] < SAME_COS * dx.hypot(dy) {
                continue;
            }
            let weight = 1.0 / (spread * spread);
            (sum, weights, beside) = (sum + weight * b.left_m.abs(), weights + weight, beside + 1);
        }
        (beside > 2).then(|| (sum / weights, beside as f64 / all as f64))
    }
}

impl Lane {
    /// Goes on straight at both ends.
    fn longer(mut self) -> Self {
        if self.straight.is_some() {
            return self;
        }
        let beyond = |from: [f64; 2], end: [f64; 2]| {
            let [dx, dy] = [end[0] - from[0], end[1] - from[1]];
            let f = BEYOND_M / dx.hypot(dy).max(1e-6);
            [end[0] + f * dx, end[1] + f * dy]
        };
        let n = self.points.len();
        if n > 4 {
            let (first, last) =
                (beyond(self.points[4], self.points[0]), beyond(self.points[n - 5], self.points[n - 1]));
            self.points.insert(0, first);
            self.points.push(last);
        }
        self
    }

    /// The mean of the paths beside it, in place of what it was.
    fn between(&self, driven: &[&Driven]) -> Self {
        let length_m: f64 = self.points.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).sum();
        let cells = (length_m / STEP_M) as usize + 1;
        let mut sums = vec![(0.0, 0.0); cells];
        for (place, spread) in driven.iter().flat_map(|d| &d.places) {
            let Some(b) = self.beside(*place).filter(|b| b.left_m.abs() < 2.0 * WITHIN_M + spread) else { continue };
            if let Some(sum) = sums.get_mut((b.along_m / STEP_M).max(0.0) as usize) {
                let weight = 1.0 / (spread * spread);
                *sum = (sum.0 + weight * b.left_m, sum.1 + weight);
            }
        }
        if let Some(straight) = self.straight(driven) {
            return straight;
        }
        let mut points = Vec::new();
        for k in 0..cells {
            let near = &sums[k.saturating_sub(SMOOTH)..(k + SMOOTH + 1).min(cells)];
            let (sum, weight) = near.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            let left = if weight > 0.0 { sum / weight } else { 0.0 };
            if let Some((place, [c, s])) = self.at((k as f64 + 0.5) * STEP_M) {
                points.push([place[0] - left * s, place[1] + left * c]);
            }
        }
        Self { points, straight: None }
    }

    /// The line through all places beside it, if that fits them.
    fn straight(&self, driven: &[&Driven]) -> Option<Self> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        let [dx, dy] = [last[0] - first[0], last[1] - first[1]];
        let length = dx.hypot(dy);
        let [c, s] = [dx / length, dy / length];
        let mut beside: Vec<[f64; 3]> = Vec::new();
        for (place, spread) in driven.iter().flat_map(|d| &d.places) {
            if self.beside(*place).is_none_or(|b| b.left_m.abs() > 2.0 * WITHIN_M + spread) {
                continue;
            }
            let [px, py] = [place[0] - first[0], place[1] - first[1]];
            beside.push([px * c + py * s, -px * s + py * c, *spread]);
        }
        // left = a + b along, near places counting most
        let mut m = [0.0; 5];
        for [along, left, spread] in &beside {
            let w = spread.powi(-4);
            for (m, v) in m.iter_mut().zip([w, w * along, w * along * along, w * left, w * along * left]) {
                *m += v;
            }
        }
        let determinant = m[0] * m[2] - m[1] * m[1];
        if determinant.abs() < 1e-9 {
            return None;
        }
        let [a, b] = [(m[2] * m[3] - m[1] * m[4]) / determinant, (m[0] * m[4] - m[1] * m[3]) / determinant];
        // mean of the cells, so that one path that leaves does not bend the lane
        let mut cells: BTreeMap<i64, [f64; 3]> = BTreeMap::new();
        for [along, left, spread] in &beside {
            let cell = cells.entry((along / (4.0 * STEP_M)) as i64).or_default();
            *cell = [cell[0] + left - a - b * along, cell[1] + spread, cell[2] + 1.0];
        }
        let bent =
            cells.values().filter(|[off, spread, n]| off.abs() > STRAIGHT_M * n + STRAIGHT_SPREAD * spread).count();
        if bent * 10 > cells.len() {
            return None;
        }
        let [low, high] =
            beside.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], b| [l.min(b[0]), h.max(b[0])]);
        let point = |along: f64| {
            let left = a + b * along;
            [first[0] + c * along - s * left, first[1] + s * along + c * left]
        };
        let points = vec![point(low - STRAIGHT_ON_M), point(high + STRAIGHT_ON_M)];
        let straight = Some((point(m[1] / m[0]), m[0]));
        (high - low > STEP_M).then_some(Self { points, straight })
    }
}

/// What the paths of a recording tell of lanes.
pub fn driven(paths: &[Path], instants: &[Instant]) -> Vec<Driven> {
    paths.iter().filter_map(|p| Driven::of(p, instants)).collect()
}

/// The lanes that are driven on, those that most speak for first.
pub fn learn(left: Vec<Driven>) -> Vec<Lane> {
    counted(left).into_iter().map(|(lane, _)| lane).collect()
}

/// The same, each with how many paths speak for it.
pub fn counted(mut left: Vec<Driven>) -> Vec<(Lane, usize)> {
    left.sort_by(|a, b| b.length_m().total_cmp(&a.length_m()));
    let (mut lanes, mut paths): (Vec<Lane>, Vec<usize>) = (Vec::new(), Vec::new());
    while let Some((first, _)) = left
        .par_iter()
        .enumerate()
        .take(CANDIDATES)
        .map(|(k, d)| (k, support(&d.lane(), &left)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
    {
        let mut lane = left[first].lane();
        let mut own: Vec<usize> = vec![first];
        for _ in 0..3 {
            own = (0..left.len())
                .filter(|k| left[*k].off(&lane).is_some_and(|(off, share)| off < WITHIN_M && share > 0.5))
                .collect();
            let driven: Vec<&Driven> = own.iter().map(|k| &left[*k]).collect();
            if driven.is_empty() {
                break;
            }
            lane = lane.between(&driven);
        }
        // what is too near to it is no lane of its own
        let lane = lane.longer();
        let too_near = |d: &Driven| d.off(&lane).is_some_and(|(off, share)| off < APART_M && share > 0.6);
        let before = left.len();
        let supported = own.len() >= FEWEST;
        let mut k = 0;
        left.retain(|d| {
            k += 1;
            k - 1 != first && !(supported && too_near(d))
        });
        if supported {
            lanes.push(lane);
            paths.push(own.len());
        } else if before == left.len() {
            break;
        }
    }
    parallel(&mut lanes);
    lanes.into_iter().zip(paths).collect()
}

/// Straight lanes of one road have one direction: places of one lane are wrong alike, those to the sensor's left and
/// right in opposite ways.
fn parallel(lanes: &mut [Lane]) {
    let ends = |lane: &Lane| {
        let (first, last) = (lane.points.first()?, lane.points.last()?);
        let [dx, dy] = [last[0] - first[0], last[1] - first[1]];
        let length = dx.hypot(dy);
        Some(([dx / length, dy / length], length, lane.straight?))
    };
    let all: Vec<_> = lanes.iter().map(ends).collect();
    for (lane, own) in lanes.iter_mut().zip(&all) {
        let Some(([c, s], _, (center, _))) = own else { continue };
        let (mut sum, mut weights) = (0.0, 0.0);
        for ([a, b], length, (_, weight)) in all.iter().flatten() {
            let (cos, sin) = (a * c + b * s, b * c - a * s);
            if cos.abs() > ONE_ROAD_COS {
                // how well its direction is known
                let weight = weight * length * length;
                (sum, weights) = (sum + weight * sin / cos, weights + weight);
            }
        }
        let turn = sum / weights;
        let [c, s] = [c - turn * s, s + turn * c];
        for p in &mut lane.points {
            let along = (p[0] - center[0]) * c + (p[1] - center[1]) * s;
            *p = [center[0] + along * c, center[1] + along * s];
        }
    }
}

/// Metres driven along a lane.
fn support(lane: &Lane, all: &[Driven]) -> f64 {
    all.iter()
        .filter_map(|d| Some((d.off(lane)?, d.length_m())))
        .filter(|((off, _), _)| *off < WITHIN_M)
        .map(|((_, share), length)| share * length)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::lane::nearest;
    use super::super::motion::Motion;
    use super::super::reflections::Reflection;
    use super::*;

    /// One path along x, at 20 m/s, `left(x)` beside; each is a reflection a frame.
    fn drive(instants: &mut Vec<Instant>, left: impl Fn(f64) -> f64) -> Path {
        let (mut members, mut motions) = (Vec::new(), Vec::new());
        for frame in 0..100 {
            let time_s = frame as f64 * 0.1;
            let x = 10.0 + 1.5 * frame as f64;
            let place = [x, left(x)];
            if instants.len() <= frame {
                instants.push(Instant { time_s, reflections: Vec::new() });
            }
            let distance_m = x.hypot(place[1]);
            let sight = [x / distance_m, place[1] / distance_m];
            let r = Reflection {
                place,
                height_m: 1.0,
                sight,
                distance_m,
                doppler_mps: 15.0,
                fixture: false,
                ahead_m: None,
            };
            instants[frame].reflections.push(r);
            members.push((frame, instants[frame].reflections.len() - 1));
            motions.push((time_s, Motion::new(place, [15.0, 0.0], 0.1, [1.0, 0.0], [0.1, 0.1])));
        }
        let headings_rad = vec![0.0; motions.len()];
        Path { members, first: 0, motions, headings_rad, reach: [0.0; 2], top_m: 1.5, lane: None, queued: Vec::new() }
    }

    #[test]
    fn lanes_are_where_many_drive_and_not_between_them() {
        let mut instants = Vec::new();
        let mut paths = Vec::new();
        for k in 0..6 {
            let off = 0.1 * f64::from(k) - 0.25;
            paths.push(drive(&mut instants, |x| 2.0 + off + 0.004 * x));
            paths.push(drive(&mut instants, |x| -2.0 + off - 0.004 * x));
        }
        // two vehicles abreast that look like one
        paths.push(drive(&mut instants, |_| 0.2));
        let lanes = learn(driven(&paths, &instants));
        assert_eq!(lanes.len(), 2);
        // wrong in opposite ways far away: both are parallel to the road
        for lane in &lanes {
            let [near, far] = [30.0, 140.0].map(|x| lane.beside([x, 0.0]).unwrap());
            assert!(
                (near.left_m - far.left_m).abs() < 0.1 && (near.left_m.abs() - 2.0).abs() < 0.6,
                "{near:?} {far:?}"
            );
            assert!(near.heading[0] > 0.999);
        }
        let at = |y: f64| nearest(&lanes, [60.0, y], Some([1.0, 0.0]), 2.0).unwrap().0;
        assert_ne!(at(2.3), at(-2.3));
        assert!(nearest(&lanes, [60.0, 2.3], Some([-1.0, 0.0]), 2.0).is_none(), "nobody drives that way");
        assert!(nearest(&lanes, [60.0, 12.0], None, 2.0).is_none());
    }

    #[test]
    fn a_bend_is_no_straight_lane_and_is_followed() {
        let mut instants = Vec::new();
        let bend = |x: f64| 0.002 * (x - 10.0).powi(2);
        let paths: Vec<Path> = (0..4).map(|k| drive(&mut instants, |x| bend(x) + 0.1 * f64::from(k))).collect();
        let lanes = learn(driven(&paths, &instants));
        assert_eq!(lanes.len(), 1);
        for x in [40.0, 80.0, 120.0] {
            assert!(lanes[0].beside([x, bend(x) + 0.15]).unwrap().left_m.abs() < 1.0, "{x}");
        }
    }
}
