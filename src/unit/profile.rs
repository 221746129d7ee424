//! The two sizes of radar-3d a unit is built in, so that boards and hosts name one and not its numbers.

macro_rules! size {
    ($(#[$doc:meta])* $name:ident, $ranges:literal, $azimuths:literal, $elevations:literal, $obstacles:literal, $detections:literal) => {
        $(#[$doc])*
        pub mod $name {
            use crate::estimator::Estimator;
            use crate::radar_3d::Radar3d;
            use crate::wire::broadcast::Broadcaster;

            /// Words of 32 range cells.
            const WORDS: usize = usize::div_ceil($ranges, 32);

            /// The estimator.
            pub type State = Radar3d<$ranges, $azimuths, $elevations, WORDS, $obstacles, $detections>;
            /// What it works with.
            pub type Parameters = <State as Estimator>::Parameters;
            /// Its map.
            pub type Map = <State as Estimator>::Map;
            /// Who sends it.
            pub type Sender = Broadcaster<$azimuths, WORDS>;
            /// A radar of the ARS408 family with as many detections.
            #[cfg(feature = "board")]
            pub type Radar = crate::inputs::ars408::Ars408<$detections>;
            /// Whether a unit of this size can run with settings.
            #[cfg(feature = "board")]
            pub const CHECK: crate::unit::settings::SettingsCheck =
                crate::unit::settings::SettingsCheck::of::<State, Sender>();
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
