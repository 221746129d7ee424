//! Radars and cameras: their frames and bytes in, scans out, or a reason.

#![allow(clippy::cast_possible_truncation, clippy::indexing_slicing, clippy::panic, clippy::unwrap_used)] // a test may fail

mod ars408;
mod boxes;
mod native;
mod ti;
