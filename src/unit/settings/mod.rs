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
//! | 2 | layout, 1 |
//! | 2 | length of the whole block |
//! | 4 | sequence: the newer slot has the higher one, modulo 2^32 |
//! | 4 x 29 | `f32`: mount, field of view, noise, gate, visibility, health, each in the order of its fields |
//! | 2 x 8 | radar bus, broadcast bus: bit rate, sample point in thousandths (2 bytes), listen-only start (2 bytes) |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it |

mod flash;
mod stored;

pub use flash::FlashSlots;
pub use stored::{SettingsCheck, SettingsSlots, StoredSettings};

use crate::camera::Camera3dConfig;
use crate::fixed::bytes::{Reader, Writer};
use crate::frame::gate::GateConfig;
use crate::frame::health::HealthConfig;
use crate::radar_3d::{Radar3dConfig, VisibilityConfig};
use crate::sensor::Sensor;
use crate::sensor::config::ConfigError;
use crate::sensor::field_of_view::FieldOfView;
use crate::sensor::mount::Mount;
use crate::sensor::noise::NoiseConfig;
use crate::unit::can_bus::BusConfig;
use crate::wire::header::fingerprint;

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
}

/// Numbers of a block, in `f32`.
const NUMBERS: usize = 29;
/// Bytes of a bus.
const BUS_LEN: usize = 8;
/// Bytes before the numbers.
const HEADER_LEN: usize = 12;
/// Bytes of a block.
pub const BLOCK_LEN: usize = HEADER_LEN + 4 * NUMBERS + 2 * BUS_LEN + 4;

const MAGIC: [u8; 4] = *b"VSCB";
const LAYOUT: u16 = 1;

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
        }
    }
}

impl core::fmt::Display for BlockError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => write!(f, "no configuration block"),
            Self::Short => write!(f, "the configuration block is cut off"),
            Self::Layout(found) => {
                write!(f, "the configuration block has layout {found}, this firmware reads {LAYOUT}")
            }
            Self::CheckSum => write!(f, "the configuration block's check sum does not hold"),
            Self::Parameter(e) => write!(f, "configuration block: {e}"),
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
        }
    }

    /// Settings for a camera: its mount, and the angles at which its picture ends along its middle row and column. The
    /// share of a column that has to be seen is the camera's, not a radar's; the rest is by default.
    pub fn of_camera(mount: Mount, field_of_view: FieldOfView) -> Self {
        let visible_from = Camera3dConfig::default().visible_share;
        let visibility = VisibilityConfig { visible_from, ..VisibilityConfig::default() };
        Self { visibility, ..Self::of(Sensor { mount, field_of_view, noise: NoiseConfig::default() }) }
    }

    /// The estimator's configuration; what an integrator does not set is the library's.
    pub fn radar_3d(&self) -> Radar3dConfig {
        Radar3dConfig { gate: self.gate, visibility: self.visibility, health: self.health, ..Radar3dConfig::default() }
    }

    /// Writes the block.
    #[allow(clippy::cast_possible_truncation)] // a block has a hundred-odd bytes
    pub fn to_block(&self, sequence: u32) -> [u8; BLOCK_LEN] {
        let mut block = [0; BLOCK_LEN];
        let mut w = Writer(&mut block);
        w.put(MAGIC);
        w.put(LAYOUT.to_le_bytes());
        w.put((BLOCK_LEN as u16).to_le_bytes());
        w.put(sequence.to_le_bytes());
        for number in self.numbers() {
            w.put(number.to_le_bytes());
        }
        for bus in [self.radar_bus, self.broadcast_bus] {
            w.put(bus.bit_rate.to_le_bytes());
            w.put(bus.sample_point_permille.to_le_bytes());
            w.put(u16::from(bus.listen_first).to_le_bytes());
        }
        if let Some((body, sum)) = block.split_last_chunk_mut::<4>() {
            *sum = fingerprint(body).to_le_bytes();
        }
        block
    }

    /// Reads a block with its sequence; bytes after it do not matter. Its parameters may be anything: whether
    /// a unit can run with them is `SettingsCheck`'s to say.
    ///
    /// # Errors
    /// The first thing that does not hold.
    pub fn from_block(bytes: &[u8]) -> Result<(u32, Self), BlockError> {
        let mut header = Reader(bytes);
        match header.take::<4>() {
            Some(MAGIC) => {}
            Some(_) => return Err(BlockError::Empty),
            None => return Err(BlockError::Short),
        }
        let layout = header.u16().ok_or(BlockError::Short)?;
        if layout != LAYOUT {
            return Err(BlockError::Layout(layout));
        }
        let length = header.u16().ok_or(BlockError::Short)?;
        let block = bytes.get(..BLOCK_LEN).filter(|_| usize::from(length) == BLOCK_LEN).ok_or(BlockError::Short)?;
        let (body, sum) = block.split_last_chunk::<4>().ok_or(BlockError::Short)?;
        if fingerprint(body) != u32::from_le_bytes(*sum) {
            return Err(BlockError::CheckSum);
        }
        let sequence = header.u32().ok_or(BlockError::Short)?;
        let settings = Self::read(&mut header).ok_or(BlockError::Short)?;
        Ok((sequence, settings))
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
        match slots.map(read) {
            [Err(first), Err(second)] => Err([first, second]),
            [Ok(first), Err(_)] => Ok(found(0, first)),
            [Err(_), Ok(second)] => Ok(found(1, second)),
            // half the range ahead is newer
            [Ok(first), Ok(second)] => {
                let second_is_newer = second.0.wrapping_sub(first.0) < 1 << 31 && second.0 != first.0;
                Ok(if second_is_newer { found(1, second) } else { found(0, first) })
            }
        }
    }

    fn numbers(&self) -> [f32; NUMBERS] {
        let Sensor { mount: m, field_of_view: v, noise: n } = self.sensor;
        let (g, s, h) = (self.gate, self.visibility, self.health);
        [
            m.x_m,
            m.y_m,
            m.height_m,
            m.yaw_deg,
            m.pitch_deg,
            m.roll_deg,
            v.azimuth_min_deg,
            v.azimuth_max_deg,
            v.elevation_min_deg,
            v.elevation_max_deg,
            v.range_min_m,
            v.range_max_m,
            n.range_m,
            n.azimuth_deg,
            n.elevation_deg,
            n.radial_velocity_mps,
            n.reflector_height_m,
            g.min_snr_db,
            g.min_rcs_dbsm,
            g.max_speed_mps,
            g.min_speed_mps,
            g.elevation_margin_deg,
            f32::from(g.max_detections),
            s.slice_height_m,
            s.visible_from,
            s.occupied_from,
            h.hold_s,
            h.blind_after_s,
            h.reset_gap_s,
        ]
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates, checked afterwards
    fn read(r: &mut Reader) -> Option<Self> {
        let mount = Mount {
            x_m: r.f32()?,
            y_m: r.f32()?,
            height_m: r.f32()?,
            yaw_deg: r.f32()?,
            pitch_deg: r.f32()?,
            roll_deg: r.f32()?,
        };
        let field_of_view = FieldOfView {
            azimuth_min_deg: r.f32()?,
            azimuth_max_deg: r.f32()?,
            elevation_min_deg: r.f32()?,
            elevation_max_deg: r.f32()?,
            range_min_m: r.f32()?,
            range_max_m: r.f32()?,
        };
        let noise = NoiseConfig {
            range_m: r.f32()?,
            azimuth_deg: r.f32()?,
            elevation_deg: r.f32()?,
            radial_velocity_mps: r.f32()?,
            reflector_height_m: r.f32()?,
        };
        let gate = GateConfig {
            min_snr_db: r.f32()?,
            min_rcs_dbsm: r.f32()?,
            max_speed_mps: r.f32()?,
            min_speed_mps: r.f32()?,
            elevation_margin_deg: r.f32()?,
            max_detections: r.f32()? as u16,
        };
        let visibility = VisibilityConfig { slice_height_m: r.f32()?, visible_from: r.f32()?, occupied_from: r.f32()? };
        let health = HealthConfig { hold_s: r.f32()?, blind_after_s: r.f32()?, reset_gap_s: r.f32()? };
        let bus = |r: &mut Reader| {
            Some(BusConfig { bit_rate: r.u32()?, sample_point_permille: r.u16()?, listen_first: r.u16()? != 0 })
        };
        let (radar_bus, broadcast_bus) = (bus(r)?, bus(r)?);
        let sensor = Sensor { mount, field_of_view, noise };
        Some(Self { sensor, gate, visibility, health, radar_bus, broadcast_bus })
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
    use super::*;

    fn settings() -> Settings {
        let mut s = Settings::of(Sensor {
            mount: Mount { x_m: 1.0, y_m: -2.0, height_m: 6.0, yaw_deg: 3.0, pitch_deg: 4.0, roll_deg: -5.0 },
            field_of_view: FieldOfView {
                azimuth_min_deg: -60.0,
                azimuth_max_deg: 50.0,
                elevation_min_deg: -16.0,
                elevation_max_deg: 12.0,
                range_min_m: 3.0,
                range_max_m: 200.0,
            },
            noise: NoiseConfig::default(),
        });
        s.gate.max_detections = 176;
        s.broadcast_bus.bit_rate = 250_000;
        s
    }

    #[test]
    fn a_block_reads_back() {
        let block = settings().to_block(7);
        assert_eq!(Settings::from_block(&block), Ok((7, settings())));
        assert_eq!(fingerprint(b"123456789"), 0xCBF4_3926, "the check value of CRC-32");
    }

    #[test]
    fn every_flipped_bit_is_refused() {
        let block = settings().to_block(7);
        for bit in 0..8 * BLOCK_LEN {
            let mut bad = block;
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(Settings::from_block(&bad).is_err(), "bit {bit}");
        }
    }

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
