//! A radar of one's own, its broadcast, and a vehicle that receives it.

use viewshed::{Detection, Epoch, Measurement, RoadPoint, Time, small};
use viewshed_example::own_radar::OwnRadar;
use viewshed_example::receiver::Vehicle;

mod pole;

use pole::sensor;

/// A part with 128 kB has a stack and a radar's own lists, too.
const MOST_BYTES: usize = 100_000;

fn at(ms: u64) -> Time {
    Time::from_micros(1_000_000 + 1000 * ms)
}

/// A truck's rear that drives away at 10 m/s, from 40 m on.
fn truck(ms: u64) -> Vec<Detection> {
    let x_m = 40.0 + 10.0 * ms as f32 / 1000.0;
    let reflection = |y_m: f32, z_m: f32| Measurement {
        range_m: x_m,
        azimuth_rad: y_m / x_m,
        elevation_rad: Some((z_m - 5.0) / x_m),
        radial_velocity_mps: 10.0,
        rcs_dbsm: Some(20.0),
        snr_db: Some(25.0),
    };
    let places = [(-1.0, 0.6), (0.0, 1.0), (1.0, 0.6), (-0.5, 2.5), (0.5, 3.5)];
    places.iter().map(|(y, z)| Detection::new(&reflection(*y, *z)).unwrap()).collect()
}

#[test]
fn a_vehicle_is_told_what_is_seen_and_not_what_a_truck_hides_nor_anything_by_silence() {
    let bytes = size_of::<small::Radar>() + size_of::<small::Sender>();
    assert!(bytes <= MOST_BYTES, "{bytes} bytes");
    let (mut state, mut sender) = (Box::new(small::Radar::new()), Box::new(None));
    let mut radar = OwnRadar { radar: &mut state, sender: &mut sender };
    radar.start(&sensor(0.0), Epoch::new(3), at(0)).unwrap();
    let mut vehicle = Vehicle::default();
    let (before, behind) = (RoadPoint::from_metres(30.0, 0.0).unwrap(), RoadPoint::from_metres(85.0, 0.3).unwrap());
    let mut last = 0;
    for ms in 0..3000 {
        if ms % 50 == 0 {
            radar.frame(at(ms), &truck(ms), false);
        }
        while let Some(frame) = radar.next_frame(at(ms)) {
            vehicle.take(&frame, at(ms));
            last = ms;
        }
    }
    let now = at(2990);
    assert!(last > 2900 && vehicle.is_seen(before, now).unwrap(), "last frame {last} ms");
    assert!(!vehicle.is_seen(behind, now).unwrap(), "behind the truck");
    assert!(!vehicle.is_seen(before, at(4500)).unwrap(), "nobody sends any more");
}
