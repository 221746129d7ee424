//! The two sizes a unit is built in, so that boards and hosts name one and not its numbers.

/// 200 x 120 x 16 cells: parts with 512 kB.
pub mod reference {
    /// Range cells.
    pub const RANGES: usize = 200;
    /// Azimuths.
    pub const AZIMUTHS: usize = 120;
    /// Elevation rows.
    pub const ELEVATIONS: usize = 16;
    /// Words of 32 range cells.
    pub const WORDS: usize = RANGES.div_ceil(32);
    /// Moving obstacles.
    pub const OBSTACLES: usize = 64;
    /// Detections a scan.
    pub const DETECTIONS: usize = 256;

    /// What a board of this size says of itself.
    pub const fn opening(ticks_per_256: u32) -> crate::pil::record::Opening {
        crate::pil::record::Opening::of::<RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>(ticks_per_256)
    }

    /// The estimator.
    pub type State = crate::radar_3d::ReferenceProfile;
    /// What it works with.
    pub type Parameters = crate::radar_3d::Radar3dParameters<RANGES, AZIMUTHS, ELEVATIONS>;
    /// Its map.
    pub type Map = crate::polar::PolarMap<RANGES, AZIMUTHS>;
    /// Who sends it.
    pub type Sender = crate::wire::broadcast::Broadcaster<AZIMUTHS, WORDS>;
    /// All of them together.
    pub type Unit<'a> = crate::unit::Unit<'a, RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
    /// The loop around them on hardware of its own.
    pub type Roadside<'a> =
        crate::unit::roadside::Roadside<'a, DETECTIONS, RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
}

/// 100 x 64 x 8 cells: parts with 128 kB.
pub mod small {
    /// Range cells.
    pub const RANGES: usize = 100;
    /// Azimuths.
    pub const AZIMUTHS: usize = 64;
    /// Elevation rows.
    pub const ELEVATIONS: usize = 8;
    /// Words of 32 range cells.
    pub const WORDS: usize = RANGES.div_ceil(32);
    /// Moving obstacles.
    pub const OBSTACLES: usize = 28;
    /// Detections a scan.
    pub const DETECTIONS: usize = 176;

    /// What a board of this size says of itself.
    pub const fn opening(ticks_per_256: u32) -> crate::pil::record::Opening {
        crate::pil::record::Opening::of::<RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>(ticks_per_256)
    }

    /// The estimator.
    pub type State = crate::radar_3d::SmallProfile;
    /// What it works with.
    pub type Parameters = crate::radar_3d::Radar3dParameters<RANGES, AZIMUTHS, ELEVATIONS>;
    /// Its map.
    pub type Map = crate::polar::PolarMap<RANGES, AZIMUTHS>;
    /// Who sends it.
    pub type Sender = crate::wire::broadcast::Broadcaster<AZIMUTHS, WORDS>;
    /// All of them together.
    pub type Unit<'a> = crate::unit::Unit<'a, RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
    /// The loop around them on hardware of its own.
    pub type Roadside<'a> =
        crate::unit::roadside::Roadside<'a, DETECTIONS, RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
}
