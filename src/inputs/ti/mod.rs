//! TI mmWave radars on a serial line: frames of type-length-value items in, scans out.
//!
//! # Model
//! A frame begins with the magic word `02 01 04 03 06 05 08 07` and a header, then items: a type, a
//! length, a payload. All numbers are little-endian. Four kinds of header share the magic word:
//!
//! | bytes | firmware | frame length at | items at | item length counts its own 8 bytes |
//! |---|---|---|---|---|
//! | 36 | xWR14xx, SDK 1 and 2 | 12 | 32 | no |
//! | 40 | SDK 2 and 3, Radar Toolbox | 12 | 32 | no |
//! | 44 | area scanner | 12 | 32 | no |
//! | 52 | people counting and traffic monitoring of older toolboxes | 20 | 48, 16 bits | yes |
//!
//! Which one it is cannot be told from a header. It is set, or learnt: the one whose items fill the
//! frame up to the next magic word, three frames in a row, when no other does. Until then nothing is
//! given out.
//!
//! | type | payload | signs |
//! |---|---|---|
//! | 1 | x, y, z in metres and velocity in m/s, `f32` each (SDK 3) | x to the right, y ahead |
//! | 1 | number, binary point; range and Doppler index, peak, x, y, z, 16 bits each (SDK 1 and 2) | the same |
//! | 7 | signal-to-noise ratio and noise of each point, 0.1 dB, `i16` | |
//! | 1000 | range, azimuth, elevation, velocity, `f32` | azimuth + to the right |
//! | 1020 | five units; elevation, azimuth, velocity, range, ratio of signal to noise | azimuth + to the right |
//! | 6 behind a 52-byte header | range, azimuth, (elevation,) velocity, ratio, `f32` | azimuth + to the right |
//!
//! Velocities are + receding in all of them. Other items are stepped over. There is no check sum: a
//! frame counts if its items fill it, and begins anew wherever the magic word is found.
//!
//! # Limits
//! Points are converted in single precision, by the same operations on every machine. Of points
//! without a signal-to-noise ratio of their own, types 1 and 1000, the first `N` are kept.
//!
//! # References
//! Texas Instruments, Understanding UART Data Output Format, Radar Toolbox; mmWave SDK,
//! `mmw_output.h`.

mod family;
mod learning;
mod points;
mod receiver;

pub use family::Family;
pub use points::{AngleUnit, Dialect, PolarPoints};
pub use receiver::{Config, Counters, Flaw, Outcome, Ti};
