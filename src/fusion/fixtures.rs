//! What usually stands where a sensor looks: missing, weaker or elsewhere, something is wrong with the sensor.
//!
//! # Model
//! Posts, masts and signs reflect in every frame, whether or not anything drives. What does not move and is seen in
//! most windows (`window_ms`) of the learning time becomes a fixture, with the place and strength it then has; what is
//! learned stays, so that a slow change is not taken for usual. From then on, each window, of the fixtures that the
//! sensor's own map calls visible:
//!
//! | what | is said of | from |
//! |---|---|---|
//! | blind | a sector | `blind_windows` more windows without any of its fixtures, where two should be, nor much else, than with |
//! | weaker | the sensor | the mean fall of their strength, over some minutes |
//! | fewer | the sensor | the share of them that is seen, against the share usually seen |
//! | turned, tilted | the sensor | the mean shift of their azimuths, of their elevations |
//!
//! Where a sensor detects anything a few times in a window, it is not blind there: what was learned as standing may have
//! been a vehicle that waited, and has left.
//!
//! A difference counts up to four times its limit, so that one wrong match weighs little, and is believed in until it
//! has sunk to half the limit, which is the hysteresis. A fixture in a shadow, as behind a lorry that waits, is not
//! asked for.
//!
//! # Limits
//! `N` fixtures, the most often seen; 1.6 kB with 64 of them and six sectors. A mount that is wrong from the first day
//! is learned as it is: other sensors tell ([`Alignment`](crate::fusion::alignment::Alignment)). Learning should see some minutes of a
//! sensor in order.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::time::Time;
use crate::fixed::trig;
use crate::frame::detection::Detection;
use crate::map::azimuths::Columns;
use crate::sensor::config::{ConfigError, within};
use crate::sensor::mount::{Levelling, Mount};
use crate::sensor::road::RoadPoint;

use super::polar::edges;
use super::window::Window;

/// What is learned, and from when a difference is named.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct FixturesConfig {
    /// Length of a window, ms.
    pub window_ms: u16,
    /// Windows of the learning time.
    pub learned_windows: u16,
    /// Least share of them in which a fixture is seen.
    pub least_share: f32,
    /// Windows without any of the expected fixtures that make a sector blind.
    pub blind_windows: u16,
    /// Fall of the strength that is named, dB.
    pub weaker_db: f32,
    /// Share of the fixtures usually seen that has to be missing for it to be named.
    pub fewer_share: f32,
    /// Turn or tilt that is named, degrees.
    pub turned_deg: f32,
}

impl Default for FixturesConfig {
    fn default() -> Self {
        Self {
            window_ms: 1000,
            learned_windows: 120,
            least_share: 0.7,
            blind_windows: 6,
            weaker_db: 3.0,
            fewer_share: 0.4,
            turned_deg: 0.4,
        }
    }
}

#[cfg(feature = "monitoring")]
impl FixturesConfig {
    /// Every number of it, in the order of the fields, for fingerprints.
    pub(crate) fn numbers(&self) -> [f32; 7] {
        let &Self { window_ms, learned_windows, least_share, blind_windows, weaker_db, fewer_share, turned_deg } = self;
        let [window, learned, blind] = [window_ms, learned_windows, blind_windows].map(f32::from);
        [window, learned, least_share, blind, weaker_db, fewer_share, turned_deg]
    }
}

/// What is slower along the line of sight may stand, cm/s.
const STANDS_CM_S: u16 = 25;
/// A reflection this near to a fixture is of it: along the line of sight, centimetres.
const SAME_RANGE_CM: u16 = 120;
/// The same across it, 2^-16 turns: 2.5 degrees, more than any turn that is to be found.
const SAME_AZIMUTH: i16 = 455;
/// Detections of whatever else in a window that show a sector not to be blind; fewer may be false alarms.
const OTHERS: u8 = 3;
/// Fixtures that have to be expected in a sector for their absence to mean anything, 2^-8.
const EXPECTED: u32 = 2 << 8;
/// Fraction bits of the means.
const FRACTION: u32 = 8;
/// Windows over which turns and tilts are averaged, as a power of two, and strength and shares.
const TURN_MEMORY: u32 = 4;
const STRENGTH_MEMORY: u32 = 6;

/// Where one stands and how strong it is; means while it is learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Landmark {
    range_cm: u16,
    /// 2^-16 turns.
    azimuth: i16,
    elevation: Option<i16>,
    /// RCS, or SNR of a radar that gives none, half dB.
    strength: Option<i16>,
    /// Windows in which it was seen.
    seen: u16,
    /// In the running window: detections, and the sum of their differences from what is said above, clipped.
    count: u8,
    shifts: [i16; 3],
}

const AZIMUTH: usize = 0;
const ELEVATION: usize = 1;
const STRENGTH: usize = 2;
/// Detections of a fixture that count in a window.
const MOST_DETECTIONS: u8 = 8;

impl Landmark {
    fn of(d: &Detection) -> Self {
        Self {
            range_cm: d.range_cm,
            azimuth: d.azimuth.raw(),
            elevation: d.elevation.map(Angle::raw),
            strength: strength(d),
            seen: 0,
            count: 1,
            shifts: [0; 3],
        }
    }

    fn is_near(&self, d: &Detection) -> bool {
        self.range_cm.abs_diff(d.range_cm) <= SAME_RANGE_CM
            && d.azimuth.raw().wrapping_sub(self.azimuth).unsigned_abs() <= SAME_AZIMUTH.unsigned_abs()
    }

    fn take(&mut self, d: &Detection, most: [i16; 3]) {
        if self.count >= MOST_DETECTIONS {
            return;
        }
        self.count += 1;
        let difference = |new: Option<i16>, old: Option<i16>| new.zip(old).map_or(0, |(a, b)| a.wrapping_sub(b));
        let new = [
            d.azimuth.raw().wrapping_sub(self.azimuth),
            difference(d.elevation.map(Angle::raw), self.elevation),
            difference(strength(d), self.strength),
        ];
        for ((sum, new), most) in self.shifts.iter_mut().zip(new).zip(most) {
            // not `clamp`, which asks whether the limits are in order
            *sum = sum.saturating_add(new.max(most.saturating_neg()).min(most));
        }
    }

    /// Mean differences of the window that ends.
    fn mean(&self) -> [i16; 3] {
        self.shifts.map(|sum| sum.checked_div(i16::from(self.count)).unwrap_or(0))
    }
}

fn strength(d: &Detection) -> Option<i16> {
    d.rcs_half_dbsm.or(d.snr_half_db)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Sector {
    /// Windows without any fixture, less those with.
    missed: u16,
    /// Detections of anything else in the running window, saturating.
    others: u8,
    blind: bool,
    /// Whether enough were expected in the last window.
    expects: bool,
}

impl Sector {
    const NEW: Self = Self { missed: 0, others: 0, blind: false, expects: false };
}

/// A mean difference, and whether it is believed in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Level {
    /// 2^-8.
    mean: i32,
    limit: i32,
    named: bool,
}

impl Level {
    const fn new(limit: i32) -> Self {
        Self { mean: 0, limit, named: false }
    }

    /// Moves on by a window of this mean difference, whole units.
    fn step(&mut self, mean: i32, memory: u32) {
        self.mean += ((mean << FRACTION) - self.mean) >> memory;
        let (size, limit) = (self.mean.abs(), self.limit << FRACTION);
        self.named = size >= if self.named { limit / 2 } else { limit };
    }

    fn said(&self) -> Option<i16> {
        if self.named { i16::try_from(self.mean >> FRACTION).ok() } else { None }
    }
}

/// A sensor's mount and view, and from when a difference is named, checked and in integers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FixturesLimits {
    levelling: Levelling,
    right: Angle,
    span: u16,
    window_ms: u16,
    learned_windows: u16,
    least_seen: u16,
    blind_windows: u16,
    /// Of turns and tilts, 2^-16 turns, and of the strength, half dB.
    levels: [i16; 3],
    /// 2^-8.
    fewer: i16,
}

impl FixturesLimits {
    /// For a sensor by its mount and the edges of its view from its heading, degrees, + left.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within limits
    pub fn new(mount: &Mount, azimuth_deg: [f32; 2], config: &FixturesConfig) -> Result<Self, ConfigError> {
        let (right, span) = edges(azimuth_deg)?;
        within("fixtures.window_ms", f32::from(config.window_ms), 100.0, 60_000.0)?;
        let windows = within("fixtures.learned_windows", f32::from(config.learned_windows), 8.0, 10_000.0)?;
        let share = within("fixtures.least_share", config.least_share, 0.1, 1.0)?;
        within("fixtures.blind_windows", f32::from(config.blind_windows), 2.0, 1000.0)?;
        let weaker = 2.0 * within("fixtures.weaker_db", config.weaker_db, 1.0, 30.0)?;
        let fewer = 256.0 * within("fixtures.fewer_share", config.fewer_share, 0.1, 0.9)?;
        let turned = 65_536.0 / 360.0 * within("fixtures.turned_deg", config.turned_deg, 0.1, 2.0)?;
        Ok(Self {
            levelling: mount.levelling()?,
            right,
            span,
            window_ms: config.window_ms,
            learned_windows: config.learned_windows,
            least_seen: math::round_i32(share * windows) as u16,
            blind_windows: config.blind_windows,
            levels: [turned, turned, weaker].map(|limit| math::round_i32(limit) as i16),
            fewer: math::round_i32(fewer) as i16,
        })
    }
}

/// What stands in the view of one sensor, in `K` sectors from right to left.
#[derive(Debug, Clone)]
pub struct Fixtures<const N: usize, const K: usize> {
    limits: FixturesLimits,
    window: Window,
    windows: u16,
    fixtures: heapless::Vec<Landmark, N>,
    sectors: [Sector; K],
    levels: [Level; 3],
    /// Share of the fixtures that is missing, 2^-8 of those usually seen.
    missing: Level,
}

impl<const N: usize, const K: usize> Fixtures<N, K> {
    /// Of no radar: nothing is learned. All bytes are 0.
    pub(super) const NOTHING: Self = Self {
        limits: FixturesLimits {
            levelling: Levelling::NOWHERE,
            right: Angle::ZERO,
            span: 0,
            window_ms: 0,
            learned_windows: 0,
            least_seen: 0,
            blind_windows: 0,
            levels: [0; 3],
            fewer: 0,
        },
        window: Window::of_ms(0),
        windows: 0,
        fixtures: heapless::Vec::new(),
        sectors: [Sector::NEW; K],
        levels: [Level::new(0); 3],
        missing: Level::new(0),
    };

    /// For a sensor by its mount and the edges of its view from its heading, degrees, + left.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    pub fn new(mount: &Mount, azimuth_deg: [f32; 2], config: &FixturesConfig) -> Result<Self, ConfigError> {
        let mut new = Self::NOTHING;
        new.begin(&FixturesLimits::new(mount, azimuth_deg, config)?);
        Ok(new)
    }

    /// Begins to learn what stands in the view of a sensor, in its place: on a controller it is large.
    pub(super) fn begin(&mut self, limits: &FixturesLimits) {
        const { assert!(K > 0 && K <= 64) }
        self.limits = *limits;
        self.window = Window::of_ms(limits.window_ms);
        self.windows = 0;
        self.fixtures.clear();
        self.sectors = [Sector::NEW; K];
        self.levels = limits.levels.map(|limit| Level::new(i32::from(limit)));
        self.missing = Level::new(i32::from(limits.fewer));
    }

    /// Takes one detection of a frame; one that the radar's own marks leave out says nothing.
    pub fn observe(&mut self, detection: &Detection) {
        if detection.marked {
            return;
        }
        let stands = detection.radial_velocity_cm_s.unsigned_abs() <= STANDS_CM_S;
        // of several, the nearest along the line of sight: posts stand in rows
        let near = self.fixtures.iter_mut().filter(|f| stands && f.is_near(detection));
        if let Some(fixture) = near.min_by_key(|f| f.range_cm.abs_diff(detection.range_cm)) {
            // differences of one detection count up to four times what is named
            fixture.take(detection, self.limits.levels.map(|limit| limit.saturating_mul(4)));
            return;
        }
        let sector = self.sector_of(detection.azimuth);
        if let Some(sector) = sector.and_then(|k| self.sectors.get_mut(k)) {
            sector.others = sector.others.saturating_add(1);
        }
        if !stands {
            return;
        }
        if self.is_learning() && self.fixtures.push(Landmark::of(detection)).is_err() {
            // no room: the one that was seen least goes, if it is not one of this window
            let least = self.fixtures.iter_mut().filter(|f| f.count == 0).min_by_key(|f| f.seen);
            if let Some(least) = least.filter(|f| u32::from(f.seen) * 4 < u32::from(self.windows)) {
                *least = Landmark::of(detection);
            }
        }
    }

    /// Closes the window when it is over; `sees` is what the sensor's own map says of a place. Time that steps back
    /// begins a new one.
    pub fn advance(&mut self, now: Time, sees: impl Fn(RoadPoint) -> bool) {
        if !self.window.is_over(now) {
            return;
        }
        if self.is_learning() {
            self.learn();
        } else {
            self.compare(sees);
        }
        for fixture in &mut self.fixtures {
            (fixture.count, fixture.shifts) = (0, [0; 3]);
        }
        self.sectors.iter_mut().for_each(|sector| sector.others = 0);
    }

    fn learn(&mut self) {
        self.windows += 1;
        for fixture in self.fixtures.iter_mut().filter(|f| f.count > 0) {
            fixture.seen = fixture.seen.saturating_add(1);
            // a mean over all windows in which it was seen
            let part =
                |shift: i16| shift.checked_div(i16::try_from(fixture.seen).unwrap_or(i16::MAX).min(16)).unwrap_or(0);
            let [azimuth, elevation, strength] = fixture.mean().map(part);
            fixture.azimuth = fixture.azimuth.wrapping_add(azimuth);
            fixture.elevation = fixture.elevation.map(|v| v.wrapping_add(elevation));
            fixture.strength = fixture.strength.map(|v| v.wrapping_add(strength));
        }
        if !self.is_learning() {
            let least = self.limits.least_seen;
            self.fixtures.retain(|f| f.seen >= least);
        }
    }

    fn compare(&mut self, sees: impl Fn(RoadPoint) -> bool) {
        let (mut expected, mut seen) = ([0_u32; K], [0_u32; K]);
        let (mut sums, mut found) = ([0_i32; 3], 0);
        for fixture in &self.fixtures {
            let direction = trig::direction(Angle::from_raw(fixture.azimuth));
            let ahead = |part: i16| (i32::from(fixture.range_cm) * i32::from(part)) >> 14;
            let sector = self.sector_of(Angle::from_raw(fixture.azimuth));
            if !sees(self.limits.levelling.unplace(ahead(direction.x), ahead(direction.y))) {
                continue;
            }
            let share = (u32::from(fixture.seen) << 8).checked_div(u32::from(self.windows)).unwrap_or(0);
            if let Some((expected, seen)) = sector.and_then(|k| expected.get_mut(k).zip(seen.get_mut(k))) {
                *expected += share;
                *seen += u32::from(fixture.count > 0) << 8;
            }
            if fixture.count > 0 {
                found += 1;
                sums.iter_mut().zip(fixture.mean()).for_each(|(sum, mean)| *sum += i32::from(mean));
            }
        }
        for (sector, (expected, seen)) in self.sectors.iter_mut().zip(expected.iter().zip(&seen)) {
            sector.expects = *expected >= EXPECTED;
            // twice what is needed at most, so that a mended sensor is trusted again soon
            let missed = match *seen > 0 || sector.others >= OTHERS {
                // also where what stands is hidden
                true => sector.missed.saturating_sub(2),
                false if sector.expects => sector.missed + 1,
                false => continue,
            };
            sector.missed = missed.min(2 * self.limits.blind_windows);
            sector.blind = sector.missed >= self.limits.blind_windows || (sector.blind && sector.missed > 0);
        }
        if found > 0 {
            let memories = [TURN_MEMORY, TURN_MEMORY, STRENGTH_MEMORY];
            for ((level, sum), memory) in self.levels.iter_mut().zip(sums).zip(memories) {
                level.step(sum / found, memory);
            }
        }
        let (expected, seen) = (expected.iter().sum::<u32>(), seen.iter().sum::<u32>());
        if expected >= EXPECTED {
            let missing = 256 - ((seen.min(expected) << 8) / expected).min(256);
            self.missing.step(i32::try_from(missing).unwrap_or(0), STRENGTH_MEMORY);
        }
    }

    fn is_learning(&self) -> bool {
        self.windows < self.limits.learned_windows
    }

    fn sector_of(&self, azimuth: Angle) -> Option<usize> {
        Columns::even(self.limits.span, K).column(azimuth - self.limits.right)
    }

    /// Fixtures that were learned; none while they are.
    pub fn learned(&self) -> Option<usize> {
        (!self.is_learning()).then_some(self.fixtures.len())
    }

    /// Whether nothing of what stands in a sector is seen; not of one that does not exist.
    pub fn is_blind(&self, sector: usize) -> bool {
        self.sectors.get(sector).is_some_and(|sector| sector.blind)
    }

    /// Whether any sector is.
    pub fn any_blind(&self) -> bool {
        self.sectors.iter().any(|sector| sector.blind)
    }

    /// Whether the sector of a bearing from the sensor's heading is, or outside of the view the one at that edge.
    pub fn is_blind_at(&self, bearing: Angle) -> bool {
        self.is_blind(Columns::even(self.limits.span, K).nearest(bearing - self.limits.right))
    }

    /// Whether a sector has enough that stands and is not in a shadow for it to be judged.
    pub fn expects(&self, sector: usize) -> bool {
        self.sectors.get(sector).is_some_and(|sector| sector.expects)
    }

    /// How far it was turned to the left since it was learned, if that is to be named.
    pub fn turned(&self) -> Option<Angle> {
        // what stands seems to have gone to the other side
        self.shift(AZIMUTH).map(|shift| Angle::from_raw(shift.wrapping_neg()))
    }

    /// How far it was tilted upwards since it was learned, if that is to be named.
    pub fn tilted(&self) -> Option<Angle> {
        self.shift(ELEVATION).map(|shift| Angle::from_raw(shift.wrapping_neg()))
    }

    /// By how much everything reflects less than it did, half dB, if that is to be named.
    pub fn weaker_half_db(&self) -> Option<i16> {
        self.shift(STRENGTH).filter(|shift| *shift < 0).map(i16::wrapping_neg)
    }

    /// Share of what is usually seen that is missing, 2^-8, if that is to be named.
    pub fn fewer(&self) -> Option<i16> {
        self.missing.said()
    }

    fn shift(&self, which: usize) -> Option<i16> {
        self.levels.get(which).and_then(Level::said)
    }
}
