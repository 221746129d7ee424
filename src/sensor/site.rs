//! What is known of a place beside the sensor: the lanes of its traffic and the heights of its road, as points.
//!
//! A host has them as lists of metres, a controller as bytes it keeps. Both are read point by point through the same
//! iterators, so that a controller has them in memory once.
//!
//! # Model
//! Bytes are little-endian. A height is `f32` x and `f32` height, metres. A lane is the number of its points (1 byte),
//! the first one (x, y: 3 bytes each, centimetres), and of each further one how far it lies from the one before (x, y:
//! 2 bytes each, centimetres). Whole centimetres come back as the `f32` that a file's "12.34" is read as, so that the
//! fingerprint of what a controller keeps is that of the file.

use crate::fixed::bytes::{Reader, Writer};

/// Bytes of a height.
pub const HEIGHT_LEN: usize = 8;
/// Bytes of a lane's number of points and first point.
pub const LANE_HEAD_LEN: usize = 7;
/// Bytes of each further point.
pub const LANE_POINT_LEN: usize = 4;

/// Lanes and heights.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// Which way traffic goes; may be none.
    pub lanes: LaneList<'a>,
    /// Heights of the road over its length; none where it is flat.
    pub heights: Points<'a>,
}

/// Polylines, one after the other.
#[derive(Debug, Clone, Copy)]
pub enum LaneList<'a> {
    /// Metres.
    Metres(&'a [&'a [[f32; 2]]]),
    /// As a controller keeps them.
    Bytes(&'a [u8]),
}

/// Points, one after the other.
#[derive(Debug, Clone, Copy)]
pub enum Points<'a> {
    /// Metres.
    Metres(&'a [[f32; 2]]),
    /// Heights as a controller keeps them.
    Heights(&'a [u8]),
    /// What is left of a lane as a controller keeps it, and the next point, centimetres.
    Lane(Option<[i32; 2]>, &'a [u8]),
}

/// Why points cannot be kept by a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PackError {
    /// More of them than there are bytes.
    TooMany,
    /// Of the lane of this number a point is not of whole centimetres.
    Fraction(usize),
    /// Of the lane of this number two points are more than 327 m apart, or one is more than 80 km from the origin.
    TooFar(usize),
}

impl Site<'static> {
    /// No lanes, and a flat road.
    pub const NOTHING: Self = Self { lanes: LaneList::Metres(&[]), heights: Points::Metres(&[]) };
}

impl Site<'_> {}

impl<'a> Iterator for LaneList<'a> {
    type Item = Points<'a>;

    fn next(&mut self) -> Option<Points<'a>> {
        match self {
            Self::Metres(lanes) => {
                let (first, rest) = lanes.split_first()?;
                *lanes = rest;
                Some(Points::Metres(first))
            }
            Self::Bytes(bytes) => {
                let mut head = Reader(bytes);
                let [count] = head.take()?;
                let further = usize::from(count).checked_sub(1)?;
                let first = [head.i24()?, head.i24()?];
                let (points, rest) = head.0.split_at_checked(LANE_POINT_LEN * further)?;
                *bytes = rest;
                Some(Points::Lane(Some(first), points))
            }
        }
    }
}

impl Iterator for Points<'_> {
    type Item = [f32; 2];

    fn next(&mut self) -> Option<[f32; 2]> {
        match self {
            Self::Metres(points) => {
                let (first, rest) = points.split_first()?;
                *points = rest;
                Some(*first)
            }
            Self::Heights(bytes) => {
                let mut r = Reader(bytes);
                let point = [r.f32()?, r.f32()?];
                *bytes = r.0;
                Some(point)
            }
            Self::Lane(next, bytes) => {
                let point = (*next)?;
                let mut r = Reader(bytes);
                let further = |r: &mut Reader<'_>| Some([i32::from(r.i16()?), i32::from(r.i16()?)]);
                *next = further(&mut r).map(|[dx, dy]| [point[0].saturating_add(dx), point[1].saturating_add(dy)]);
                *bytes = r.0;
                // exact integers divided: the nearest number, as a decimal fraction is read
                #[allow(clippy::cast_precision_loss)] // 24 bits
                Some(point.map(|cm| cm as f32 / 100.0))
            }
        }
    }
}

impl LaneList<'_> {
    /// Writes them as a controller keeps them; how many bytes.
    ///
    /// # Errors
    /// See [`PackError`].
    #[allow(clippy::cast_possible_truncation)] // checked before
    pub fn pack(self, bytes: &mut [u8]) -> Result<usize, PackError> {
        let most = bytes.len();
        let mut w = Writer(bytes);
        let mut length = 0;
        for (number, lane) in self.enumerate() {
            let count = u8::try_from(lane.count()).map_err(|_| PackError::TooMany)?;
            length += LANE_HEAD_LEN + LANE_POINT_LEN * usize::from(count).saturating_sub(1);
            if length > most {
                return Err(PackError::TooMany);
            }
            w.put([count]);
            let mut last: Option<[i32; 2]> = None;
            for metres in lane {
                let [x, y] = metres.map(centimetres);
                let at = [x.ok_or(PackError::Fraction(number))?, y.ok_or(PackError::Fraction(number))?];
                match last.replace(at) {
                    None => {
                        if at.iter().any(|cm| cm.abs() > 8_000_000) {
                            return Err(PackError::TooFar(number));
                        }
                        at.iter()
                            .for_each(|cm| w.put::<3>(cm.to_le_bytes().first_chunk().copied().unwrap_or_default()));
                    }
                    Some([fx, fy]) => {
                        for step in [at[0] - fx, at[1] - fy] {
                            let step = i16::try_from(step).map_err(|_| PackError::TooFar(number))?;
                            w.put(step.to_le_bytes());
                        }
                    }
                }
            }
        }
        Ok(length)
    }
}

impl Points<'_> {
    /// Writes heights as a controller keeps them; how many bytes.
    ///
    /// # Errors
    /// Too many.
    pub fn pack(self, bytes: &mut [u8]) -> Result<usize, PackError> {
        let length = HEIGHT_LEN * self.count();
        if length > bytes.len() {
            return Err(PackError::TooMany);
        }
        let mut w = Writer(bytes);
        self.flatten().for_each(|number| w.put(number.to_le_bytes()));
        Ok(length)
    }
}

/// Whole centimetres that come back as the same metres.
#[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)] // 84 km at most, which is asked for first
fn centimetres(metres: f32) -> Option<i32> {
    let near = metres.abs() < 84_000.0;
    let cm = crate::fixed::math::round_i32(if near { metres * 100.0 } else { 0.0 });
    (near && cm as f32 / 100.0 == metres).then_some(cm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    const LANES: [&[[f32; 2]]; 2] =
        [&[[-120.37, 3.4], [-20.01, 3.45], [-5.0, -12.3]], &[[1234.56, -1.75], [1230.0, 300.0]]];

    #[test]
    fn lanes_come_back_bit_for_bit_from_their_bytes() {
        let mut bytes = [0; 100];
        let length = LaneList::Metres(&LANES).pack(&mut bytes).unwrap();
        assert_eq!(length, 7 + 2 * 4 + 7 + 4);
        assert_eq!(bytes[..7], [3, 0xFB, 0xD0, 0xFF, 0x54, 0x01, 0x00], "-12037 and 340 centimetres");
        assert_eq!(bytes[7..11], [0x34, 0x27, 0x05, 0x00], "100.36 m on, 5 cm to the left");
        let back: Vec<Vec<[f32; 2]>> = LaneList::Bytes(&bytes[..length]).map(Iterator::collect).collect();
        assert_eq!(back, LANES);
    }

    #[test]
    fn heights_come_back_bit_for_bit_from_their_bytes() {
        let heights = [[-100.0, 498.123], [0.1, 500.0]];
        let mut bytes = [0; 16];
        assert_eq!(Points::Metres(&heights).pack(&mut bytes), Ok(16));
        assert_eq!(bytes[..4], (-100.0_f32).to_le_bytes());
        assert_eq!(Points::Heights(&bytes).collect::<Vec<_>>(), heights);
        assert_eq!(Points::Metres(&heights).pack(&mut [0; 15]), Err(PackError::TooMany));
    }

    #[test]
    fn what_would_not_come_back_is_not_written() {
        let pack = |lane: &[[f32; 2]]| LaneList::Metres(&[&[[0.0, 0.0], [1.0, 0.0]], lane]).pack(&mut [0; 30]);
        assert_eq!(pack(&[[0.0, 0.0], [0.125, 0.0]]), Err(PackError::Fraction(1)));
        assert_eq!(pack(&[[0.0, f32::NAN]]), Err(PackError::Fraction(1)));
        assert_eq!(pack(&[[0.0, 0.0], [327.68, 0.0]]), Err(PackError::TooFar(1)));
        assert_eq!(pack(&[[0.0, 0.0], [327.67, 0.0]]), Ok(22));
        assert_eq!(pack(&[[80_001.0, 0.0]]), Err(PackError::TooFar(1)));
        assert_eq!(pack(&[[0.0; 2]; 6]), Err(PackError::TooMany));
    }

    #[test]
    fn bytes_that_are_cut_off_end_with_the_last_whole_lane() {
        let mut bytes = [0; 100];
        let length = LaneList::Metres(&LANES).pack(&mut bytes).unwrap();
        for cut in 0..length {
            let whole = LaneList::Bytes(&bytes[..cut]).count();
            assert_eq!(whole, usize::from(cut >= 15), "{cut}");
        }
        assert_eq!(LaneList::Bytes(&[0, 1, 2, 3, 4, 5, 6]).count(), 0, "a lane of no points");
    }
}
