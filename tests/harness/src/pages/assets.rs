//! What the pages are made of, from inside the program: they work without a network, and no path names a file.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_bytes!(concat!("web/", $name)).as_slice())),*]
    };
}

static FILES: &[(&str, &[u8])] = &files![
    "index.html",
    "style.css",
    "azimuths.js",
    "camera.js",
    "colours.js",
    "ground.js",
    "guess.js",
    "history.js",
    "keys.js",
    "main.js",
    "marks.js",
    "panel.js",
    "plot.js",
    "points.js",
    "proposals.js",
    "recording.js",
    "saving.js",
    "session.js",
    "tracks.js",
    "view.html",
    "view.js",
    "viewer.css",
    "viewer.js",
    "viewer-camera.js",
    "viewer-ground.js",
    "viewer-marks.js",
    "viewer-panel.js",
    "viewer-source.js",
    "ways.js",
];

/// The file of a name, and what kind it is.
pub fn answer(name: &str) -> Response {
    let Some((_, bytes)) = FILES.iter().find(|(file, _)| *file == name) else {
        return (StatusCode::NOT_FOUND, "there is nothing here\n").into_response();
    };
    let kind = match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        _ => "application/octet-stream",
    };
    ([(header::CONTENT_TYPE, kind)], *bytes).into_response()
}
