//! Continental ARS404, ARS408 and SRR308 on classic CAN, and clones that borrow their identifiers.
//!
//! # Model
//! A scan is a status message that announces a number of entries, a general message per entry, and
//! on request a quality message per entry (and, of objects, an extended one, which holds nothing that
//! is used here). Entries are clusters, single reflections, or objects, tracked by the radar. All
//! fields are unsigned and in Motorola order; `identifier = base + 0x10 * sensor id`, sensor id 0 to 7.
//!
//! The radar measures no elevation and sends no time. A distance to the front and one to the side
//! become range and azimuth, two components of a velocity the part along the line of sight. Its own
//! convention, x forward, y left, velocity + receding, is the library's.
//!
//! # Limits
//! Up to 250 clusters or 100 objects a scan. Of the two offsets of the lateral distance found in
//! public descriptions, -102.3 m and -102.4 m (objects -204.6 m and -204.8 m), the former are taken;
//! they differ by half a step.
//!
//! # References
//! ARS 404-21, ARS 408-21: Standardized ARS Interface, technical documentation V1.91.

pub mod configuration;
mod counter;
pub mod filter;

pub mod message;
pub mod motion;
pub mod profile;
pub mod quality;
pub mod receiver;
pub mod state;
pub mod upkeep;

pub use receiver::{Ars408, Ars408Config, Ars408Counters, Ars408Outcome, Refusal};
