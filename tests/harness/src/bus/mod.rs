//! What the maps of a recording cost on a bus, and what a receiver makes of them.

pub mod symbols;
