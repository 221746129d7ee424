//! A whole unit: its sessions, its service, its loop on a bus, and the files of the bench.

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
