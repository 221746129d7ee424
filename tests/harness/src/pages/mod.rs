//! Pages in a browser of this machine: a server on the loopback address, and what it serves.
//!
//! A command makes the routes, one answer a path ([`label`], [`view`]); [`server`] gives them an address that holds a secret
//! ([`guard`]) and answers until it is stopped. All scripts and styles are in the program ([`assets`]); no path of a
//! request names a file. `labels` keeps what a person draws, `points` and `visibility` are what is drawn on.
//!
//! How the pages are used: `tests/GUIDE.md`.
//!
//! Those in `web/` are plain modules without a build step, in the order of the data: `recording.js` loads, `points.js` draws
//! detections, `plot.js` is one plot, `tracks.js` and `history.js` what is drawn, `session.js` all that keys and clicks do,
//! `saving.js` the way back; `viewer*.js` is the page of `view`, on the same plots. Points are drawn by a loop over the bytes
//! of a canvas, the same on every machine. A pan moves the drawn picture at once and draws it afresh when it rests.
//!
//! The tests drive a real browser (Debian: `chromium-headless-shell`); with `VIEWSHED_PICTURES=$PWD/tests/pictures` they renew
//! the pictures of the pages. Times:
//!
//!     cargo test --release -p viewshed-harness --test label -- --ignored --nocapture
//!     cargo test --release -p viewshed-harness --test view -- --ignored --nocapture takes_to_the_screen

pub mod assets;
mod camera;
pub mod guard;
mod labels;
mod patience;
mod points;
pub mod server;
mod visibility;

pub mod label;
pub mod view;

use std::sync::{Mutex, MutexGuard, PoisonError};

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

/// Locks; what a thread that panicked left is as good as before it.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn json(value: &impl Serialize) -> Response {
    match serde_json::to_vec(value) {
        Ok(bytes) => as_json(bytes),
        Err(error) => broken(&error.into()),
    }
}

fn broken(error: &anyhow::Error) -> Response {
    (StatusCode::INTERNAL_SERVER_ERROR, format!("{error:#}\n")).into_response()
}

fn as_json(bytes: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], bytes).into_response()
}
