//! Harness of `viewshed` for PCs: recordings in, figures and pictures out, and the `viewshed` command.
//!
//! ```text
//!   traffic ──> twin ──┐                          ┌──> evaluation ──> results
//!                      ├──> recording ──> estimators                 ^
//!   radar, logs ───────┘         │                ├──> bus ──────────┤
//!                                │                └──> boards ───────┤
//!                                └──> doctor ────────────────────────┘
//! ```
//!
//! # What is where
//!
//! | room | what comes in, and what goes out |
//! |---|---|
//! | [`geometry`] | poses, boxes and exact lines of sight, in double precision |
//! | [`recording`] | MCAP files, CAN logs and captures in; frames, mount and labelled objects out. Writes them too |
//! | [`twin`] | a scene and traffic in, a recording with ground truth out |
//! | [`estimators`] | frames in, maps out: the library's estimators, and what perfect occupancy would give |
//! | [`evaluation`] | maps and truth in; rates, intervals, trade-offs and examples out |
//! | [`labels`] | lines a person draws, and tracks the machine offers; boxes, `NAME.labels.csv` and lanes of traffic out |
//! | [`studies`] | the paper's experiment on the twin, and the search for a mount |
//! | [`bus`] | maps in, their load on CAN, CAN FD and serial lines out; what a receiver of a log has |
//! | [`doctor`] | a radar's log in, what is wrong with it and what to do out |
//! | [`boards`] | the same scans through a controller and through the library here, compared frame by frame |
//! | [`configure`] | a TOML file in, a unit that runs with it out, over serial ports and CAN |
//! | [`results`] | figures in; text, JSON, CSV, pictures and recordings for Foxglove out, written whole or not at all |
//! | `pages` | recordings in; pages in a browser out, and labels a person draws there (feature `pages`) |
//! | [`command`] | the `viewshed` command: options, and one file for each subcommand |
//!
//! No room uses one that uses it (`cargo test --test architecture`).

pub mod boards;
pub mod bus;
pub mod command;
pub mod configure;
pub mod doctor;
pub mod estimators;
pub mod evaluation;
pub mod geometry;
pub mod labels;
#[cfg(feature = "pages")]
pub mod pages;
pub mod recording;
pub mod results;
pub mod studies;
pub mod twin;
