//! Radars and cameras: their frames and bytes in, scans out, or a reason.

mod ars408;
mod boxes;
mod native;
mod ti;
