//! The example on the shipped log of an ARS408's bus.

use viewshed::{CanFrame, CanId, FieldOfView, Mount, NoiseConfig, RoadPoint, Sensor, Time};
use viewshed_example::Guard;

const LOG: &str = include_str!("../../recordings/ars408-made-up.log");

/// `(seconds) can0 ID#BYTES`.
fn frame(line: &str) -> Option<(Time, CanFrame)> {
    let (time, rest) = line.strip_prefix('(')?.split_once(") can0 ")?;
    let (id, data) = rest.split_once('#')?;
    let bytes =
        (0..data.len() / 2).map(|k| u8::from_str_radix(&data[2 * k..2 * k + 2], 16)).collect::<Result<Vec<_>, _>>();
    let id = CanId::standard(u16::from_str_radix(id, 16).ok()?)?;
    let micros = time.replace('.', "").parse().ok()?;
    Some((Time::from_micros(micros), CanFrame::classic(id, &bytes.ok()?)?))
}

#[test]
fn the_road_ahead_is_free_while_scans_come_and_unknown_soon_after() {
    let sensor = Sensor {
        mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 5.0, yaw_deg: 0.0, pitch_deg: 2.0, roll_deg: 0.0 },
        field_of_view: FieldOfView {
            azimuth_min_deg: -45.0,
            azimuth_max_deg: 45.0,
            elevation_min_deg: -16.0,
            elevation_max_deg: 16.0,
            range_min_m: 1.0,
            range_max_m: 100.0,
        },
        noise: NoiseConfig::default(),
    };
    let mut guard = Guard::new(&sensor).unwrap();
    let near = RoadPoint::from_metres(20.0, -2.0).unwrap();
    let behind = RoadPoint::from_metres(-20.0, 0.0).unwrap();
    let (mut now, mut frames, mut free) = (Time::from_micros(0), 0, 0);
    for (time, frame) in LOG.lines().filter_map(frame) {
        guard.take(&frame, time);
        (now, frames) = (time, frames + 1);
        free += u32::from(guard.is_free(near, time).unwrap());
        assert!(!guard.is_free(behind, time).unwrap(), "nobody looks there");
    }
    assert!(frames > 1700 && free > 1000, "{free} of {frames}");
    let later = Time::from_micros(now.micros() + 600_000);
    assert!(!guard.is_free(near, later).unwrap(), "silence is no free road");
}
