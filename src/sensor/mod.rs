//! A sensor as it is installed: what the integrator measures and reads off the data sheet.

pub mod config;
pub mod field_of_view;
pub mod ground;
pub mod mount;
pub mod noise;
pub mod road;
pub mod site;

use crate::sensor::field_of_view::FieldOfView;
use crate::sensor::mount::Mount;
use crate::sensor::noise::NoiseConfig;

/// Where a sensor stands, what it could see, and how well it measures.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Sensor {
    /// Where it stands.
    pub mount: Mount,
    /// What it could see under ideal conditions.
    pub field_of_view: FieldOfView,
    /// How well it measures.
    pub noise: NoiseConfig,
}
