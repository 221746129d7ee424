//! Memory the estimators take, asserted. kB = 1000 bytes; output maps are not counted.

use std::mem::size_of;

use viewshed::inputs::ars408::Ars408;
use viewshed::inputs::native::{NativeReceiver, NativeSerialReceiver};
use viewshed::inputs::ti::Ti;
use viewshed::radar_2d::{Radar2d, Radar2dParameters};
use viewshed::unit::profile::{reference, small};
use viewshed::wire::receive::SensorReceiver;

#[test]
fn the_reference_grid_fits_368_kb() {
    let state = size_of::<reference::State>();
    let parameters = size_of::<reference::Parameters>();
    println!("radar-3d 200 x 128 x 12: state {state} B, parameters {parameters} B");
    assert!(state + parameters <= 368_000, "{state} + {parameters}");
}

#[test]
fn the_small_profile_fits_63_5_kb_in_all() {
    let state = size_of::<small::State>();
    let parameters = size_of::<small::Parameters>();
    println!("radar-3d 100 x 96 x 4: state {state} B, parameters {parameters} B");
    assert!(state + parameters <= 63_500, "{state} + {parameters}");
}

#[test]
fn the_flat_baseline_fits_450_kb() {
    let state = size_of::<Radar2d<208, 45, 320, 256>>();
    let parameters = size_of::<Radar2dParameters>();
    println!("radar-2d 208 x 360 m: state {state} B, parameters {parameters} B");
    assert!(state + parameters <= 450_000, "{state} + {parameters}");
}

#[test]
fn a_polar_map_takes_two_bytes_a_cell() {
    let map = size_of::<reference::Map>();
    println!("polar map 200 x 128: {map} B");
    assert!(map <= 2 * 200 * 128 + 128, "{map}");
}

#[test]
fn a_radar_input_for_256_detections_fits_8_1_kb() {
    let sizes = [
        ("ARS408", size_of::<Ars408<256>>()),
        ("native over CAN FD", size_of::<NativeReceiver<256>>()),
        ("native over a serial line", size_of::<NativeSerialReceiver<256>>()),
        ("TI mmWave", size_of::<Ti<256>>()),
    ];
    for (input, bytes) in sizes {
        println!("{input}: {bytes} B");
        assert!(bytes <= 8_100, "{input}: {bytes}");
    }
}

#[test]
fn a_sensor_at_its_receiver_fits_8_6_kb_and_its_sender_9_kb() {
    let receiver = size_of::<SensorReceiver<{ reference::State::AZIMUTHS }, { reference::State::WORDS }, 1>>();
    let sender = size_of::<reference::Sender>();
    println!("receiver of 128 x 200: {receiver} B a sensor, sender: {sender} B");
    assert!(receiver <= 8600 && sender <= 9050, "{receiver}, {sender}");
}
