//! Maps out of a sensor's unit and into its receivers, over CAN, CAN FD and serial lines.
//!
#![doc = include_str!("SPECIFICATION.md")]

pub mod broadcast;
pub mod code;
pub mod e2e;
pub mod frame;
pub mod header;
pub mod map_message;
pub mod message;
pub mod planes;
pub mod receive;
pub mod scan_number;
#[cfg(feature = "secoc")]
pub mod secoc;
pub mod serial;
pub mod status;
pub mod visible_range;
