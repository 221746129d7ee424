//! The digital twin: traffic and a scene in, recordings by contract out.
//!
//! In data-flow order: [`traffic`] says where vehicles are, a [`scene`] what stands beside them and which
//! sensors look; [`body`] turns a vehicle into what blocks a wave and [`scatter`] into what returns it;
//! [`world`] is one instant of it all with its exact lines of sight; [`radar`] and [`camera`] measure it;
//! [`simulate`] writes the recording. [`random`] is where every draw comes from.

pub mod body;
pub mod camera;
pub mod radar;
pub mod random;
pub mod road;
pub mod scatter;
pub mod scene;
pub mod simulate;
pub mod traffic;
pub mod world;
