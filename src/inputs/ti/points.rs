//! Records to detections: units, axes and signs.

use crate::fixed::math;
use crate::frame::detection::{Detection, Measurement, NotADetection};

/// Unit of the angles of spherical points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TiAngleUnit {
    /// What TI's own programs take them for.
    Radians,
    /// What the comment in one SDK says.
    Degrees,
}

/// Points after a 52-byte header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PolarPoints {
    /// Range, azimuth, velocity, ratio: 16 bytes.
    Flat,
    /// With an elevation after the azimuth: 20 bytes.
    Raised,
}

/// What becomes a detection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Entries {
    /// Points: single reflections, what the estimators want.
    Points,
    /// Targets: objects the radar tracks, for a firmware that sends nothing else.
    Targets,
}

/// What a firmware's messages do not say.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TiDialect {
    /// Unit of the angles of spherical points, type 1000.
    pub angles: TiAngleUnit,
    /// Points after a 52-byte header, type 6.
    pub polar_points: PolarPoints,
    /// Whether the antenna measures elevation; where it does not, z is sent as zero.
    pub has_elevation: bool,
    /// Velocity of one Doppler step, m/s: SDK 1 and 2 send the step's number. Their points are left
    /// out without it.
    pub doppler_step_mps: Option<f32>,
    /// What becomes a detection.
    pub entries: Entries,
}

impl TiDialect {
    /// Radians, an antenna with elevation, no Doppler step, points.
    pub const USUAL: Self = Self {
        angles: TiAngleUnit::Radians,
        polar_points: PolarPoints::Flat,
        has_elevation: true,
        doppler_step_mps: None,
        entries: Entries::Points,
    };
}

/// How an item's payload is laid out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Layout {
    /// x, y, z, velocity.
    Cartesian,
    /// Number and binary point, to come.
    IndexedHead,
    /// Indices and coordinates with so many binary places.
    Indexed(u16),
    /// Range, azimuth, elevation, velocity.
    Spherical,
    /// Five units, to come.
    CompressedHead,
    /// Elevation, azimuth, velocity, range, ratio, in these units.
    Compressed([f32; 5]),
    /// Range, azimuth, (elevation,) velocity, ratio.
    Polar(PolarPoints),
    /// Units and numbers, to come.
    ExtendedHead,
    /// x, y, z, velocity, ratio, noise: in these units of place, velocity and ratio, and so many; 0 where it is not announced.
    Extended([f32; 3], u16),
    /// Number, x, y, z, their velocities, and what is of no interest.
    Targets,
    /// The same without z.
    FlatTargets,
    /// Ratios of the points before.
    SideInfo,
}

/// Most bytes of a record that are of interest.
pub(super) const LONGEST_RECORD: usize = 28;

/// What a record holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Record {
    /// What the records after it need.
    Head(Layout),
    Point(Result<Detection, NotADetection>),
    /// Half dB.
    Snr(i16),
}

impl Layout {
    /// Bytes of a record.
    pub(super) const fn record(self) -> usize {
        match self {
            Self::SideInfo | Self::IndexedHead => 4,
            Self::Compressed(_) => 8,
            Self::Indexed(_) => 12,
            Self::Cartesian | Self::Spherical | Self::Polar(PolarPoints::Flat) => 16,
            Self::CompressedHead | Self::ExtendedHead | Self::Polar(PolarPoints::Raised) => 20,
            Self::Extended(..) => 10,
            Self::Targets => 112,
            Self::FlatTargets => 68,
        }
    }

    /// Whether its own count of points is another.
    pub(super) const fn miscounts(self, points: u16) -> bool {
        matches!(self, Self::Extended(_, announced) if announced != 0 && announced != points)
    }

    /// Whether it makes detections or belongs to them, given what is wanted.
    pub(super) const fn wanted(self, entries: Entries) -> bool {
        let target = matches!(self, Self::Targets | Self::FlatTargets);
        target == matches!(entries, Entries::Targets)
    }

    /// Reads a record of [`record`](Self::record) bytes.
    pub(super) fn read(self, bytes: &[u8; LONGEST_RECORD], dialect: &TiDialect) -> Record {
        let float = |n: usize| f32::from_bits(chunk(bytes, 4 * n).map_or(0, u32::from_le_bytes));
        let short = |at: usize| chunk(bytes, at).map_or(0, u16::from_le_bytes);
        let signed = |at: usize| chunk(bytes, at).map_or(0, i16::from_le_bytes);
        let byte = |at: usize| chunk(bytes, at).map_or(0, i8::from_le_bytes);
        match self {
            Self::Cartesian => Record::Point(cartesian([float(0), float(1), float(2)], float(3), None, dialect)),
            Self::IndexedHead => Record::Head(Self::Indexed(short(2).min(15))),
            Self::Indexed(places) => {
                let one = f32::from(1_u16 << places);
                let metres = |at| f32::from(signed(at)) / one;
                let step = dialect.doppler_step_mps.unwrap_or(f32::NAN);
                Record::Point(cartesian([metres(6), metres(8), metres(10)], f32::from(signed(2)) * step, None, dialect))
            }
            Self::Spherical => {
                let unit = match dialect.angles {
                    TiAngleUnit::Radians => 1.0,
                    TiAngleUnit::Degrees => core::f32::consts::PI / 180.0,
                };
                let (azimuth, elevation) = (float(1) * unit, float(2) * unit);
                Record::Point(spherical(float(0), azimuth, Some(elevation), float(3), None, dialect))
            }
            Self::CompressedHead => Record::Head(Self::Compressed([float(0), float(1), float(2), float(3), float(4)])),
            Self::Compressed([elevation, azimuth, velocity, range, ratio]) => Record::Point(spherical(
                f32::from(short(4)) * range,
                f32::from(byte(1)) * azimuth,
                Some(f32::from(byte(0)) * elevation),
                f32::from(signed(2)) * velocity,
                Some(f32::from(short(6)) * ratio),
                dialect,
            )),
            Self::Polar(PolarPoints::Flat) => {
                Record::Point(spherical(float(0), float(1), None, float(2), Some(float(3)), dialect))
            }
            Self::Polar(PolarPoints::Raised) => {
                Record::Point(spherical(float(0), float(1), Some(float(2)), float(3), Some(float(4)), dialect))
            }
            Self::ExtendedHead => {
                let announced = short(16).saturating_add(short(18));
                Record::Head(Self::Extended([float(0), float(1), float(2)], announced))
            }
            Self::Extended([place, velocity, ratio], _) => {
                let metres = |at| f32::from(signed(at)) * place;
                let snr_db = f32::from(u8::from_ne_bytes(byte(8).to_ne_bytes())) * ratio;
                let velocity = f32::from(signed(6)) * velocity;
                Record::Point(cartesian([metres(0), metres(2), metres(4)], velocity, Some(snr_db), dialect))
            }
            Self::Targets => {
                Record::Point(target([float(1), float(2), float(3)], [float(4), float(5), float(6)], dialect))
            }
            Self::FlatTargets => {
                let flat = TiDialect { has_elevation: false, ..*dialect };
                Record::Point(target([float(1), float(2), 0.0], [float(3), float(4), 0.0], &flat))
            }
            Self::SideInfo => Record::Snr(halves(signed(0))),
        }
    }
}

/// Tenths to halves, rounded.
#[allow(clippy::cast_possible_truncation)] // a fifth of 16 bits
fn halves(tenths: i16) -> i16 {
    let tenths = i32::from(tenths);
    ((tenths + 2 * tenths.signum()) / 5) as i16
}

fn chunk<const N: usize>(bytes: &[u8; LONGEST_RECORD], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

/// A target's place and velocity, x to the right, y ahead, z up.
fn target(place: [f32; 3], velocity: [f32; 3], dialect: &TiDialect) -> Result<Detection, NotADetection> {
    let along = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b);
    let radial = along(velocity, place) / math::sqrt(along(place, place));
    cartesian(place, radial, None, dialect)
}

/// A point x to the right, y ahead, z up.
fn cartesian(
    [x, y, z]: [f32; 3],
    velocity: f32,
    snr_db: Option<f32>,
    dialect: &TiDialect,
) -> Result<Detection, NotADetection> {
    let ground = math::sqrt(x * x + y * y);
    Detection::new(&Measurement {
        range_m: math::sqrt(x * x + y * y + z * z),
        azimuth_rad: math::atan2(-x, y),
        elevation_rad: dialect.has_elevation.then(|| math::atan2(z, ground)),
        radial_velocity_mps: velocity,
        rcs_dbsm: None,
        snr_db,
    })
}

/// A point by its angles, azimuth + to the right; `ratio` of signal to noise.
fn spherical(
    range: f32,
    azimuth: f32,
    elevation: Option<f32>,
    velocity: f32,
    ratio: Option<f32>,
    dialect: &TiDialect,
) -> Result<Detection, NotADetection> {
    Detection::new(&Measurement {
        range_m: range,
        azimuth_rad: -azimuth,
        elevation_rad: elevation.filter(|_| dialect.has_elevation),
        radial_velocity_mps: velocity,
        rcs_dbsm: None,
        snr_db: ratio.filter(|ratio| *ratio > 0.0).map(|ratio| 10.0 * math::log10(ratio)),
    })
}
