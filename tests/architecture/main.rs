//! The shape of the library: folders that use one another in one direction, and a face that stays small.

mod circles;
mod dependencies;
mod extending;
mod face;
mod figures;
mod files;
mod skips;
mod uncalled;
