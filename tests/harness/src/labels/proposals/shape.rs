//! What stands around the reflections of a path: class by extent, and the box centres.

use super::View;
use super::path::{HEIGHT_WITHIN_M, Path, quantile};
use super::reflections::Instant;
use crate::labels::near_face::{BoxStep, drawn};
use crate::labels::tracks::LabelTrack;
use crate::recording::labels::class_size;

/// How far the polyline may be from the path, metres.
const TOLERANCE_M: f64 = 0.4;
/// Cosine of the aspect from which on the end that is seen tells where the vehicle is.
const END_COS: f64 = 0.4;
/// How long a fast path goes on at both ends, seconds, and in which steps.
const BEYOND_S: f64 = 5.0;
const STEP_S: f64 = 0.25;
/// Speed from which on something is fast, m/s.
const FAST_MPS: f64 = 6.0;
/// Extents that only buses have, metres: a truck that is seen well is longer.
const BUS_M: std::ops::RangeInclusive<f64> = 12.6..=13.8;
/// Cars are not higher than this, by so many reflections, metres, and nothing of them is higher than that.
const LOW_M: f64 = 1.7;
const HIGH_M: f64 = 2.7;
const WELL: usize = 60;
/// A lorry that reaches less far than this, metres, by so many reflections from near, is a short one: what of it does
/// not reflect, metres, and between which heights it is, metres.
const SHORT_M: f64 = 12.0;
const SHORT_BY: usize = 500;
const ENDS_M: f64 = 0.7;
const SHORT_HIGH_M: [f64; 2] = [3.0, 4.0];
/// How long a car looks at most with reflections of another one, metres.
const BESIDES_M: f64 = 12.5;
/// Fewest reflections an end is told by.
const FEWEST: usize = 5;

/// What the reflections of a path say of the vehicle, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Rear and front along the heading, from the path on; `None` where that end was not seen.
    pub rear: Option<f64>,
    pub front: Option<f64>,
    /// 5 % to 95 % of all reflections along the heading.
    pub reach: [f64; 2],
    /// Height of the higher ones.
    pub top_m: f64,
    /// Height of the highest ones, and how many reflections from near that is of; 0 without a radar that measures it.
    pub highest_m: f64,
    pub heights: usize,
    /// Seen well enough to know that nothing of it is high.
    pub low: bool,
}

impl Extent {
    pub fn of(path: &Path, instants: &[Instant]) -> Self {
        let (mut behind, mut ahead) = (Vec::new(), Vec::new());
        for (frame, r) in path.reflections(instants) {
            let Some([along, _]) = path.local(frame, r) else { continue };
            let Some(cos) = path.heading_at(frame).map(|h| h.cos() * r.sight[0] + h.sin() * r.sight[1]) else {
                continue;
            };
            if cos > END_COS {
                behind.push(along);
            } else if cos < -END_COS {
                ahead.push(along);
            }
        }
        let end = |values: &[f64], share: f64| quantile(values, share).filter(|_| values.len() >= FEWEST);
        let near = path.reflections(instants).filter(|(_, r)| r.distance_m < HEIGHT_WITHIN_M);
        let heights: Vec<f64> = near.map(|(_, r)| r.height_m).collect();
        // a radar without elevation gives all reflections one height
        let measured = heights.iter().any(|h| (h - heights[0]).abs() > 1e-6);
        let highest_m = quantile(&heights, 0.95).unwrap_or(0.0);
        let low = heights.len() >= WELL && measured && path.top_m < LOW_M && highest_m < HIGH_M;
        Self {
            rear: end(&behind, 0.1),
            front: end(&ahead, 0.9),
            reach: path.reach,
            top_m: path.top_m,
            highest_m,
            heights: if measured { heights.len() } else { 0 },
            low,
        }
    }

    /// The class whose size is nearest to what is seen.
    pub fn class(&self) -> &'static str {
        let length_m = self.seen_m();
        match () {
            // with the reflections of the car behind it it looks long
            () if self.low && length_m < BESIDES_M => "car",
            () if BUS_M.contains(&length_m) => "bus",
            () if length_m > 7.2 || (self.top_m > 2.9 && length_m > 5.5) => "truck",
            () if length_m > 5.5 || self.top_m > 2.4 => "van",
            () => "car",
        }
    }

    /// Length, width and height where it is surely not that of the class: lorries are 7 to 19 m long. One that may only
    /// be hidden in part has that of the class.
    pub fn size(&self, class: &str) -> Option<[f64; 3]> {
        let [length_m, width_m, _] = class_size(class)?;
        let seen_m = self.seen_m() + ENDS_M;
        let short = class == "truck" && seen_m < SHORT_M && self.heights >= SHORT_BY && seen_m < length_m;
        short.then_some([seen_m, width_m, self.highest_m.clamp(SHORT_HIGH_M[0], SHORT_HIGH_M[1])])
    }

    /// Length, width and height of its box.
    pub fn box_m(&self) -> [f64; 3] {
        let class = self.class();
        self.size(class).or_else(|| class_size(class)).unwrap_or([4.6, 1.8, 1.5])
    }

    /// From the rearmost to the foremost of it that reflects.
    fn seen_m(&self) -> f64 {
        let reach_m = self.reach[1] - self.reach[0];
        self.rear.zip(self.front).map_or(reach_m, |(rear, front)| (front - rear).max(reach_m))
    }

    /// Where the centre of a vehicle of this length is along the heading, from the path on.
    fn center_m(&self, length_m: f64) -> f64 {
        match (self.rear, self.front) {
            (Some(rear), Some(front)) => 0.5 * (rear + front),
            (Some(rear), None) => rear + 0.5 * length_m,
            (None, Some(front)) => front - 0.5 * length_m,
            (None, None) => 0.5 * (self.reach[0] + self.reach[1]),
        }
    }
}

/// Mean velocity around a time, if that is fast enough to go on.
fn speed_near(path: &Path, time_s: f64) -> Option<[f64; 2]> {
    let near = path.motions.iter().filter(|(t, _)| (t - time_s).abs() <= 1.0);
    let (n, [x, y]) = near.fold((0.0, [0.0, 0.0]), |(n, [x, y]), (_, m)| {
        let [vx, vy] = m.velocity();
        (n + 1.0, [x + vx, y + vy])
    });
    let velocity = [x / n, y / n];
    (n > 0.0 && velocity[0].hypot(velocity[1]) > FAST_MPS).then_some(velocity)
}

/// The near face of the vehicle around a path. What is fast comes from somewhere and goes somewhere: up to
/// [`BEYOND_S`] in the field of view are added at both ends.
pub fn track(path: &Path, extent: &Extent, left_m: f64, view: &View, id: String) -> LabelTrack {
    let (class, size) = (extent.class(), extent.box_m());
    let along = extent.center_m(size[0]);
    let mut steps: Vec<BoxStep> = path
        .motions
        .iter()
        .zip(&path.headings_rad)
        .map(|((time_s, m), heading_rad)| {
            let ([x, y], (s, c)) = (m.place(), heading_rad.sin_cos());
            BoxStep {
                time_s: *time_s,
                center: [x + along * c - left_m * s, y + along * s + left_m * c],
                heading_rad: *heading_rad,
            }
        })
        .collect();
    let ends = [(steps.first().copied(), -STEP_S), (steps.last().copied(), STEP_S)];
    for (end, step_s) in ends {
        let Some(end) = end else { continue };
        let Some([vx, vy]) = speed_near(path, end.time_s) else { continue };
        for k in 1..=(BEYOND_S / STEP_S) as u32 {
            let dt_s = step_s * f64::from(k);
            let (time_s, center) = (end.time_s + dt_s, [end.center[0] + vx * dt_s, end.center[1] + vy * dt_s]);
            if !(0.0..=view.latest_s).contains(&time_s) || !(view.contains)(center) {
                break;
            }
            steps.push(BoxStep { time_s, center, ..end });
        }
    }
    steps.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    let points = drawn(&steps, size, view.sensor, TOLERANCE_M);
    LabelTrack { id, class: class.to_owned(), size_m: extent.size(class), points }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(reach: [f64; 2], top_m: f64, low: bool) -> Extent {
        Extent { rear: Some(reach[0]), front: None, reach, top_m, highest_m: top_m, heights: 0, low }
    }

    #[test]
    fn length_and_height_tell_the_class_and_what_is_surely_low_is_a_car() {
        assert_eq!(extent([-2.0, 2.2], 1.4, true).class(), "car");
        assert_eq!(extent([-3.0, 3.2], 2.0, false).class(), "van");
        assert_eq!(extent([-8.0, 7.5], 2.2, false).class(), "truck");
        assert_eq!(extent([-6.5, 6.5], 2.2, false).class(), "bus");
        // two cars in one path: low all along; a truck that reflects low is longer than that
        assert_eq!(extent([-4.0, 7.0], 1.4, true).class(), "car");
        assert_eq!(extent([-4.0, 7.0], 1.4, false).class(), "truck");
        assert_eq!(extent([-8.0, 8.0], 1.6, true).class(), "truck");
    }

    #[test]
    fn only_lorries_that_are_seen_well_and_short_have_a_size_of_their_own() {
        let lorry = |reach, heights| Extent { highest_m: 3.5, heights, ..extent(reach, 2.4, false) };
        assert_eq!(lorry([-4.0, 4.5], 900).size("truck"), Some([9.2, 2.55, 3.5]));
        assert_eq!(Extent { highest_m: 2.1, ..lorry([-4.0, 4.5], 900) }.size("truck"), Some([9.2, 2.55, 3.0]));
        // it may be hidden in part, it is a long one, it is none
        assert_eq!(lorry([-4.0, 4.5], 100).size("truck"), None);
        assert_eq!(lorry([-8.0, 7.5], 900).size("truck"), None);
        assert_eq!(lorry([-4.0, 4.5], 900).size("van"), None);
        assert_eq!(lorry([-4.0, 4.5], 900).size("nobody"), None);
    }
}
