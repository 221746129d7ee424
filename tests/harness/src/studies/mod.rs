//! Questions put to the digital twin: the paper's experiment, and where to mount a sensor.

pub mod experiment;
pub mod site;
pub mod starts;
pub mod tune;
