//! Maps on the wire: code, protection, authentication, receivers, and the promise that nothing is seen that is not.

#[path = "../dbc/mod.rs"]
mod dbc;
#[path = "../shadows/mod.rs"]
mod shadows;
#[path = "../common/skipped.rs"]
mod skipped;

mod bus_description;
#[cfg(feature = "secoc")]
mod bus_description_secured;
mod c_receiver;
mod configuration_block;
mod e2e;
mod fail_safe;
mod maps;
mod probability;
#[cfg(feature = "secoc")]
mod secured;
mod specification;
mod worked_example;
