//! The road's profile: how high the road lies along its axis, where it is not flat.
//!
//! # Model
//! Heights over the road's x axis, linear between points and level beyond the first and the last; across the road it
//! lies level. Not over range from the sensor: a road that climbs ahead of a radar beside it falls behind it, and the
//! place where a crest begins is the same for every direction of sight. Only differences count: heights may be those of
//! a map. The mount's height is above the road below the sensor.
//!
//! Along a line of sight the ground is then straight between the points, and where a slope meets the slice above it is
//! one division, as it is on a plane.
//!
//! # Limits
//! At most [`MOST_HEIGHTS`] points, none without the feature `ground`; grades up to 12 %, 1 m and more apart, within
//! 1 km of the sensor. What is wrong with one is refused by name.

use heapless::Vec;

use crate::fixed::math;
use crate::fixed::trig::Direction;
use crate::sensor::config::{ConfigError, Problem, above, within};
use crate::sensor::mount::Levelling;
use crate::sensor::site::Points;

/// Whether there is room for any.
pub const ROOM: bool = cfg!(feature = "ground");
/// Most points of a profile.
pub const MOST_HEIGHTS: usize = if ROOM { 16 } else { 0 };

/// Steepest grade, height over length.
const STEEPEST: f32 = 0.12;
/// Farthest that a point may lie from the sensor along the road, metres.
const FARTHEST_M: f32 = 1000.0;
/// Shortest distance of two points, metres.
const SHORTEST_M: f32 = 1.0;
/// Fraction bits of a grade.
const GRADE_BITS: u32 = 16;
/// Fraction bits of a slope.
pub const SLOPE_BITS: u32 = 18;
/// A line of sight within 0.06 degrees of straight across the road stays where it is along it, 2^-14.
const ACROSS: i32 = 16;
/// Beyond all ranges, centimetres.
const FAR_CM: i32 = 1 << 20;

/// Heights of the road, in the levelled frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ground {
    points: Vec<Point, MOST_HEIGHTS, u8>,
    /// The road's axis in the levelled frame.
    axis: Direction,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Point {
    /// From the sensor along the road, centimetres.
    along_cm: i32,
    /// Above the road below the sensor, centimetres.
    height_cm: i32,
    /// From here to the next point, 2^-16.
    grade: i32,
}

/// A part of a line of sight below which the ground is straight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// Where it begins and ends, centimetres along the ground.
    pub from_cm: i32,
    /// See `from_cm`.
    pub to_cm: i32,
    /// Height at which the straight line of the ground meets the sensor's mast, centimetres.
    pub foot_cm: i32,
    /// How it rises from there, 2^-18.
    pub rise: i32,
}

#[allow(clippy::cast_possible_truncation)] // lists and lengths are bounded
impl Ground {
    /// A flat road.
    pub const LEVEL: Self = Self { points: Vec::new(), axis: Direction::AHEAD };

    /// Takes a profile over: x along the road and height, metres, in the mount's road coordinates.
    ///
    /// # Errors
    /// More points than there is room for, one too near to the one before it or behind it, too far from the sensor, or
    /// after a grade that is too steep.
    pub fn new(levelling: &Levelling, points: Points<'_>) -> Result<Self, ConfigError> {
        let mut ground = Self { axis: levelling.road_axis(), ..Self::LEVEL };
        let sensor_m = levelling.origin().x_cm as f32 / 100.0;
        let below_m = height_m(points, sensor_m);
        let mut last: Option<[f32; 2]> = None;
        for (number, [x, height]) in points.enumerate() {
            let refuse = |problem| ConfigError { parameter: "ground", value: number as f32, problem };
            within("ground.x_m", x, sensor_m - FARTHEST_M, sensor_m + FARTHEST_M)?;
            within("ground.height_m", height, -10_000.0, 10_000.0)?;
            if let Some([before, lower]) = last.replace([x, height]) {
                above("ground.x_m", x, before)?;
                let grade = (height - lower) / (x - before).max(SHORTEST_M / 2.0);
                if x - before < SHORTEST_M || grade.abs() > STEEPEST + 1e-4 {
                    return Err(refuse(Problem::TooSteep));
                }
                if let Some(from) = ground.points.last_mut() {
                    from.grade = math::round_i32(grade * (1 << GRADE_BITS) as f32);
                }
            }
            let point = Point {
                along_cm: math::round_i32((x - sensor_m) * 100.0),
                height_cm: math::round_i32((height - below_m) * 100.0),
                grade: 0,
            };
            ground.points.push(point).map_err(|_| refuse(Problem::TooManyHeights))?;
        }
        Ok(ground)
    }

    /// Whether it is flat.
    #[inline]
    pub fn is_level(&self) -> bool {
        !ROOM || self.points.is_empty()
    }

    /// Height of the ground at a place of the levelled frame, above that below the sensor, centimetres.
    #[inline]
    pub fn height_cm(&self, x_cm: i32, y_cm: i32) -> i32 {
        if self.is_level() { 0 } else { self.along(self.axis.along(x_cm, y_cm)) }
    }

    /// Cosine of a direction to the road's axis, 2^-14.
    pub fn along_road(&self, sight: Direction) -> i32 {
        self.axis.cosine(sight)
    }

    fn along(&self, along_cm: i32) -> i32 {
        let before = self.points.partition_point(|p| p.along_cm <= along_cm);
        match (before.checked_sub(1).and_then(|k| self.points.get(k)), self.points.first()) {
            (Some(p), _) => p.height_cm + math::mul_shift(along_cm - p.along_cm, p.grade, GRADE_BITS),
            (None, Some(first)) => first.height_cm,
            (None, None) => 0,
        }
    }

    /// The stretches below a line of sight of this direction, from the sensor on.
    pub fn stretches(&self, sight: Direction) -> impl Iterator<Item = Stretch> {
        let cosine = self.axis.cosine(sight);
        let pieces = self.points.len() + 1;
        let across = self.is_level() || cosine.abs() < ACROSS;
        let flat = across.then_some(Stretch { from_cm: 0, to_cm: FAR_CM, foot_cm: 0, rise: 0 });
        let order = (0..if across { 0 } else { pieces }).map(move |k| if cosine > 0 { k } else { pieces - 1 - k });
        flat.into_iter().chain(order.filter_map(move |k| self.stretch(k, cosine)))
    }

    /// What a ray of this cosine to the road has above piece `k`, which ends at point `k`.
    fn stretch(&self, k: usize, cosine: i32) -> Option<Stretch> {
        let begin = k.checked_sub(1).and_then(|k| self.points.get(k));
        let low_cm = begin.map_or(-FAR_CM, |p| p.along_cm);
        let high_cm = self.points.get(k).map_or(FAR_CM, |p| p.along_cm);
        let (near, far) = if cosine > 0 { (low_cm, high_cm) } else { (high_cm, low_cm) };
        let distance = |along_cm: i32| {
            if along_cm.abs() == FAR_CM {
                return if (along_cm > 0) == (cosine > 0) { FAR_CM } else { 0 };
            }
            (along_cm << 14).checked_div(cosine).unwrap_or(0).clamp(0, FAR_CM)
        };
        let (from_cm, to_cm) = (distance(near), distance(far));
        let (at, grade) = begin.map_or((self.points.first()?, 0), |p| (p, p.grade));
        let foot_cm = at.height_cm - math::mul_shift(at.along_cm, grade, GRADE_BITS);
        (from_cm < to_cm).then_some(Stretch {
            from_cm,
            to_cm,
            foot_cm,
            rise: (grade * cosine) >> (14 + GRADE_BITS - SLOPE_BITS),
        })
    }
}

/// Height of a profile somewhere along the road, metres; for start-up.
fn height_m(points: Points<'_>, x_m: f32) -> f32 {
    let mut last: Option<[f32; 2]> = None;
    for point in points {
        if x_m < point[0] {
            return last.map_or(point[1], |from| {
                from[1] + (point[1] - from[1]) * (x_m - from[0]) / (point[0] - from[0]).max(SHORTEST_M)
            });
        }
        last = Some(point);
    }
    last.map_or(0.0, |point| point[1])
}

impl Stretch {
    /// Where along it the plane `above_cm` over the ground is seen below a slope from a height, centimetres.
    pub fn below(&self, slope: i32, height_cm: i32, above_cm: i32) -> Option<(i32, i32)> {
        // (drop / d + rise < slope)
        let (drop, steeper) = (self.foot_cm + above_cm - height_cm, slope - self.rise);
        let meets = || {
            let at = (i64::from(drop) << SLOPE_BITS).checked_div(i64::from(steeper)).unwrap_or(0);
            i32::try_from(at).unwrap_or(FAR_CM).clamp(0, FAR_CM)
        };
        let (from_cm, to_cm) = match (drop < 0, steeper < 0) {
            (true, false) => (self.from_cm, self.to_cm),
            (true, true) => (self.from_cm, self.to_cm.min(meets())),
            (false, false) if steeper > 0 => (self.from_cm.max(meets()), self.to_cm),
            (false, _) => return None,
        };
        (from_cm < to_cm).then_some((from_cm, to_cm))
    }

    /// Slope under which the ground at its end is seen from a height, 2^-18.
    pub fn end_slope(&self, height_cm: i32) -> i32 {
        let over = i64::from(self.foot_cm - height_cm) << SLOPE_BITS;
        i32::try_from(over / i64::from(self.to_cm.max(1))).unwrap_or(i32::MIN / 2) + self.rise
    }
}

#[cfg(test)]
#[cfg(feature = "ground")]
mod tests {
    use super::*;
    use crate::sensor::mount::Mount;
    use std::string::ToString;
    use std::vec::Vec;

    fn levelling(x_m: f32, yaw_deg: f32) -> Levelling {
        let mount = Mount { x_m, y_m: 3.0, height_m: 6.0, yaw_deg, pitch_deg: 2.0, roll_deg: 0.0 };
        mount.levelling().unwrap()
    }

    fn ground(x_m: f32, yaw_deg: f32, points: &[[f32; 2]]) -> Ground {
        Ground::new(&levelling(x_m, yaw_deg), Points::Metres(points)).unwrap()
    }

    const CREST: [[f32; 2]; 4] = [[-100.0, 498.0], [0.0, 500.0], [80.0, 503.2], [200.0, 498.4]];

    #[test]
    fn heights_are_of_the_road_and_from_the_road_below_the_sensor() {
        let g = ground(40.0, 0.0, &CREST);
        // below the sensor it is at 501.6 m
        for (x_m, expected_cm) in [(0.0, 0), (40.0, 160), (100.0, -80), (160.0, -320), (300.0, -320), (-40.0, -160)] {
            let got = g.height_cm((x_m * 100.0) as i32, 5000);
            assert!((got - expected_cm).abs() <= 1, "{x_m} m ahead: {got} cm");
        }
        assert_eq!(g.height_cm(-14_000, 0), g.height_cm(-30_000, 0), "level before the first");
    }

    #[test]
    fn the_profile_stays_with_the_road_where_the_sensor_looks_back_or_across() {
        let back = ground(40.0, 180.0, &CREST);
        assert!((back.height_cm(4000, 0) - -160).abs() <= 1, "behind it the road falls");
        let left = ground(40.0, 90.0, &CREST);
        assert!(left.height_cm(4000, 0).abs() <= 1, "across the road it lies level");
        assert!((left.height_cm(0, -4000) - 160).abs() <= 1, "what is ahead on the road is to the right");
    }

    #[test]
    fn stretches_join_and_have_the_heights_of_the_ground() {
        for yaw in [0.0, 60.0, 90.0, 180.0, -130.0] {
            let g = ground(-10.0, yaw, &CREST);
            for degrees in (-80..=80).step_by(20) {
                let sight = crate::fixed::trig::direction(crate::fixed::angle::Angle::from_degrees(degrees as f32));
                let all: Vec<Stretch> = g.stretches(sight).collect();
                assert_eq!((all[0].from_cm, all[all.len() - 1].to_cm), (0, FAR_CM), "{all:?}");
                assert!(all.windows(2).all(|w| w[0].to_cm == w[1].from_cm), "{all:?}");
                for d in (100..25_000).step_by(700) {
                    let s = all.iter().find(|s| (s.from_cm..s.to_cm).contains(&d)).unwrap();
                    let of_stretch = s.foot_cm + math::mul_shift(s.rise, d, SLOPE_BITS);
                    let (x, y) = ((i32::from(sight.x) * d) >> 14, (i32::from(sight.y) * d) >> 14);
                    let exact = g.height_cm(x, y);
                    assert!((of_stretch - exact).abs() <= 4, "yaw {yaw}, {degrees} deg, {d} cm: {of_stretch} {exact}");
                }
            }
        }
    }

    #[test]
    fn the_part_below_a_slope_is_that_of_double_precision() {
        for (foot_cm, rise) in [(0, 0.0), (0, 0.04), (0, -0.04), (-320, 0.08), (640, -0.04), (900, 0.02)] {
            let rise = (rise * f64::from(1 << SLOPE_BITS)) as i32;
            let s = Stretch { from_cm: 3000, to_cm: 20_000, foot_cm, rise };
            for slope_permille in [-100, -40, -20, -5, 0, 10, 30, 60] {
                let slope = slope_permille * (1 << SLOPE_BITS) / 1000;
                let got = s.below(slope, 600, 100);
                for d in (3010..20_000).step_by(90) {
                    let seen =
                        f64::from(foot_cm + 100 - 600) / f64::from(d) + f64::from(rise) / f64::from(1 << SLOPE_BITS);
                    let off = seen - f64::from(slope) / f64::from(1 << SLOPE_BITS);
                    let inside = got.is_some_and(|(from, to)| (from..to).contains(&d));
                    assert!((off < 0.0) == inside || off.abs() < 1e-4, "{s:?} {slope_permille} {d}: {got:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_road_is_refused_by_name() {
        let refused =
            |points: &[[f32; 2]]| Ground::new(&levelling(0.0, 0.0), Points::Metres(points)).unwrap_err().to_string();
        assert_eq!(refused(&[[0.0, 0.0], [10.0, 1.3]]), "ground: before point 1 the road is steeper than 12 %");
        assert_eq!(refused(&[[0.0, 0.0], [10.0, -1.3]]), "ground: before point 1 the road is steeper than 12 %");
        assert_eq!(refused(&[[10.0, 0.0], [0.0, 0.0]]), "ground.x_m is 0, not above 10");
        assert_eq!(refused(&[[2000.0, 0.0]]), "ground.x_m is 2000, outside -1000 to 1000");
        assert_eq!(refused(&[[0.0, f32::NAN]]), "ground.height_m is NaN, not a finite number");
        let many: Vec<[f32; 2]> = (0..17).map(|k| [10.0 * k as f32, 0.0]).collect();
        assert_eq!(refused(&many), "ground: point 16 is one more than there is room for");
        assert!(Ground::new(&levelling(0.0, 0.0), Points::Metres(&many[..16])).is_ok());
        assert!(Ground::new(&levelling(0.0, 0.0), Points::Metres(&[[0.0, 0.0], [100.0, 12.0]])).is_ok());
    }
}

#[cfg(test)]
#[cfg(not(feature = "ground"))]
mod without_room {
    use super::*;

    #[test]
    fn a_profile_without_room_for_one_is_refused() {
        let refused = Ground::new(&Levelling::NOWHERE, Points::Metres(&[[0.0, 0.0], [100.0, 4.0]])).unwrap_err();
        assert_eq!((refused.parameter, refused.problem), ("ground", Problem::TooManyHeights));
    }
}
