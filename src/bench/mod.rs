//! Test benches: recorded scans in, one fingerprint a frame out, to compare a controller with a PC.
//!
//! Nothing of a unit on the road is here. The host writes a [job], the controller runs the estimator over it and
//! answers with [records](record): per frame a fingerprint over every grade, occupancy and bit of the map, and
//! what each [stage] cost. The host runs the same estimator over the same job and compares. Time comes
//! from the job, never from the controller's clock. On a CAN bus it comes over the [bus](can) itself.
//!
//! # Model
//! Both directions are plain byte streams of little-endian numbers, so that files, semihosting and
//! serial ports carry them alike.

pub mod can;
pub mod files;
pub mod fingerprint;
pub mod flash;
pub mod job;
pub mod record;
mod run;
pub mod stage;
mod start;

pub use run::{Bench, run};
pub use start::{start, start_stored};
