//! Pictures in, boxes of vehicles out, by a neural network the user brings.
//!
//! ```text
//! picture -> the whole and its tiles -> letterboxed -> network -> head -> boxes without doubles -> bottom edge moved
//! ```
//!
//! A package of its own because a runtime for networks takes minutes to build; nothing else in the project needs it.

pub mod classes;
pub mod command;
pub mod detector;
pub mod heads;
pub mod letterbox;
pub mod network;
pub mod picture;
pub mod suppression;
pub mod tiles;
