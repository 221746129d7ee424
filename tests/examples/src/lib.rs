//! The least a unit or a receiver needs of viewshed, an example a file; each is tested in `tests/`.
#![no_std]

pub mod ars408_unit;
pub mod own_radar;
pub mod receiver;
