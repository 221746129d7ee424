//! Several sensors of one recording as one map: table, JSON, and a picture of who sees what.

use anyhow::{Context, Result, bail};
use serde_json::Value;

use super::frame_at;
use crate::command::progress::bar;
use crate::estimators::Estimator;
use crate::evaluation::Settings;
use crate::evaluation::camera;
use crate::evaluation::sensor_set::{self, SensorSet};
use crate::recording::Recording;
use crate::results::files::Folder;
use crate::results::pictures::canvas::Canvas;
use crate::results::pictures::scene::Window;
use crate::results::pictures::who_sees::{self, Sensor, WhoSees};
use crate::results::report::json::Options;
use crate::results::report::{sensor_set as report, table};

/// Room around the road, metres.
const AROUND_M: f64 = 8.0;

/// A set of sensors judged, and drawn at a time.
pub struct FusedReplay {
    set: SensorSet,
    picture: Canvas,
}

/// Whether there is something to be fused: several radars, or the first with its camera if that is asked for.
pub fn is_due(first: Option<&Recording>, radars: usize, asked: bool) -> Result<bool> {
    let Some(first) = first.filter(|first| first.truth.is_some() && !first.sensor.frames_independent) else {
        return Ok(false);
    };
    match (radars, &first.camera) {
        (1, Some(camera)) if !camera.alone => Ok(asked),
        (0 | 1, _) if asked => {
            bail!(
                "{}: --fused is for several radars in one recording, or a camera beside the radar; it has neither",
                first.name
            )
        }
        (n, _) => Ok(n > 1),
    }
}

impl FusedReplay {
    /// Judges all sensors of a recording as a set.
    ///
    /// # Errors
    /// Those of [`sensor_set::judge`]; a time beside the recording.
    pub fn new(name: &str, radars: &[Recording], time_s: Option<f64>, settings: &Settings) -> Result<Self> {
        let first = radars.first().context("no sensor")?;
        let camera = camera::recording(first, f64::from(settings.estimators.camera_3d.range_max_m));
        let named = |radar: &Recording| Recording { name: radar.sensor.name.clone(), camera: None, ..radar.clone() };
        let camera = camera.map(|camera| Recording { name: camera.sensor.name.clone(), ..camera });
        let all: Vec<Recording> = radars.iter().map(named).chain(camera).collect();
        let fusing = bar(&format!("fusing the maps of {name}"), sensor_set::steps(&all));
        let judged = sensor_set::judge(&all, settings, 1, &|| fusing.step())?;
        let set = SensorSet::pooled(&format!("{name}, {} sensors", all.len()), &[&judged], &settings.evaluation);
        let frame = time_s.map_or(Ok(first.frames.len() / 2), |time_s| frame_at(first, time_s))?;
        let picture = draw(name, &all, &judged.road, frame, settings)?;
        Ok(Self { set: set.context("no sensor")?, picture })
    }

    pub fn text(&self, extent: table::Extent) -> String {
        format!("\n{}\n", report::text(&self.set, extent))
    }

    pub fn json(&self, settings: &Settings) -> Value {
        let Settings { reading, evaluation, estimators, .. } = settings;
        report::json(&self.set, Options { reading, evaluation, estimators })
    }

    /// Table and picture into a folder.
    pub fn write(&self, folder: &Folder, extent: table::Extent) -> Result<()> {
        folder.file("fused.txt")?.write(self.text(extent))?;
        self.picture.save(&folder.file("who-sees.png")?)
    }
}

fn draw(name: &str, all: &[Recording], road: &[(i32, i32)], frame: usize, settings: &Settings) -> Result<Canvas> {
    let first = all.first().context("no sensor")?;
    let mut fused = sensor_set::fuse(all, road, 1, settings)?;
    first.frames.iter().take(frame + 1).for_each(|frame| fused.step(frame));
    let (start, now) = (first.frames.first(), first.frames.get(frame).context("no frame")?);
    let objects = first.truth.as_ref().map(|truth| truth.at(now.time_ns)).unwrap_or_default();
    let boxes: Vec<_> = objects.iter().map(|object| object.solid).collect();
    let sensors: Vec<Sensor> = all
        .iter()
        .map(|r| Sensor { name: r.sensor.name.clone(), pose: r.pose, field_of_view: r.sensor.field_of_view })
        .collect();
    let mounts = all.iter().map(|r| [r.pose.position[0], r.pose.position[1]]);
    let places = road.iter().map(|(i, j)| [f64::from(*i), f64::from(*j)]);
    let time_s = (now.time_ns - start.map_or(0, |f| f.time_ns)) as f64 * 1e-9;
    Ok(who_sees::draw(&WhoSees {
        place: &|point| fused.place(point),
        sensors: &sensors,
        window: Window::around(mounts.chain(places), AROUND_M),
        boxes: &boxes,
        slice_height_m: settings.evaluation.slice_height_m,
        title: format!("{name}, who sees what after {time_s:.1} s"),
        caption: first.sensor.synthetic.then(|| "Synthetic data.".to_owned()),
    }))
}
