//! What a unit keeps of its place beside its settings: heights of the road, lanes of traffic, a table of probabilities.

use anyhow::{Result, bail, ensure};
use viewshed::sensor::site::{LaneList, PackError, Points};
use viewshed::unit::reply::Said;
use viewshed::unit::settings::{
    BlockError, BlockKind, MOST_BLOCK_LEN, Which, announced_length, heights_block, kept_points, lanes_block,
};

use super::link::Ask;
use super::{ANSWER, Found};

/// Kinds of blocks beside settings.
pub const KINDS: [BlockKind; 3] = [BlockKind::Heights, BlockKind::Lanes, BlockKind::Probabilities];

/// What a kind is called in a file.
pub const fn key(kind: BlockKind) -> &'static str {
    match kind {
        BlockKind::Settings => "settings",
        BlockKind::Heights => "[ground]",
        BlockKind::Lanes => "[[lanes]]",
        BlockKind::Probabilities => "[probability]",
    }
}

/// Blocks of a file or a unit, by [`KINDS`].
pub type Blocks = [Option<Vec<u8>>; 3];

/// What a unit has of a kind.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kept {
    /// Its firmware, or its memory, has no room for such blocks.
    NoRoom,
    /// Something that does not hold any more.
    Damaged,
    /// Nothing, or this block.
    Block(Option<Vec<u8>>),
}

/// Heights as a block.
///
/// # Errors
/// Too many.
pub fn of_heights(points: &[[f32; 2]]) -> Result<Vec<u8>> {
    packed("ground", |block| heights_block(Points::Metres(points), block))
}

/// Lanes as a block.
///
/// # Errors
/// Too many; a lane that a unit cannot keep as it is.
pub fn of_lanes(lanes: &[&[[f32; 2]]]) -> Result<Vec<u8>> {
    packed("lanes", |block| lanes_block(LaneList::Metres(lanes), block))
}

fn packed(key: &str, pack: impl FnOnce(&mut [u8]) -> Result<usize, PackError>) -> Result<Vec<u8>> {
    let mut block = vec![0; MOST_BLOCK_LEN];
    match pack(&mut block) {
        Ok(length) => {
            block.truncate(length);
            Ok(block)
        }
        Err(PackError::TooMany) => bail!("{key}: more points than a unit has room for"),
        Err(PackError::Fraction(lane)) => bail!(
            "{key}: lane {lane} has a point that is not of whole centimetres, which a unit keeps; round it, so that unit and PC have the same"
        ),
        Err(PackError::TooFar(lane)) => {
            bail!("{key}: lane {lane} has two points more than 327 m apart; put one between them")
        }
    }
}

/// Whether two blocks say the same, whatever their sequences.
pub fn same(a: &[u8], b: &[u8]) -> bool {
    let said = |block: &[u8]| block.get(12..block.len().saturating_sub(4)).map(<[u8]>::to_vec);
    a.len() == b.len() && said(a) == said(b)
}

/// What a block says, as a part of a file; of a table its check sum alone, as a comment.
///
/// # Errors
/// A block that does not hold.
pub fn text(kind: BlockKind, block: &[u8]) -> Result<String> {
    let (heights, lanes) = kept_points(kind, block)?;
    let list = |points: Points<'_>| -> String {
        points.map(|[x, y]| format!("[{x:?}, {y:?}]")).collect::<Vec<_>>().join(", ")
    };
    let mut text = String::new();
    if let Some(heights) = heights {
        text += &format!("\n[ground]\npoints = [{}]\n", list(heights));
    }
    for lane in lanes.into_iter().flatten() {
        text += &format!("\n[[lanes]]\npoints = [{}]\n", list(lane));
    }
    if kind == BlockKind::Probabilities {
        let sum = block.len().checked_sub(4).and_then(|at| block.get(at..)).unwrap_or_default();
        text += &format!("\n# a table of probabilities, in a block of check sum {:02x?}\n", sum);
    }
    Ok(text)
}

impl Found<'_> {
    /// What it has of a kind, in use or from its next start on.
    ///
    /// # Errors
    /// It does not answer.
    pub fn kept(&mut self, which: Which) -> Result<Kept> {
        let mut bytes: Vec<u8> = Vec::new();
        loop {
            let at = u16::try_from(bytes.len())?;
            // six times as long as settings
            let heard = self.ask(Ask::ReadPart(which, at), 6 * ANSWER, |said| match said {
                Said::Block(_) | Said::Refused(_) => Some(said),
                Said::Part(of, place, _) if of == which && place == at => Some(said),
                _ => None,
            })?;
            match heard {
                // firmware that knows settings alone answers with these
                Some(Said::Block(block)) if BlockKind::of_block(block.bytes()) != Some(which.kind) => {
                    return Ok(Kept::NoRoom);
                }
                Some(Said::Block(block)) => return Ok(Kept::Block(Some(block.bytes().to_vec()))),
                Some(Said::Part(_, _, part)) => bytes.extend_from_slice(part.bytes()),
                Some(Said::Refused(refusal)) => {
                    let (_, reason) = refusal.of_kind();
                    return Ok(match reason {
                        reason if reason == BlockError::Empty.code() => Kept::Block(None),
                        reason if reason == BlockError::NoRoom.code() => Kept::NoRoom,
                        _ => Kept::Damaged,
                    });
                }
                _ => bail!("{}: the unit does not answer any more; nothing was changed", self.place()),
            }
            if announced_length(&bytes).is_some_and(|length| bytes.len() >= length) {
                return Ok(Kept::Block(Some(bytes)));
            }
            ensure!(bytes.len() > usize::from(at), "{}: the unit's block ends before it is whole", self.place());
        }
    }

    /// What a file's blocks change: kinds that are to be emptied and written, in this order around the settings, as a unit
    /// checks what is new together with what it keeps.
    ///
    /// # Errors
    /// It does not answer; it has no room for what the file has.
    pub fn plan(&mut self, blocks: &Blocks) -> Result<Vec<(BlockKind, bool)>> {
        let mut plan = Vec::new();
        for (kind, wanted) in KINDS.into_iter().zip(blocks) {
            match (self.kept(Which::newest(kind))?, wanted) {
                (Kept::NoRoom, Some(_)) => bail!(
                    "{}: the unit has no room for {} in its firmware; nothing was written",
                    self.place(),
                    key(kind)
                ),
                (Kept::NoRoom | Kept::Block(None), None) => {}
                (Kept::Block(Some(has)), Some(wanted)) if same(&has, wanted) => {}
                (Kept::Block(None), Some(_)) => plan.push((kind, false)),
                (Kept::Block(Some(_)) | Kept::Damaged, _) => plan.push((kind, true)),
            }
        }
        Ok(plan)
    }

    /// Writes a block and reads it back; its sequence.
    ///
    /// # Errors
    /// It refuses it, falls silent, or says something else afterwards.
    pub fn write_kept(&mut self, kind: BlockKind, block: &[u8]) -> Result<u32> {
        let sequence = self.send(block)?;
        let kept = self.kept(Which::newest(kind))?;
        let is_same = matches!(&kept, Kept::Block(Some(has)) if same(has, block));
        ensure!(is_same, "{}: {} does not read back as it was written", self.place(), key(kind));
        Ok(sequence)
    }
}
