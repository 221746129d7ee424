// Links of the front page lead to files beside it; here to the pages that rustdoc makes of these.
#![doc = "[wire]: specification/index.html"]
#![doc = "[cameras]: cameras/index.html"]
#![doc = "[extending]: extending/index.html"]
#![doc = "[fusion]: mod@crate::fusion"]
#![doc = "[inputs]: mod@crate::inputs"]
#![doc = "[bus]: mod@crate::wire"]
#![doc = include_str!("README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![warn(clippy::indexing_slicing, clippy::cast_possible_truncation)]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]
#![warn(unnameable_types)]

#[cfg(test)]
extern crate std;

#[cfg(feature = "bench")]
pub mod bench;
#[cfg(doc)]
#[doc = include_str!("EXTENDING.md")]
pub mod extending {}
#[cfg(doc)]
#[doc = include_str!("camera/CAMERAS.md")]
pub mod cameras {}
#[cfg(doc)]
#[doc = include_str!("wire/SPECIFICATION.md")]
pub mod specification {}

// Every stage is public, in the order of the data; the front page says which names are stable.
pub mod camera;
pub mod estimator;
pub mod fixed;
pub mod frame;
pub mod fusion;
pub mod grid;
pub mod inputs;
pub mod map;
pub mod obstacles;
pub mod probability;
pub mod radar_2d;
pub mod radar_3d;
pub mod sensor;
pub mod unit;
pub mod wire;

// A sensor and one frame of it.
pub use fixed::angle::Angle;
pub use fixed::time::Time;
pub use frame::detection::{Detection, Measurement, NotADetection};
pub use frame::health::{Condition, Continuity, FrameStatus};
pub use sensor::Sensor;
pub use sensor::config::{ConfigError, Problem};
pub use sensor::field_of_view::FieldOfView;
pub use sensor::mount::Mount;
pub use sensor::noise::NoiseConfig;
pub use sensor::road::RoadPoint;

// Estimators and what can be set of them.
pub use camera::boxes::{ImageBox, VehicleClass};
pub use camera::calibration::{Calibration, Intrinsics, PointPair};
pub use camera::{Camera3d, Camera3dConfig, Camera3dParameters};
pub use estimator::{ESTIMATOR_VERSION, Estimator, Progress};
pub use frame::gate::GateConfig;
pub use frame::health::HealthConfig;
pub use grid::evidence::EvidenceConfig;
pub use grid::settling::SettlingConfig;
pub use obstacles::config::ObstacleConfig;
pub use radar_3d::{Radar3d, Radar3dConfig, Radar3dParameters, VisibilityConfig};

// Maps and questions to them.
pub use map::polar::PolarMap;
pub use map::query;
pub use map::resample::RoadGrid;
pub use map::{CellState, Visibility, VisibilityMap};

// Maps on a bus: sender and receiver.
pub use wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
pub use wire::frame::{CanFrame, CanId};
pub use wire::header::Header;
pub use wire::message::{Addresses, Epoch};
pub use wire::receive::{Receiver, ReceiverLimits};
pub use wire::serial::{MOST_STUFFED, Unstuffer};
pub use wire::status::{Reason, ResetCause, Status, UnitState};
#[cfg(feature = "secoc")]
pub use wire::{
    receive::SecuredReceiver,
    secoc::{Key, Sealer},
};

// Radars.
pub use inputs::ars408::{Ars408, Ars408Config, quality::Ars408Wanted};
pub use inputs::native::{NativeConfig, NativeMedium, NativeReceiver, NativeSender};
pub use inputs::ti::{Ti, TiAngleUnit, TiConfig, TiDialect, TiFamily};
pub use inputs::{Feed, Frame};

// A unit: radar in, maps out, as an integrator set it up.
pub use unit::can_bus::BusConfig;
pub use unit::profile::{reference, small};
pub use unit::settings::Settings;
pub use unit::{InUnit, MapSender, Unit};

/// What it takes to build a unit, on a controller or as a service: its loop, buses, lines and stored settings.
#[cfg(feature = "board")]
pub mod board {
    // a radar's own settings, and what its decoder says of each piece
    pub use crate::inputs::ars408::{
        Ars408Outcome, configuration::Ars408Configuration, profile::Ars408Profile, upkeep::Ars408Upkeep,
    };
    pub use crate::inputs::native::NativeOutcome;
    pub use crate::inputs::ti::TiOutcome;

    // buses and lines
    pub use crate::unit::can_bus::{BitTiming, BusKeeper, CanPort};
    pub use crate::unit::frame_queue::FrameQueue;
    pub use crate::unit::serial_service::SerialLine;

    // settings that outlast a restart, and the service that sets them
    pub use crate::unit::can_service::{CanService, CanServiceConfig};
    pub use crate::unit::identity::Identity;
    pub use crate::unit::session::SerialSession;
    pub use crate::unit::settings::{
        BLOCK_LEN, BlockError, ConfigureRadar, FlashSlots, SettingsCheck, SettingsSlots, StoredSettings, UnitConfig,
    };

    // the loop
    pub use crate::unit::Flow;
    pub use crate::unit::radar_clock::RadarClock;
    pub use crate::unit::roadside::{
        FaultySlots, ResetFlags, Roadside, RoadsideMemory, RoadsidePorts, RoadsideStart, SerialPort,
    };
    pub use crate::unit::status_output::StatusOutput;
    pub use crate::unit::timing::CycleCounter;
}
