//! `camera-3d` on the boxes of a recorded camera, and `camera-true-boxes` on true boxes through the same voxels.

use std::sync::Arc;

use anyhow::{Context, Result};
use viewshed::camera::boxes::{BoxRejection, ImageBox, VehicleClass};
use viewshed::camera::calibration::Calibration;
use viewshed::camera::lift::LiftedBox;
use viewshed::camera::map::CameraMap;
use viewshed::camera::{Camera3dConfig, Camera3dParameters, CameraProfile};
use viewshed::fixed::time::Time;
use viewshed::frame::health::FrameStatus;
use viewshed::map::VisibilityMap;
use viewshed::map::query::Footprint;
use viewshed::sensor::road::RoadPoint;

use super::Estimator;
use crate::geometry::solid::Solid;
use crate::recording::Frame;
use crate::recording::camera::{CameraFrame, RecordedCamera};
use crate::recording::truth::Truth;

/// Rows and columns of the grid.
const ROWS: usize = 200;
const COLUMNS: usize = 60;

/// Counted for boxes of classes that are no vehicles.
pub const NO_VEHICLE: &str = "box of no vehicle";

struct Driver {
    parameters: Camera3dParameters<ROWS, COLUMNS>,
    state: Box<CameraProfile>,
    map: CameraMap<ROWS, COLUMNS>,
    frames: Arc<[CameraFrame]>,
    no_vehicle: u64,
}

/// The camera as the library takes it.
pub fn calibration(camera: &RecordedCamera) -> Calibration {
    Calibration { intrinsics: camera.intrinsics.for_library(), mount: super::mount(&camera.pose) }
}

/// The estimator, and with truth its reference. Frames are found by their time.
///
/// # Errors
/// A parameter the library refuses, by name.
pub fn all(camera: &RecordedCamera, truth: Option<&Truth>, config: &Camera3dConfig) -> Result<Vec<Box<dyn Estimator>>> {
    let parameters = Camera3dParameters::new(&calibration(camera), config).context("the camera")?;
    let map = parameters.map();
    let frames: Arc<[CameraFrame]> = camera.frames.clone().into();
    let state = || Box::new(CameraProfile::new());
    let mut all: Vec<Box<dyn Estimator>> = Vec::new();
    if let Some(truth) = truth {
        let truth = truth.clone();
        all.push(Box::new(Reference { parameters: parameters.clone(), state: state(), map: map.clone(), truth }));
    }
    all.insert(0, Box::new(Driver { parameters, state: state(), map, frames, no_vehicle: 0 }));
    Ok(all)
}

/// The boxes of a frame where they are lifted to.
///
/// # Errors
/// A camera that cannot be worked with.
pub fn lifted(camera: &RecordedCamera, frame: &CameraFrame, config: &Camera3dConfig) -> Result<Vec<Solid>> {
    let parameters = Camera3dParameters::<ROWS, COLUMNS>::new(&calibration(camera), config).context("the camera")?;
    let mut solids = Vec::new();
    parameters.lift(&vehicles(frame).0, |lifted| {
        let Footprint { centre, heading, half_length_cm, half_width_cm } = lifted.footprint;
        let metres = |cm: i32| f64::from(cm) / 100.0;
        solids.push(Solid {
            center: [metres(centre.x_cm), metres(centre.y_cm), metres(lifted.height_cm) / 2.0],
            yaw_rad: f64::from(heading.y).atan2(f64::from(heading.x)),
            size: [metres(2 * half_length_cm), metres(2 * half_width_cm), metres(lifted.height_cm)],
        });
    });
    Ok(solids)
}

/// The boxes of a frame as the library takes them, and how many are of vehicles: more, where some are no boxes.
pub fn vehicles(frame: &CameraFrame) -> (Vec<ImageBox>, usize) {
    let named = frame.boxes.iter().filter_map(|b| Some((b, VehicleClass::named(&b.class)?)));
    let boxes = named.clone().filter_map(|(b, class)| ImageBox::from_pixels(b.edges.map(|v| v as f32), class));
    (boxes.collect(), named.count())
}

/// As the library takes it.
pub fn time(time_ns: i64) -> Time {
    Time::from_micros(u64::try_from(time_ns / 1000).unwrap_or(0))
}

impl Estimator for Driver {
    fn name(&self) -> &str {
        "camera-3d"
    }

    fn reset(&mut self) {
        self.state.reset();
        self.map.forget();
    }

    fn step(&mut self, frame: &Frame) {
        let Ok(own) = self.frames.binary_search_by_key(&frame.time_ns, |f| f.time_ns) else { return };
        let own = &self.frames[own];
        let (boxes, named) = vehicles(own);
        self.no_vehicle += (own.boxes.len() - named) as u64;
        let refused = own.refused + (named - boxes.len()) as u64;
        let status = FrameStatus { refused: u16::try_from(refused).unwrap_or(u16::MAX), ..FrameStatus::default() };
        self.state.process(&self.parameters, time(frame.time_ns), &boxes, status, &mut self.map);
    }

    fn map(&self) -> &dyn VisibilityMap {
        &self.map
    }

    fn counters(&self) -> Vec<(&'static str, u64)> {
        let rejected = BoxRejection::ALL.map(|r| (r.name(), u64::from(self.state.rejections().count(r))));
        let own = [(NO_VEHICLE, self.no_vehicle)];
        rejected.into_iter().chain(own).filter(|(_, n)| *n > 0).collect()
    }
}

/// True boxes of each frame alone, through the same voxels and lines of sight.
struct Reference {
    parameters: Camera3dParameters<ROWS, COLUMNS>,
    state: Box<CameraProfile>,
    map: CameraMap<ROWS, COLUMNS>,
    truth: Truth,
}

impl Estimator for Reference {
    fn name(&self) -> &str {
        "camera-true-boxes"
    }

    fn reset(&mut self) {}

    fn step(&mut self, frame: &Frame) {
        let vehicles: Vec<LiftedBox> = self.truth.at(frame.time_ns).iter().filter_map(|o| standing(&o.solid)).collect();
        self.state.reset();
        self.state.process_lifted(&self.parameters, time(frame.time_ns), &vehicles, false, &mut self.map);
    }

    fn map(&self) -> &dyn VisibilityMap {
        &self.map
    }
}

/// A true box as if it had been lifted without error; `None` where the library has no such place or size.
fn standing(solid: &Solid) -> Option<LiftedBox> {
    let [length, width, _] = solid.size.map(|v| v as f32);
    let centre = RoadPoint::from_metres(solid.center[0] as f32, solid.center[1] as f32).ok()?;
    let heading = solid.yaw_rad.to_degrees().rem_euclid(360.0) as f32;
    let footprint = Footprint::new(centre, heading, length, width).ok()?;
    Some(LiftedBox { footprint, height_cm: (solid.top() * 100.0).round() as i32, along_cm: 0, across_cm: 0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::pose::SensorPose;
    use crate::recording::camera::{Box2d, Intrinsics};
    use crate::recording::truth::Label;

    fn camera(frames: Vec<CameraFrame>) -> RecordedCamera {
        RecordedCamera {
            pose: SensorPose::new([0.0, 0.0, 6.0], 0.0, 0.0, 0.0),
            intrinsics: Intrinsics::centred([1920, 1080], 1600.0),
            frames,
            alone: false,
        }
    }

    fn frame(time_ns: i64) -> Frame {
        Frame { time_ns, detections: Vec::new(), refused: 0, unwanted: Vec::new(), fault: false }
    }

    /// A truck to the left: 12 x 2.5 x 4 m, its rear at 40 m, 3 m to the left.
    const TRUCK: Solid = Solid { center: [46.0, 3.0, 2.0], yaw_rad: 0.0, size: [12.0, 2.5, 4.0] };

    #[test]
    fn both_see_the_truck_where_it_is() {
        let (u, v) = (|x: f64, y: f64| 960.0 - 1600.0 * y / x, |x: f64, z: f64| 540.0 - 1600.0 * (z - 6.0) / x);
        let edges = [u(40.0, 4.25), v(52.0, 4.0), u(52.0, 1.75), v(40.0, 0.0)];
        let b = |class: &str| Box2d { class: class.into(), score: 1.0, edges };
        let boxes = vec![b("truck"), b("traffic light")];
        let camera = camera(vec![CameraFrame { time_ns: 7_000, boxes, refused: 1 }]);
        let label = Label { time_ns: 7_000, id: "a".into(), class: "truck".into(), solid: TRUCK };
        let truth = Truth::new(vec![label]);
        let mut all = all(&camera, Some(&truth), &Camera3dConfig::default()).unwrap();
        for estimator in &mut all {
            estimator.step(&frame(7_000));
            let visible = |x, y| estimator.map().at(RoadPoint::from_metres(x, y).unwrap()).visible();
            assert!(visible(30.5, 2.5) && visible(40.5, 2.5) && visible(60.5, -4.5), "{}", estimator.name());
            assert!(!visible(60.5, 4.5), "{}", estimator.name());
        }
        assert_eq!(all[0].counters(), [("no box", 1), (NO_VEHICLE, 1)]);
    }

    #[test]
    fn a_camera_that_cannot_be_is_named() {
        let mut wrong = camera(Vec::new());
        wrong.intrinsics.focal_px[0] = 0.0;
        let error = all(&wrong, None, &Camera3dConfig::default()).err().unwrap();
        assert_eq!(format!("{error:#}"), "the camera: intrinsics.focal_px[0] is 0, outside 50 to 20000");
    }
}
