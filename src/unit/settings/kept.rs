//! Blocks of what is known of a place: heights of the road, lanes of traffic, a table of probabilities.
//!
//! # Model
//! All numbers are little-endian.
//!
//! | bytes | |
//! |---|---|
//! | 4 | `VSHB` heights, `VSLB` lanes, `VSPB` probabilities |
//! | 2 | layout, 1 |
//! | 2 | length of the whole block |
//! | 4 | sequence, as of settings |
//! | n | the body |
//! | 0 to 3 | zeros, up to a multiple of 4 |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it |
//!
//! | body | |
//! |---|---|
//! | heights | number of points (2 bytes), 0 (2 bytes), points as [`place`](crate::sensor::site) has them |
//! | lanes | number of lanes (2 bytes), bytes of their points (2 bytes), points as there |
//! | probabilities | ranges and azimuths of the grid it was fitted on (1 byte each); what is visible: 0 what has the map's least grade, 1 what has at least the next byte's probability, 2 nothing (1 byte); that probability in 1/255 (1 byte); the table as [`crate::probability`] has it |

use super::BlockError;
#[cfg(feature = "probability")]
use super::kind::TABLE_LEN;
use super::kind::{BlockKind, COUNT_LEN, HEADER_LEN, SUM_LEN};
use crate::fixed::bytes::{Reader, Writer, fingerprint};
#[cfg(feature = "probability")]
use crate::probability::{self, ProbabilityTable, Threshold};
use crate::sensor::site::{HEIGHT_LEN, LaneList, PackError, Points};

const LAYOUT: u16 = 1;

/// Which of a table's probabilities are visible.
#[cfg(feature = "probability")]
mod visible {
    pub const BY_GRADE: u8 = 0;
    pub const FROM: u8 = 1;
    pub const NOTHING: u8 = 2;
}

/// Writes heights; how many bytes.
///
/// # Errors
/// More than the buffer holds.
pub fn heights_block(points: Points<'_>, block: &mut [u8]) -> Result<usize, PackError> {
    let count = u16::try_from(points.count()).map_err(|_| PackError::TooMany)?;
    let body = body_mut(block, COUNT_LEN).ok_or(PackError::TooMany)?;
    let length = points.pack(body)?;
    seal(BlockKind::Heights, [count.to_le_bytes(), [0; 2]], COUNT_LEN + length, block).ok_or(PackError::TooMany)
}

/// Writes lanes; how many bytes.
///
/// # Errors
/// More than the buffer holds; a lane that does not come back as it is.
pub fn lanes_block(lanes: LaneList<'_>, block: &mut [u8]) -> Result<usize, PackError> {
    let count = u16::try_from(lanes.count()).map_err(|_| PackError::TooMany)?;
    let body = body_mut(block, COUNT_LEN).ok_or(PackError::TooMany)?;
    let length = lanes.pack(body)?;
    let bytes = u16::try_from(length).map_err(|_| PackError::TooMany)?;
    let counts = [count.to_le_bytes(), bytes.to_le_bytes()];
    seal(BlockKind::Lanes, counts, COUNT_LEN + length, block).ok_or(PackError::TooMany)
}

/// Writes a table that was fitted on a grid of so many ranges and azimuths, and what of it is visible; without a
/// threshold what has the map's least visible grade.
#[cfg(feature = "probability")]
pub fn table_block(grid: [u8; 2], table: &ProbabilityTable, threshold: Option<Threshold>) -> [u8; TABLE_LEN] {
    let mut block = [0; TABLE_LEN];
    let rule = match threshold {
        None => [visible::BY_GRADE, 0],
        Some(Threshold::Everything) => [visible::FROM, 0],
        Some(Threshold::From(least)) => [visible::FROM, least],
        Some(Threshold::Nothing) => [visible::NOTHING, 0],
    };
    if let Some(body) = body_mut(&mut block, COUNT_LEN) {
        Writer(body).put(table.to_block());
    }
    let _ = seal(BlockKind::Probabilities, [grid, rule], COUNT_LEN + probability::BLOCK_LEN, &mut block);
    block
}

fn body_mut(block: &mut [u8], from: usize) -> Option<&mut [u8]> {
    let end = block.len().checked_sub(SUM_LEN)?;
    block.get_mut(HEADER_LEN + from..end)
}

/// Writes what goes around a body of this length, which begins with `counts`, and fills what is left up to the check
/// sum; bytes of the block.
fn seal(kind: BlockKind, counts: [[u8; 2]; 2], body: usize, block: &mut [u8]) -> Option<usize> {
    let length = (HEADER_LEN + body + SUM_LEN).next_multiple_of(4);
    let block = block.get_mut(..length)?;
    block.get_mut(HEADER_LEN + body..)?.fill(0);
    let mut w = Writer(block);
    w.put(kind.magic());
    w.put(LAYOUT.to_le_bytes());
    w.put(u16::try_from(length).ok()?.to_le_bytes());
    w.put(0_u32.to_le_bytes());
    counts.into_iter().for_each(|count| w.put(count));
    add_sum(block);
    Some(length)
}

/// Gives a block another sequence.
pub(super) fn number(block: &mut [u8], sequence: u32) {
    if let Some(place) = block.get_mut(8..) {
        Writer(place).put(sequence.to_le_bytes());
    }
    add_sum(block);
}

fn add_sum(block: &mut [u8]) {
    if let Some((body, sum)) = block.split_last_chunk_mut::<SUM_LEN>() {
        *sum = fingerprint(body).to_le_bytes();
    }
}

/// Bytes of the block that a slot begins with, as it says itself; 0 without one.
pub(super) fn length(kind: BlockKind, slot: &[u8]) -> usize {
    let mut r = Reader(slot);
    let of_kind = r.take().filter(|magic| *magic == kind.magic());
    let length = of_kind.and_then(|_| r.u16()).filter(|layout| *layout == LAYOUT).and_then(|_| r.u16());
    length.map_or(0, usize::from)
}

/// Reads a block's sequence and body; bytes after it do not matter. The body has the form of its kind; whether a unit
/// can run with it is `SettingsCheck`'s to say.
///
/// # Errors
/// The first thing that does not hold. Empty is erased memory only: what else is there was a block once.
pub(super) fn open(kind: BlockKind, bytes: &[u8]) -> Result<(u32, &[u8]), BlockError> {
    let mut header = Reader(bytes);
    match header.take::<4>() {
        Some(magic) if magic == kind.magic() => {}
        Some([0xFF, 0xFF, 0xFF, 0xFF]) => return Err(BlockError::Empty),
        Some(_) => return Err(BlockError::CheckSum),
        None => return Err(BlockError::Short),
    }
    let layout = header.u16().ok_or(BlockError::Short)?;
    if layout != LAYOUT {
        return Err(BlockError::Layout(layout));
    }
    let length = header.u16().ok_or(BlockError::Short)?;
    let block = bytes.get(..usize::from(length)).ok_or(BlockError::Short)?;
    let (before, sum) = block.split_last_chunk::<SUM_LEN>().ok_or(BlockError::Short)?;
    let body = before.get(HEADER_LEN..).ok_or(BlockError::Short)?;
    if fingerprint(before) != u32::from_le_bytes(*sum) {
        return Err(BlockError::CheckSum);
    }
    let sequence = header.u32().ok_or(BlockError::Short)?;
    let whole = match kind {
        BlockKind::Settings => false,
        BlockKind::Heights => heights(body).is_some(),
        BlockKind::Lanes => lanes(body).is_some(),
        #[cfg(feature = "probability")]
        BlockKind::Probabilities => table(body).map_err(BlockError::Table)?.is_some(),
        #[cfg(not(feature = "probability"))]
        BlockKind::Probabilities => false,
    };
    if whole { Ok((sequence, body)) } else { Err(BlockError::Short) }
}

/// What a block says of heights and of lanes; none of either where it is of another kind.
///
/// # Errors
/// The first thing that does not hold.
pub fn kept_points(kind: BlockKind, block: &[u8]) -> Result<(Option<Points<'_>>, Option<LaneList<'_>>), BlockError> {
    let (_, body) = open(kind, block)?;
    Ok((heights(body).filter(|_| kind == BlockKind::Heights), lanes(body).filter(|_| kind == BlockKind::Lanes)))
}

/// The heights in a body.
pub(super) fn heights(body: &[u8]) -> Option<Points<'_>> {
    let mut r = Reader(body);
    let (count, _) = (r.u16()?, r.u16()?);
    r.0.get(..HEIGHT_LEN * usize::from(count)).map(Points::Heights)
}

/// The lanes in a body, all of which are whole.
pub(super) fn lanes(body: &[u8]) -> Option<LaneList<'_>> {
    let mut r = Reader(body);
    let (count, bytes) = (r.u16()?, r.u16()?);
    let all = LaneList::Bytes(r.0.get(..usize::from(bytes))?);
    (all.count() == usize::from(count)).then_some(all)
}

/// A table, what of it is visible, and the grid it was fitted on.
#[cfg(feature = "probability")]
pub(super) type Fitted = (ProbabilityTable, Option<Threshold>, [u8; 2]);

/// The table in a body.
#[cfg(feature = "probability")]
pub(super) fn table(body: &[u8]) -> Result<Option<Fitted>, probability::TableError> {
    let Some((&[ranges, azimuths, rule, least], bytes)) = body.split_first_chunk() else { return Ok(None) };
    let threshold = match rule {
        visible::BY_GRADE => None,
        visible::FROM => Some(Threshold::From(least)),
        visible::NOTHING => Some(Threshold::Nothing),
        _ => return Ok(None),
    };
    Ok(Some((ProbabilityTable::from_block(bytes)?, threshold, [ranges, azimuths])))
}
