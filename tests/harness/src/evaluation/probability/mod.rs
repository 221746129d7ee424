//! Probabilities of detection: a table fitted to labelled samples, and what is made of it.
//!
//! [`samples`] of a recording's scores are fitted ([`fit`]) to the library's table; a [`file`](mod@file) keeps it with the counts
//! that a [`risk`] is turned into a threshold by.

pub mod file;
pub mod fit;
pub mod risk;
pub mod samples;
pub mod table_file;

pub use viewshed::probability::{Probability, ProbabilityTable, TableError, Threshold};
