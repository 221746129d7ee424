//! TI mmWave radars on a serial line: frames of type-length-value items in, scans out.
//!
//! # Model
//! A frame begins with the magic word `02 01 04 03 06 05 08 07` and a header, then items: a type, a
//! length, a payload. All numbers are little-endian. Five kinds of header share the magic word:
//!
//! | bytes | firmware | frame length at | items at | item length counts its own 8 bytes |
//! |---|---|---|---|---|
//! | 36 | xWR14xx, SDK 1 and 2 | 12 | 32 | no |
//! | 40 | SDK 2 and 3, Radar Toolbox | 12 | 32 | no |
//! | 44 | area scanner | 12 | 32 | no |
//! | 48 | 3D people counting of older toolboxes | 12 | 44, 16 bits | yes |
//! | 52 | people counting and traffic monitoring of older toolboxes | 20 | 48, 16 bits | yes |
//!
//! Which one it is cannot be seen in a header. It is set, or learnt: the one whose items fill the
//! frame up to the next magic word, three frames in a row, when no other does. Until then nothing is
//! given out.
//!
//! | type | payload | signs |
//! |---|---|---|
//! | 1 | x, y, z in metres and velocity in m/s, `f32` each (SDK 3) | x to the right, y ahead |
//! | 1 | number, binary point; range and Doppler index, peak, x, y, z, 16 bits each (SDK 1 and 2) | the same |
//! | 7 | signal-to-noise ratio and noise of each point, 0.1 dB, `i16` | |
//! | 1000 | range, azimuth, elevation, velocity, `f32` | azimuth + to the right |
//! | 1020; 6 after 48 bytes | five units; elevation, azimuth, velocity, range, ratio of signal to noise | azimuth + to the right |
//! | 301 | four units and two numbers; x, y, z, velocity, 16 bits each, ratio, noise, 8 bits each (L-SDK) | x to the right, y ahead |
//! | 6 after 52 bytes | range, azimuth, (elevation,) velocity, ratio, `f32` | azimuth + to the right |
//! | 308, 1010; 7 after 48 bytes | number; x, y, z, their velocities, `f32`; 84 bytes more | x to the right, y ahead |
//! | 7 after 52 bytes | number; x, y, their velocities, `f32`; 48 bytes more | the same |
//!
//! Velocities are + receding in all of them. The last two rows are targets, objects the radar tracks: they were made of the
//! points and may be predicted, so they are left out, or by [`Entries::Targets`] stand in place of the points. Their radial
//! velocity is the part along the line of sight, and their place is the sensor's only where `sensorPosition` was set to
//! zero height and tilt. Other items are stepped over: profiles, heat maps, statistics, indices, heights. There is no check sum: a
//! frame counts if its items fill it, and begins anew wherever the magic word is found.
//!
//! # Limits
//! Points are converted in single precision, by the same operations on every machine. Of points
//! without a signal-to-noise ratio of their own, types 1 and 1000, and of targets the first `N` are kept.
//!
//! # References
//! Texas Instruments, Understanding UART Data Output Format, Radar Toolbox; mmWave SDK,
//! `mmw_output.h`; MMWAVE-L-SDK, API guide, `MmwDemo_output_message_UARTpoint`.

mod family;
mod learning;
mod points;
mod receiver;

pub use family::TiFamily;
pub use points::{Entries, PolarPoints, TiAngleUnit, TiDialect};
pub use receiver::{Flaw, Ti, TiConfig, TiCounters, TiOutcome};
