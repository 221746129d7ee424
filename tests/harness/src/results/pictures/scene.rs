//! What there is to be drawn of one frame, and the part of the road that is shown.

use std::borrow::Cow;

use viewshed::map::VisibilityMap;

use super::axes::{LEFT_PX, Plot, RIGHT_PX};
use super::canvas::Area;
use super::cells::Carries;
use super::legend::WIDTH_PX;
use super::palette::Outcome;
use crate::estimators::Lane;
use crate::evaluation::samples::Cell;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::{FieldOfView, RadarDetection};

/// Greatest height of one plot, pixels.
const PLOT_HEIGHT_PX: i32 = 760;
/// A part of the road plane, metres in the road frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    pub x_m: [f64; 2],
    pub y_m: [f64; 2],
}

impl Window {
    /// The least window of whole metres around points, with a margin; at least 20 m wide and deep.
    pub fn around(points: impl IntoIterator<Item = [f64; 2]>, margin_m: f64) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let [x, y] = points
            .into_iter()
            .fold([none, none], |[x, y], p| [[x[0].min(p[0]), x[1].max(p[0])], [y[0].min(p[1]), y[1].max(p[1])]]);
        let side = |[lo, hi]: [f64; 2]| {
            let [lo, hi] = if lo <= hi { [lo - margin_m, hi + margin_m] } else { [-margin_m, margin_m] };
            let missing = (20.0 - (hi - lo)).max(0.0) / 2.0;
            [(lo - missing).floor(), (hi + missing).ceil()]
        };
        Self { x_m: side(x), y_m: side(y) }
    }

    /// A picture of this width that shows the window and nothing around it.
    pub(super) fn filling(&self, width_px: i32) -> Plot {
        let depth = (self.y_m[1] - self.y_m[0]) / (self.x_m[1] - self.x_m[0]).max(1.0);
        let height_px = (f64::from(width_px) * depth).round() as i32;
        Plot { area: Area::new(0, 0, width_px, height_px), x: self.x_m, y: self.y_m }
    }

    pub(super) fn plot(&self, top: i32) -> Plot {
        let (width, depth) = ((self.x_m[1] - self.x_m[0]).max(1.0), (self.y_m[1] - self.y_m[0]).max(1.0));
        let room = WIDTH_PX - LEFT_PX - RIGHT_PX;
        let scale = (f64::from(room) / width).min(f64::from(PLOT_HEIGHT_PX) / depth);
        let (width_px, height_px) = ((width * scale).round() as i32, (depth * scale).round() as i32);
        let left = LEFT_PX + (room - width_px) / 2;
        let [x, y] = [[self.x_m[0], self.x_m[0] + width], [self.y_m[0], self.y_m[0] + depth]];
        Plot { area: Area::new(left, top, width_px, height_px), x, y }
    }
}

/// A ground-truth box; without an outcome it is drawn as not counted.
#[derive(Debug, Clone, Copy)]
pub struct TruthBox {
    pub solid: Solid,
    pub outcome: Option<Outcome>,
}

/// Everything on one bird's-eye picture.
pub struct Scene<'a> {
    pub map: &'a dyn VisibilityMap,
    pub carries: Carries,
    pub pose: SensorPose,
    pub field_of_view: FieldOfView,
    /// Height at which visibility is judged; detections without elevation are drawn where they lie at it.
    pub slice_height_m: f64,
    pub window: Window,
    pub detections: &'a [RadarDetection],
    pub boxes: Vec<TruthBox>,
    /// Cells whose common border is drawn; may be empty.
    pub road: &'a [Cell],
    /// Lanes of traffic that the map was made with, given or learnt; may be empty.
    pub lanes: Cow<'a, [Lane]>,
    /// Whether they are numbered from 1, in their order.
    pub lanes_numbered: bool,
    /// Recording, estimator, time.
    pub title: String,
    /// What has to be said of the data.
    pub caption: Option<String>,
    pub highlight: Option<Highlight>,
}

/// One object looked at closely: ringed, and enlarged in a second plot below.
#[derive(Debug, Clone)]
pub struct Highlight {
    pub solid: Solid,
    /// What there is to see, above the enlarged plot.
    pub note: String,
    pub window: Window,
}

impl Highlight {
    /// A window of 72 m x 26 m around the object, shifted towards the sensor by 14 m at most so
    /// that it shows what stands before the object.
    pub fn on(solid: Solid, pose: &SensorPose, note: impl Into<String>) -> Self {
        let [x, y, _] = solid.center;
        let (dx, dy) = (pose.position[0] - x, pose.position[1] - y);
        let shift = (14.0 / dx.hypot(dy).max(1.0)).min(1.0);
        let (x, y) = ((x + dx * shift).round(), (y + dy * shift).round());
        Self { solid, note: note.into(), window: Window { x_m: [x - 36.0, x + 36.0], y_m: [y - 13.0, y + 13.0] } }
    }
}
