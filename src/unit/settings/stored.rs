//! The stored blocks a unit runs with, and whether it could run with one that came.
//!
//! Both are decided by the same function, which builds what the blocks are for: a block that is answered
//! "written" starts, and one that cannot start is refused with its parameter's name. Of the settings stored
//! only those that can start count. If there are none, the unit has no maps and answers its service: the
//! safe state.
//!
//! *Lanes and heights* are kept beside the settings and checked together with them. Maps depend on them, so what was
//! stored and does not hold any more leads to the safe state, too: without its heights a road would be taken for flat.
//! Where nothing was ever stored there are none.
//!
//! *A table of probabilities* belongs to one fingerprint. Where it is of another, or does not hold, the unit goes on with
//! grades and says so.

use super::block::{is_layout_1, length};
use super::kind::{BlockKind, Which};
use super::{BlockError, MOST_BLOCK_LEN, Newest, Settings, UnitConfig, kept, newer};
#[cfg(feature = "probability")]
use crate::probability::{ProbabilityTable, Quantiser, TableError, Threshold};
use crate::sensor::config::ConfigError;
use crate::sensor::site::{LaneList, Points, Site};
use crate::unit::can_bus::BusConfig;
use crate::wire::header::Header;

/// Where blocks are kept.
///
/// Two slots for settings, 0 and 1. Where there is room for them two more for each further kind of block: 2 and 3 for
/// heights of the road, 4 and 5 for lanes, 6 and 7 for a table of probabilities.
pub trait SettingsSlots {
    /// The bytes of a slot; none of one there is no room for.
    fn slot(&self, slot: usize) -> &[u8];
    /// Writes a slot. What is left of it after a shorter block does not matter.
    fn write(&mut self, slot: usize, block: &[u8]);
}

/// Whether a unit can be built with settings: with its grid, its senders and its controller's clock.
#[derive(Debug, Clone, Copy)]
pub struct SettingsCheck {
    build: fn(&Settings, &Site<'_>) -> Result<Header, ConfigError>,
    /// Clock of the CAN controllers this program sets the bit rate of.
    can_clock_hz: Option<u32>,
    /// Whether its sender has a use for a table of probabilities.
    takes_tables: bool,
}

impl SettingsCheck {
    /// By this function; [`SettingsCheck::of`] is the one for an estimator and a sender.
    pub const fn by(build: fn(&Settings, &Site<'_>) -> Result<Header, ConfigError>, takes_tables: bool) -> Self {
        Self { build, can_clock_hz: None, takes_tables }
    }

    /// And for CAN controllers of this clock, whose dividers have to meet the bit rates.
    pub const fn on_can(self, clock_hz: u32) -> Self {
        Self { can_clock_hz: Some(clock_hz), ..self }
    }

    /// Tries it. Takes as long and as much of the stack as a start.
    ///
    /// # Errors
    /// Names the parameter that stands against it.
    pub fn settings(&self, settings: &Settings) -> Result<(), ConfigError> {
        self.at(settings, &settings.place()).map(|_| ())
    }

    /// The same at another place than the settings' own; the header of its maps.
    fn at(&self, settings: &Settings, place: &Site<'_>) -> Result<Header, ConfigError> {
        if let Some(clock_hz) = self.can_clock_hz {
            settings.radar_bus.check_clock("radar_bus", clock_hz)?;
            settings.broadcast_bus.check_clock("broadcast_bus", clock_hz)?;
        }
        (self.build)(settings, place)
    }
}

/// Why a block is not used, and what it is of.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StoredError {
    /// What the block is of.
    pub kind: BlockKind,
    /// What is wrong with it.
    pub error: BlockError,
}

impl StoredError {
    /// Of settings.
    pub const fn of_settings(error: BlockError) -> Self {
        Self { kind: BlockKind::Settings, error }
    }
}

impl StoredError {
    /// Number of the reason on the wire: that of what is wrong, and the kind's number in the upper four bits.
    pub const fn code(&self) -> u8 {
        self.error.code() | self.kind.number() << 4
    }

    /// What goes with it there: a parameter's value, a layout, a bin of a table or its grid, each number big-endian.
    pub fn detail(&self) -> [u8; 4] {
        match self.error {
            BlockError::Parameter(error) => error.value.to_be_bytes(),
            BlockError::Layout(layout) => {
                let [high, low] = layout.to_be_bytes();
                [high, low, 0, 0]
            }
            #[cfg(feature = "probability")]
            BlockError::Grid([ranges, azimuths]) => [ranges, azimuths, 0, 0],
            #[cfg(feature = "probability")]
            BlockError::Table(TableError::NotMonotone { azimuth, range }) => {
                [azimuth, range, 0, 0].map(|bin| u8::try_from(bin).unwrap_or(u8::MAX))
            }
            #[cfg(feature = "probability")]
            BlockError::Table(TableError::Configuration { unit, .. }) => unit.to_be_bytes(),
            _ => [0; 4],
        }
    }
}

impl core::fmt::Display for StoredError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.kind {
            BlockKind::Settings => write!(f, "{}", self.error),
            BlockKind::Heights => write!(f, "heights of the road: {}", self.error),
            BlockKind::Lanes => write!(f, "lanes: {}", self.error),
            BlockKind::Probabilities => write!(f, "table of probabilities: {}", self.error),
        }
    }
}

impl core::error::Error for StoredError {}

/// The settings a unit runs with, or why there are none, and which slots its other blocks are in.
#[derive(Debug, Clone, Copy)]
pub struct StoredSettings {
    found: Result<Newest, StoredError>,
    /// What the settings say of the unit and its buses; also where lanes or heights stand against them, so that it is found
    /// where it was.
    unit: UnitConfig,
    buses: [BusConfig; 2],
    /// Where they say the far road lies.
    far_road_deg: Option<i8>,
    /// Slots of the blocks in use, by kind.
    in_use: [Option<usize>; BlockKind::ALL.len()],
    check: SettingsCheck,
}

impl StoredSettings {
    /// The newest blocks that the unit can run with.
    pub fn read(slots: &impl SettingsSlots, check: SettingsCheck) -> Self {
        let found = place(slots).and_then(|place| newest(slots, check, &place));
        let in_use = BlockKind::ALL.map(|kind| match kind {
            BlockKind::Settings => found.as_ref().ok().map(|newest| newest.slot),
            _ => stored(kind, slots).ok().flatten().map(|(slot, _)| slot),
        });
        let alone = || newest(slots, check, &Site::NOTHING);
        let of_unit = found.or_else(|_| alone()).ok().map(|newest| newest.settings);
        let buses = of_unit.map_or_else(Default::default, |s| [s.radar_bus, s.broadcast_bus]);
        let unit = of_unit.map_or_else(UnitConfig::default, |s| s.unit);
        let far_road_deg = of_unit.and_then(|s| s.visibility.far_road_deg);
        Self { found, unit, buses, far_road_deg, in_use, check }
    }

    /// What to work with; none in the safe state. Lanes and heights are not among them: [`place`](Self::place).
    pub fn settings(&self) -> Option<&Settings> {
        self.found.as_ref().ok().map(|newest| &newest.settings)
    }

    /// What is stored of the place.
    ///
    /// # Errors
    /// A block that does not hold.
    pub fn place(slots: &impl SettingsSlots) -> Result<Site<'_>, StoredError> {
        place(slots)
    }

    /// The slot and the sequence of the settings in use.
    ///
    /// # Errors
    /// Why there are none.
    #[allow(clippy::cast_possible_truncation)] // 0 or 1
    pub fn position(&self) -> Result<(u8, u32), StoredError> {
        self.found.map(|newest| (newest.slot as u8, newest.next_sequence.wrapping_sub(1)))
    }

    /// The slot of a block. The one that counts from the next start on is another one after a write; to find it takes as
    /// long as two starts.
    ///
    /// # Errors
    /// Why there is nothing to read.
    pub fn find(&self, Which { kind, newest }: Which, slots: &impl SettingsSlots) -> Result<usize, StoredError> {
        let slot = match (newest, kind) {
            (false, _) => self.in_use.get(usize::from(kind.number())).copied().flatten(),
            (true, BlockKind::Settings) => self.newest(slots).ok().map(|newest| newest.slot),
            (true, _) => stored(kind, slots).ok().flatten().map(|(slot, _)| slot),
        };
        // emptied since the start it holds none
        let slot = slot.filter(|slot| !Self::in_slot(slots, *slot).is_empty());
        slot.ok_or_else(|| self.absence_of(kind, slots))
    }

    /// The block in a slot, as long as it says itself; empty without one.
    pub fn in_slot(slots: &impl SettingsSlots, slot: usize) -> &[u8] {
        let bytes = slots.slot(slot);
        let length = match BlockKind::of_slot(slot) {
            None | Some(BlockKind::Settings) => length(bytes),
            Some(kind) => kept::length(kind, bytes),
        };
        // a slot is as long as the longest block
        bytes.get(..length).unwrap_or(&[])
    }

    /// Why there is nothing to read of a kind: what was refused at the start, or that nothing is stored or could be.
    fn absence_of(&self, kind: BlockKind, slots: &impl SettingsSlots) -> StoredError {
        let empty = if has_room(kind, slots, self.check) { BlockError::Empty } else { BlockError::NoRoom };
        let error = match kind {
            BlockKind::Settings => self.found.err().filter(|refused| refused.kind == kind).map(|refused| refused.error),
            _ => stored(kind, slots).err().map(|refused| refused.error),
        };
        StoredError { kind, error: error.unwrap_or(empty) }
    }

    /// Both buses as the settings describe them: the radar's, the broadcast's. By default without any.
    pub fn buses(self) -> [BusConfig; 2] {
        self.buses
    }

    /// The unit's own numbers and rates by the settings; by default without any.
    pub fn unit(&self) -> UnitConfig {
        self.unit
    }

    /// The newest settings that the unit could run with, at the place that is stored where that holds.
    fn newest(&self, slots: &impl SettingsSlots) -> Result<Newest, StoredError> {
        let place = place(slots).unwrap_or(Site::NOTHING);
        newest(slots, self.check, &place).or_else(|_| newest(slots, self.check, &Site::NOTHING))
    }

    /// Checks a block that came and writes it into the slot of its kind that is not in use; its sequence. It counts
    /// from the next start on.
    ///
    /// # Errors
    /// Why the unit could not start with it; nothing is written then.
    pub fn write(&self, block: &[u8], slots: &mut impl SettingsSlots) -> Result<u32, StoredError> {
        match BlockKind::of_block(block) {
            None | Some(BlockKind::Settings) => self.write_settings(block, slots),
            Some(kind) => self.write_kept(kind, block, slots).map_err(|error| StoredError { kind, error }),
        }
    }

    fn write_settings(&self, block: &[u8], slots: &mut impl SettingsSlots) -> Result<u32, StoredError> {
        let (_, mut settings) = Settings::from_block(block).map_err(StoredError::of_settings)?;
        if is_layout_1(block) {
            (settings.unit, settings.visibility.far_road_deg) = (self.unit, self.far_road_deg);
        }
        let place = place(slots)?;
        let refused = |error| StoredError::of_settings(BlockError::Parameter(error));
        self.check.at(&settings, &place).map_err(refused)?;
        let newest = newest(slots, self.check, &place);
        let (slot, sequence) = newest.map_or((0, 1), |n| (n.next_slot, n.next_sequence));
        slots.write(slot, &settings.to_block(sequence));
        // what was written counts, not what was meant
        let written = Settings::from_block(slots.slot(slot)).map(|(sequence, _)| sequence);
        written.map_err(StoredError::of_settings)
    }

    fn write_kept(&self, kind: BlockKind, block: &[u8], slots: &mut impl SettingsSlots) -> Result<u32, BlockError> {
        if !has_room(kind, slots, self.check) {
            return Err(BlockError::NoRoom);
        }
        let (_, body) = kept::open(kind, block)?;
        self.fits(kind, body, slots)?;
        let (slot, sequence) = match stored(kind, slots) {
            Ok(Some((slot, (sequence, _)))) => (slot ^ 1, sequence.wrapping_add(1)),
            // of two that do not hold neither is missed
            Ok(None) | Err(_) => (kind.slots()[0], 1),
        };
        let mut copy = [0; MOST_BLOCK_LEN];
        let copy = copy.get_mut(..kept::length(kind, block)).ok_or(BlockError::NoRoom)?;
        copy.copy_from_slice(block.get(..copy.len()).ok_or(BlockError::Short)?);
        kept::number(copy, sequence);
        slots.write(slot, copy);
        kept::open(kind, slots.slot(slot)).map(|(sequence, _)| sequence)
    }

    /// Whether the unit could start with this body in place of the stored one. Without settings there is nothing it
    /// could not fit: they are checked together with it when they come.
    fn fits(&self, kind: BlockKind, body: &[u8], slots: &impl SettingsSlots) -> Result<(), BlockError> {
        // what does not hold of the other kind stands against every settings, and is no matter of this block
        let stored = |other: BlockKind| stored(other, slots).ok().flatten().map(|(_, (_, body))| body);
        let of = |other: BlockKind| if other == kind { Some(body) } else { stored(other) };
        let place = place_from(of(BlockKind::Heights), of(BlockKind::Lanes));
        let Ok(Newest { settings, .. }) = self.newest(slots) else { return Ok(()) };
        #[cfg(feature = "probability")]
        if kind == BlockKind::Probabilities {
            let header = self.check.at(&settings.of_grades(), &place).map_err(BlockError::Parameter)?;
            return fitted(body, &header, header.fingerprint).map(|_| ());
        }
        self.check.at(&settings, &place).map(|_| ()).map_err(BlockError::Parameter)
    }

    /// What becomes of the maps of a unit with this header by the stored table; none where none is stored.
    ///
    /// # Errors
    /// Why the table is not used.
    #[cfg(feature = "probability")]
    pub fn quantiser(
        settings: &Settings,
        header: &Header,
        slots: &impl SettingsSlots,
    ) -> Result<Option<Quantiser>, StoredError> {
        let kind = BlockKind::Probabilities;
        let refused = |error| StoredError { kind, error };
        let Some((_, (_, body))) = stored(kind, slots)? else { return Ok(None) };
        let fingerprint = settings.of_grades().fingerprint_at(&place(slots)?);
        let (table, threshold) = fitted(body, header, fingerprint).map_err(refused)?;
        let visible_from = settings.visibility.least_grade().map_err(BlockError::Parameter).map_err(refused)?;
        Ok(Some(Quantiser::new(table, threshold, visible_from)))
    }

    /// Empties both slots of a kind: from the next start on the unit is as it was before its first block of it. A slot that
    /// is empty already is left alone: erasing takes a controller long, and a request may come again.
    pub fn clear(kind: BlockKind, slots: &mut impl SettingsSlots) {
        const ERASED: [u8; MOST_BLOCK_LEN] = [0xFF; MOST_BLOCK_LEN];
        for slot in kind.slots() {
            if slots.slot(slot).iter().all(|byte| *byte == 0xFF) {
                continue;
            }
            slots.write(slot, ERASED.get(..kind.most_len()).unwrap_or(&ERASED));
        }
    }
}

/// The table in a body, if it is of this grid and configuration.
#[cfg(feature = "probability")]
fn fitted(body: &[u8], header: &Header, fingerprint: u32) -> Result<(ProbabilityTable, Option<Threshold>), BlockError> {
    let (table, threshold, [ranges, azimuths]) =
        kept::table(body).map_err(BlockError::Table)?.ok_or(BlockError::Short)?;
    if (u16::from(ranges), azimuths) != (header.ranges, header.azimuths) {
        return Err(BlockError::Grid([ranges, azimuths]));
    }
    Ok((table.of_unit(fingerprint).map_err(BlockError::Table)?, threshold))
}

/// Whether blocks of a kind can be kept and are of use.
fn has_room(kind: BlockKind, slots: &impl SettingsSlots, check: SettingsCheck) -> bool {
    let is_of_use = kind != BlockKind::Probabilities || check.takes_tables;
    let longest = kind.most_len();
    is_of_use && longest > 0 && kind.slots().iter().all(|slot| slots.slot(*slot).len() >= longest)
}

/// A block's sequence and body.
type Body<'s> = (u32, &'s [u8]);

/// The newest stored block of a kind that is no settings, and its slot; none where nothing was ever stored.
fn stored(kind: BlockKind, slots: &impl SettingsSlots) -> Result<Option<(usize, Body<'_>)>, StoredError> {
    let [first, second] = kind.slots();
    if kind.most_len() == 0 || slots.slot(first).is_empty() {
        return Ok(None);
    }
    match newer([first, second].map(|slot| kept::open(kind, slots.slot(slot)))) {
        Ok((which, body)) => Ok(Some((first + which, body))),
        Err([BlockError::Empty, BlockError::Empty]) => Ok(None),
        Err(both) => Err(StoredError { kind, error: worst(both) }),
    }
}

fn place(slots: &impl SettingsSlots) -> Result<Site<'_>, StoredError> {
    let body = |kind| stored(kind, slots).map(|found| found.map(|(_, (_, body))| body));
    Ok(place_from(body(BlockKind::Heights)?, body(BlockKind::Lanes)?))
}

fn place_from<'s>(heights: Option<&'s [u8]>, lanes: Option<&'s [u8]>) -> Site<'s> {
    Site {
        lanes: lanes.and_then(kept::lanes).unwrap_or(LaneList::Bytes(&[])),
        heights: heights.and_then(kept::heights).unwrap_or(Points::Heights(&[])),
    }
}

fn newest(slots: &impl SettingsSlots, check: SettingsCheck, place: &Site<'_>) -> Result<Newest, StoredError> {
    let accept = |settings: &Settings| check.at(settings, place).map(|_| ());
    let [first, second] = BlockKind::Settings.slots();
    Settings::newest([slots.slot(first), slots.slot(second)], accept).map_err(worst).map_err(StoredError::of_settings)
}

/// Of two refusals the one that says more: an empty slot says least.
fn worst([first, second]: [BlockError; 2]) -> BlockError {
    if first == BlockError::Empty { second } else { first }
}
