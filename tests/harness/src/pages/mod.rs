//! Pages in a browser of this machine: a server on the loopback address, and what it serves.
//!
//! A command makes the routes, one answer a path ([`label`], [`view`]); [`server`] gives them an address that holds a secret
//! ([`guard`]) and answers until it is stopped. All scripts and styles are in the program ([`assets`]); no path of a
//! request names a file. `labels` keeps what a person draws, `points` and `visibility` are what is drawn on.
//!
//! How the page of `viewshed label` is used: `README.md` beside this file.

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
