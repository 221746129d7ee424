//! Pictures for people: maps from above, polar grids, trade-off curves, heat maps, as PNG.
//!
//! Every function takes plain data and gives a [`canvas::Canvas`]; the same input gives the same
//! bytes. Text is set in DejaVu Sans from inside the program, so no font has to be installed.

pub mod birdseye;
pub mod camera_view;
pub mod canvas;
mod closeup;
pub mod heatmap;
pub mod palette;
pub mod polar;
pub mod reliability;
pub mod returns;
pub mod scene;
pub mod site;
pub mod tradeoff;
pub mod who_sees;

mod axes;
pub mod cells;
mod labels;
mod legend;
mod overlay;
mod text;

pub use axes::Ticks;
