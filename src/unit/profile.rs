//! The two sizes of radar-3d a unit is built in, and a camera's, so that boards and hosts name one and not its numbers.

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
            /// Who sends it where there may be a table of probabilities.
            #[cfg(feature = "probability")]
            pub type QuantisedSender = crate::unit::quantised::QuantisedSender<$azimuths, WORDS>;
            /// An estimator with its parameters and its map, for one `static`.
            pub type Radar = crate::unit::radar::Radar<$ranges, $azimuths, $elevations, WORDS, $obstacles, $detections>;
            /// A decoder of an ARS408 or one of its kin, with as many detections.
            pub type Ars408 = crate::inputs::ars408::Ars408<$detections>;
            /// Who receives the maps of one sensor of this size.
            pub type Receiver = crate::wire::receive::Receiver<1, $azimuths, WORDS>;
            /// Whether a unit of this size can run with settings.
            #[cfg(feature = "board")]
            pub const CHECK: crate::unit::settings::SettingsCheck =
                crate::unit::settings::SettingsCheck::of::<State, Sender>();

            /// The same, supervised by what stands in the radar's view where the settings say so.
            #[cfg(feature = "monitoring")]
            pub mod supervised {
                use crate::estimator::Estimator;

                pub use super::{Map, Sender};

                /// The estimator.
                pub type State = crate::fusion::Supervised<super::State>;
                /// What it works with.
                pub type Parameters = <State as Estimator>::Parameters;
                pub use super::Ars408;
                /// Whether a unit of this size can run with settings.
                #[cfg(feature = "board")]
                pub const CHECK: crate::unit::settings::SettingsCheck =
                    crate::unit::settings::SettingsCheck::of::<State, Sender>();
            }
        }
    };
}

size!(
    /// 200 x 128 x 12 cells: parts with 512 kB.
    reference, 200, 128, 12, 96, 256
);
size!(
    /// 100 x 96 x 4 cells: parts with 128 kB.
    small, 100, 96, 4, 28, 160
);

/// A camera's unit, 200 m ahead and 30 m to each side.
pub mod camera {
    use crate::camera::{CameraProfile, map};
    use crate::estimator::Estimator;
    use crate::unit::settings::SettingsCheck;
    use crate::wire::broadcast::Broadcaster;

    /// The estimator.
    pub type State = CameraProfile;
    /// What it works with.
    pub type Parameters = <State as Estimator>::Parameters;
    /// Its map.
    pub type Map = <State as Estimator>::Map;
    /// Who sends it.
    pub type Sender = Broadcaster<{ map::AZIMUTHS }, 7>;

    /// Rows ahead, azimuths on the wire, voxels above each other, boxes.
    pub const SHAPE: [usize; 4] = [200, map::AZIMUTHS, 8, crate::camera::MOST_BOXES];

    /// Whether a camera's unit can run with settings.
    pub const CHECK: SettingsCheck = SettingsCheck::of::<State, Sender>();
}
