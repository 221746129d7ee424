//! What the controller answers.
//!
//! # Model
//!
//! | bytes | opening | frame | map | closing |
//! |---|---|---|---|---|
//! | 1 | `B` | `F` | `M` | `E` |
//! | 3 | 0 | condition; used detections (2) | 0 | reason of the end (0: stream done); 0 |
//! | 4 | ranges, azimuths (2 each) | frame | frame | frames |
//! | 4 | elevations, detections (2 each) | fingerprint, low | ranges, azimuths (2 each) | most stack used |
//! | 4 | ticks to 256 instructions, 0 = not counted | fingerprint, high | 0 | stack |
//! | 4 x 8 | state, parameters, map, 5 zeros | ticks of each stage | zeros | zeros |
//!
//! A map record is followed by its grades, then its occupancies, azimuth by azimuth, of a camera row by row.

use super::stage::Stage;
use crate::estimator::Estimator;
use crate::fixed::bytes::{Reader, Writer};
use crate::frame::health::Condition;
use crate::unit::Event;

/// Bytes of a record.
pub const RECORD_LEN: usize = 16 + 4 * Stage::COUNT;

/// One record of the answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Record {
    /// Who answers.
    Opening(Opening),
    /// A frame is done.
    Frame(FrameRecord),
    /// A map follows.
    Map {
        /// Frame it belongs to.
        frame: u32,
        /// Range cells, azimuths.
        cells: [u16; 2],
    },
    /// Nothing follows.
    Closing(Closing),
}

/// Who answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Opening {
    /// Range cells, azimuths, elevations, detections.
    pub shape: [u16; 4],
    /// Counter ticks to 256 instructions; 0 where instructions cannot be counted.
    pub ticks_per_256: u32,
    /// Bytes of state, parameters and map.
    pub bytes: [u32; 3],
}

impl Opening {
    /// Of an estimator of this size.
    #[allow(clippy::cast_possible_truncation)] // sizes of types that fit a controller
    pub const fn of<E: Estimator>(shape: [usize; 4], ticks_per_256: u32) -> Self {
        let [ranges, azimuths, elevations, detections] = shape;
        Self {
            shape: [ranges as u16, azimuths as u16, elevations as u16, detections as u16],
            ticks_per_256,
            bytes: [size_of::<E>() as u32, size_of::<E::Parameters>() as u32, size_of::<E::Map>() as u32],
        }
    }
}

/// What a frame gave and what it cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRecord {
    /// Its number, from 0.
    pub frame: u32,
    /// What the sensor's frames say of it.
    pub condition: Condition,
    /// Detections used.
    pub used: u16,
    /// The map's fingerprint.
    pub fingerprint: u64,
    /// Counter ticks of each stage.
    pub ticks: [u32; Stage::COUNT],
}

/// Counts what the stages of frames cost.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tracer {
    frame: u32,
    last: u32,
    stage: usize,
    ticks: [u32; Stage::COUNT],
}

impl Tracer {
    /// Takes what a unit does and the counter at that moment; the record of a frame that is done.
    #[inline]
    pub fn event(&mut self, event: Event, counter: u32) -> Option<FrameRecord> {
        match event {
            Event::Began => (self.stage, self.ticks) = (0, [0; Stage::COUNT]),
            Event::Ended => {
                if let Some(ticks) = self.ticks.get_mut(self.stage) {
                    *ticks = counter.wrapping_sub(self.last);
                }
                self.stage += 1;
            }
            Event::Done(done) => {
                let (frame, ticks) = (self.frame, self.ticks);
                self.frame = frame.wrapping_add(1);
                return Some(FrameRecord { frame, condition: done.condition, used: done.used, fingerprint: 0, ticks });
            }
        }
        self.last = counter;
        None
    }
}

/// How it ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Closing {
    /// 0, or why the stream was not read to its end.
    pub reason: u8,
    /// Frames processed.
    pub frames: u32,
    /// Most bytes of stack used, and how many there are.
    pub stack: [u32; 2],
}

impl Record {
    /// Writes the record.
    pub fn to_bytes(&self) -> [u8; RECORD_LEN] {
        let mut bytes = [0; RECORD_LEN];
        let mut w = Writer(&mut bytes);
        let words = |w: &mut Writer, words: &[u32]| words.iter().for_each(|v| w.put(v.to_le_bytes()));
        match self {
            Self::Opening(o) => {
                w.put(*b"B\0\0\0");
                o.shape.iter().for_each(|v| w.put(v.to_le_bytes()));
                w.put(o.ticks_per_256.to_le_bytes());
                words(&mut w, &o.bytes);
            }
            Self::Frame(f) => {
                w.put([b'F', f.condition as u8]);
                w.put(f.used.to_le_bytes());
                w.put(f.frame.to_le_bytes());
                w.put(f.fingerprint.to_le_bytes());
                words(&mut w, &f.ticks);
            }
            Self::Map { frame, cells } => {
                w.put(*b"M\0\0\0");
                w.put(frame.to_le_bytes());
                cells.iter().for_each(|v| w.put(v.to_le_bytes()));
            }
            Self::Closing(c) => {
                w.put([b'E', c.reason, 0, 0]);
                w.put(c.frames.to_le_bytes());
                words(&mut w, &c.stack);
            }
        }
        bytes
    }

    /// Reads a record; `None` for anything else.
    pub fn from_bytes(bytes: &[u8; RECORD_LEN]) -> Option<Self> {
        let mut r = Reader(bytes);
        let [tag, detail] = r.take()?;
        let used = r.u16()?;
        Some(match tag {
            b'B' => Self::Opening(Opening {
                shape: [r.u16()?, r.u16()?, r.u16()?, r.u16()?],
                ticks_per_256: r.u32()?,
                bytes: [r.u32()?, r.u32()?, r.u32()?],
            }),
            b'F' => {
                use Condition::{Blind, Healthy, Misaligned, SectorBlind, Settling, Stale, Starting, Unusable, Weaker};
                let all = [Starting, Healthy, Settling, Blind, Stale, Unusable, SectorBlind, Misaligned, Weaker];
                let condition = all.into_iter().find(|c| *c as u8 == detail)?;
                let (frame, fingerprint) = (r.u32()?, r.u64()?);
                let mut ticks = [0; Stage::COUNT];
                for t in &mut ticks {
                    *t = r.u32()?;
                }
                Self::Frame(FrameRecord { frame, condition, used, fingerprint, ticks })
            }
            b'M' => Self::Map { frame: r.u32()?, cells: [r.u16()?, r.u16()?] },
            b'E' => Self::Closing(Closing { reason: detail, frames: r.u32()?, stack: [r.u32()?, r.u32()?] }),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_read_back() {
        let frame = FrameRecord {
            frame: 70_000,
            condition: Condition::Unusable,
            used: 256,
            fingerprint: 0x0123_4567_89AB_CDEF,
            ticks: [1, 2, 3, 4, 5, 6, 7, u32::MAX],
        };
        for record in [
            Record::Opening(Opening { shape: [200, 120, 16, 256], ticks_per_256: 410, bytes: [1, 2, 3] }),
            Record::Frame(frame),
            Record::Map { frame: 3, cells: [200, 120] },
            Record::Closing(Closing { reason: 14, frames: 900, stack: [7000, 50_000] }),
        ] {
            assert_eq!(Record::from_bytes(&record.to_bytes()), Some(record));
        }
        assert_eq!(Record::from_bytes(&[0; RECORD_LEN]), None);
    }
}
