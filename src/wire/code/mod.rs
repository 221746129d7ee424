//! The code of the map: rays in, words out, whatever they travel on.

mod basis;
pub mod block;
pub mod edges;
mod expectation;
pub mod interval;
mod known;
pub mod model;
pub mod ray;
pub mod reading;
