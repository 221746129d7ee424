//! What the page of `viewshed view` asks for, one answer a path.
//!
//! [`instants`] holds what there is to see, as [`instant`] describes it; [`recorded`] and [`broadcast`] make it.

pub mod broadcast;
pub mod instant;
pub mod instants;
pub mod recorded;

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Serialize;
use serde_json::json;

use super::camera::Images;
use super::server::Server;
use super::{as_json, assets};
use crate::geometry::sight::shadow;
use crate::recording::Recording;
use instant::{Box3, Remembered};
use instants::Instants;

/// How long a page waits for news before it asks again.
const PATIENCE: Duration = Duration::from_secs(20);
/// Instants that are looked through for the time since when a cell is as it is.
const LOOKED_BACK: usize = 1500;

/// What the page is told before everything else.
#[derive(Debug, Clone, Serialize)]
pub struct About {
    pub name: String,
    /// `recording`, `log` or `live`.
    pub source: &'static str,
    pub sensor: String,
    /// How many sensors a recording has.
    pub sensors: usize,
    /// Whose data it is, and whether it is synthetic.
    pub notes: Vec<String>,
    /// What was wrong with the input.
    pub problems: Vec<String>,
    pub labelled: bool,
    pub slice_height_m: f64,
    /// Corners of the field of view on the road.
    pub field_of_view: Vec<[f64; 2]>,
    pub camera: Option<Camera>,
}

/// How a camera shows the road.
#[derive(Debug, Clone, Serialize)]
pub struct Camera {
    pub size_px: [u32; 2],
    pub focal_px: [f64; 2],
    pub center_px: [f64; 2],
    pub position: [f64; 3],
    /// Rows: ahead, left, up; columns: the road's x, y, z.
    pub rotation: [[f64; 3]; 3],
    pub has_pictures: bool,
}

/// A source that is looked at.
pub struct Viewing {
    pub about: About,
    pub instants: Instants,
    images: Images,
    /// Time of each frame of a recording, for its pictures.
    times_ns: Vec<i64>,
}

type Shared = State<Arc<Viewing>>;

impl About {
    /// Of the radars of a recording; what is not of each is the first one's.
    pub fn recording(radars: &[Recording], images: &Images, slice_height_m: f64) -> Self {
        let sensors: Vec<&str> = radars.iter().map(|radar| radar.sensor.name.as_str()).collect();
        let Some(recording) = radars.first() else { return Self::broadcast(String::new(), "recording", Vec::new()) };
        let start = recording.frames.first().map_or(0, |f| f.time_ns);
        let (pose, view) = (&recording.pose, &recording.sensor.field_of_view);
        let [right, left] = view.azimuth_rad;
        let corner = |azimuth: f64| {
            let heading = pose.yaw_rad() + azimuth;
            [pose.position[0] + view.range_m[1] * heading.cos(), pose.position[1] + view.range_m[1] * heading.sin()]
        };
        let arc = (0..=48).map(|k| corner(right + (left - right) * f64::from(k) / 48.0));
        let camera = recording.camera.as_ref().map(|camera| Camera {
            size_px: camera.intrinsics.size_px,
            focal_px: camera.intrinsics.focal_px,
            center_px: camera.intrinsics.center_px,
            position: camera.pose.position,
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| camera.pose.rotate_to_road(axis)),
            has_pictures: !images.is_empty(),
        });
        let synthetic = recording.sensor.synthetic.then(|| "synthetic".to_owned());
        let licence = recording.sensor.licence.as_ref().map(|licence| format!("licence: {licence}"));
        Self {
            name: recording.name.clone(),
            source: "recording",
            sensor: sensors.join(", "),
            sensors: radars.len(),
            notes: synthetic.into_iter().chain(licence).collect(),
            problems: recording.problems.iter().map(|p| p.since(start)).collect(),
            labelled: recording.truth.is_some(),
            slice_height_m,
            field_of_view: [[pose.position[0], pose.position[1]]].into_iter().chain(arc).collect(),
            camera,
        }
    }

    /// Of a broadcast.
    pub fn broadcast(name: String, source: &'static str, problems: Vec<String>) -> Self {
        Self {
            name,
            source,
            sensor: String::new(),
            sensors: 0,
            notes: Vec::new(),
            problems,
            labelled: false,
            slice_height_m: 1.0,
            field_of_view: Vec::new(),
            camera: None,
        }
    }
}

impl Viewing {
    /// Of the radars of a recording, with the pictures in its file.
    pub fn recording(radars: &[Recording], file: &std::path::Path, slice_height_m: f64) -> Arc<Self> {
        let images = Images::of(file);
        let about = About::recording(radars, &images, slice_height_m);
        let times_ns = radars.iter().take(1).flat_map(|radar| &radar.frames).map(|f| f.time_ns).collect();
        Arc::new(Self { about, instants: Instants::default(), images, times_ns })
    }

    /// Of a broadcast.
    pub fn broadcast(about: About) -> Arc<Self> {
        let (instants, images) = (Instants::default(), Images::none());
        Arc::new(Self { about, instants, images, times_ns: Vec::new() })
    }

    /// The answers, under a server's address.
    pub fn routes(self: Arc<Self>, server: &Server) -> Router {
        let path = |path: &str| server.path(path);
        Router::new()
            .route(&path("/"), get(|| async { assets::answer("view.html") }))
            .route(&path("/assets/{name}"), get(|Path(name): Path<String>| async move { assets::answer(&name) }))
            .route(&path("/about"), get(async |State(this): Shared| super::json(&this.about)))
            .route(&path("/overview/{from}"), get(overview))
            .route(&path("/instant/{number}"), get(instant))
            .route(&path("/newer/{after}"), get(newer))
            .route(&path("/cell/{number}/{map}/{azimuth}/{range}"), get(cell))
            .route(&path("/camera/{number}"), get(image))
            .with_state(self)
    }
}

async fn overview(State(this): Shared, Path(from): Path<usize>) -> Response {
    super::json(&this.instants.overview(from))
}

fn packed(bytes: &[u8]) -> Response {
    let kind = [(header::CONTENT_TYPE, "application/json"), (header::CONTENT_ENCODING, "gzip")];
    (kind, bytes.to_vec()).into_response()
}

/// An instant; 202 while it is not found yet, 410 when it is not kept any more.
async fn instant(State(this): Shared, Path(number): Path<usize>) -> Response {
    if let Some(bytes) = this.instants.at(number) {
        return packed(&bytes);
    }
    let overview = this.instants.overview(usize::MAX);
    match number {
        n if n < overview.kept_from => (StatusCode::GONE, "this instant is not kept any more\n").into_response(),
        _ if !overview.done => (StatusCode::ACCEPTED, "not found yet\n").into_response(),
        _ => (StatusCode::NOT_FOUND, "there is no such instant\n").into_response(),
    }
}

/// The newest instant when there are more than `after`; 204 when none came for a while, `null` when none will.
async fn newer(State(this): Shared, Path(after): Path<usize>) -> Response {
    match tokio::time::timeout(PATIENCE, this.instants.newer(after)).await {
        Ok(Some(bytes)) => packed(&bytes),
        Ok(None) => super::json(&()),
        Err(_) => StatusCode::NO_CONTENT.into_response(),
    }
}

async fn image(State(this): Shared, Path(number): Path<usize>) -> Response {
    match this.times_ns.get(number).and_then(|time_ns| this.images.at(*time_ns)) {
        Some((kind, bytes)) => ([(header::CONTENT_TYPE, kind)], bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no picture\n").into_response(),
    }
}

/// What is known of a cell.
async fn cell(State(this): Shared, Path(place): Path<(usize, usize, usize, usize)>) -> Response {
    // it looks through many instants, while others want to be answered
    match tokio::task::spawn_blocking(move || told(&this, place)).await {
        Ok(Some(answer)) => as_json(answer.to_string().into_bytes()),
        _ => (StatusCode::NOT_FOUND, "there is no such cell\n").into_response(),
    }
}

fn told(this: &Viewing, (number, map, azimuth, range): (usize, usize, usize, usize)) -> Option<serde_json::Value> {
    let now = this.instants.remembered(number)?;
    let shown = now.maps.get(map)?;
    let (grade, state) = shown.cell(azimuth, range)?;
    let place = shown.cells.middle(azimuth, range);
    let mut since_s = now.sample.time_s;
    let mut is_longer = true;
    for before in (number.saturating_sub(LOOKED_BACK)..number).rev() {
        let Some(then) = this.instants.remembered(before) else { break };
        let same = |m: &instant::Shown| {
            m.name == shown.name && m.cell(azimuth, range).is_some_and(|(_, s)| s & 3 == state & 3)
        };
        if !then.maps.get(map).is_some_and(same) {
            is_longer = false;
            break;
        }
        since_s = then.sample.time_s;
    }
    // the first instant of all is as far back as can be known
    let since_begin = is_longer && number <= LOOKED_BACK;
    let [x, y, height, _] = shown.cells.mount;
    let sensor = [x, y, height];
    Some(json!({
        "x_m": place[0],
        "y_m": place[1],
        "range_m": (range as f64 + 0.5) * shown.cells.cell_m,
        "azimuth_deg": azimuth_deg(shown.cells.mount, place),
        "grade": grade,
        "state": state,
        "probability": shown.probability(azimuth, range),
        "since_s": since_s,
        "since_begin": since_begin,
        "or_longer": is_longer && !since_begin,
        "age_ms": shown.ages_ms.as_ref().and_then(|ages| ages.get(azimuth).copied().flatten()),
        "shadows": casting(&now.obstacles, sensor, place, this.about.slice_height_m),
        "hidden_by": casting(&now.boxes, sensor, place, this.about.slice_height_m),
        "stands_on": on(&now, place),
    }))
}

/// Where a place lies from where a sensor looks, degrees, + to its left, -180 to 180.
fn azimuth_deg([x, y, _, yaw_rad]: [f64; 4], place: [f64; 2]) -> f64 {
    let azimuth = ((place[1] - y).atan2(place[0] - x) - yaw_rad).to_degrees();
    (azimuth + 180.0).rem_euclid(360.0) - 180.0
}

/// Numbers of the boxes whose shadow reaches a place, the nearest to the sensor first.
fn casting(boxes: &[Box3], [x, y, height]: [f64; 3], place: [f64; 2], slice_height_m: f64) -> Vec<usize> {
    let casts = |b: &Box3| shadow([x, y, height], &b.solid(), slice_height_m).is_some_and(|s| s.contains(place));
    let mut all: Vec<usize> = (0..boxes.len()).filter(|k| boxes.get(*k).is_some_and(casts)).collect();
    let distance = |k: &usize| boxes.get(*k).map_or(0.0, |b| (b.center[0] - x).hypot(b.center[1] - y));
    all.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    all
}

/// The labelled vehicle that stands on a place.
fn on(now: &Remembered, place: [f64; 2]) -> Option<usize> {
    now.boxes.iter().position(|b| b.solid().footprint_distance(place) <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::solid::Solid;

    #[test]
    fn the_obstacle_that_hides_a_place_is_named_and_no_other() {
        let at = |x: f64, y: f64| Box3::of(&Solid { center: [x, y, 2.0], yaw_rad: 0.0, size: [12.0, 2.5, 4.0] });
        let boxes = [at(80.0, 0.0), at(40.0, 0.0), at(40.0, 8.0)];
        let sensor = [0.0, 0.0, 6.0];
        assert_eq!(casting(&boxes, sensor, [100.0, 0.0], 1.0), [1, 0], "the nearer first");
        assert_eq!(casting(&boxes, sensor, [60.0, 0.0], 1.0), [1]);
        assert!(
            casting(&boxes, sensor, [60.0, -8.0], 1.0).is_empty()
                && casting(&boxes, sensor, [20.0, 0.0], 1.0).is_empty()
        );
    }

    #[test]
    fn an_azimuth_is_told_from_where_the_sensor_looks_and_never_a_turn_off() {
        let told = |yaw_deg: f64, to_deg: f64| {
            let (sin, cos) = to_deg.to_radians().sin_cos();
            azimuth_deg([10.0, 5.0, 6.0, yaw_deg.to_radians()], [10.0 + 40.0 * cos, 5.0 + 40.0 * sin])
        };
        for (yaw_deg, to_deg, expected) in [
            (0.0, 20.0, 20.0),
            (170.0, 200.0, 30.0),
            (170.0, 160.0, -10.0),
            (-170.0, 150.0, -40.0),
            (200.0, 190.0, -10.0),
        ] {
            assert!((told(yaw_deg, to_deg) - expected).abs() < 1e-9, "{yaw_deg} {to_deg}: {}", told(yaw_deg, to_deg));
        }
    }
}
