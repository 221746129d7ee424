//! Rejected is not empty, and a healthy recording is never unknown: every frame of what is shipped.

use std::path::Path;

use viewshed_harness::estimators::{self, Options, radar_3d};
use viewshed_harness::recording::{ReadOptions, Recording, read};

/// Frames whose map is unknown altogether.
fn unknown(recording: &Recording) -> usize {
    let mut unknown = 0;
    let options = Options::default();
    radar_3d::maps(&recording.frames, &estimators::sensor(recording, &options.noise), &options.radar_3d, |_, map| {
        unknown += usize::from((0..radar_3d::AZIMUTHS).all(|a| map.grades(a).unwrap().iter().all(|g| *g == 0)));
    })
    .unwrap();
    unknown
}

#[test]
fn no_frame_of_the_shipped_recordings_is_unknown() {
    for (name, sensor_id, frames) in [("motorway.mcap", None, 435), ("ars408-made-up.log", Some(0), 28)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").join(name);
        let mut recording = read(&path, &ReadOptions { sensor_id, ..Default::default() }).unwrap();
        assert!(recording.frames.len() >= frames, "{name}");
        assert_eq!(unknown(&recording), 0, "{name}");
        for detection in recording.frames.iter_mut().flat_map(|f| &mut f.detections) {
            detection.range_m = f32::NAN;
        }
        let duration = recording.duration_s();
        if duration > 2.0 {
            let share = unknown(&recording) as f64 / recording.frames.len() as f64;
            assert!(share > 1.0 - 1.5 / duration, "{name}: {share}");
        }
    }
}
