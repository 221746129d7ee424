//! Host-side harness of `viewshed`: recordings in, metrics and pictures out.

pub mod boards;
pub mod bus;
pub mod commands;
pub mod doctor;
pub mod estimators;
pub mod evaluation;
pub mod experiment;
pub mod foxglove;
pub mod geometry;
pub mod options;
pub mod output;
pub mod pictures;
pub mod recording;
pub mod report;
pub mod site;
pub mod truth;
pub mod twin;
