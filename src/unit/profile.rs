//! The two sizes of radar-3d a unit is built in, so that boards and hosts name one and not its numbers.

macro_rules! size {
    ($(#[$doc:meta])* $name:ident, $ranges:literal, $azimuths:literal, $elevations:literal, $obstacles:literal, $detections:literal) => {
        $(#[$doc])*
        pub mod $name {
            use crate::estimator::Estimator;

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
            /// Whether a unit of this size can run with settings.
            pub const CHECK: crate::unit::settings::Check = crate::unit::settings::Check::of::<State, Sender>();

            /// The estimator.
            pub type State = crate::radar_3d::Radar3d<RANGES, AZIMUTHS, ELEVATIONS, WORDS, OBSTACLES, DETECTIONS>;
            /// What it works with.
            pub type Parameters = <State as Estimator>::Parameters;
            /// Its map.
            pub type Map = <State as Estimator>::Map;
            /// Who sends it.
            pub type Sender = crate::wire::broadcast::Broadcaster<AZIMUTHS, WORDS>;
            /// All of them together.
            pub type Unit<'a> = crate::unit::Unit<'a, State, Sender>;
            /// A radar of the ARS408 family with as many detections.
            pub type Radar = crate::inputs::ars408::Ars408<DETECTIONS>;
            /// The loop around unit and radar on hardware of its own.
            pub type Roadside<'a> = crate::unit::roadside::Roadside<'a, State, Sender, Radar>;
        }
    };
}

size!(
    /// 200 x 120 x 16 cells: parts with 512 kB.
    reference, 200, 120, 16, 96, 256
);
size!(
    /// 100 x 64 x 8 cells: parts with 128 kB.
    small, 100, 64, 8, 28, 176
);
