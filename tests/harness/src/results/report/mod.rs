//! What people and programs get to see of a replay: a table, JSON, CSV.

pub mod calibration;
pub mod compare;
pub mod csv;
pub mod experiment;
pub mod gantry_camera;
pub mod json;
pub mod notes;
pub mod scenes;
pub mod sensor_set;
pub mod several_sensors;
pub mod site;
pub mod starts;
pub mod table;

/// To be said wherever results of synthetic recordings are shown.
pub const ORIGIN: &str = "No labelled gantry-radar recording is publicly obtainable. Synthetic recordings are synthetic: \
                          their figures show that the method works on their world, not how well it does on a road.";

/// A share in per cent; `n/a` where there was nothing to divide by.
pub fn percent(rate: Option<f64>) -> String {
    rate.map_or_else(|| "n/a".into(), |r| format!("{:.1}", 100.0 * r))
}
