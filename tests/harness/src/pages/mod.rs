//! Pages in a browser of this machine: a server on the loopback address, and what it serves.
//!
//! A command makes the routes, one answer a path ([`label`]); [`server`] gives them an address that holds a secret
//! ([`guard`]) and answers until it is stopped. All scripts and styles are in the program ([`assets`]); no path of a
//! request names a file. [`labels`] keeps what a person draws, [`points`] and [`visibility`] are what is drawn on.
//!
//! How the page of `viewshed label` is used: `README.md` beside this file.

pub mod assets;
mod camera;
pub mod guard;
mod labels;
mod points;
pub mod server;
mod visibility;

pub mod label;

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks; what a thread that panicked left is as good as before it.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
