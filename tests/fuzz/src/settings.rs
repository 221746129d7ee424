//! Any bytes as configuration block, service message and bench record: what is taken is within its limits
//! and comes back as it was.

use viewshed::bench::record::{RECORD_LEN, Record};
use viewshed::sensor::Sensor;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;
use viewshed::unit::profile::small;
use viewshed::unit::service::{Reply, Request, data_id};
use viewshed::unit::settings::{BLOCK_LEN, Settings, StoredError};
use viewshed::wire::e2e::Profile;

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum: u32, _| if sum & 1 == 1 { sum >> 1 ^ 0xEDB8_8320 } else { sum >> 1 })
    })
}

/// A whole block whose numbers are the input's, with a check sum that is right.
fn block(content: &[u8]) -> [u8; BLOCK_LEN] {
    let mount = Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 4.0, roll_deg: 0.0 };
    let field_of_view = FieldOfView {
        azimuth_min_deg: -60.0,
        azimuth_max_deg: 60.0,
        elevation_min_deg: -16.0,
        elevation_max_deg: 16.0,
        range_min_m: 3.0,
        range_max_m: 200.0,
    };
    let sensor = Sensor { mount, field_of_view, noise: NoiseConfig::default() };
    let mut block = Settings::of(sensor).to_block(3);
    // the input exchanges some numbers: place, then the value's bytes
    for five in content.chunks_exact(5) {
        let numbers = (BLOCK_LEN - 12 - 4) / 4;
        let at = 12 + 4 * (usize::from(five[0]) % numbers);
        block[at..at + 4].copy_from_slice(&five[1..]);
    }
    let sum = crc32(&block[..BLOCK_LEN - 4]);
    block[BLOCK_LEN - 4..].copy_from_slice(&sum.to_le_bytes());
    block
}

/// One input.
pub fn run(bytes: &[u8]) {
    let _ = Settings::from_block(bytes);
    let whole = block(bytes);
    let check = small::CHECK;
    let slots = Settings::newest([bytes, &whole], |settings| check.settings(settings));
    match slots.map(|newest| (newest.next_sequence - 1, newest.settings)).map_err(|[_, reason]| reason) {
        Ok((sequence, settings)) => {
            assert_eq!(sequence, 3);
            assert!(settings.sensor.mount.levelling().is_ok() && settings.sensor.field_of_view.limits().is_ok());
            // flags are written as 0 or 1
            let again = settings.to_block(sequence);
            assert_eq!(Settings::from_block(&again), Ok((sequence, settings)));
        }
        Err(reason) => {
            assert!((1..=5).contains(&reason.code()));
            let reply = Reply::Refused(&StoredError::of_settings(reason)).message(4, 9);
            assert!(Profile::P05.check(reply.bytes(), data_id(4)).is_ok());
        }
    }
    // a service message of any kind and content
    let mut message = bytes.get(..200).unwrap_or(bytes).to_vec();
    assert!(Request::read(&message, 4).is_none_or(|_| message.len() >= 4));
    if message.len() >= 4 {
        message[3] %= 9;
        Profile::P05.protect(&mut message, data_id(4), 1);
        assert_eq!(Request::read(&message, 5), None, "another sensor's");
        if let Some(request) = Request::read(&message, 4) {
            let again = request.message(4, 2);
            assert_eq!(Request::read(again.bytes(), 4), Some(request));
        }
    }
    for record in bytes.chunks_exact(RECORD_LEN) {
        if let Some(record) = record.first_chunk().and_then(Record::from_bytes) {
            assert_eq!(Record::from_bytes(&record.to_bytes()), Some(record));
        }
    }
}
