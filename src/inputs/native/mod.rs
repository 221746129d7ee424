//! A scan format of our own, for cameras and for every radar that has none of the others: CAN FD and serial lines.
//!
//! # Model
//! A scan is sent in parts, each a message that can be checked and placed alone. All numbers are
//! little-endian.
//!
//! | byte | content |
//! |---|---|
//! | 0, 1 | check sum of AUTOSAR E2E profile 05 over bytes 2 to the end and the data ID |
//! | 2 | counter of the profile, one more with every message |
//! | 3 | high nibble: version of this format, 1; bit 0: the radar reports a fault; bit 1: all parts but the last hold 22 records, else 5; other bits 0 |
//! | 4 | sensor |
//! | 5 | scan number, one more with every scan |
//! | 6 | part, from 0 |
//! | 7 | parts of this scan, 1 to 255 |
//! | 8 to 13 | time of measurement on the sender's clock, microseconds; starts over after 8.9 years |
//! | 14 on | records of 10 bytes |
//!
//! | byte of a record | content |
//! |---|---|
//! | 0, 1 | range, centimetres; 0: no record, what CAN FD pads with |
//! | 2, 3 | azimuth, 2^-16 turn, + left |
//! | 4, 5 | elevation, 2^-16 turn, + up; 0x8000: not measured |
//! | 6, 7 | radial velocity, cm/s, + receding |
//! | 8 | radar cross-section, half dBsm, signed; 0x80: not measured |
//! | 9 | signal-to-noise ratio, half dB; 0xFF: not measured |
//!
//! A camera's boxes are sent in the same way, a picture for a scan, with another record and another data ID:
//!
//! | byte of a box | content |
//! |---|---|
//! | 0, 1 | left edge, 2^-14 of the picture's width from its left border, signed |
//! | 2, 3 | upper edge, 2^-14 of the picture's height from its upper border, signed |
//! | 4, 5 | right edge, as the left one |
//! | 6, 7 | lower edge, as the upper one |
//! | 8 | class: 1 car, 2 van, 3 truck, 4 bus, 5 motorcycle, 6 bicycle, 7 pedestrian; 0: no record |
//! | 9 | 0 |
//!
//! Edges are shares of the picture, so that it does not matter to which size a detector shrank it: the unit's
//! calibration is [normalised](crate::camera::calibration::Calibration::normalised) in the same way. The picture has
//! to be the rectified one, and whole. A box of another class is counted as refused; one that is inverted or outside
//! of the picture is given on, and the estimator counts it with its reason.
//!
//! The data ID is `0x4000 | sensor`, of boxes `0x4100 | sensor`. Serial messages are stuffed and ended by a zero as in
//! [`serial`](crate::wire::serial), CAN FD frames come under one identifier a sensor, by default
//! `0x100 + sensor`, and the extended `0x1000100 + sensor` for boxes. A scan without detections, a picture without
//! boxes, is one part without records.
//!
//! # Limits
//! 5 detections or boxes a CAN FD frame, 22 a serial message; 1 275 and 5 610 a scan. RCS beyond -63.5 to
//! 63.5 dBsm and SNR beyond 0 to 127 dB are cut to these, edges beyond 2 pictures too. An edge is right to 0.12 pixels of 1920.
//!
//! # Example
//! ```
//! use viewshed::board::NativeOutcome;
//! use viewshed::{Angle, Detection, NativeConfig, NativeMedium, NativeReceiver, NativeSender, Time};
//!
//! let car = Detection {
//!     range_cm: 5000,
//!     azimuth: Angle::from_degrees(10.0),
//!     elevation: None,
//!     radial_velocity_cm_s: -2500,
//!     rcs_half_dbsm: Some(20),
//!     snr_half_db: None,
//!     marked: false,
//! };
//! let mut sender = NativeSender::new(7);
//! let mut receiver = NativeReceiver::<256>::new(NativeConfig::sensor(7));
//! for message in sender.scan(Time::from_micros(123_456), false, &[car], NativeMedium::CanFd) {
//!     match receiver.push(message.bytes(), Time::from_micros(9)) {
//!         NativeOutcome::Scan(scan) => assert_eq!((scan.time.micros(), scan.detections), (123_456, &[car][..])),
//!         other => panic!("{other:?}"),
//!     }
//! }
//! ```

mod message;
mod receiver;
mod sender;

pub use message::{
    Content, MOST_BYTES, NativeEntry, NativeMedium, NativeMessage, VERSION, box_data_id, box_id, data_id, id,
};
pub use receiver::{NativeConfig, NativeCounters, NativeOutcome, NativeReceiver, NativeSerialReceiver, Refusal};
pub use sender::{NativeSender, Parts};
