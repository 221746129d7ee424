//! Frames of SocketCAN and of `candump -L` logs as the library's, and back.

use socketcan::dump::CanDumpRecord;
use socketcan::id::FdFlags;
use socketcan::{CanAnyFrame, CanDataFrame, CanFdFrame, EmbeddedFrame, ExtendedId, Id, StandardId};
use viewshed::{CanFrame, CanId, Time};

/// The library's frame; `None` for remote and error frames.
pub fn from_socketcan(frame: &CanAnyFrame) -> Option<CanFrame> {
    let id = match frame.id() {
        Id::Standard(id) => CanId::standard(id.as_raw())?,
        Id::Extended(id) => CanId::extended(id.as_raw())?,
    };
    match frame {
        CanAnyFrame::Normal(frame) => CanFrame::classic(id, frame.data()),
        CanAnyFrame::Fd(frame) => CanFrame::fd(id, frame.data()),
        CanAnyFrame::Remote(_) | CanAnyFrame::Error(_) => None,
    }
}

/// SocketCAN's frame; CAN FD with the switched bit rate.
pub fn to_socketcan(frame: &CanFrame) -> Option<CanAnyFrame> {
    let id: Id = match frame.id {
        CanId::Standard(raw) => StandardId::new(raw)?.into(),
        CanId::Extended(raw) => ExtendedId::new(raw)?.into(),
    };
    if frame.fd {
        return CanFdFrame::with_flags(id, frame.data(), FdFlags::BRS).map(CanAnyFrame::Fd);
    }
    CanDataFrame::new(id, frame.data()).map(CanAnyFrame::Normal)
}

/// A line of a log.
pub fn line(time: Time, device: &str, frame: &CanFrame) -> Option<String> {
    let record = CanDumpRecord { t_us: time.micros(), device: device.to_owned(), frame: to_socketcan(frame)? };
    Some(record.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_go_both_ways_and_into_logs() {
        let classic = CanFrame::classic(CanId::Standard(0x421), &[1, 2, 0xAB]).unwrap();
        let fd = CanFrame::fd(CanId::Extended(0x0400_0001), &[7; 20]).unwrap();
        let short_fd = CanFrame::fd(CanId::Standard(5), &[7; 3]).unwrap();
        for frame in [classic, fd, short_fd] {
            assert_eq!(from_socketcan(&to_socketcan(&frame).unwrap()), Some(frame));
        }
        let time = Time::from_micros(1_000_000_000_004_200);
        assert_eq!(line(time, "can0", &classic).unwrap(), "(1000000000.004200) can0 421#0102AB");
        let text = line(Time::from_micros(12), "can0", &fd).unwrap();
        assert!(text.starts_with("(0.000012) can0 04000001##"), "{text}");
        let mut reader = socketcan::dump::Reader::from_reader(text.as_bytes());
        let read = reader.next_record().unwrap().unwrap();
        assert_eq!((read.t_us, from_socketcan(&read.frame)), (12, Some(fd)));
    }
}
