//! Where a roadside radar can see, and where it is blind.
//!
//! From each radar frame the library estimates which cells of the road have a line of sight to the
//! sensor and which are hidden behind vehicles, so that whoever relies on the sensor knows its blind
//! spots. Integers only after start-up, no allocation, no panics, every loop bounded; time is an
//! argument. The same input gives the same bits on every machine.
//!
//! ```
//! use viewshed::query::{self, Answer, Footprint};
//! use viewshed::{Detection, FieldOfView, Measurement, Mount, NoiseConfig, Radar3dConfig, Radar3dParameters};
//! use viewshed::{RoadPoint, Sensor, Time, small};
//!
//! // a gantry, 6 m up, looking 4 degrees down
//! let sensor = Sensor {
//!     mount: Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 4.0, roll_deg: 0.0 },
//!     field_of_view: FieldOfView {
//!         azimuth_min_deg: -60.0,
//!         azimuth_max_deg: 60.0,
//!         elevation_min_deg: -16.0,
//!         elevation_max_deg: 16.0,
//!         range_min_m: 3.0,
//!         range_max_m: 200.0,
//!     },
//!     noise: NoiseConfig::default(),
//! };
//! let parameters = Radar3dParameters::new(&sensor, &Radar3dConfig::default())?;
//! // on a controller: a static
//! let mut radar = Box::new(small::State::new());
//! let mut map = parameters.map();
//!
//! // one parked truck's reflection, again and again
//! let measured = Measurement {
//!     range_m: 40.0,
//!     azimuth_rad: 0.0,
//!     elevation_rad: Some(-0.05),
//!     radial_velocity_mps: 0.0,
//!     rcs_dbsm: Some(20.0),
//!     snr_db: Some(25.0),
//! };
//! let detection = Detection::new(&measured).expect("finite and in range");
//! for frame in 0..20 {
//!     radar.process(&parameters, Time::from_micros(frame * 66_667), [&detection], false, &mut map);
//! }
//! let ahead = RoadPoint::from_metres(20.0, 0.0)?;
//! assert_eq!(query::point(&map, ahead), Answer::VisibleFree);
//! let behind_the_sensor = RoadPoint::from_metres(-20.0, 0.0)?;
//! assert_eq!(query::point(&map, behind_the_sensor), Answer::Unknown);
//! // is there room for a car in the next lane? (heading and size in degrees and metres)
//! let car = Footprint::new(RoadPoint::from_metres(30.0, 3.5)?, 0.0, 4.6, 1.8)?;
//! assert_eq!(query::area(&map, &car), Answer::VisibleFree);
//! # Ok::<(), viewshed::ConfigError>(())
//! ```
//!
//! # The interface
//!
//! What a user needs, by use. All public names are in the lists at the end of this page; the rest is private.
//!
//! | for | names |
//! |---|---|
//! | a sensor as it is installed, in SI units, checked once | [`Sensor`], [`Mount`], [`FieldOfView`], [`NoiseConfig`], [`RoadPoint`]; errors name the parameter: [`ConfigError`] |
//! | a frame of it | [`Detection`], [`Measurement`], [`Angle`], [`Time`], [`FrameStatus`] |
//! | the estimator, in two sizes or one of your own | [`reference`](mod@reference), [`small`], [`Radar3d`], [`Radar3dConfig`], [`Radar3dParameters`] |
//! | a camera: its calibration, boxes of its pictures | [`Camera3d`], [`Camera3dConfig`], [`Camera3dParameters`], [`Calibration`], [`Intrinsics`], [`PointPair`], [`ImageBox`], [`VehicleClass`]; how it is installed: [`cameras`] |
//! | what is known of the road | [`PolarMap`], [`RoadGrid`]; every map answers [`VisibilityMap`] and the [questions](query) |
//! | several sensors as one map | [`fusion`] |
//! | maps on CAN, CAN FD and serial lines | [`Broadcaster`], [`BroadcastConfig`], [`Medium`]; a [`Receiver`] gives maps back |
//! | radars that are decoded, and boxes of a camera | [`Ars408`], [`Ti`], [`NativeReceiver`]; each is a [`Feed`] |
//! | a unit: radar in, maps out | [`Unit`] joins [`Estimator`], [`Feed`] and [`MapSender`], by [`Settings`] |
//!
//! # Features
//!
//! | feature | for | what it adds |
//! |---|---|---|
//! | `board` | who builds a unit, on a controller or as a service | module `board`: the loop `Roadside` with a board's `CanPort`, `SerialPort` and `SettingsSlots`; sessions and services on a line or bus; settings that outlast a restart |
//! | `defmt` | who reads a controller's log | `Format` on public types, and events |
//! | `serde` | who reads the configuration from files | `Serialize` and `Deserialize` on it |
//! | `lanes` | units at crossings that have 6 kB to spare, 1.5 kB of it memory | room for lanes of traffic; without it there is room for none |
//! | `learning` | the same with 19 kB more, 8 kB on the small grid | room for lanes that the unit learns by itself, and that for others |
//! | `tuned` | units whose parameters were tuned for their place, with 2 kB to spare | [`Settings`] with parameters of obstacles and evidence |
//! | `monitoring` | who watches sensors for being blind, turned or dirty | [`fusion`]'s `Fixtures`, `Supervised` and `Alignment`; [`Settings`] with fixtures, 2 kB |
//! | `probability` | units with a table of probabilities, and receivers of theirs | module `probability`: the table, thresholds of an accepted risk, what goes on the wire; `QuantisedSender` of the two grids, for units that have one |
//! | `ground` | units beside roads that are not flat, with 5 kB of flash to spare | room for heights of the road over its length; without it all roads are flat |
//! | `secoc` | broadcasts that are authenticated | `SecuredReceiver`, `Sealer`, `Key` |
//! | `bench` | benches, tests and those who work on the library, not products | every room, the flat baseline `radar_2d`, and the loops that compare boards with a PC |
//!
//! `cargo doc --features board` (or `bench`) shows what each adds.
//!
//! # What is where
//!
//! One folder a stage, in the order of the data; what is listed below uses only what is listed above it.
//!
//! | folder | what comes in, and what goes out |
//! |---|---|
//! | `fixed` | integers with their scale: angles, time, directions, rows of bits |
//! | `sensor` | a sensor as it is installed, in SI units, checked once: mount, field of view, noise |
//! | `frame` | one radar frame: detections in, gated and counted, placed on the road; how well fixtures repeat; what a silent or blind sensor means |
//! | `obstacles` | what moves is followed: place, length, width, height; fixtures beside it are learnt, and lanes given or learnt; solid boxes out |
//! | `map` | what a map answers: the interface, the polar map, queries, the 1 m grid, the bitmap |
//! | `fusion` | maps of several sensors in, one map of the road out: who sees what, and who contradicts whom |
//! | `grid` | range x azimuth x slope: evidence and boxes in, lines of sight, shadows and a polar map out |
//! | `estimator` | what a unit asks of an estimator, whatever its sensor and its map |
//! | `radar_3d` | the estimator: all stages above, in order |
//! | `radar_2d` | the flat baseline, as an estimator of its own |
//! | `camera` | boxes of a camera's detector in, lifted onto the road, into voxels and lines of sight; the same maps out |
//! | `probability` | a grade and a place in, the probability out that a vehicle there is detected; a map's cells as bits by it; a table fitted on a PC |
//! | `wire` | maps to bytes for CAN, CAN FD and serial lines, and back in a receiver |
//! | `inputs` | a radar's bytes to scans: ARS408 family, TI mmWave, the native format; that for a camera's boxes too |
//! | `unit` | a whole unit: sessions on its lines, stored settings, buses, the loop of a board |
//! | `bench` | the same scans on a controller and on a PC, compared, stage by stage |
//!
//! # Words
//!
//! | word | what it means here |
//! |---|---|
//! | detection | one measurement of the radar: range, azimuth, perhaps elevation, radial velocity, strength |
//! | reflection | a detection placed on the road, in the levelled frame under the sensor |
//! | obstacle | what is followed over many frames because its reflections move together: a vehicle |
//! | solid | the upright box that an obstacle becomes; it casts its shadow on the map |
//! | fixture | what stands and was never seen moving: a mast, a post, a rail, a parked car. `frame` learns the noise of azimuths from them, `obstacles` keeps their detections from vehicles, `fusion` tells by them that a radar is blind or turned; each finds its own |
//! | evidence | occupancy of the grid's cells from reflections that no obstacle explains; fades by the second |
//! | slope | height over ground range; a row of the grid is a range of slopes, so a line of sight is a row |
//! | slice | the surface, 1 m above the road, on which visibility is judged: a plane where the road is flat |
//! | grade | how visible a cell is: 1 hidden to 255 clear; 0 is unknown |
//! | scan | the detections of one radar frame, as an input gives them out |
//! | refresh | a message that describes azimuths by itself; a *delta* describes them against a refresh |
//! | epoch | four bits that change whenever what a receiver holds of a sender is no longer true |
//!
//! # What was decided, and why
//!
//! - **The grid stands upright, whatever the mount.** Detections are turned into a levelled frame
//!   under the sensor (x ahead on the road, z up), so that an azimuth column stays a vertical plane and
//!   a vehicle's wall a vertical wall. Columns are azimuths, range runs along the ground, and the
//!   elevation rows are *slopes* (fall per metre): a line of sight is a row, and ray casting a running
//!   maximum along it. Slope edges are dense just below the horizon, where a degree spans half the
//!   road, and no row is spent on the sky.
//! - **Moving vehicles are obstacles before they are cells.** A radar sees a handful of reflections of
//!   a truck, never its outline; a grid alone has no way to know its length. Detections that move
//!   together are followed, the ends of their reflections over time give the length, length gives width
//!   and height, corrected by elevation, and the box casts its shadow on the map. Unmoving things enter
//!   the grid by the inverse sensor model instead, where evidence decays per second and is cleared only
//!   where the map says that it could have been seen.
//! - **Gaps end with headway.** Reflections in line and equally fast belong to one vehicle while the
//!   gap between them is smaller than vehicles keep at that speed, and for longer gaps once they have
//!   come some way at the same distance. What turns (wheels) or lies inside an outline is no vehicle.
//! - **Boxes are not drawn into cells.** Shadows of boxes end where similar triangles say, not at the edge
//!   of a row of slopes: in queues that is every twentieth blocked cell.
//! - **Columns are worth more than rows.** Since boxes cast their shadows with exact ends, rows hold what never moves only: eight
//!   for sixteen change no rate by more than 0.2 points, while every column less widens every shadow. So the grids have as many columns as the wire
//!   carries, 128 of 0.95 degrees, and 12 rows; the small one 96 and 4, which took 3 points off what it wrongly calls visible, and memory with it.
//! - **Columns are narrow where the far road lies.** At 150 m a degree is a lane wide, and of a view of 120 degrees nearly
//!   all vehicles are within twenty. Where [`VisibilityConfig`] says where that is, columns there are four times
//!   narrower than the others: twice as many of all alike give the same, for twice the memory. Angles are
//!   counted in widths of a narrow column, so that one factor tells both; on the wire it is one more group of the header.
//! - **The road's height is a function of its length.** Crests, dips and ramps lie along the road, so a profile over its
//!   x axis holds for any mount and any direction of sight; heights over range would bend the road with the sensor's
//!   yaw, and say nothing of a road that climbs on one side and falls on the other. Straight pieces are what makes it
//!   cheap: along a line of sight the ground is straight too, and a shadow's end on each piece is one division, exact as
//!   on a plane. A crest's shadow is a box's of no height. Grids, slopes and rays stay as they are, since they are taken from
//!   the sensor and not from the road.
//! - **A thing never hides itself.** Along a row only cells behind the *end* of an occupied run are
//!   hidden by it, and a box shades only what lies behind it.
//! - **Elevation says how high, within what length allows.** A reflection well above a level proves it; many
//!   together distinguish a car from a van or a lorry where none alone does; and what is as long as a lorry is not
//!   called low, unless it hardly reflects or is several cars in a row. Seeing reflections *past* an obstacle was tried as a ceiling on its height and left out: road
//!   bounce under trucks makes it lie, and each lie is a false "visible".
//! - **An azimuth's noise is learnt**: two measurements of a post differ by noise alone, so posts, signs and walls show it
//!   within a minute. How far from a vehicle its detections are looked for, and how far behind them its middle lies,
//!   hangs on it; a data sheet says the worst case at best. It is never taken to be worse than configured.
//! - **No floats after start-up**: angles are binary (2^16 a turn), lengths centimetres; `libm` makes
//!   the start-up tables, `micromath` helps only where a test shows that its error cannot matter, and
//!   both are named in one file. TI's radars send floats: their decoder computes in them, in software
//!   that gives the same bits everywhere.
//! - **Unknown is not invisible.** Outside the field of view, before the first frames, when frames stop
//!   or come empty, the map is unknown, and every transport, coarsening and resampling may only lose
//!   visibility, never make any.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![warn(clippy::indexing_slicing, clippy::cast_possible_truncation)]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]
// rooms also hold what only benches and tests call, and of rooms that are public in part, what other features use; with all
// features, whatever is left unused is found
#![cfg_attr(not(all(feature = "bench", feature = "monitoring")), allow(dead_code, unused_imports))]

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
#[cfg(all(doc, not(feature = "bench")))]
#[doc = include_str!("wire/SPECIFICATION.md")]
pub mod specification {}

// What is public of the rooms stands below; benches and tests go into them.
#[cfg(not(feature = "bench"))]
use rooms::*;
#[cfg(feature = "bench")]
pub use rooms::*;

// in the folders beside this file
#[path = ""]
mod rooms {
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
}

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

// Maps of several sensors as one.
#[cfg(not(feature = "bench"))]
pub use rooms::fusion;

// What a map says of the probability that a vehicle is detected.
#[cfg(all(feature = "probability", not(feature = "bench")))]
pub use rooms::probability;

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
