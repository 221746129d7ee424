//! How often a place for a car that is clear by exact geometry is answered free, and one that is not.

use std::path::Path;

use viewshed::RoadPoint;
use viewshed::map::query::{self, Answer, Footprint};
use viewshed_harness::estimators::{self, Options, radar_3d};
use viewshed_harness::evaluation;
use viewshed_harness::evaluation::samples::collect_every;
use viewshed_harness::geometry::polygon::{Convex, uncovered_area};
use viewshed_harness::geometry::sight::shadow;
use viewshed_harness::geometry::solid::Solid;
use viewshed_harness::recording::{ReadOptions, read};

/// Length, width and height of the car that is asked for, metres.
const CAR: [f64; 3] = [4.6, 1.8, 1.5];

/// Answers, by whether a place is clear: all of its footprint in sight, and nothing on it.
#[derive(Debug, Default)]
struct Counts {
    places: usize,
    free: usize,
    /// If the centres of the square metres it overlaps were looked at, and nothing between them.
    free_by_centres: usize,
}

impl Counts {
    fn share(&self) -> f64 {
        100.0 * self.free as f64 / self.places as f64
    }
}

#[test]
fn most_places_that_are_clear_are_answered_free() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.mcap");
    let recording = read(&path, &ReadOptions::default()).unwrap();
    let truth = recording.truth.as_ref().unwrap();
    let options = Options::default();
    let every = 10;
    let samples = collect_every(&recording, &evaluation::Options::default(), every, &|| ());
    let (mut clear, mut not_clear) = (Counts::default(), Counts::default());
    let mut frames = recording.frames.iter().zip(&samples).enumerate();
    let sensor = estimators::sensor(&recording, &options.noise);
    radar_3d::maps(&recording.frames, &sensor, &options.radar_3d, |_, map, _| {
        let (k, (frame, samples)) = frames.next().unwrap();
        if !samples.counted {
            return;
        }
        let boxes: Vec<Solid> = truth.at(frame.time_ns).iter().map(|object| object.solid).collect();
        // in the way, or on it
        let covers: Vec<Convex> = boxes
            .iter()
            .flat_map(|solid| {
                [shadow(recording.pose.position, solid, 1.0), Some(Convex::hull(solid.footprint().to_vec()))]
            })
            .flatten()
            .collect();
        // every so manieth cell of the road, others at each frame
        for ((i, j), _) in samples.cells.iter().skip(k % 13).step_by(13) {
            let (x, y) = (f64::from(*i) + 0.5, f64::from(*j) + 0.5);
            let car = Solid { center: [x, y, CAR[2] / 2.0], yaw_rad: 0.0, size: CAR };
            let outline = Convex::hull(car.footprint().to_vec());
            let in_view =
                |[x, y]: &[f64; 2]| recording.sensor.field_of_view.contains(recording.pose.to_spherical([*x, *y, 1.0]));
            if !car.footprint().iter().all(in_view) {
                continue;
            }
            let is_clear = uncovered_area(outline, &covers) > CAR[0] * CAR[1] - 1e-6;
            let at = RoadPoint::from_metres(x as f32, y as f32).unwrap();
            let footprint = Footprint::new(at, 0.0, CAR[0] as f32, CAR[1] as f32).unwrap();
            let counts = if is_clear { &mut clear } else { &mut not_clear };
            let mut centres = Answer::VisibleFree;
            footprint.each_cell(|cell| centres = centres.min(query::point(map, cell)));
            counts.places += 1;
            counts.free += usize::from(query::area(map, &footprint) == Answer::VisibleFree);
            counts.free_by_centres += usize::from(centres == Answer::VisibleFree);
        }
    })
    .unwrap();
    println!(
        "clear: {clear:?}, {:.1} % free; not clear: {not_clear:?}, {:.1} % free",
        clear.share(),
        not_clear.share()
    );
    assert!(clear.places > 2000 && not_clear.places > 500, "{clear:?} {not_clear:?}");
    assert!(clear.share() > 50.0, "an area that is never free is of no use: {clear:?}");
    assert!(not_clear.share() < 10.0, "{not_clear:?}");
}
