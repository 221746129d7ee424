//! The unit's end: takes a block, keeps it, answers what it runs with, and what it sends without one.

use super::{ANSWER, BlockAnswer, BlockRequest, Came, INCOMPLETE, REQUEST, frame, received};
use crate::fixed::time::Time;
use crate::unit::Flow;
use crate::unit::identity::Identity;
use crate::unit::reply::Piece;
use crate::unit::safe_state::SafeState;
use crate::unit::settings::{
    BlockError, BlockKind, MOST_BLOCK_LEN, Settings, SettingsSlots, StoredError, StoredSettings,
};
use crate::wire::broadcast::Medium;
use crate::wire::frame::CanFrame;
use crate::wire::message::Epoch;
use crate::wire::status::Status;

/// Times at which units of one number say which ones they are, and the time from one to the next, microseconds: two
/// frames of a slow bus.
const SLOTS: u32 = 64;
const SLOT_US: u64 = 4000;

/// Where and how a unit answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CanServiceConfig {
    /// The sensor's number.
    pub sensor: u8,
    /// The bus its messages are on, and their identifiers.
    pub medium: Medium,
    /// Least time between two answers, microseconds.
    pub gap_us: u32,
    /// Which program on which chip.
    pub identity: Identity,
}

impl CanServiceConfig {
    /// An answer every 2 ms at most: between them there is room for a map.
    pub const fn new(sensor: u8, medium: Medium) -> Self {
        Self { sensor, medium, gap_us: 2000, identity: Identity::UNNAMED }
    }
}

/// What lies between a bus and the slots of a unit, from start to restart.
///
/// # Example
/// A block is sent in parts, written, and read by the next start:
/// ```
/// # use viewshed::unit::can_service::{Answers, Tool};
/// # use viewshed::unit::reply::Said;
/// # use viewshed::board::{BLOCK_LEN, CanService, CanServiceConfig, Flow, SettingsSlots, StoredSettings};
/// # use viewshed::{Addresses, Epoch, FieldOfView, Medium, Mount, NoiseConfig, Sensor, Settings, Time, small};
/// # struct InRam([[u8; BLOCK_LEN]; 2]);
/// # impl SettingsSlots for InRam {
/// #     fn slot(&self, slot: usize) -> &[u8] { self.0.get(slot).map_or(&[], |slot| slot) }
/// #     fn write(&mut self, slot: usize, block: &[u8]) { self.0[slot][..block.len()].copy_from_slice(block) }
/// # }
/// # let settings = Settings::of(Sensor {
/// #     mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 3.0, roll_deg: 0.0 },
/// #     field_of_view: FieldOfView {
/// #         azimuth_min_deg: -60.0, azimuth_max_deg: 60.0,
/// #         elevation_min_deg: -16.0, elevation_max_deg: 16.0,
/// #         range_min_m: 3.0, range_max_m: 200.0,
/// #     },
/// #     noise: NoiseConfig::default(),
/// # });
/// let medium = Medium::Can(Addresses::STANDARD);
/// let config = CanServiceConfig { gap_us: 0, ..CanServiceConfig::new(3, medium) };
/// let (mut slots, now) = (InRam([[0xFF; BLOCK_LEN]; 2]), Time::from_micros(0));
///
/// let check = small::CHECK;
///
/// let mut unit = CanService::start(config, Epoch::new(1), now, StoredSettings::read(&slots, check));
/// assert!(unit.settings().is_none());
/// let (mut tool, mut answers) = (Tool::new(3, medium), Answers::new(3, medium));
/// for frame in tool.write(&settings.to_block(0)) {
///     unit.take(&frame, &mut slots);
/// }
/// let mut reported = std::iter::from_fn(|| unit.next_frame(now, &slots)).filter_map(|f| answers.take(&f));
/// assert!(reported.any(|report| report == Said::Written(1)));
/// let restart = tool.restart().unwrap();
/// assert_eq!(unit.take(&restart, &mut slots), Some(Flow::Restart));
///
/// let unit = CanService::start(config, Epoch::new(2), now, StoredSettings::read(&slots, check));
/// assert_eq!(unit.settings(), Some(&settings));
/// ```
#[derive(Debug, Clone)]
pub struct CanService {
    config: CanServiceConfig,
    epoch: Epoch,
    stored: StoredSettings,
    safe: SafeState,
    incoming: Incoming,
    outgoing: Outgoing,
    counter: u8,
    /// When the next answer may be sent.
    next: Time,
    /// Requests are for another chip's unit.
    passed_over: bool,
    /// Whether somebody asked which unit this is, and when it says so.
    presence: Presence,
}

/// An answer that waits, so that units of one number do not answer at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Presence {
    NotAsked,
    Asked,
    Due(Time),
}

impl CanService {
    /// Starts with a block, or without.
    pub fn start(config: CanServiceConfig, epoch: Epoch, now: Time, stored: StoredSettings) -> Self {
        let refused = stored.position().err().map(|error| Refused { what: What::Block(error), next: 0 });
        Self {
            config,
            epoch,
            stored,
            safe: SafeState::new(config.sensor, config.medium, epoch, now),
            incoming: Incoming::NONE,
            outgoing: Outgoing { started: true, refused, written: None, part: None, identified: false, cleared: false },
            counter: 0,
            next: now,
            passed_over: false,
            presence: Presence::NotAsked,
        }
    }

    /// What to work with; none in the safe state.
    pub fn settings(&self) -> Option<&Settings> {
        self.stored.settings()
    }

    /// Why there is no block to work with.
    pub fn refusal(&self) -> Option<StoredError> {
        self.stored.position().err()
    }

    /// Takes a frame of the bus; `None` if it is none of the integrator's.
    pub fn take(&mut self, frame: &CanFrame, slots: &mut impl SettingsSlots) -> Option<Flow> {
        let own = received(frame, &self.config.medium, self.config.sensor, REQUEST)?;
        let request = BlockRequest::read(own)?;
        let chip = self.config.identity.chip;
        match request {
            BlockRequest::Identify => self.presence = Presence::Asked,
            BlockRequest::Address { chip: named } => {
                self.passed_over = named != 0 && named != chip;
                self.outgoing.identified |= named == chip && named != 0;
            }
            _ if !self.passed_over => return Some(self.work(request, slots)),
            // heard, and not for this one
            _ => {}
        }
        Some(Flow::Continue)
    }

    /// Does what is asked of this unit.
    fn work(&mut self, request: BlockRequest, slots: &mut impl SettingsSlots) -> Flow {
        match request {
            BlockRequest::Begin { length } => self.incoming.begin(length),
            BlockRequest::Part { number, bytes } => self.incoming.part(number, bytes),
            BlockRequest::Complete { last } => match self.incoming.complete(last, &self.stored, slots) {
                Ok(sequence) => self.outgoing.written = Some(sequence),
                Err(what) => self.outgoing.refused = Some(Refused { what, next: 0 }),
            },
            BlockRequest::Read(which) => match self.stored.find(which, slots) {
                Ok(slot) => self.outgoing.part = Some((slot, 0)),
                Err(error) => self.outgoing.refused = Some(Refused { what: What::Block(error), next: 0 }),
            },
            BlockRequest::Clear(kind) => {
                StoredSettings::clear(kind, slots);
                // a completion that is repeated is of no block any more
                self.incoming = Incoming::NONE;
                self.outgoing.cleared = true;
            }
            BlockRequest::Restart => return Flow::Restart,
            BlockRequest::Identify | BlockRequest::Address { .. } => {}
        }
        Flow::Continue
    }

    /// Whether slots were written and that is still to be answered.
    pub fn has_written(&self) -> bool {
        self.outgoing.cleared || self.outgoing.written.is_some()
    }

    /// The next answer, if one is due.
    pub fn next_frame(&mut self, now: Time, slots: &impl SettingsSlots) -> Option<CanFrame> {
        let gap_us = u64::from(self.config.gap_us);
        // a clock that stepped back does not put it off
        if self.next.since(now).is_some_and(|wait| wait > 0 && wait <= gap_us) {
            return None;
        }
        self.outgoing.identified |= self.is_present(now);
        let answer = self.outgoing.next(&self.stored, slots, &self.config.identity)?;
        self.next = Time::from_micros(now.micros().saturating_add(gap_us));
        let CanServiceConfig { sensor, medium, .. } = self.config;
        frame(&medium, sensor, ANSWER, self.epoch, &mut self.counter, answer.own())
    }

    /// Whether it is this unit's time to say which one it is.
    fn is_present(&mut self, now: Time) -> bool {
        match self.presence {
            Presence::NotAsked => false,
            Presence::Asked => {
                let wait = u64::from(self.config.identity.chip % SLOTS) * SLOT_US;
                self.presence = Presence::Due(Time::from_micros(now.micros().saturating_add(wait)));
                false
            }
            // a clock that stepped back does not put it off
            Presence::Due(due) => {
                let wait = due.since(now).unwrap_or(0);
                let is_due = wait == 0 || wait > u64::from(SLOTS) * SLOT_US;
                if is_due {
                    self.presence = Presence::NotAsked;
                }
                is_due
            }
        }
    }

    /// The next status of a unit in its safe state, where nothing else of it is sent; versions and counters as
    /// in `base`.
    pub fn next_status(&mut self, now: Time, base: Status) -> Option<CanFrame> {
        self.safe.next_frame(now, base)
    }
}

/// A block on its way here.
#[derive(Debug, Clone, Copy)]
struct Incoming {
    block: Piece,
    /// Parts that came.
    came: Came,
    /// Of the block that began and is not yet complete.
    length: Option<usize>,
    /// Last bytes and sequence of the block that was written last.
    written: Option<([u8; 4], u32)>,
}

impl Incoming {
    const NONE: Self = Self { block: Piece::EMPTY, came: Came::NONE, length: None, written: None };

    fn begin(&mut self, length: u16) {
        // what is longer is of another layout, as its first bytes say
        (self.came, self.length) = (Came::NONE, Some(usize::from(length).min(MOST_BLOCK_LEN)));
    }

    fn part(&mut self, number: u8, bytes: [u8; 4]) {
        if self.length.is_some() && self.block.put(4 * usize::from(number), &bytes) {
            self.came.set(usize::from(number));
        }
    }

    /// Checks the block and writes it; its sequence.
    fn complete(
        &mut self,
        last: [u8; 4],
        stored: &StoredSettings,
        slots: &mut impl SettingsSlots,
    ) -> Result<u32, What> {
        let Some(length) = self.length else {
            // the answer may have been lost
            let again = self.written.filter(|(sum, _)| *sum == last);
            return again.map(|(_, sequence)| sequence).ok_or(What::Missing(0));
        };
        #[allow(clippy::cast_possible_truncation)] // at most 255
        if let Some(missing) = (0..length.div_ceil(4)).find(|part| !self.came.get(*part)) {
            return Err(What::Missing(missing as u8));
        }
        self.length = None;
        let block = self.block.bytes().get(..length).unwrap_or(&[]);
        if block.last_chunk::<4>().is_some_and(|end| *end != last) {
            let kind = BlockKind::of_block(block).unwrap_or(BlockKind::Settings);
            return Err(What::Block(StoredError { kind, error: BlockError::CheckSum }));
        }
        let sequence = stored.write(block, slots).map_err(What::Block)?;
        self.written = Some((last, sequence));
        Ok(sequence)
    }
}

/// What was refused.
#[derive(Debug, Clone, Copy)]
enum What {
    Block(StoredError),
    /// The first part that did not come.
    Missing(u8),
}

#[derive(Debug, Clone, Copy)]
struct Refused {
    what: What,
    /// Messages sent of it.
    next: u8,
}

/// What is to be answered, one message after the other.
#[derive(Debug, Clone, Copy)]
struct Outgoing {
    started: bool,
    refused: Option<Refused>,
    written: Option<u32>,
    /// A block's slot, and its next part.
    part: Option<(usize, u8)>,
    identified: bool,
    cleared: bool,
}

impl Outgoing {
    fn next(
        &mut self,
        stored: &StoredSettings,
        slots: &impl SettingsSlots,
        identity: &Identity,
    ) -> Option<BlockAnswer> {
        if core::mem::take(&mut self.started) {
            let (slot, sequence) = stored.position().unwrap_or((u8::MAX, 0));
            return Some(BlockAnswer::Started { slot, sequence });
        }
        if let Some(sequence) = self.written.take() {
            return Some(BlockAnswer::Written { sequence });
        }
        if core::mem::take(&mut self.identified) {
            return Some(BlockAnswer::Identified { is_bench: identity.is_bench, chip: identity.chip });
        }
        if core::mem::take(&mut self.cleared) {
            return Some(BlockAnswer::Cleared);
        }
        if let Some(mut refused) = self.refused.take() {
            let answer = refused.answer();
            refused.next = refused.next.saturating_add(1);
            self.refused = refused.goes_on().then_some(refused);
            return Some(answer);
        }
        let (slot, number) = self.part.take()?;
        let block = StoredSettings::in_slot(slots, slot);
        let bytes = *block.get(4 * usize::from(number)..)?.first_chunk::<4>()?;
        self.part = (4 * (usize::from(number) + 1) < block.len()).then_some((slot, number + 1));
        Some(BlockAnswer::Part { number, bytes })
    }
}

impl Refused {
    fn name(&self) -> &'static [u8] {
        match &self.what {
            What::Block(StoredError { error: BlockError::Parameter(error), .. }) => error.parameter.as_bytes(),
            _ => &[],
        }
    }

    fn answer(&self) -> BlockAnswer {
        if let Some(number) = self.next.checked_sub(1) {
            let mut letters = [0; 4];
            let rest = self.name().get(4 * usize::from(number)..).unwrap_or(&[]);
            letters.iter_mut().zip(rest).for_each(|(to, from)| *to = *from);
            return BlockAnswer::Name { number, letters };
        }
        match &self.what {
            What::Missing(part) => BlockAnswer::Refused { reason: INCOMPLETE, detail: [*part, 0, 0, 0] },
            What::Block(error) => BlockAnswer::Refused { reason: error.code(), detail: error.detail() },
        }
    }

    /// Whether letters are left, or the zero that ends them.
    fn goes_on(&self) -> bool {
        let letters = self.name().len();
        letters > 0 && 4 * (usize::from(self.next) - 1) <= letters
    }
}
