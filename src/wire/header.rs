//! What a sender's maps are of: mount, geometry, configuration; and its clock.
//!
//! # Model
//! Seven groups of five bytes, and more with the number 7 of senders that have a table of probabilities, or azimuths of
//! which some are narrow. Group 0 is the sender's clock; the others stay the same for a whole epoch. A long message
//! carries them one after another, a classic one carries one of them, so a receiver collects six and keeps them. All
//! numbers are big-endian.
//!
//! | group | bytes |
//! |---|---|
//! | 0 | time, ms modulo 2^40 |
//! | 1 | x, cm, 3 bytes signed; height, cm |
//! | 2 | y, cm, 3 bytes signed; yaw, 2^-16 turn |
//! | 3 | pitch, roll, 2^-16 turn; planes, a bit each |
//! | 4 | right edge of the first azimuth from the boresight's heading, 2^-16 turn; width of all azimuths together, 2^-16 turn; azimuths less one, and 128 more if some are narrow |
//! | 5 | length of a range cell, cm; range cells less one; first and last cell usually known (1 and 0: none) |
//! | 6 | fingerprint of the configuration, 4 bytes; CRC-8 of profile 11 over the 29 bytes before it and, if some azimuths are narrow, the five of that group |
//! | 7 | least probabilities by a cell's bits, 3 bytes; lowest 16 bits of the table's check sum |
//! | 7 | first narrow azimuth; first behind them; 0; how many times narrower; 0 |
//!
//! A receiver that knows nothing of narrow azimuths finds more than 128 of them and no header, so it shows nothing; and
//! a third byte of 0 is of no probabilities.
//!
//! # Limits
//! 128 azimuths (their start takes seven bits of a classic frame), 256 range cells, positions within
//! 83 km of the road's origin.

use crc::Crc;

use super::code::block::Context;
use super::code::interval::Form;
use super::code::ray::Known;
use super::message::{CLASSIC_BYTES, WIRE_VERSION};
use crate::fixed::angle::Angle;
pub use crate::fixed::bytes::fingerprint;
use crate::map::azimuths::Narrow;
use crate::map::polar::PolarGeometry;
use crate::probability::Levels;
use crate::sensor::mount::{Levelling, Mount};
use crate::sensor::road::RoadPoint;

/// Groups every header has.
pub const GROUPS: u8 = 7;

/// The number of groups after them, which say what a cell's bits say of its probability and which azimuths are narrow.
pub(super) const MORE: u8 = 7;

/// Added to the number of azimuths if some are narrow.
const SOME_NARROW: u8 = 0x80;

/// Bytes of a group.
pub(super) const GROUP: usize = 5;

/// Most own bytes of a long header: flags, then the groups.
pub const LONG: usize = 1 + (GROUPS as usize + 2) * GROUP;

/// Most azimuths of a map on the wire.
pub const MOST_AZIMUTHS: usize = 128;

static CRC_8: Crc<u8> = Crc::<u8>::new(&crc::CRC_8_GSM_A);

/// The sender's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Clock {
    /// Milliseconds, modulo 2^40.
    pub time_ms: u64,
    /// Whether it is set by a time service, so that it can be compared with other clocks.
    pub synchronised: bool,
}

/// The mount as the wire has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct WireMount {
    /// Place on the road plane.
    pub origin: RoadPoint,
    /// Above the road, centimetres.
    pub height_cm: u16,
    /// Heading of the boresight, + left.
    pub yaw: Angle,
    /// + nose down.
    pub pitch: Angle,
    /// + left side up.
    pub roll: Angle,
}

/// What the maps of an epoch are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Header {
    /// Where the sensor stands.
    pub mount: WireMount,
    /// Right edge of the first azimuth, from the boresight's heading.
    pub azimuth_origin: Angle,
    /// Width of all azimuths together, 2^-16 turn.
    pub azimuth_span: u16,
    /// Number of azimuths, 1 to 128.
    pub azimuths: u8,
    /// Which of them are narrower than the others.
    pub narrow: Narrow,
    /// Length of a range cell along the ground, centimetres.
    pub cell_cm: u16,
    /// Number of range cells, 1 to 256.
    pub ranges: u16,
    /// Cells that are usually known.
    pub usual: Known,
    /// Planes the sender sends, a bit each.
    pub planes: u8,
    /// Fingerprint of the configuration.
    pub fingerprint: u32,
    /// Least probabilities by a cell's bits, of a sender that has a table.
    pub probability: Option<Levels>,
}

/// Why there is no header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotAHeader {
    /// A wire version this receiver does not know.
    Version {
        /// The sender's.
        version: u8,
    },
    /// Bytes are missing.
    TooShort,
    /// The check over all groups does not fit.
    Check,
    /// A value out of range.
    Range,
    /// A map of this size or place cannot be sent.
    Unsendable,
}

impl Header {
    /// For the maps of an estimator.
    ///
    /// # Errors
    /// `NotAHeader::Unsendable` if the map has more than 128 azimuths or 256 range cells, or the
    /// mount is none.
    pub fn new<const R: usize, const A: usize>(
        mount: &Mount,
        geometry: &PolarGeometry,
        usual: Known,
        planes: u8,
        fingerprint: u32,
    ) -> Result<Self, NotAHeader> {
        let unsendable = NotAHeader::Unsendable;
        let origin = mount.levelling().map_err(|_| unsendable)?.origin();
        if A == 0 || A > MOST_AZIMUTHS || R == 0 || R > 256 || usual.end() > R {
            return Err(unsendable);
        }
        Ok(Self {
            mount: WireMount {
                origin,
                height_cm: u16::try_from(geometry.levelling.height_cm).map_err(|_| unsendable)?,
                yaw: Angle::from_degrees(mount.yaw_deg),
                pitch: Angle::from_degrees(mount.pitch_deg),
                roll: Angle::from_degrees(mount.roll_deg),
            },
            azimuth_origin: geometry.azimuth_origin,
            azimuth_span: geometry.azimuth_span,
            azimuths: u8::try_from(A).map_err(|_| unsendable)?,
            narrow: geometry.narrow,
            cell_cm: u16::try_from(geometry.cell_cm).map_err(|_| unsendable)?,
            ranges: u16::try_from(R).map_err(|_| unsendable)?,
            usual,
            planes,
            fingerprint,
            probability: None,
        })
    }

    /// Groups it has.
    pub fn count(&self) -> u8 {
        GROUPS + u8::from(self.probability.is_some()) + u8::from(self.some_narrow())
    }

    fn some_narrow(&self) -> bool {
        self.narrow != Narrow::NONE
    }

    /// The groups with the number 7.
    fn more(&self) -> impl Iterator<Item = [u8; GROUP]> {
        self.probability.map(Levels::to_bytes).into_iter().chain(self.narrow_group())
    }

    fn narrow_group(&self) -> Option<[u8; GROUP]> {
        let [first, end, times] = self.narrow.to_bytes();
        self.some_narrow().then_some([first, end, 0, times, 0])
    }

    /// Where the cells lie on the road, for queries.
    pub fn geometry(&self) -> PolarGeometry {
        PolarGeometry {
            levelling: Levelling::on_road(self.mount.origin, i32::from(self.mount.height_cm), self.mount.yaw),
            cell_cm: i32::from(self.cell_cm),
            azimuth_origin: self.azimuth_origin,
            azimuth_span: self.azimuth_span,
            narrow: self.narrow,
        }
    }

    /// What the code of its maps needs of it.
    pub fn context(&self, form: Form) -> Context {
        Context { form, usual: self.usual, azimuths: usize::from(self.azimuths), ranges: usize::from(self.ranges) }
    }

    /// Groups 1 to 6.
    pub(super) fn groups(&self) -> Groups {
        let [_, x1, x2, x3] = self.mount.origin.x_cm.to_be_bytes();
        let [_, y1, y2, y3] = self.mount.origin.y_cm.to_be_bytes();
        let [h1, h2] = self.mount.height_cm.to_be_bytes();
        let [yaw1, yaw2] = self.mount.yaw.raw().to_be_bytes();
        let [pitch1, pitch2] = self.mount.pitch.raw().to_be_bytes();
        let [roll1, roll2] = self.mount.roll.raw().to_be_bytes();
        let [origin1, origin2] = self.azimuth_origin.raw().to_be_bytes();
        let [span1, span2] = self.azimuth_span.to_be_bytes();
        let [cell1, cell2] = self.cell_cm.to_be_bytes();
        let [f1, f2, f3, f4] = self.fingerprint.to_be_bytes();
        let [_, ranges] = self.ranges.saturating_sub(1).to_be_bytes();
        let [near, last] = self.usual.limits();
        let azimuths = self.azimuths.saturating_sub(1) | if self.some_narrow() { SOME_NARROW } else { 0 };
        let mut groups = [
            [x1, x2, x3, h1, h2],
            [y1, y2, y3, yaw1, yaw2],
            [pitch1, pitch2, roll1, roll2, self.planes],
            [origin1, origin2, span1, span2, azimuths],
            [cell1, cell2, ranges, near, last],
            [f1, f2, f3, f4, 0],
        ];
        let sum = check(&groups, self.narrow_group());
        if let Some(byte) = groups.last_mut().and_then(|group| group.last_mut()) {
            *byte = sum;
        }
        groups
    }

    /// From groups 1 to 6 and the one of narrow azimuths, if that came.
    pub(super) fn parse(groups: &Groups, narrow: Option<[u8; GROUP]>) -> Result<Self, NotAHeader> {
        let [
            [x1, x2, x3, h1, h2],
            [y1, y2, y3, yaw1, yaw2],
            [pitch1, pitch2, roll1, roll2, planes],
            [origin1, origin2, span1, span2, azimuths],
            [cell1, cell2, ranges, near, last],
            [f1, f2, f3, f4, sum],
        ] = *groups;
        if sum != check(groups, narrow) {
            return Err(NotAHeader::Check);
        }
        let coordinate = |a, b, c| i32::from_be_bytes([a, b, c, 0]) >> 8;
        let angle = |a, b| Angle::from_raw(i16::from_be_bytes([a, b]));
        let ranges = u16::from(ranges) + 1;
        let usual = Known::from_limits([near, last]).ok_or(NotAHeader::Range)?;
        let number = (azimuths & !SOME_NARROW) + 1;
        let some = narrow.and_then(|[first, end, _, times, _]| Narrow::from_bytes([first, end, times], number));
        let header = Self {
            mount: WireMount {
                origin: RoadPoint::new(coordinate(x1, x2, x3), coordinate(y1, y2, y3)),
                height_cm: u16::from_be_bytes([h1, h2]),
                yaw: angle(yaw1, yaw2),
                pitch: angle(pitch1, pitch2),
                roll: angle(roll1, roll2),
            },
            azimuth_origin: angle(origin1, origin2),
            azimuth_span: u16::from_be_bytes([span1, span2]),
            azimuths: number,
            narrow: if some_narrow(groups) { some.ok_or(NotAHeader::Range)? } else { Narrow::NONE },
            cell_cm: u16::from_be_bytes([cell1, cell2]),
            ranges,
            usual,
            planes,
            fingerprint: u32::from_be_bytes([f1, f2, f3, f4]),
            probability: None,
        };
        let empty = header.cell_cm == 0 || header.azimuth_span == 0;
        if empty || usual.end() > usize::from(ranges) { Err(NotAHeader::Range) } else { Ok(header) }
    }

    /// Own bytes of a long message, and how many they are.
    pub fn emit(&self, clock: &Clock) -> ([u8; LONG], usize) {
        let mut bytes = [0; LONG];
        let groups = [clock.group()].into_iter().chain(self.groups()).chain(self.more());
        let all = [flags(clock, 0)].into_iter().chain(groups.flatten());
        bytes.iter_mut().zip(all).for_each(|(to, from)| *to = from);
        (bytes, 1 + usize::from(self.count()) * GROUP)
    }

    /// Own bytes of the classic message that carries a group, by its place among all of them.
    pub fn emit_group(&self, clock: &Clock, group: u8) -> [u8; CLASSIC_BYTES] {
        let mut others = self.groups().into_iter().chain(self.more());
        let place = usize::from(group).checked_sub(1).and_then(|place| others.nth(place));
        let [a, b, c, d, e] = place.unwrap_or_else(|| clock.group());
        [flags(clock, if place.is_some() { group.min(MORE) } else { 0 }), a, b, c, d, e]
    }
}

impl Clock {
    fn group(&self) -> [u8; GROUP] {
        let [_, _, _, a, b, c, d, e] = self.time_ms.to_be_bytes();
        [a, b, c, d, e]
    }

    pub(super) fn parse(synchronised: bool, [a, b, c, d, e]: [u8; GROUP]) -> Self {
        Self { time_ms: u64::from_be_bytes([0, 0, 0, a, b, c, d, e]), synchronised }
    }
}

/// Whether a group 7 is of narrow azimuths. Probabilities with a third byte of 0 do not hold.
pub(super) fn is_narrow([_, _, third, times, _]: &[u8; GROUP]) -> bool {
    *third == 0 && *times > 1
}

/// First own byte: clock set, group, wire version.
fn flags(clock: &Clock, group: u8) -> u8 {
    u8::from(clock.synchronised) << 7 | group << 4 | WIRE_VERSION
}

/// Groups 1 to 6.
pub(super) type Groups = [[u8; GROUP]; GROUPS as usize - 1];

/// The check over groups 1 to 6, the last byte left out, and the one of narrow azimuths where they say that there are any.
pub(super) fn check(groups: &Groups, narrow: Option<[u8; GROUP]>) -> u8 {
    let mut digest = CRC_8.digest();
    digest.update(groups.as_flattened().split_last().map_or(&[], |(_, rest)| rest));
    if let Some(narrow) = narrow.filter(|_| some_narrow(groups)) {
        digest.update(&narrow);
    }
    digest.finalize()
}

/// Whether groups 1 to 6 say that some azimuths are narrow.
pub(super) fn some_narrow(groups: &Groups) -> bool {
    let [.., [.., azimuths], _, _] = *groups;
    azimuths & SOME_NARROW != 0
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn header() -> Header {
        Header {
            mount: WireMount {
                origin: RoadPoint::new(-1234, 560),
                height_cm: 600,
                yaw: Angle::from_raw(-2731),
                pitch: Angle::from_raw(728),
                roll: Angle::from_raw(-1),
            },
            azimuth_origin: Angle::from_raw(-10968),
            azimuth_span: 21936,
            azimuths: 120,
            narrow: Narrow::NONE,
            cell_cm: 100,
            ranges: 200,
            usual: Known::new(15, 200),
            planes: 1,
            fingerprint: 0xDEAD_BEEF,
            probability: None,
        }
    }

    pub fn emit(header: &Header) -> std::vec::Vec<u8> {
        let (bytes, length) = header.emit(&CLOCK);
        bytes[..length].to_vec()
    }

    pub const CLOCK: Clock = Clock { time_ms: 0x01_0203_0405, synchronised: true };

    #[test]
    fn the_long_header_is_these_bytes() {
        let expected = [
            0x81, // clock set, wire version 1
            0x01, 0x02, 0x03, 0x04, 0x05, // time
            0xFF, 0xFB, 0x2E, 0x02, 0x58, // x = -1234, height 600
            0x00, 0x02, 0x30, 0xF5, 0x55, // y = 560, yaw
            0x02, 0xD8, 0xFF, 0xFF, 0x01, // pitch, roll, planes
            0xD5, 0x28, 0x55, 0xB0, 119, // azimuths from -60.25 degrees on
            0x00, 0x64, 199, 15, 199, // cells
            0xDE, 0xAD, 0xBE, 0xEF, 0xD2, // fingerprint, check
        ];
        assert_eq!(emit(&header()), expected);
    }

    pub const LEVELS_7: [u8; 5] = [60, 200, 240, 0xAB, 0xCD];

    pub fn with_levels(bytes: [u8; 5]) -> Header {
        Header { probability: Levels::from_bytes(bytes), ..header() }
    }

    pub fn with_narrow(bytes: [u8; 3]) -> Header {
        Header { narrow: Narrow::from_bytes(bytes, 120).unwrap(), ..header() }
    }

    #[test]
    fn a_receiver_that_knows_nothing_of_narrow_azimuths_has_no_header_of_them() {
        // it reads 248 azimuths, and of group 7 probabilities that do not hold
        let sent = with_narrow([40, 88, 4]);
        let group = sent.emit_group(&CLOCK, 7);
        assert_eq!(
            (group[0] >> 4 & 7, Levels::from_bytes([group[1], group[2], group[3], group[4], group[5]])),
            (7, None)
        );
        let azimuths = sent.emit_group(&CLOCK, 4)[5];
        assert!(usize::from(azimuths) >= MOST_AZIMUTHS);
    }

    #[test]
    fn a_point_lies_in_the_same_cell_on_both_sides() {
        let mount = Mount { x_m: -12.34, y_m: 5.6, height_m: 6.0, yaw_deg: -15.0, pitch_deg: 4.0, roll_deg: 1.0 };
        let geometry = PolarGeometry {
            levelling: mount.levelling().unwrap(),
            cell_cm: 100,
            azimuth_origin: Angle::from_degrees(-60.25),
            azimuth_span: 21936,
            narrow: Narrow::NONE,
        };
        let sent = Header::new::<200, 120>(&mount, &geometry, Known::new(15, 200), 1, 0).unwrap();
        let received = sent.geometry();
        for i in (-20_000..20_000).step_by(333) {
            let p = RoadPoint::new(i, i / 3 - 1000);
            let (here, there) = (geometry.levelling.place(p), received.levelling.place(p));
            assert_eq!(here, there);
            assert_eq!(received.locate(here.0, here.1, 200, 120), geometry.locate(here.0, here.1, 200, 120));
        }
        assert!(Header::new::<200, 200>(&mount, &geometry, Known::NONE, 1, 0).is_err());
    }
}
