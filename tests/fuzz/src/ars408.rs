//! Any frames on a bus with ARS408s: no panic, and every scan within its bounds.
//!
//! Twelve bytes make a frame: which message, its length, milliseconds since the last, data.

use viewshed::fixed::time::Time;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::{Ars408, Ars408Config, Ars408Outcome};
use viewshed::wire::frame::{CanFrame, CanId};

/// One input.
pub fn run(bytes: &[u8]) {
    let Some((profile, bytes)) = bytes.split_first() else { return };
    let config = Ars408Config {
        profile: Ars408Profile::ALL[usize::from(*profile) % Ars408Profile::ALL.len()],
        ..Ars408Config::sensor(0)
    };
    let mut radar = Ars408::<16>::new(config);
    let (mut micros, mut scans, mut broken) = (0_u64, 0, 0);
    for twelve in bytes.chunks_exact(12) {
        let id = match Message::ALL.get(usize::from(twelve[0])) {
            Some(message) => message.id(twelve[1] >> 7),
            None => CanId::Standard(u16::from(twelve[0]) << 3),
        };
        let length = usize::from(twelve[1] & 0x7F).min(8);
        // time now and then steps back
        micros = if twelve[2] == 255 { micros / 2 } else { micros + 1000 * u64::from(twelve[2] >> 1) };
        let now = Time::from_micros(micros);
        let Some(frame) = CanFrame::classic(id, &twelve[4..4 + length]) else { continue };
        let mut see = |outcome: Ars408Outcome<'_>| match outcome {
            Ars408Outcome::Scan(scan) => {
                scans += 1;
                assert!(scan.detections.len() <= 16 && scan.detections.iter().all(|d| d.range_cm > 0));
            }
            Ars408Outcome::Broken { announced, arrived } => {
                broken += 1;
                assert!(arrived < announced);
            }
            _ => {}
        };
        see(radar.push(&frame, now));
        radar.poll(now).map(&mut see);
        assert!(radar.poll(now).is_none(), "one call of poll fetches all there is");
    }
    let c = radar.counters();
    assert_eq!((c.scans, c.broken), (scans, broken));
}
