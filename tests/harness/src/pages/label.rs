//! What the page of `viewshed label` asks for, one answer a path.

use std::io::Write;
use std::sync::{Arc, OnceLock};

use anyhow::Result;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde::Deserialize;

use super::labels::{Labels, NotSaved};
use super::points::{self, Description};
use super::server::Server;
use super::visibility::Maps;
use super::{as_json, assets, broken, camera, json};
use crate::estimators::Options;
use crate::labels::Site;
use crate::labels::proposals::follow::Follower;
use crate::labels::proposals::propose;
use crate::labels::tracks::{LabelPoint, LabelTrack, TrackError};
use crate::recording::Recording;
use crate::results::files::Target;

/// Most bytes of labels a page may send.
const LABELS_BYTES: usize = 64 << 20;
/// Header that names the page that writes.
const WRITER: HeaderName = HeaderName::from_static("x-writer");
/// Header that names the version of the labels that a page has.
const VERSION: HeaderName = HeaderName::from_static("x-version");
/// Header with the place of a map's cells.
const CELLS: HeaderName = HeaderName::from_static("x-cells");

/// A recording that is labelled.
pub struct Labelling {
    recording: Recording,
    labels: Labels,
    maps: Maps,
    proposals: OnceLock<Vec<u8>>,
    follower: OnceLock<Follower>,
    images: camera::Images,
}

type Shared = State<Arc<Labelling>>;

impl Labelling {
    /// Begins the work on a recording; what takes long is done beside it.
    ///
    /// # Errors
    /// Labels that are broken, and another program that writes them.
    pub fn new(file: &std::path::Path, recording: Recording, labels: Target, options: Options) -> Result<Arc<Self>> {
        let labels = Labels::new(file, labels, Site::of(&recording))?;
        labels.read()?;
        let images = camera::Images::of(file);
        let (maps, proposals, follower) = (Maps::default(), OnceLock::new(), OnceLock::new());
        let this = Arc::new(Self { recording, labels, maps, proposals, follower, images });
        let worker = this.clone();
        std::thread::spawn(move || {
            worker.follower.get_or_init(|| Follower::new(&worker.recording));
            let found = serde_json::to_vec(&propose(&worker.recording, &|_| ()));
            let _ = worker.proposals.set(found.unwrap_or_else(|_| b"[]".to_vec()));
            if let Err(error) = worker.maps.fill(&worker.recording, &options) {
                // where nobody reads it, nobody is told
                let _ = writeln!(std::io::stderr(), "no estimated visibility: {error:#}");
            }
        });
        Ok(this)
    }

    /// The answers, under a server's address.
    pub fn routes(self: Arc<Self>, server: &Server) -> Router {
        let path = |path: &str| server.path(path);
        Router::new()
            .route(&path("/"), get(|| async { assets::answer("index.html") }))
            .route(&path("/assets/{name}"), get(|Path(name): Path<String>| async move { assets::answer(&name) }))
            .route(&path("/recording"), get(recording))
            .route(&path("/points"), get(async |State(this): Shared| points::bytes(&this.recording)))
            .route(&path("/visibility/{frame}"), get(visibility))
            .route(&path("/camera/{frame}"), get(image))
            .route(&path("/proposals"), get(proposals))
            .route(&path("/follow"), post(follow))
            .route(&path("/labels"), get(labels).put(save))
            .route(&path("/boxes"), get(boxes))
            .route(&path("/writer"), post(hold))
            .layer(DefaultBodyLimit::max(LABELS_BYTES))
            .with_state(self)
    }
}

async fn recording(State(this): Shared) -> Response {
    json(&Description::of(&this.recording, !this.images.is_empty()))
}

/// The map of a frame; 202 while it is not found yet.
async fn visibility(State(this): Shared, Path(frame): Path<usize>) -> Response {
    if frame >= this.recording.frames.len() {
        return (StatusCode::NOT_FOUND, "the recording has no such frame\n").into_response();
    }
    let Some((cells, map)) = this.maps.at(frame) else {
        return (StatusCode::ACCEPTED, "not found yet\n").into_response();
    };
    match serde_json::to_string(&cells) {
        Ok(cells) => ([(CELLS, cells)], map).into_response(),
        Err(error) => broken(&error.into()),
    }
}

async fn image(State(this): Shared, Path(frame): Path<usize>) -> Response {
    let time_ns = this.recording.frames.get(frame).map(|f| f.time_ns);
    match time_ns.and_then(|time_ns| this.images.at(time_ns)) {
        Some((kind, bytes)) => ([(header::CONTENT_TYPE, kind)], bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no picture\n").into_response(),
    }
}

/// Tracks the machine offers; 202 while they are not found yet.
async fn proposals(State(this): Shared) -> Response {
    match this.proposals.get() {
        Some(found) => as_json(found.clone()),
        None => (StatusCode::ACCEPTED, "not found yet\n").into_response(),
    }
}

/// A click on a vehicle: its track as it is, where the click was, and the tracks of others.
#[derive(Deserialize)]
struct Click {
    track: LabelTrack,
    click: LabelPoint,
    others: Vec<LabelTrack>,
}

/// The track through a click; 204 where nothing is to follow, 202 while the reflections are not sorted yet.
async fn follow(State(this): Shared, body: Bytes) -> Response {
    let click: Click = match serde_json::from_slice(&body) {
        Ok(click) => click,
        Err(error) => {
            return (StatusCode::UNPROCESSABLE_ENTITY, format!("this is no click: {error}\n")).into_response();
        }
    };
    let checked = click.others.iter().try_for_each(LabelTrack::check);
    let own = match click.track.check() {
        // one that begins has no points
        Err(TrackError::TooFewPoints { .. }) => Ok(()),
        other => other,
    };
    if let Err(error) = checked.and(own) {
        return (StatusCode::UNPROCESSABLE_ENTITY, format!("{error}\n")).into_response();
    }
    let found = tokio::task::spawn_blocking(move || {
        let follower = this.follower.get().ok_or(StatusCode::ACCEPTED)?;
        follower.through(&click.track, click.click, &click.others).ok_or(StatusCode::NO_CONTENT)
    });
    match found.await {
        Ok(Ok(track)) => json(&track),
        Ok(Err(status)) => status.into_response(),
        Err(error) => broken(&error.into()),
    }
}

async fn labels(State(this): Shared) -> Response {
    match this.labels.read() {
        Ok((version, tracks)) => ([(VERSION, version.to_string())], json(&tracks)).into_response(),
        Err(error) => (StatusCode::UNPROCESSABLE_ENTITY, format!("{error:#}\n")).into_response(),
    }
}

/// Saves tracks and answers with their boxes.
async fn save(State(this): Shared, headers: HeaderMap, body: Bytes) -> Response {
    let number = |name: &HeaderName| headers.get(name).and_then(|value| value.to_str().ok()?.parse().ok()).unwrap_or(0);
    let tracks: Vec<LabelTrack> = match serde_json::from_slice(&body) {
        Ok(tracks) => tracks,
        Err(error) => {
            return (StatusCode::UNPROCESSABLE_ENTITY, format!("these are no tracks: {error}\n")).into_response();
        }
    };
    match this.labels.save(number(&WRITER), number(&VERSION), &tracks) {
        Ok(version) => ([(VERSION, version.to_string())], json(&this.labels.boxes(&tracks))).into_response(),
        Err(error) => {
            let status = match error {
                NotSaved::AnotherPage | NotSaved::Changed(_) => StatusCode::CONFLICT,
                NotSaved::Track(_) => StatusCode::UNPROCESSABLE_ENTITY,
                NotSaved::File(_) => StatusCode::INSUFFICIENT_STORAGE,
            };
            (status, format!("{error}\n")).into_response()
        }
    }
}

async fn boxes(State(this): Shared) -> Response {
    match this.labels.read() {
        Ok((_, tracks)) => json(&this.labels.boxes(&tracks)),
        Err(error) => (StatusCode::UNPROCESSABLE_ENTITY, format!("{error:#}\n")).into_response(),
    }
}

/// The right to write, for as long as the answer lasts; 202 while another page has it.
async fn hold(State(this): Shared) -> Response {
    match this.labels.hold() {
        Some(body) => body.into_response(),
        None => (StatusCode::ACCEPTED, "another page writes these labels\n").into_response(),
    }
}
