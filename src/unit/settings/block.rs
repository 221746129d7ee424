//! Settings as bytes and back.

use super::{BlockError, ConfigureRadar, Settings, UnitConfig};
use crate::fixed::bytes::{Reader, Writer};
use crate::frame::gate::GateConfig;
use crate::frame::health::HealthConfig;
#[cfg(feature = "tuned")]
use crate::grid::evidence::EvidenceConfig;
#[cfg(feature = "tuned")]
use crate::obstacles::config::ObstacleConfig;
use crate::obstacles::lanes::MOST_LANES;
use crate::radar_3d::VisibilityConfig;
use crate::sensor::Sensor;
use crate::sensor::config::{ConfigError, Problem};
use crate::sensor::field_of_view::FieldOfView;
use crate::sensor::ground;
use crate::sensor::mount::Mount;
use crate::sensor::noise::NoiseConfig;
use crate::sensor::site::Site;
use crate::unit::can_bus::BusConfig;
use crate::wire::header::fingerprint;

/// Numbers of a block, in `f32`.
const NUMBERS: usize = 29;
/// Bytes of a bus.
const BUS_LEN: usize = 8;
/// Bytes of the unit's own figures.
const UNIT_LEN: usize = 12;
/// Bytes of the check sum.
const SUM_LEN: usize = 4;
/// Bytes before the numbers.
const HEADER_LEN: usize = 12;
/// Bytes of a block of layout 1.
const LAYOUT_1_LEN: usize = HEADER_LEN + 4 * NUMBERS + 2 * BUS_LEN + SUM_LEN;
/// Bytes of a block.
pub const BLOCK_LEN: usize = LAYOUT_1_LEN + UNIT_LEN;

const MAGIC: [u8; 4] = *b"VSCB";
/// Of the blocks that are written.
pub(super) const LAYOUT: u16 = 2;

impl Settings {
    /// Writes the block.
    pub fn to_block(&self, sequence: u32) -> [u8; BLOCK_LEN] {
        let mut block = [0; BLOCK_LEN];
        self.write(LAYOUT, sequence, &mut block);
        block
    }

    /// Identifies what maps depend on: the check sum of the block in layout 1, with sequence 0, and of each point of
    /// each lane together with the check sum so far; a lane begins with its number. After them in the same way each
    /// tuned number with its place, from 2^16 on for obstacles, from 2^17 on for evidence and from 2^18 on
    /// for fixtures; the number 2^21, if the unit learns lanes; the number 2^20 and where the far road lies, if that is
    /// said; and where the road is not flat the number 2^19 and each point of its profile.
    pub fn fingerprint(&self) -> u32 {
        self.fingerprint_at(&self.place())
    }

    /// The same at another place than the settings' own.
    #[inline(never)] // once a start
    pub fn fingerprint_at(&self, place: &Site<'_>) -> u32 {
        let mut block = [0; LAYOUT_1_LEN];
        self.write(1, 0, &mut block);
        // not of the check sum as well: a CRC over its own is the same for every block
        let mut sum = block.last_chunk().map_or(0, |sum| u32::from_le_bytes(*sum));
        let mut take = |what: [u32; 2]| {
            let mut with = [0; 3 * SUM_LEN];
            let mut w = Writer(&mut with);
            w.put(sum.to_le_bytes());
            what.iter().for_each(|word| w.put(word.to_le_bytes()));
            sum = fingerprint(&with);
        };
        // where there is no room for lanes, nothing runs with them
        let Site { lanes, mut heights } = *place;
        for (number, lane) in (1..).zip(lanes).take(MOST_LANES) {
            take([number, 0]);
            lane.for_each(|point| take(point.map(f32::to_bits)));
        }
        #[cfg(feature = "tuned")]
        {
            let obstacles = self.obstacles.into_iter().flat_map(ObstacleConfig::numbers);
            (1 << 16..).zip(obstacles).for_each(|(place, number)| take([place, number.to_bits()]));
            let evidence = self.evidence.into_iter().flat_map(EvidenceConfig::numbers);
            (1 << 17..).zip(evidence).for_each(|(place, number)| take([place, number.to_bits()]));
        }
        #[cfg(feature = "monitoring")]
        {
            let fixtures = self.fixtures().into_iter().flat_map(|fixtures| fixtures.numbers());
            (1 << 18..).zip(fixtures).for_each(|(place, number)| take([place, number.to_bits()]));
        }
        if self.unit.learn_lanes {
            take([1 << 21, 0]);
        }
        if let Some(far_road) = self.visibility.far_road_deg {
            take([1 << 20, i32::from(far_road).cast_unsigned()]);
        }
        if let Some(first) = heights.next().filter(|_| ground::ROOM) {
            take([1 << 19, 0]);
            core::iter::once(first).chain(heights).for_each(|point| take(point.map(f32::to_bits)));
        }
        sum
    }

    /// Fills a block that is as long as its layout asks for.
    #[allow(clippy::cast_possible_truncation)] // a block has a hundred-odd bytes
    fn write(&self, layout: u16, sequence: u32, block: &mut [u8]) {
        let length = block.len() as u16;
        let mut w = Writer(block);
        w.put(MAGIC);
        w.put(layout.to_le_bytes());
        w.put(length.to_le_bytes());
        w.put(sequence.to_le_bytes());
        for number in self.numbers() {
            w.put(number.to_le_bytes());
        }
        for bus in [self.radar_bus, self.broadcast_bus] {
            w.put(bus.bit_rate.to_le_bytes());
            w.put(bus.sample_point_permille.to_le_bytes());
            w.put(u16::from(bus.listen_first).to_le_bytes());
        }
        if layout > 1 {
            w.put([self.unit.sensor, self.unit.radar_id]);
            w.put(self.unit.max_delay_ms.to_le_bytes());
            w.put(self.unit.serial_baud.to_le_bytes());
            let far_road = self.visibility.far_road_deg;
            let [said, towards] = far_road.map_or([0, 0], |degrees| [1, degrees.cast_unsigned()]);
            let said = said | u8::from(self.unit.learn_lanes) << 1;
            w.put([self.unit.configure_radar as u8, u8::from(self.unit.supervise), said, towards]);
        }
        if let Some((body, sum)) = block.split_last_chunk_mut::<SUM_LEN>() {
            *sum = fingerprint(body).to_le_bytes();
        }
    }

    /// Reads a block with its sequence; bytes after it do not matter. Its parameters may be anything: whether
    /// a unit can run with them is `SettingsCheck`'s to say. What layout 1 does not say is by default.
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
        let expected = length_of(layout).ok_or(BlockError::Layout(layout))?;
        let length = header.u16().ok_or(BlockError::Short)?;
        let block = bytes.get(..expected).filter(|_| usize::from(length) == expected).ok_or(BlockError::Short)?;
        let (body, sum) = block.split_last_chunk::<SUM_LEN>().ok_or(BlockError::Short)?;
        if fingerprint(body) != u32::from_le_bytes(*sum) {
            return Err(BlockError::CheckSum);
        }
        let sequence = header.u32().ok_or(BlockError::Short)?;
        let mut settings = Self::read(&mut header).ok_or(BlockError::Short)?;
        if layout > 1 {
            let (unit, far_road_deg) = unit(&mut header).ok_or(BlockError::Short)?.map_err(BlockError::Parameter)?;
            (settings.unit, settings.visibility.far_road_deg) = (unit, far_road_deg);
        }
        Ok((sequence, settings))
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
        let visibility = VisibilityConfig {
            slice_height_m: r.f32()?,
            visible_from: r.f32()?,
            occupied_from: r.f32()?,
            far_road_deg: None,
        };
        let health = HealthConfig { hold_s: r.f32()?, blind_after_s: r.f32()?, reset_gap_s: r.f32()? };
        let bus = |r: &mut Reader| {
            Some(BusConfig { bit_rate: r.u32()?, sample_point_permille: r.u16()?, listen_first: r.u16()? != 0 })
        };
        let (radar_bus, broadcast_bus) = (bus(r)?, bus(r)?);
        let of = Self { radar_bus, broadcast_bus, ..Self::of(Sensor { mount, field_of_view, noise }) };
        Some(Self { gate, visibility, health, ..of })
    }
}

/// Bytes of a block of this layout, where it is known.
const fn length_of(layout: u16) -> Option<usize> {
    match layout {
        1 => Some(LAYOUT_1_LEN),
        LAYOUT => Some(BLOCK_LEN),
        _ => None,
    }
}

/// Whether a block says nothing of the unit itself.
pub(super) fn is_layout_1(block: &[u8]) -> bool {
    layout(block) == Some(1)
}

/// Bytes of the block that a slot begins with; 0 without one.
pub(super) fn length(slot: &[u8]) -> usize {
    layout(slot).and_then(length_of).unwrap_or(0)
}

fn layout(block: &[u8]) -> Option<u16> {
    let mut r = Reader(block);
    r.take().filter(|magic| *magic == MAGIC).and_then(|_| r.u16())
}

/// The unit's own figures, and where the far road lies.
fn unit(r: &mut Reader) -> Option<Result<(UnitConfig, Option<i8>), ConfigError>> {
    let [sensor, radar_id] = r.take()?;
    let (max_delay_ms, serial_baud) = (r.u16()?, r.u32()?);
    let [number, supervise, said, towards] = r.take()?;
    let refused = |parameter, number, max| {
        let problem = Problem::OutOfLimits { min: 0.0, max };
        Err(ConfigError { parameter, value: f32::from(number), problem })
    };
    let Some(configure_radar) = ConfigureRadar::from_number(number) else {
        return Some(refused("unit.configure_radar", number, 2.0));
    };
    if supervise > 1 {
        return Some(refused("unit.supervise", supervise, 1.0));
    }
    if said > 3 {
        return Some(refused("unit.flags", said, 3.0));
    }
    let (supervise, learn_lanes) = (supervise == 1, said & 2 != 0);
    let far_road_deg = (said & 1 != 0).then_some(towards.cast_signed());
    let unit = UnitConfig { sensor, radar_id, max_delay_ms, serial_baud, configure_radar, supervise, learn_lanes };
    Some(Ok((unit, far_road_deg)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::fusion::FixturesConfig;

    /// A block as firmware before layout 2 wrote it.
    pub fn layout_1(settings: &Settings, sequence: u32) -> [u8; LAYOUT_1_LEN] {
        let mut block = [0; LAYOUT_1_LEN];
        settings.write(1, sequence, &mut block);
        block
    }

    pub fn settings() -> Settings {
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
        let configure_radar = ConfigureRadar::Objects;
        let unit = UnitConfig { sensor: 3, radar_id: 1, max_delay_ms: 120, serial_baud: 921_600, ..s.unit };
        s.unit = UnitConfig { configure_radar, supervise: true, learn_lanes: true, ..unit };
        s.visibility.far_road_deg = Some(-3);
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
    fn a_block_of_layout_1_is_read_and_says_nothing_of_the_unit() {
        let (old, unit) = (layout_1(&settings(), 7), UnitConfig::default());
        assert_eq!((old.len(), old[4], old[6]), (148, 1, 148));
        let visibility = VisibilityConfig { far_road_deg: None, ..settings().visibility };
        assert_eq!(Settings::from_block(&old), Ok((7, Settings { unit, visibility, ..settings() })));
        let padded: [u8; BLOCK_LEN] = core::array::from_fn(|k| old.get(k).copied().unwrap_or(0xFF));
        assert_eq!(Settings::from_block(&padded), Settings::from_block(&old), "in a slot of today's length");
        // neither layout passes for the other
        let mut relabelled = settings().to_block(7);
        relabelled[4] = 1;
        assert_eq!(Settings::from_block(&relabelled), Err(BlockError::Short));
    }

    #[test]
    fn the_fingerprint_is_of_what_maps_depend_on() {
        let (a, mut b) = (settings(), settings());
        let far_road = |far_road_deg| Settings { visibility: VisibilityConfig { far_road_deg, ..a.visibility }, ..a };
        let plain = Settings { unit: UnitConfig::default(), ..far_road(None) };
        assert_eq!(plain.fingerprint(), fingerprint(&layout_1(&a, 0)[..LAYOUT_1_LEN - SUM_LEN]));
        b.unit = UnitConfig { supervise: true, learn_lanes: true, ..UnitConfig::default() };
        assert_eq!(a.fingerprint(), b.fingerprint());
        b.unit.supervise = false;
        assert_ne!(a.fingerprint(), b.fingerprint(), "which sectors are known");
        b.unit = UnitConfig { supervise: true, learn_lanes: false, ..b.unit };
        assert_ne!(a.fingerprint(), b.fingerprint(), "which lanes are known");
        b.unit.learn_lanes = true;
        b.sensor.mount.height_m += 0.5;
        assert_ne!(a.fingerprint(), b.fingerprint());
        // of lanes each point, each end and the order
        let of = |lanes| Settings { lanes, ..a }.fingerprint();
        let over = |ground| Settings { ground, ..a }.fingerprint();
        let all = [
            a.fingerprint(),
            of(&[&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0], [6.0, 7.0]]]),
            of(&[&[[0.0, 1.0], [2.0, 3.0]], &[[4.0, 5.0], [6.0, 7.0]]]),
            of(&[&[[4.0, 5.0], [6.0, 7.0]], &[[0.0, 1.0], [2.0, 3.0]]]),
            of(&[&[[1.0, 0.0], [2.0, 3.0]], &[[4.0, 5.0], [6.0, 7.0]]]),
            of(&[&[[0.0, 1.0], [2.0, 3.0]]]),
            over(&[[0.0, 1.0], [2.0, 3.0]]),
            over(&[[0.0, 1.0], [2.0, 3.5]]),
            over(&[[0.0, 1.0]]),
            far_road(None).fingerprint(),
            far_road(Some(0)).fingerprint(),
            far_road(Some(3)).fingerprint(),
        ];
        assert!((1..all.len()).all(|k| !all[..k].contains(&all[k])), "{all:x?}");
    }

    #[test]
    fn the_fingerprint_is_of_what_was_tuned_and_of_where_it_stands() {
        let a = settings();
        let obstacles = |change: fn(&mut ObstacleConfig)| {
            let mut config = ObstacleConfig::default();
            change(&mut config);
            Settings { obstacles: Some(std::boxed::Box::leak(std::boxed::Box::new(config))), ..a }
        };
        static GAIN: EvidenceConfig = EvidenceConfig { gain: 0.25, clearing: 0.3, ..EVIDENCE };
        static SWAPPED: EvidenceConfig = EvidenceConfig { gain: 0.3, clearing: 0.25, ..EVIDENCE };
        const EVIDENCE: EvidenceConfig = EvidenceConfig {
            gain: 0.0,
            clearing: 0.0,
            hidden_memory_s: 5.0,
            visible_memory_s: 1.0,
            height_prior_m: 0.5,
            height_prior_sigma_m: 0.4,
        };
        let all = [
            a,
            obstacles(|_| ()),
            obstacles(|c| c.min_speed_mps = 2.5),
            obstacles(|c| c.gap_m = 2.5),
            obstacles(|c| c.sizes.points[3].height_m = 3.9),
            obstacles(|c| c.sizes.min_length_m = 3.0),
            Settings { evidence: Some(&GAIN), ..a },
            Settings { evidence: Some(&SWAPPED), ..a },
        ];
        let all = all.map(|settings| settings.fingerprint());
        assert!((1..all.len()).all(|k| !all[..k].contains(&all[k])), "{all:x?}");
        // and they are what the estimator runs with
        assert_eq!(obstacles(|c| c.gap_m = 2.5).radar_3d().obstacles.gap_m, 2.5);
        assert_eq!(Settings { evidence: Some(&GAIN), ..a }.radar_3d().evidence.clearing, 0.3);
    }

    #[test]
    fn the_fingerprint_is_of_each_number_that_fixtures_are_watched_with() {
        let a = settings();
        let fixtures = |change: fn(&mut FixturesConfig)| {
            let mut config = FixturesConfig::default();
            change(&mut config);
            Settings { fixtures: Some(std::boxed::Box::leak(std::boxed::Box::new(config))), ..a }.fingerprint()
        };
        assert_eq!(a.fingerprint(), fixtures(|_| ()), "supervised by the usual numbers");
        let all = [
            fixtures(|_| ()),
            fixtures(|c| c.window_ms += 1),
            fixtures(|c| c.learned_windows += 1),
            fixtures(|c| c.least_share += 0.1),
            fixtures(|c| c.blind_windows += 1),
            fixtures(|c| c.weaker_db += 0.5),
            fixtures(|c| c.fewer_share += 0.1),
            fixtures(|c| c.turned_deg += 0.1),
            // two of them the other way round
            fixtures(|c| (c.least_share, c.fewer_share) = (c.fewer_share, c.least_share)),
        ];
        assert!((1..all.len()).all(|k| !all[..k].contains(&all[k])), "{all:x?}");
    }
}
