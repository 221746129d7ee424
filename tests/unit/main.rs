//! A whole unit: its sessions, its service, its loop on a bus, and the files of the bench.

#![allow(
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used
)] // a test may fail

#[path = "../common/mod.rs"]
mod common;

mod block;
mod camera;
mod can_service;
mod kept;
mod pil;
mod roadside;
mod session;
mod status;
