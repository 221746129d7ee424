//! The one home of figures: what the commands of a plan print, kept with what it was measured on, and shown on pages between markers.

pub mod pages;
pub mod parts;
pub mod photo;
pub mod table;
