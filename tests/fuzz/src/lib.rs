//! What must hold whatever the bytes are: a function for every decoder and for the receivers.
//!
//! Run by cargo-fuzz (`tests/fuzz.sh`), and by `tests/fuzz_corpus.rs` on the kept inputs and changes of them.

pub mod ars408;
pub mod can_service;
pub mod native;
pub mod settings;
pub mod ti;
pub mod wire_block;
pub mod wire_maps;
#[cfg(feature = "secoc")]
pub mod wire_messages;
pub mod wire_receiver;
#[cfg(feature = "secoc")]
pub mod wire_secured;
