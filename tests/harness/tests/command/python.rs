//! Recordings as another implementation reads them: Python's `mcap-ros2-support`, which knows nothing of ours.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::skipped::skipped;

/// A Python that has the package; `VIEWSHED_PYTHON` names one that is not on the path.
fn python() -> Option<String> {
    let python = std::env::var("VIEWSHED_PYTHON").unwrap_or_else(|_| "python3".into());
    let found = Command::new(&python).args(["-c", "import mcap_ros2.decoder"]).output();
    found.is_ok_and(|o| o.status.success()).then_some(python)
}

#[test]
fn python_reads_the_shipped_recording() {
    let Some(python) = python() else {
        return skipped("mcap-ros2-support", "a recording read by Python (tests/mcap_ros2.sh installs it)");
    };
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.mcap");
    let output = Command::new(python).args(["-c", include_str!("read.py")]).arg(recording).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["profile"], "ros2");
    let topics = [
        ("/radar/points", "sensor_msgs/msg/PointCloud2", 450),
        ("/ground_truth/objects", "vision_msgs/msg/Detection3DArray", 450),
        ("/camera/objects", "vision_msgs/msg/Detection2DArray", 450),
        ("/camera/info", "sensor_msgs/msg/CameraInfo", 450),
        ("/tf_static", "tf2_msgs/msg/TFMessage", 1),
    ];
    for (topic, schema, messages) in topics {
        assert_eq!((found["schemas"][topic].as_str(), found["topics"][topic].as_i64()), (Some(schema), Some(messages)));
    }
    let list =
        |key: &str| -> Vec<&str> { found[key].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect() };
    for field in ["range", "azimuth", "elevation", "radial_velocity", "rcs", "snr", "x", "y", "z"] {
        assert!(list("fields").contains(&field), "{field}");
    }
    assert!(["barrier", "car", "truck", "van"].iter().all(|class| list("classes").contains(class)));
    assert_eq!(list("frames"), ["camera>camera_optical", "road>camera", "road>radar"]);
    // 1920 px over 60 degrees: 960 / tan 30
    assert_eq!((&found["camera"][0], &found["camera"][1]), (&Value::from(1920), &Value::from(1080)));
    assert!((found["camera"][2].as_f64().unwrap() - 960.0 * 3_f64.sqrt()).abs() < 0.1);
    assert!(found["boxes"].as_i64().unwrap() > 1000);
    let sensor = &found["metadata"]["viewshed.sensor"];
    assert_eq!((sensor["has_elevation"].as_str(), sensor["range_max_m"].as_str()), (Some("true"), Some("200")));
}
