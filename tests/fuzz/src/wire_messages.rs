//! Any bytes as header, status, visible range, sealed message and serial line.

use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Packing, Received, data_id};
use viewshed::wire::receive::Collector;
use viewshed::wire::secoc::Opener;
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer, stuff};
use viewshed::wire::status::Status;
use viewshed::wire::visible_range::Ranges;

/// One input.
pub fn run(bytes: &[u8]) {
    let mut collector = Collector::NEW;
    let mut status = Status::default();
    for own in bytes.chunks(6).chain([bytes]) {
        if collector.take(own).is_ok()
            && let Some(header) = collector.header()
        {
            assert!(header.azimuths <= 128 && header.ranges <= 256);
            assert!(header.usual.end() <= usize::from(header.ranges));
        }
        if status.take(own).is_ok() && own.len() >= 26 {
            assert_eq!(status.emit()[1..22], own[1..22]);
        }
        if let Some(ranges) = Ranges::parse(own) {
            assert!((0..=255).filter_map(|azimuth| ranges.metres(azimuth)).all(|metres| metres <= 510));
        }
    }
    if let Ok(frame) = u16::try_from(bytes.len()).map(|n| CanId::Standard(0x400 + n % 256)) {
        let _ = CanFrame::classic(frame, bytes).map(|f| Received::from_frame(&f, &Addresses::STANDARD).is_ok());
        let _ = CanFrame::fd(frame, bytes).map(|f| Received::from_frame(&f, &Addresses::STANDARD).is_ok());
    }
    // what passes the check sum, with a key that is not the sender's
    let mut message = bytes.get(..64).unwrap_or(bytes).to_vec();
    if message.len() > 6 {
        message[3] %= 32;
        message[5] = message[5] & 0x0F | 0x80;
        let id = data_id(message[4], viewshed::wire::message::Message::from_number(message[3]).unwrap());
        Packing::Secured.profile().protect(&mut message, id, 1);
        let received = Received::from_bytes(&message).unwrap();
        assert!(received.sealed);
        assert!(Opener::resume([3; 16], 7).open(&received).is_err());
    }
    // a line of any bytes, and back in step behind it
    let mut unstuffer = Unstuffer::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (taken, message) = unstuffer.push(rest);
        assert!(taken > 0);
        if let Some(message) = message {
            let mut line = [0; MOST_STUFFED];
            assert!(stuff(message, &mut line).is_some());
        }
        rest = &rest[taken..];
    }
    unstuffer.push(&[0]);
    unstuffer.push(&[0]);
    assert_eq!(unstuffer.push(&[3, 1, 2, 0]).1, Some(&[1, 2][..]));
}
