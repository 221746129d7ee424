//! Double-precision geometry of the evaluation: poses, boxes and exact lines of sight.

pub mod azimuths;
pub mod ground;
pub mod heading;
pub mod looks;
pub mod polygon;
pub mod polyline;
pub mod pose;
pub mod sight;
pub mod solid;
