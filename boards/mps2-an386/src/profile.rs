//! Size of the grid this image is built for.

#[cfg(not(feature = "small"))]
mod size {
    pub type State = viewshed::radar_3d::ReferenceProfile;
    pub const RANGES: usize = 200;
    pub const AZIMUTHS: usize = 120;
    pub const ELEVATIONS: usize = 16;
    /// Words of 32 range cells.
    pub const WORDS: usize = 7;
}

#[cfg(feature = "small")]
mod size {
    pub type State = viewshed::radar_3d::SmallProfile;
    pub const RANGES: usize = 100;
    pub const AZIMUTHS: usize = 64;
    pub const ELEVATIONS: usize = 8;
    /// Words of 32 range cells.
    pub const WORDS: usize = 4;
}

pub use size::*;

pub type Parameters = viewshed::radar_3d::Radar3dParameters<RANGES, AZIMUTHS, ELEVATIONS>;
pub type Map = viewshed::polar::PolarMap<RANGES, AZIMUTHS>;
pub type Sender = viewshed::wire::broadcast::Broadcaster<AZIMUTHS, WORDS>;
