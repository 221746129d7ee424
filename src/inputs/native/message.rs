//! One message: header and records as bytes.

use crate::camera::boxes::{ImageBox, VehicleClass};
use crate::fixed::angle::Angle;
use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::inputs::collected::Entry;
use crate::wire::e2e::{E2eError, Profile};
use crate::wire::frame::{self, CanFrame, CanId};
use crate::wire::serial;

/// Version of the format.
pub const VERSION: u8 = 1;

/// Most bytes of a message.
pub const MOST_BYTES: usize = serial::MOST_BYTES;

const HEADER: usize = 14;
/// Bytes of a record.
pub const RECORD: usize = 10;
const FAULT: u8 = 1;
const SERIAL: u8 = 2;
const NO_ELEVATION: i16 = i16::MIN;
const NO_RCS: i8 = i8::MIN;
const NO_SNR: u8 = u8::MAX;

/// What carries the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NativeMedium {
    /// Frames of up to 64 bytes.
    CanFd,
    /// Messages of up to 240 bytes.
    Serial,
}

impl NativeMedium {
    /// Detections or boxes a message holds.
    pub const fn detections(self) -> usize {
        match self {
            Self::CanFd => (frame::MOST_BYTES - HEADER) / RECORD,
            Self::Serial => (serial::MOST_BYTES - HEADER) / RECORD,
        }
    }
}

/// The data ID of a radar's messages.
pub const fn data_id(sensor: u8) -> u16 {
    0x4000 | sensor as u16
}

/// The data ID of a camera's messages: neither passes for the other's.
pub const fn box_data_id(sensor: u8) -> u16 {
    0x4100 | sensor as u16
}

/// The usual identifier of a radar's CAN FD frames.
pub const fn id(sensor: u8) -> CanId {
    CanId::Standard(0x100 + sensor as u16)
}

/// The usual identifier of a camera's CAN FD frames.
pub const fn box_id(sensor: u8) -> CanId {
    CanId::Extended(0x0100_0100 + sensor as u32)
}

/// What a record is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content<T> {
    /// Padding.
    None,
    /// Something this version does not know.
    Refused,
    /// A detection, or a box.
    Entry(T),
}

/// What messages hold: detections of a radar, or boxes of a camera.
pub trait NativeEntry: Entry {
    /// The data ID of a sensor's messages.
    fn data_id(sensor: u8) -> u16;
    /// As a record.
    fn write(&self) -> [u8; RECORD];
    /// From a record.
    fn read(record: &[u8; RECORD]) -> Content<Self>;
}

/// What comes before the records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) sensor: u8,
    pub(super) fault: bool,
    pub(super) scan: u8,
    pub(super) part: u8,
    pub(super) parts: u8,
    pub(super) time: Time,
    pub(super) medium: NativeMedium,
}

/// A message, ready to be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NativeMessage {
    bytes: [u8; MOST_BYTES],
    length: usize,
}

impl NativeMessage {
    /// Header and records; what does not fit is left out.
    pub(super) fn new<T: NativeEntry>(header: &Header, detections: &[T], counter: u8) -> Self {
        let medium = header.medium;
        let mut bytes = [0; MOST_BYTES];
        let [t0, t1, t2, t3, t4, t5, ..] = header.time.micros().to_le_bytes();
        let serial = if medium == NativeMedium::Serial { SERIAL } else { 0 };
        let kind = VERSION << 4 | serial | if header.fault { FAULT } else { 0 };
        let head = [0, 0, 0, kind, header.sensor, header.scan, header.part, header.parts, t0, t1, t2, t3, t4, t5];
        let detections = detections.get(..medium.detections()).unwrap_or(detections);
        let (place, records) = bytes.split_at_mut(HEADER);
        place.copy_from_slice(&head);
        for (detection, record) in detections.iter().zip(records.chunks_exact_mut(RECORD)) {
            record.copy_from_slice(&detection.write());
        }
        let wanted = HEADER + RECORD * detections.len();
        let length = match medium {
            NativeMedium::CanFd => frame::fd_length(wanted).unwrap_or(frame::MOST_BYTES),
            NativeMedium::Serial => wanted,
        };
        let mut message = Self { bytes, length };
        if let Some(bytes) = message.bytes.get_mut(..length) {
            Profile::P05.protect(bytes, T::data_id(header.sensor), counter);
        }
        message
    }

    /// The bytes, before stuffing.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or(&[])
    }

    /// As a CAN FD frame; `None` if it was made for a serial line and is too long.
    pub fn frame(&self, id: CanId) -> Option<CanFrame> {
        CanFrame::fd(id, self.bytes())
    }

    /// As it goes on a serial line, with the ending zero: its length, or `None` if `line` is shorter.
    pub fn stuff(&self, line: &mut [u8]) -> Option<usize> {
        serial::stuff(self.bytes(), line)
    }
}

/// Why bytes are no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoMessage {
    E2e(E2eError),
    Version(u8),
}

/// Counter and header of a message.
pub(super) fn read(bytes: &[u8], data_id: u16) -> Result<(u8, Header), NoMessage> {
    let counter = Profile::P05.check(bytes, data_id).map_err(NoMessage::E2e)?;
    let short = NoMessage::E2e(E2eError::TooShort { length: bytes.len() });
    let Some((head, _)) = bytes.split_first_chunk::<HEADER>() else { return Err(short) };
    let &[_, _, _, kind, sensor, scan, part, parts, t0, t1, t2, t3, t4, t5] = head;
    if kind >> 4 != VERSION {
        return Err(NoMessage::Version(kind >> 4));
    }
    let time = Time::from_micros(u64::from_le_bytes([t0, t1, t2, t3, t4, t5, 0, 0]));
    let medium = if kind & SERIAL != 0 { NativeMedium::Serial } else { NativeMedium::CanFd };
    let header = Header { sensor, fault: kind & FAULT != 0, scan, part, parts, time, medium };
    Ok((counter, header))
}

/// What a message that was read holds, padding left out.
pub(super) fn records<T: NativeEntry>(bytes: &[u8]) -> impl Iterator<Item = Option<T>> {
    let (records, _) = bytes.get(HEADER..).unwrap_or(&[]).as_chunks::<RECORD>();
    records.iter().filter_map(|record| match T::read(record) {
        Content::None => None,
        Content::Refused => Some(None),
        Content::Entry(entry) => Some(Some(entry)),
    })
}

impl NativeEntry for Detection {
    fn data_id(sensor: u8) -> u16 {
        data_id(sensor)
    }

    fn write(&self) -> [u8; RECORD] {
        write_detection(self)
    }

    fn read(record: &[u8; RECORD]) -> Content<Self> {
        read_detection(record).map_or(Content::None, Content::Entry)
    }
}

impl NativeEntry for ImageBox {
    fn data_id(sensor: u8) -> u16 {
        box_data_id(sensor)
    }

    fn write(&self) -> [u8; RECORD] {
        let [[l0, l1], [t0, t1], [r0, r1], [b0, b1]] = self.shares().map(i16::to_le_bytes);
        [l0, l1, t0, t1, r0, r1, b0, b1, self.class().number(), 0]
    }

    fn read(&[l0, l1, t0, t1, r0, r1, b0, b1, class, _]: &[u8; RECORD]) -> Content<Self> {
        if class == 0 {
            return Content::None;
        }
        let shares = [[l0, l1], [t0, t1], [r0, r1], [b0, b1]].map(i16::from_le_bytes);
        VehicleClass::numbered(class).map_or(Content::Refused, |class| Content::Entry(Self::of_shares(shares, class)))
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limits are within
fn write_detection(d: &Detection) -> [u8; RECORD] {
    let [r0, r1] = d.range_cm.to_le_bytes();
    let [a0, a1] = d.azimuth.raw().to_le_bytes();
    let [e0, e1] = d.elevation.map_or(NO_ELEVATION, Angle::raw).to_le_bytes();
    let [v0, v1] = d.radial_velocity_cm_s.to_le_bytes();
    let [rcs] = d.rcs_half_dbsm.map_or(NO_RCS, |rcs| rcs.clamp(-127, 127) as i8).to_le_bytes();
    let snr = d.snr_half_db.map_or(NO_SNR, |snr| snr.clamp(0, 254) as u8);
    [r0, r1, a0, a1, e0, e1, v0, v1, rcs, snr]
}

/// The detection of a record; `None` where there is none.
fn read_detection(&[r0, r1, a0, a1, e0, e1, v0, v1, rcs, snr]: &[u8; RECORD]) -> Option<Detection> {
    let range_cm = u16::from_le_bytes([r0, r1]);
    let elevation = i16::from_le_bytes([e0, e1]);
    let rcs = i8::from_le_bytes([rcs]);
    (range_cm > 0).then(|| Detection {
        range_cm,
        azimuth: Angle::from_raw(i16::from_le_bytes([a0, a1])),
        elevation: (elevation != NO_ELEVATION).then(|| Angle::from_raw(elevation)),
        radial_velocity_cm_s: i16::from_le_bytes([v0, v1]),
        rcs_half_dbsm: (rcs != NO_RCS).then(|| i16::from(rcs)),
        snr_half_db: (snr != NO_SNR).then(|| i16::from(snr)),
        marked: false,
    })
}
