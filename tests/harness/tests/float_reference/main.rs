//! The radar-3d pipeline in double precision, and the integer one compared with it.
//!
//! Written from the model the library documents, with plain vectors, metres, radians, seconds and
//! shares of one: exact roots and angles where the library has tables, `exp(-dt / memory)` where it
//! divides, real numbers where it rounds. One stage one file, in data-flow order; each ends with
//! the comparison of its stage, [`agreement`] compares the whole over the shipped recording and [`traffic`] on random scenes.
//!
//! Parameters come from the library's configurations in SI units. Rules of tracking that are no
//! configuration are read from [`viewshed::obstacles::parameters::TrackingParameters`] in their stated units.
//! What differs from the library by design: no sorting by range, no table, no byte. All roads are flat here; over
//! others shadows are compared with lines of sight in `tests/properties/ground.rs`.

mod geometry;

mod gate;

mod repeatability;

mod obstacles;

mod grid;

mod evidence;

mod raycast;

mod settling;
mod shadow;

mod pipeline;

mod cartesian;

mod agreement;
mod line_of_sight;
mod scene;
mod traffic;
