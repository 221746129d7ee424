//! Rejected is not empty, and a healthy recording is never unknown: every frame of what is shipped.

use std::path::Path;

use viewshed_harness::estimators::{self, Options, radar_3d};
use viewshed_harness::recording::{ReadOptions, Recording, read};

/// Seconds from which on a part of the map has settled.
const SETTLES_S: f64 = 1.3;

/// Frames whose map is unknown altogether, of those since a part of it has settled.
fn unknown(recording: &Recording) -> [usize; 2] {
    let (mut unknown, mut all) = (0, 0);
    let options = Options::default();
    let begin = recording.frames[0].time_ns / 1000;
    radar_3d::maps(
        &recording.frames,
        &estimators::sensor(recording, &options.noise),
        &options.radar_3d,
        |time, map, _| {
            if (time.micros() as i64 - begin) as f64 >= SETTLES_S * 1e6 {
                all += 1;
                unknown += usize::from((0..radar_3d::AZIMUTHS).all(|a| map.grades(a).unwrap().iter().all(|g| *g == 0)));
            }
        },
    )
    .unwrap();
    [unknown, all]
}

#[test]
fn no_frame_of_the_shipped_recordings_is_unknown() {
    for (name, sensor_id, frames) in [("motorway.mcap", None, 435), ("ars408-made-up.log", Some(0), 28)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").join(name);
        let mut recording = read(&path, &ReadOptions { sensor_id, ..Default::default() }).unwrap();
        assert!(recording.frames.len() >= frames, "{name}");
        let [none, all] = unknown(&recording);
        assert!(none == 0 && all > 8, "{name}: {none} of {all}");
        for detection in recording.frames.iter_mut().flat_map(|f| &mut f.detections) {
            detection.range_m = f32::NAN;
        }
        let [none, all] = unknown(&recording);
        assert_eq!(none, all, "{name}");
    }
}
