//! Where a roadside radar can see, and where it is blind.
//!
//! From each radar frame the library estimates which cells of the road have a line of sight to the
//! sensor and which are hidden behind vehicles, so that whoever relies on the sensor knows its blind
//! spots. Integers only after start-up, no allocation, no panics, every loop bounded; time is an
//! argument. The same input gives the same bits on every machine.
//!
//! ```
//! use viewshed::frame::detection::{Detection, Measurement};
//! use viewshed::sensor::field_of_view::FieldOfView;
//! use viewshed::sensor::road::RoadPoint;
//! use viewshed::sensor::mount::Mount;
//! use viewshed::map::query::{self, Answer, Footprint};
//! use viewshed::radar_3d::{Radar3dConfig, Radar3dParameters, SmallProfile};
//! use viewshed::sensor::noise::NoiseConfig;
//! use viewshed::sensor::Sensor;
//! use viewshed::fixed::time::Time;
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
//! let mut radar = Box::new(SmallProfile::new());
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
//! # Ok::<(), viewshed::sensor::config::ConfigError>(())
//! ```
//!
//! # What is where
//!
//! One folder a stage, in the order of the data; what is listed below uses only what is listed above it.
//!
//! | folder | what comes in, and what goes out |
//! |---|---|
//! | [`fixed`] | integers with their scale: [angles](fixed::angle), [time](fixed::time), [directions](fixed::trig), [rows of bits](fixed::bits) |
//! | [`sensor`] | a sensor as it is installed, in SI units, checked once: [mount](sensor::mount), [field of view](sensor::field_of_view), [noise](sensor::noise) |
//! | [`frame`] | one radar frame: [detections](frame::detection) in, [gated](frame::gate) and counted, [placed on the road](frame::reflection); what a silent or [blind](frame::health) sensor means |
//! | [`obstacles`] | what moves is followed: place, length, width, height; [solid](obstacles::solid) boxes out |
//! | [`map`] | what a map answers: the [interface](map::VisibilityMap), the [polar map](map::polar), [queries](map::query), the [1 m grid](map::resample), the [bitmap](map::bitmap) |
//! | [`grid`] | range x azimuth x slope: boxes and [evidence](grid::evidence) in, [lines of sight](grid::raycast) and a polar map out |
//! | [`radar_3d`] | the estimator: all stages above, in order |
//! | [`radar_2d`] | the flat baseline, as an estimator of its own |
//! | [`camera`] | boxes of a camera's detector in, lifted onto the road, into voxels and lines of sight; the same maps out |
//! | [`wire`] | maps to bytes for CAN, CAN FD and serial lines, and back in a receiver |
//! | [`inputs`] | a radar's bytes to scans: ARS408 family, TI mmWave, the native format |
//! | [`mod@unit`] | a whole unit: sessions on its lines, stored settings, buses, the loop of a board |
//! | [`pil`], [`stage`], [`profile`] | the same scans on a controller and on a PC, compared, stage by stage |
//!
//! # Words
//!
//! | word | what it means here |
//! |---|---|
//! | detection | one measurement of the radar: range, azimuth, perhaps elevation, radial velocity, strength |
//! | reflection | a detection placed on the road, in the levelled frame under the sensor |
//! | obstacle | what is followed over many frames because its reflections move together: a vehicle |
//! | solid | the upright box that an obstacle becomes for the grid |
//! | evidence | occupancy of the grid's cells from reflections that no obstacle explains; fades by the second |
//! | slope | height over ground range; a row of the grid is a range of slopes, so a line of sight is a row |
//! | slice | the plane, 1 m above the road, on which visibility is judged |
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

#[cfg(doc)]
#[doc = include_str!("EXTENDING.md")]
pub mod extending {}
pub mod camera;
pub mod fixed;
pub mod frame;
pub mod grid;
pub mod inputs;
pub mod map;
pub mod obstacles;
pub mod pil;
pub mod profile;
pub mod radar_2d;
pub mod radar_3d;
pub mod sensor;
pub mod stage;
pub mod unit;
pub mod wire;
