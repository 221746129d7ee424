//! What the host asks for: a configuration and the scans of a recording.
//!
//! # Model
//!
//! | bytes | |
//! |---|---|
//! | 4 | `VSJB` |
//! | 2 | layout, 1 |
//! | 2 | 0 |
//! | 4 | frame whose map is wanted cell by cell, 2^32 - 1 for none |
//! | 148 | configuration block ([`settings`](crate::unit::settings)) |
//!
//! then, until the stream ends, a scan after the other:
//!
//! | bytes | |
//! |---|---|
//! | 8 | time, microseconds |
//! | 2 | detections that follow |
//! | 2 | bit 0: the radar reports a fault; bit 1: forget everything first |
//! | 12 each | range (cm), azimuth, elevation (2^-16 turn), radial velocity (cm/s), RCS, SNR (half dB); -32768 = not measured |
//!
//! or, for a camera, boxes as in the [native format](crate::inputs::native), and two zeros.

use heapless::Vec;

use super::Bench;
use crate::camera::boxes::ImageBox;
use crate::fixed::angle::Angle;
use crate::fixed::bytes::{Reader, Writer};
use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::inputs::native::{Content, NativeEntry};
use crate::unit::settings::{BLOCK_LEN, BlockError, Settings};

/// Bytes before the scans.
pub const HEADER_LEN: usize = 12 + BLOCK_LEN;
/// Bytes of a scan before its detections.
pub const SCAN_LEN: usize = 12;
/// Bytes of a detection.
pub const DETECTION_LEN: usize = 12;

const MAGIC: [u8; 4] = *b"VSJB";
const LAYOUT: u16 = 1;
const NO_FRAME: u32 = u32::MAX;
const FAULT: u16 = 1;
const RESET: u16 = 2;
/// In place of what was not measured.
const ABSENT: i16 = i16::MIN;

/// Why a job cannot be run.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum JobError {
    /// No job, or one of another layout.
    NotAJob,
    /// Its configuration is refused.
    Block(BlockError),
    /// The stream ends within a scan.
    Cut,
    /// A scan has more detections than the buffer holds.
    TooMany(u16),
}

impl JobError {
    /// Number of the reason in the closing record, from 1.
    pub const fn code(&self) -> u8 {
        match self {
            Self::NotAJob => 1,
            Self::Block(reason) => 10 + reason.code(),
            Self::Cut => 2,
            Self::TooMany(_) => 3,
        }
    }
}

/// The head of a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Job {
    /// What to run with.
    pub settings: Settings,
    /// Frame whose map is wanted cell by cell.
    pub dump: Option<u32>,
}

impl Job {
    /// Writes the head.
    pub fn to_bytes(&self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        let mut w = Writer(&mut bytes);
        w.put(MAGIC);
        w.put(LAYOUT.to_le_bytes());
        w.put([0; 2]);
        w.put(self.dump.unwrap_or(NO_FRAME).to_le_bytes());
        w.put(self.settings.to_block(0));
        bytes
    }

    /// Reads the head.
    ///
    /// # Errors
    /// Anything but a job with a configuration that can be worked with.
    pub fn read(bench: &mut impl Bench) -> Result<Self, JobError> {
        let mut bytes = [0; HEADER_LEN];
        if !fill(bench, &mut bytes) {
            return Err(JobError::NotAJob);
        }
        let mut r = Reader(&bytes);
        if r.take() != Some(MAGIC) || r.u16() != Some(LAYOUT) || r.u16() != Some(0) {
            return Err(JobError::NotAJob);
        }
        let dump = r.u32().filter(|frame| *frame != NO_FRAME);
        let (_, settings) = Settings::from_block(r.0).map_err(JobError::Block)?;
        Ok(Self { settings, dump })
    }
}

/// The head of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScanHead {
    /// When it was measured.
    pub time: Time,
    /// Detections that follow.
    pub detections: u16,
    /// The radar reports a fault.
    pub fault: bool,
    /// Forget everything first: the scan does not follow the one before.
    pub reset: bool,
}

impl ScanHead {
    /// Writes the head.
    pub fn to_bytes(&self) -> [u8; SCAN_LEN] {
        let mut bytes = [0; SCAN_LEN];
        let mut w = Writer(&mut bytes);
        w.put(self.time.micros().to_le_bytes());
        w.put(self.detections.to_le_bytes());
        let flags = if self.fault { FAULT } else { 0 } | if self.reset { RESET } else { 0 };
        w.put(flags.to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut r = Reader(bytes);
        let (time, detections, flags) = (Time::from_micros(r.u64()?), r.u16()?, r.u16()?);
        Some(Self { time, detections, fault: flags & FAULT != 0, reset: flags & RESET != 0 })
    }
}

/// What scans hold.
pub trait JobEntry: Sized {
    /// Writes it.
    fn to_bytes(&self) -> [u8; DETECTION_LEN];
    /// Reads it; `None` for anything else.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

impl JobEntry for Detection {
    fn to_bytes(&self) -> [u8; DETECTION_LEN] {
        let mut bytes = [0; DETECTION_LEN];
        let mut w = Writer(&mut bytes);
        w.put(self.range_cm.to_le_bytes());
        for v in [
            self.azimuth.raw(),
            self.elevation.map_or(ABSENT, Angle::raw),
            self.radial_velocity_cm_s,
            self.rcs_half_dbsm.unwrap_or(ABSENT),
            self.snr_half_db.unwrap_or(ABSENT),
        ] {
            w.put(v.to_le_bytes());
        }
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut r = Reader(bytes);
        let range_cm = r.u16()?;
        let mut next = || r.i16();
        let measured = |v: i16| (v != ABSENT).then_some(v);
        Some(Self {
            range_cm,
            azimuth: Angle::from_raw(next()?),
            elevation: measured(next()?).map(Angle::from_raw),
            radial_velocity_cm_s: next()?,
            rcs_half_dbsm: measured(next()?),
            snr_half_db: measured(next()?),
            marked: false,
        })
    }
}

impl JobEntry for ImageBox {
    fn to_bytes(&self) -> [u8; DETECTION_LEN] {
        let mut bytes = [0; DETECTION_LEN];
        let mut w = Writer(&mut bytes);
        w.put(NativeEntry::write(self));
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        match NativeEntry::read(bytes.first_chunk()?) {
            Content::Entry(entry) => Some(entry),
            Content::None | Content::Refused => None,
        }
    }
}

/// Detections or boxes of the scan at hand, up to `N`.
#[derive(Debug, Clone)]
pub struct ScanBuffer<const N: usize, T = Detection>(Vec<T, N>);

impl<const N: usize, T> Default for ScanBuffer<N, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize, T> ScanBuffer<N, T> {
    /// No detections.
    pub const fn new() -> Self {
        Self(Vec::new())
    }
}

impl<const N: usize, T: JobEntry> ScanBuffer<N, T> {
    /// Reads the next scan; `None` at the end of the stream.
    ///
    /// # Errors
    /// A stream that ends within the scan, more detections than there is room for.
    pub fn read(&mut self, bench: &mut impl Bench) -> Result<Option<ScanHead>, JobError> {
        let mut head = [0; SCAN_LEN];
        if !fill(bench, &mut head) {
            return Ok(None);
        }
        let head = ScanHead::from_bytes(&head).ok_or(JobError::Cut)?;
        self.0.clear();
        let mut left = usize::from(head.detections);
        if left > N {
            return Err(JobError::TooMany(head.detections));
        }
        let mut chunk = [0; 32 * DETECTION_LEN];
        while left > 0 {
            let some = left.min(32);
            let bytes = chunk.get_mut(..some * DETECTION_LEN).ok_or(JobError::Cut)?;
            if !fill(bench, bytes) {
                return Err(JobError::Cut);
            }
            for d in bytes.chunks(DETECTION_LEN) {
                let _ = self.0.push(T::from_bytes(d).ok_or(JobError::Cut)?);
            }
            left -= some;
        }
        Ok(Some(head))
    }

    /// The scan's detections.
    pub fn detections(&self) -> &[T] {
        &self.0
    }
}

/// Reads until the buffer is full; `false` if the stream ends before.
fn fill(bench: &mut impl Bench, buffer: &mut [u8]) -> bool {
    let mut filled = 0;
    while let Some(rest) = buffer.get_mut(filled..).filter(|rest| !rest.is_empty()) {
        match bench.read(rest) {
            0 => return false,
            n => filled += n,
        }
    }
    true
}
