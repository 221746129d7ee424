//! The daemon: run as a program on logs and pseudo-terminals, compared with the library on the same input.

mod daemon;
mod lines;
mod logs;
mod service;
mod terminal;
