//! What a unit asks of an estimator, whatever its sensor: frames in, one map kept up to date.
//!
//! Parameters, state and map lie apart, each in the memory its owner has for it: parameters are made once,
//! state and map are large and stay where they are.

use crate::fixed::time::Time;
use crate::frame::health::{Condition, Continuity, FrameStatus};
use crate::sensor::config::ConfigError;

/// Version of what estimators make of the same frames, and the check sum of the maps of fixed scans by it
/// (`tests/estimators/version.rs`). Whoever changes these maps raises the first and writes down the second, so that what
/// was fitted to the maps of before is known for what it is.
pub const MAPS: (u16, u64) = (2, 0x9138_f2e5_7522_e588);

/// Version of the estimators: with another the same frames may give other maps. Tables of probabilities are of one version, see
/// `probability::fitted_with`.
pub const ESTIMATOR_VERSION: u16 = MAPS.0;

/// What a frame did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Progress {
    /// How the frame follows the last.
    pub continuity: Continuity,
    /// What the sensor's frames say of it.
    pub condition: Condition,
    /// What of the input was used: detections, boxes, maps.
    pub used: u16,
}

/// An estimator's state.
pub trait Estimator {
    /// Everything that can be set, in SI units, the sensor included.
    type Config;
    /// The configuration, checked and in the estimator's own numbers.
    type Parameters: core::fmt::Debug;
    /// What a frame holds: the detections of a radar, the boxes of a camera, the maps of others.
    type Input: ?Sized;
    /// What is kept up to date.
    type Map: core::fmt::Debug;

    /// Checks a configuration.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with.
    fn parameters(config: &Self::Config) -> Result<Self::Parameters, ConfigError>;

    /// Makes a map one for these parameters, where it lies, everything on it unknown.
    fn prepare(parameters: &Self::Parameters, map: &mut Self::Map);

    /// Forgets everything but the counters, the map included: what comes next does not follow.
    fn forget(&mut self, map: &mut Self::Map);

    /// Takes a frame measured at this time and brings the map up to it. `status` is what the sensor says of
    /// itself; `ended` is called as each stage ends, in their order.
    fn process(
        &mut self,
        parameters: &Self::Parameters,
        measured: Time,
        input: &Self::Input,
        status: FrameStatus,
        map: &mut Self::Map,
        ended: &mut impl FnMut(),
    ) -> Progress;

    /// Makes the map unknown when its time has run out; to be called when no frame comes.
    fn expire(&mut self, parameters: &Self::Parameters, now: Time, map: &mut Self::Map) -> Condition;
}
