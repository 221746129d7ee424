//! What the maps of a recording cost on a bus, and what a receiver makes of them.

pub mod bits;
pub mod ears;
pub mod entropy;
pub mod listening;
pub mod load;
pub mod logged;
pub mod loss;
pub mod report;
pub mod symbols;
pub mod traffic;
