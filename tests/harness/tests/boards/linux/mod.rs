//! The daemon: run as a program on logs and pseudo-terminals, compared with the library on the same input.

mod daemon;
mod lines;
mod logs;
mod probability;
mod service;
mod starts;
mod terminal;
#[allow(dead_code)] // of every kind of frame, few are sent here
#[path = "../../../../inputs/ti/frames.rs"]
mod ti;
