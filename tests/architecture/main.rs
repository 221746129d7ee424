//! The shape of the library: folders that use one another in one direction, and a face that stays small.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)] // a test may fail

mod circles;
mod extending;
mod public_names;
mod skips;
