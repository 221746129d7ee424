//! What an integrator sets, as a block of bytes with a check sum in two slots of memory.
//!
//! A controller reads both slots at its start, works with the newer one that holds, and writes a new
//! block into the other: power may fail at any moment without losing both. A block is applied at a
//! restart only, and one that does not hold is refused with its reason.
//!
//! # Model
//! All numbers are little-endian.
//!
//! | bytes | |
//! |---|---|
//! | 4 | `VSCB` |
//! | 2 | layout, 2 |
//! | 2 | length of the whole block |
//! | 4 | sequence: the newer slot has the higher one, modulo 2^32 |
//! | 4 x 29 | `f32`: mount, field of view, noise, gate, visibility, health, each in the order of its fields |
//! | 2 x 8 | radar bus, broadcast bus: bit rate, sample point in thousandths (2 bytes), listen-only start (2 bytes) |
//! | 12 | the unit: sensor (1 byte), the radar's id (1 byte), greatest delay in milliseconds (2 bytes), baud rate (4 bytes), whether the radar is configured (1 byte: 0 no, 1 clusters, 2 objects), whether it is supervised by what stands in its view (1 byte: 0 or 1), what it is told (1 byte: 1 where the far road lies, 2 to learn lanes, or both) and where that is, whole degrees (1 byte, signed) |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it |
//!
//! Blocks of what is known of a place, in slots of their own: `kept`. Layout 1 ends after the buses. It is still read: what it does not say is kept as the unit has it, or is by default.
//! What maps depend on is in layout 1, so the header's fingerprint is of that form, and where there are any, of lanes,
//! of tuned parameters, of what is said of fixtures, of where the far road lies, of whether lanes are learnt and of the road's heights.

mod block;
mod flash;
mod kept;
mod kind;
mod stored;
mod unit_config;

pub use block::BLOCK_LEN;
pub use flash::FlashSlots;
#[cfg(feature = "probability")]
pub use kept::table_block;
pub use kept::{heights_block, kept_points, lanes_block};
pub use kind::{ALL_SLOTS_LEN, BlockKind, MOST_BLOCK_LEN, SLOTS, Which, announced_length, in_copy};
pub use stored::{SettingsCheck, SettingsSlots, StoredError, StoredSettings};
pub use unit_config::{ConfigureRadar, UnitConfig};

use crate::camera::Camera3dConfig;
use crate::frame::gate::GateConfig;
use crate::frame::health::HealthConfig;
#[cfg(feature = "monitoring")]
use crate::fusion::FixturesConfig;
#[cfg(feature = "tuned")]
use crate::grid::evidence::EvidenceConfig;
#[cfg(feature = "tuned")]
use crate::obstacles::config::ObstacleConfig;
use crate::obstacles::lanes::Lane;
#[cfg(feature = "probability")]
use crate::probability::TableError;
use crate::radar_3d::{Radar3dConfig, VisibilityConfig};
use crate::sensor::Sensor;
use crate::sensor::config::ConfigError;
use crate::sensor::field_of_view::FieldOfView;
use crate::sensor::mount::Mount;
use crate::sensor::noise::NoiseConfig;
use crate::sensor::site::{LaneList, Points, Site};
use crate::unit::can_bus::BusConfig;

/// Everything an integrator sets for one installation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Settings {
    /// Where the sensor stands, what it could see, how well it measures.
    pub sensor: Sensor,
    /// Which detections count.
    #[cfg_attr(feature = "serde", serde(default))]
    pub gate: GateConfig,
    /// How the result is read off the grid.
    #[cfg_attr(feature = "serde", serde(default))]
    pub visibility: VisibilityConfig,
    /// When maps end.
    #[cfg_attr(feature = "serde", serde(default))]
    pub health: HealthConfig,
    /// The bus the radar is on.
    #[cfg_attr(feature = "serde", serde(default))]
    pub radar_bus: BusConfig,
    /// The bus maps are broadcast on.
    #[cfg_attr(feature = "serde", serde(default))]
    pub broadcast_bus: BusConfig,
    /// Numbers and rates of the unit itself.
    #[cfg_attr(feature = "serde", serde(default))]
    pub unit: UnitConfig,
    /// Which way traffic goes, where that is given; a controller has it in a block of its own.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub lanes: &'static [Lane],
    /// Height of the road over its length, where it is not flat; likewise.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub ground: &'static [[f32; 2]],
    /// How obstacles are tracked, where that was tuned for the place; no block has it.
    #[cfg(feature = "tuned")]
    #[cfg_attr(feature = "serde", serde(skip))]
    pub obstacles: Option<&'static ObstacleConfig>,
    /// How evidence comes and goes, likewise.
    #[cfg(feature = "tuned")]
    #[cfg_attr(feature = "serde", serde(skip))]
    pub evidence: Option<&'static EvidenceConfig>,
    /// When what stands in the view tells that something is wrong with the radar; where the unit is only told to
    /// [`supervise`](UnitConfig::supervise), it is by default. No block has it.
    #[cfg(feature = "monitoring")]
    #[cfg_attr(feature = "serde", serde(skip))]
    pub fixtures: Option<&'static FixturesConfig>,
}

/// Why a block is not used.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BlockError {
    /// Nothing was ever written here, or something else.
    Empty,
    /// Cut off.
    Short,
    /// Written for another layout.
    Layout(u16),
    /// The check sum does not hold.
    CheckSum,
    /// A parameter that cannot be worked with.
    Parameter(ConfigError),
    /// This firmware, or its memory, has no room for blocks of this kind.
    NoRoom,
    /// A table of probabilities that is not this unit's, or none.
    #[cfg(feature = "probability")]
    Table(TableError),
    /// A table of probabilities of another grid: its ranges and azimuths.
    #[cfg(feature = "probability")]
    Grid([u8; 2]),
}

impl BlockError {
    /// Number of the reason on the wire, from 1.
    pub const fn code(&self) -> u8 {
        match self {
            Self::Empty => 1,
            Self::Short => 2,
            Self::Layout(_) => 3,
            Self::CheckSum => 4,
            Self::Parameter(_) => 5,
            Self::NoRoom => 7,
            #[cfg(feature = "probability")]
            Self::Table(TableError::Edges(_)) => 8,
            #[cfg(feature = "probability")]
            Self::Table(TableError::NotMonotone { .. }) => 9,
            #[cfg(feature = "probability")]
            Self::Table(TableError::Configuration { .. }) => 10,
            #[cfg(feature = "probability")]
            Self::Table(TableError::Empty | TableError::Short | TableError::Layout | TableError::CheckSum) => 11,
            #[cfg(feature = "probability")]
            Self::Grid(_) => 12,
        }
    }
}

impl core::fmt::Display for BlockError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => write!(f, "no configuration block"),
            Self::Short => write!(f, "the configuration block is cut off"),
            Self::Layout(found) => {
                write!(f, "the configuration block has layout {found}, this firmware reads 1 and {}", block::LAYOUT)
            }
            Self::CheckSum => write!(f, "the configuration block's check sum does not hold"),
            Self::Parameter(e) => write!(f, "configuration block: {e}"),
            Self::NoRoom => write!(f, "this firmware has no room for such a block"),
            #[cfg(feature = "probability")]
            Self::Table(e) => write!(f, "{e}"),
            #[cfg(feature = "probability")]
            Self::Grid([ranges, azimuths]) => {
                write!(f, "the probability table was fitted on a grid of {ranges} x {azimuths}")
            }
        }
    }
}

impl core::error::Error for BlockError {}

impl Settings {
    /// Settings for a sensor, the rest by default.
    pub fn of(sensor: Sensor) -> Self {
        Self {
            sensor,
            gate: GateConfig::default(),
            visibility: VisibilityConfig::default(),
            health: HealthConfig::default(),
            radar_bus: BusConfig::default(),
            broadcast_bus: BusConfig::default(),
            unit: UnitConfig::default(),
            lanes: &[],
            ground: &[],
            #[cfg(feature = "tuned")]
            obstacles: None,
            #[cfg(feature = "tuned")]
            evidence: None,
            #[cfg(feature = "monitoring")]
            fixtures: None,
        }
    }

    /// Settings for a camera: its mount, and the angles at which its picture ends along its middle row and column. The
    /// share of a column that has to be seen is the camera's, not a radar's; the rest is by default.
    pub fn of_camera(mount: Mount, field_of_view: FieldOfView) -> Self {
        let visible_from = Camera3dConfig::default().visible_share;
        let visibility = VisibilityConfig { visible_from, ..VisibilityConfig::default() };
        Self { visibility, ..Self::of(Sensor { mount, field_of_view, noise: NoiseConfig::default() }) }
    }

    /// The same without what watches the radar, which changes no grade: tables of probabilities are of these.
    #[cfg(feature = "probability")]
    pub(crate) fn of_grades(&self) -> Self {
        let unit = UnitConfig { supervise: false, ..self.unit };
        Self {
            unit,
            #[cfg(feature = "monitoring")]
            fixtures: None,
            ..*self
        }
    }

    /// What is asked of what stands in the view, if the radar is supervised.
    #[cfg(feature = "monitoring")]
    pub fn fixtures(&self) -> Option<FixturesConfig> {
        self.fixtures.copied().or_else(|| self.unit.supervise.then(FixturesConfig::default))
    }

    /// What they say of the place.
    pub fn place(&self) -> Site<'static> {
        Site { lanes: LaneList::Metres(self.lanes), heights: Points::Metres(self.ground) }
    }

    /// The estimator's configuration; what an integrator does not set is the library's.
    pub fn radar_3d(&self) -> Radar3dConfig {
        let Self { gate, visibility, health, lanes, ground, .. } = *self;
        let mut config = Radar3dConfig { gate, visibility, health, lanes, ground, ..Radar3dConfig::default() };
        #[cfg(feature = "tuned")]
        {
            config.obstacles = self.obstacles.copied().unwrap_or_default();
            config.evidence = self.evidence.copied().unwrap_or_default();
        }
        if self.unit.learn_lanes {
            config.obstacles = config.obstacles.learning();
        }
        config
    }

    /// The newer of two slots that holds and is accepted: its number and settings, and the sequence to write
    /// into the other one next.
    ///
    /// # Errors
    /// Why each was refused.
    pub fn newest(
        slots: [&[u8]; 2],
        accept: impl Fn(&Self) -> Result<(), ConfigError>,
    ) -> Result<Newest, [BlockError; 2]> {
        let read = |bytes| {
            let (sequence, settings) = Self::from_block(bytes)?;
            accept(&settings).map_err(BlockError::Parameter).map(|()| (sequence, settings))
        };
        let found = |slot, (sequence, settings): (u32, Self)| Newest {
            slot,
            settings,
            next_slot: 1 - slot,
            next_sequence: sequence.wrapping_add(1),
        };
        newer(slots.map(read)).map(|(slot, what)| found(slot, what))
    }
}

/// The newer of two slots that hold: its number, its sequence and what it has.
fn newer<T, E>(slots: [Result<(u32, T), E>; 2]) -> Result<(usize, (u32, T)), [E; 2]> {
    match slots {
        [Err(first), Err(second)] => Err([first, second]),
        [Ok(first), Err(_)] => Ok((0, first)),
        [Err(_), Ok(second)] => Ok((1, second)),
        // half the range ahead is newer
        [Ok(first), Ok(second)] => {
            let second_is_newer = second.0.wrapping_sub(first.0) < 1 << 31 && second.0 != first.0;
            Ok(if second_is_newer { (1, second) } else { (0, first) })
        }
    }
}

/// The slot in use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newest {
    /// Its number, 0 or 1.
    pub slot: usize,
    /// What it says.
    pub settings: Settings,
    /// Where the next block goes.
    pub next_slot: usize,
    /// The next block's sequence.
    pub next_sequence: u32,
}

#[cfg(test)]
mod tests {
    use super::block::tests::settings;
    use super::*;

    #[test]
    fn refusals_say_why() {
        let block = settings().to_block(1);
        assert_eq!(Settings::from_block(&[0xFF; BLOCK_LEN]), Err(BlockError::Empty), "erased flash");
        assert_eq!(Settings::from_block(&block[..BLOCK_LEN - 1]), Err(BlockError::Short));
        let mut other = block;
        other[4] = 9;
        assert_eq!(Settings::from_block(&other), Err(BlockError::Layout(9)));
        let high = |s: &Settings| s.sensor.mount.levelling().map(|_| ());
        let mut too_high = settings();
        too_high.sensor.mount.height_m = 50.0;
        let refused = Settings::newest([&too_high.to_block(2), &settings().to_block(1)], high).map(|n| n.slot);
        assert_eq!(refused, Ok(1), "the newer one is not accepted");
        let Err([BlockError::Parameter(e), _]) = Settings::newest([&too_high.to_block(2), &[]], high) else { panic!() };
        assert_eq!((e.parameter, e.value), ("mount.height_m", 50.0));
    }

    #[test]
    fn the_newer_slot_that_holds_is_used_and_the_other_written() {
        let (mut old, mut new) = (settings(), settings());
        old.gate.max_detections = 100;
        new.gate.max_detections = 200;
        let pick =
            |slots: [&[u8]; 2]| Settings::newest(slots, |_| Ok(())).map(|n| (n.slot, n.settings.gate.max_detections));
        let (a, b) = (old.to_block(u32::MAX), new.to_block(0));
        assert_eq!(pick([&a, &b]), Ok((1, 200)), "the sequence wraps");
        assert_eq!(pick([&b, &a]), Ok((0, 200)));
        let torn = &b[..50];
        assert_eq!(pick([&a, torn]), Ok((0, 100)), "power failed while writing");
        assert_eq!(pick([torn, &[0; 4]]), Err([BlockError::Short, BlockError::Empty]));
        let n = Settings::newest([&a, &b], |_| Ok(())).unwrap();
        assert_eq!((n.next_slot, n.next_sequence), (0, 1));
    }
}
