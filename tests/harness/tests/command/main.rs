//! The `viewshed` command on small recordings made here: results, files, and input that is bad.

mod bad_input;
mod bag;
mod calibration;
mod camera;
mod can_log;
mod foxglove;
mod lanes;
mod mutated;
mod native_capture;
mod outputs;
mod own_data;
mod python;
mod radar_scan;
mod read_by_people;
mod replay;
mod results;
mod scene;
mod scenes;
mod simulate;
#[path = "../../../common/skipped.rs"]
mod skipped;
mod starts;
mod ti_capture;
