//! Results out: text, JSON and CSV, pictures, a report as one page, recordings for Foxglove, and how files are written.

pub mod figures;
pub mod files;
pub mod foxglove;
pub mod html;
pub mod pictures;
pub mod report;
