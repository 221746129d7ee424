//! Where a roadside radar can see, and where it is blind.
//!
//! From each radar frame the library estimates which cells of the road have a line of sight to the
//! sensor and which are hidden behind vehicles, so that whoever relies on the sensor knows its blind
//! spots. Integers only after start-up, no allocation, no panics, every loop bounded; time is an
//! argument. The same input gives the same bits on every machine.
//!
//! ```
//! use viewshed::detection::{Detection, Measurement};
//! use viewshed::field_of_view::FieldOfView;
//! use viewshed::map::RoadPoint;
//! use viewshed::mount::Mount;
//! use viewshed::query::{self, Answer};
//! use viewshed::radar_3d::{Radar3dConfig, Radar3dParameters};
//! use viewshed::reflection::NoiseConfig;
//! use viewshed::sensor::Sensor;
//! use viewshed::time::Time;
//! use viewshed::unit::profile::small;
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
//! let ahead = RoadPoint { x_cm: 2_000, y_cm: 0 };
//! assert_eq!(query::point(&map, ahead), Answer::VisibleFree);
//! let behind_the_sensor = RoadPoint { x_cm: -2_000, y_cm: 0 };
//! assert_eq!(query::point(&map, behind_the_sensor), Answer::Unknown);
//! # Ok::<(), viewshed::config::ConfigError>(())
//! ```
//!
//! # What is where
//!
//! | stage | modules |
//! |---|---|
//! | a sensor and its configuration, in SI units, checked once | [`sensor`], [`mount`], [`field_of_view`], [`config`] |
//! | detections in, gated and counted, placed on the road | [`detection`], [`gate`], [`reflection`], [`scan`] |
//! | what moves: place, length, width, height | [`obstacles`], [`solid`] |
//! | the grid: range x azimuth x slope, evidence with decay | [`axes`], [`spherical`], [`voxelise`], [`evidence`] |
//! | lines of sight, and the slice at 1 m | [`raycast`], [`polar`] |
//! | what a silent sensor means | [`health`] |
//! | the flat baseline | [`cartesian`], [`sightlines`] |
//! | whole estimators | [`radar_3d`], [`radar_2d`] |
//! | results: the map interface, queries, the 1 m grid, the bitmap | [`map`], [`query`], [`resample`], [`bitmap`] |
//! | radar frames in: ARS408 family, TI mmWave, the native format | [`inputs`] |
//! | maps out over CAN, CAN FD and serial lines, and their receiver | [`wire`] |
//! | what a unit asks of an estimator, and a decoder that feeds one | [`estimator`], [`inputs::Feed`] |
//! | a whole unit: sessions on its lines, stored settings, buses looked after, the loop of a board | [`mod@unit`] |
//! | the same input on a controller and on a PC, compared | [`mod@bench`] |
//! | integers: angles, time, tables, rows of bits | [`angle`], [`time`], [`trig`], [`bits`] |
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
//!   and height (with elevation as a floor), and the box is what fills the grid. Unmoving things enter
//!   the grid by the inverse sensor model instead, where evidence decays per second and is cleared only
//!   where the map says that it could have been seen.
//! - **Gaps end with headway.** Reflections in line and equally fast belong to one vehicle while the
//!   gap between them is smaller than vehicles keep at that speed, and for longer gaps once they have
//!   come some way at the same distance. What turns (wheels) or lies inside an outline is no vehicle.
//! - **A thing never hides itself.** Along a row only cells behind the *end* of an occupied run are
//!   hidden by it, so a vehicle's own cells keep the grade of its front.
//! - **Elevation only proves a least height.** Seeing reflections *past* an obstacle was tried as a
//!   ceiling on its height and left out: road bounce under trucks makes it lie, and each lie is a false
//!   "visible".
//! - **No floats after start-up**: angles are binary (2^16 a turn), lengths centimetres; `libm` makes
//!   the start-up tables, `micromath` helps only where a test shows that its error cannot matter, and
//!   both are named in one file. TI's radars send floats: their decoder computes in them, in software
//!   that gives the same bits everywhere.
//! - **Unknown is not invisible.** Outside the field of view, before the first frames, when frames stop
//!   or come empty, the map is unknown, and every transport, coarsening and resampling may only lose
//!   visibility, never make any.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

#[cfg(test)]
extern crate std;

pub mod angle;
pub mod axes;
pub mod bench;
pub mod bitmap;
pub mod bits;
mod bytes;
pub mod cartesian;
pub mod config;
pub mod detection;
pub mod estimator;
pub mod evidence;
pub mod field_of_view;
pub mod gate;
pub mod health;
pub mod inputs;
pub mod map;
mod math;
pub mod mount;
pub mod obstacles;
pub mod polar;
pub mod query;
pub mod radar_2d;
pub mod radar_3d;
pub mod raycast;
pub mod reflection;
pub mod resample;
pub mod scan;
pub mod sensor;
pub mod sightlines;
pub mod solid;
pub mod spherical;
mod stack;
pub mod time;
pub mod trig;
pub mod unit;
pub mod voxelise;
pub mod wire;
