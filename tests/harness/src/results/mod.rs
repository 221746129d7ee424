//! Results out: text, JSON and CSV, pictures, recordings for Foxglove, and how files are written.

pub mod files;
pub mod foxglove;
pub mod pictures;
pub mod report;
