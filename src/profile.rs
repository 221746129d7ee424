//! The two sizes a unit is built in, so that boards and hosts name one and not its numbers.

macro_rules! size {
    ($(#[$doc:meta])* $name:ident, $state:ty, $ranges:literal, $azimuths:literal, $elevations:literal, $obstacles:literal, $detections:literal) => {
        $(#[$doc])*
        pub mod $name {
            /// Range cells.
            pub const RANGES: usize = $ranges;
            /// Azimuths.
            pub const AZIMUTHS: usize = $azimuths;
            /// Elevation rows.
            pub const ELEVATIONS: usize = $elevations;
            /// Words of 32 range cells.
            pub const WORDS: usize = RANGES.div_ceil(32);
            /// Moving obstacles.
            pub const OBSTACLES: usize = $obstacles;
            /// Detections a scan.
            pub const DETECTIONS: usize = $detections;

            /// What a board of this size says of itself.
            pub const fn opening(ticks_per_256: u32) -> crate::pil::record::Opening {
                crate::pil::record::Opening::of::<RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>(ticks_per_256)
            }

            /// Whether a unit of this size can run with settings.
            pub const CHECK: crate::unit::stored::Check =
                crate::unit::stored::Check::of::<RANGES, AZIMUTHS, ELEVATIONS, WORDS>();

            /// The estimator.
            pub type State = $state;
            /// What it works with.
            pub type Parameters = crate::radar_3d::Radar3dParameters<RANGES, AZIMUTHS, ELEVATIONS>;
            /// Its map.
            pub type Map = crate::map::polar::PolarMap<RANGES, AZIMUTHS>;
            /// Who sends it.
            pub type Sender = crate::wire::broadcast::Broadcaster<AZIMUTHS, WORDS>;
            /// All of them together.
            pub type Unit<'a> = crate::unit::Unit<'a, RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
            /// The loop around them on hardware of its own.
            pub type Roadside<'a> =
                crate::unit::roadside::Roadside<'a, DETECTIONS, RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
        }
    };
}

size!(
    /// 200 x 120 x 16 cells: parts with 512 kB.
    reference, crate::radar_3d::ReferenceProfile, 200, 120, 16, 96, 256
);
size!(
    /// 100 x 64 x 8 cells: parts with 128 kB.
    small, crate::radar_3d::SmallProfile, 100, 64, 8, 28, 176
);
