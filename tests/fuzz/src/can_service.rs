//! Any requests and answers of an integrator on CAN, six own bytes each, with check sums that hold.

use viewshed::bench::flash::Flash;
use viewshed::fixed::time::Time;
use viewshed::unit::can_service::{ANSWER, Answers, CanService, CanServiceConfig, REQUEST};
use viewshed::unit::profile::small;
use viewshed::unit::settings::{BlockError, Settings, SettingsSlots, StoredSettings};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::{Addresses, Epoch, Packet, Packing};

/// A unit without settings and a tool, both given the same.
pub fn run(bytes: &[u8]) {
    let medium = Medium::Can(Addresses::STANDARD);
    let mut flash = Flash::ERASED;
    let check = small::CHECK;
    let config = CanServiceConfig { gap_us: 0, ..CanServiceConfig::new(0, medium) };
    let mut unit = CanService::start(config, Epoch::new(0), Time::from_micros(0), StoredSettings::read(&flash, check));
    let mut answers = Answers::new(0, medium);
    for own in bytes.chunks(6) {
        for message in [REQUEST, ANSWER] {
            let packet = Packet::new(Packing::Classic, 0, message, Epoch::new(3), own).protect(0, None);
            let frame = packet.frame(&Addresses::STANDARD).unwrap();
            let _ = unit.take(&frame, &mut flash);
            let _ = answers.take(&frame);
        }
        // an answer has an end
        let said = std::iter::from_fn(|| unit.next_frame(Time::from_micros(0), &flash)).take(300).count();
        assert!(said < 300);
        for slot in 0..2 {
            let read = Settings::from_block(flash.slot(slot));
            assert!(read.is_ok() || read == Err(BlockError::Empty));
        }
    }
}
