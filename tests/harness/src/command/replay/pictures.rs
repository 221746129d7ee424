//! The pictures of one replay: a frame from above, found examples, the polar grid, the trade-offs, a camera's view.

use anyhow::Result;
use viewshed::sensor::road::RoadPoint;

use super::window::window;
use crate::command::progress::bar;
use crate::estimators::{Estimator, at_risk, camera_3d};
use crate::evaluation::counts::Outcome;
use crate::evaluation::curve::CurvePoint;
use crate::evaluation::examples::Example;
use crate::evaluation::replay::{Replay, visit};
use crate::evaluation::summary::Row;
use crate::evaluation::{Grid, Settings, bounds};
use crate::recording::truth::Object;
use crate::results::files::Folder;
use crate::results::pictures::birdseye;
use crate::results::pictures::camera_view::{self, View};
use crate::results::pictures::cells::Carries;
use crate::results::pictures::polar::{self, PolarGrid};
use crate::results::pictures::scene::{Highlight, Scene, TruthBox};
use crate::results::pictures::tradeoff::{self, Counted, Curve, Marker, MarkerKind, Span, TradeOff};
use crate::results::pictures::{canvas::Canvas, palette};

/// Whether an estimator is drawn from above at the chosen frame, beside the one examples are of: `radar-3d` with
/// whatever it was told, and what it is compared with.
fn also_drawn(name: &str) -> bool {
    name.starts_with("radar-3d-") || ["radar-2d", "true-boxes", "camera-true-boxes"].contains(&name)
}

/// Draws everything into a folder; `all` are the estimators of the table.
pub fn write(
    folder: &Folder,
    replay: &Replay,
    mut all: Vec<Box<dyn Estimator>>,
    shown: &str,
    examples: &[Example],
    asked: Option<usize>,
    settings: &Settings,
) -> Result<()> {
    let drawing = bar("drawing pictures", 1);
    let chosen = asked.unwrap_or_else(|| chosen_frame(replay, examples));
    all.retain(|estimator| estimator.name() == shown || also_drawn(estimator.name()));
    let mut drawn: Vec<Vec<Named>> = all.iter().map(|_| Vec::new()).collect();
    let mut outcome = Ok(());
    let mut draw = |frame: usize, k: usize, estimator: &dyn Estimator| -> Result<()> {
        let (Some(drawn), name) = (drawn.get_mut(k), estimator.name()) else { return Ok(()) };
        if name == shown {
            drawn.extend(shown_frame(replay, examples, estimator, frame, frame == chosen, settings)?);
        } else if frame == chosen {
            drawn.push((format!("birdseye-{name}"), from_above(replay, estimator, frame, None, settings)));
        }
        Ok(())
    };
    let frames: Vec<usize> = examples.iter().map(|e| e.frame).chain([chosen]).collect();
    visit(&replay.recording, &mut all, &frames, |frame, k, estimator| {
        if outcome.is_ok() {
            outcome = draw(frame, k, estimator);
        }
    });
    outcome?;
    for (name, canvas) in drawn.into_iter().flatten() {
        save(Some(canvas), folder, &name)?;
    }
    save(trade_off(replay, Counted::Objects, |row| (&row.curve, rates(row))), folder, "tradeoff-objects")?;
    save(trade_off(replay, Counted::Cells, |row| (&row.cell_curve, cell_rates(row))), folder, "tradeoff-cells")?;
    drawing.step();
    Ok(())
}

/// A picture with the name of its file.
type Named = (String, Canvas);

fn save(canvas: Option<Canvas>, folder: &Folder, name: &str) -> Result<()> {
    canvas.map_or(Ok(()), |c| c.save(&folder.file(format!("{name}.png"))?))
}

/// The frame of the true invisible example, which has something to show; else the middle one.
pub fn chosen_frame(replay: &Replay, examples: &[Example]) -> usize {
    let telling = examples.iter().find(|e| e.outcome == Outcome::Ti).or(examples.first());
    telling.map_or(replay.recording.count() / 2, |e| e.frame)
}

fn shown_frame(
    replay: &Replay,
    examples: &[Example],
    estimator: &dyn Estimator,
    frame: usize,
    chosen: bool,
    settings: &Settings,
) -> Result<Vec<Named>> {
    let (name, mut drawn) = (estimator.name(), Vec::new());
    if chosen {
        drawn.push((format!("birdseye-{name}"), from_above(replay, estimator, frame, None, settings)));
        drawn.extend(polar_grid(replay, estimator, frame).map(|canvas| (format!("polar-{name}"), canvas)));
        drawn.extend(camera_view(replay, estimator, frame, settings)?.map(|canvas| ("camera-view".to_owned(), canvas)));
    }
    for example in examples.iter().filter(|e| e.frame == frame) {
        let picture = from_above(replay, estimator, frame, Some(example), settings);
        drawn.push((format!("example-{}", example.outcome.name()), picture));
    }
    Ok(drawn)
}

pub fn title(replay: &Replay, name: &str, frame: usize) -> String {
    let recording = &replay.recording;
    let time = recording.frame(frame).map_or(0, |f| f.time_ns.saturating_sub(recording.start_ns()));
    format!("{} · {name} · {:.2} s", recording.name, time as f64 * 1e-9)
}

/// What has to be said of the data: whose it is.
fn caption(replay: &Replay) -> Option<String> {
    let sensor = &replay.recording.sensor;
    Some(match &sensor.licence {
        Some(licence) => format!("{} · {licence}", sensor.name),
        None => sensor.name.clone(),
    })
}

/// A frame as an estimator has it, from above.
pub fn from_above(
    replay: &Replay,
    estimator: &dyn Estimator,
    frame: usize,
    example: Option<&Example>,
    settings: &Settings,
) -> Canvas {
    let recording = &replay.recording;
    let objects = objects_at(replay, frame);
    let by_cells = settings.evaluation.grid == Grid::Cartesian;
    let seldom_visible = |o: &Object| {
        let seen = cells_in_sight(replay, estimator, frame, o.track);
        seen.is_some_and(|(visible, all)| visible > 0 && 2 * visible <= all)
    };
    let any_cell = objects.iter().any(seldom_visible);
    let highlight = example.and_then(|e| {
        let sample = replay.samples.get(frame)?.objects.get(e.object)?;
        let solid = objects.iter().find(|o| o.track == sample.track)?.solid;
        let cells = cells_in_sight(replay, estimator, frame, sample.track).filter(|_| by_cells);
        let by = cells.map(|(visible, all)| format!("; {visible} of the {all} cells under it are visible"));
        let note = format!(
            "{}: {} {} at {:.0} m, lasting {} frames{}",
            e.outcome.name(),
            e.class,
            e.object_id,
            e.distance_m,
            e.lasts,
            by.unwrap_or_default()
        );
        Some(Highlight::on(solid, &recording.pose, note))
    });
    let mut scene = scene(replay, estimator, frame, highlight, settings);
    if by_cells && any_cell {
        scene.caption = scene.caption.map(|said| format!("{said} · {ANY_CELL}"));
    }
    birdseye::draw(&scene)
}

/// What is about one labelled object at a frame, enlarged; `None` where it is not labelled then.
pub fn about(
    replay: &Replay,
    estimator: &dyn Estimator,
    frame: usize,
    track: usize,
    width_px: i32,
    settings: &Settings,
) -> Option<Canvas> {
    let solid = objects_at(replay, frame).into_iter().find(|o| o.track == track)?.solid;
    let highlight = Highlight::on(solid, &replay.recording.pose, "");
    birdseye::tile(&scene(replay, estimator, frame, Some(highlight), settings), width_px)
}

fn objects_at(replay: &Replay, frame: usize) -> Vec<Object> {
    let recording = &replay.recording;
    recording.truth.as_ref().zip(recording.frame(frame)).map(|(t, f)| t.at(f.time_ns)).unwrap_or_default()
}

/// The labelled boxes of a frame, and what became of them by an estimator.
pub fn boxes(replay: &Replay, estimator: &str, frame: usize) -> Vec<TruthBox> {
    let outcome = |track| {
        let (visible, detected) = replay.judged(estimator, frame, track)?;
        Some(palette::Outcome::of(visible, detected))
    };
    let of = |o: &Object| TruthBox { solid: o.solid, outcome: outcome(o.track) };
    objects_at(replay, frame).iter().map(of).collect()
}

/// Everything there is to be drawn of a frame.
fn scene<'a>(
    replay: &'a Replay,
    estimator: &'a dyn Estimator,
    frame: usize,
    highlight: Option<Highlight>,
    settings: &'a Settings,
) -> Scene<'a> {
    let told = has_given_lanes(estimator.name());
    let recording = &replay.recording;
    Scene {
        map: estimator.map(),
        carries: Carries::ALL,
        pose: recording.pose,
        field_of_view: recording.sensor.field_of_view,
        slice_height_m: settings.evaluation.slice_height_m,
        window: window(&replay.recording),
        detections: recording.frame(frame).map_or(&[], |f| &f.detections),
        boxes: boxes(replay, estimator.name(), frame),
        road: &[],
        lanes: if told { settings.estimators.lanes.as_slice().into() } else { estimator.learnt_lanes().into() },
        lanes_numbered: told,
        title: title(replay, estimator.name(), frame),
        caption: caption(replay),
        highlight,
    }
}

/// Whether an estimator is given the lanes.
fn has_given_lanes(name: &str) -> bool {
    name.ends_with("-lanes") || name.ends_with("-site") || name == at_risk::NAME
}

/// Said where a box called visible stands on cells of which most are not.
const ANY_CELL: &str =
    "An object is called visible where any of the 1 m cells under it is: a box on orange can be FV or TV.";

/// Visible cells under an object, and all of them.
fn cells_in_sight(replay: &Replay, estimator: &dyn Estimator, frame: usize, track: usize) -> Option<(usize, usize)> {
    let sample = replay.samples.get(frame)?.objects.iter().find(|s| s.track == track)?;
    let visible = |&&(i, j): &&(i32, i32)| estimator.map().at(RoadPoint::cell_centre(i, j)).visible();
    Some((sample.cells.iter().filter(visible).count(), sample.cells.len()))
}

pub fn polar_grid(replay: &Replay, estimator: &dyn Estimator, frame: usize) -> Option<Canvas> {
    let cells = estimator.polar()?;
    Some(polar::draw(&PolarGrid {
        azimuths: cells.azimuths,
        ranges: cells.ranges,
        azimuth_rad: cells.azimuth_rad,
        narrow: cells.narrow,
        range_m: [0.0, cells.cell_m * cells.ranges as f64],
        state: &*cells.cell,
        carries: Carries::ALL,
        title: title(replay, estimator.name(), frame),
        caption: caption(replay),
    }))
}

/// A camera's picture of a frame, with what the estimator made of it.
pub fn camera_view(
    replay: &Replay,
    estimator: &dyn Estimator,
    frame: usize,
    settings: &Settings,
) -> Result<Option<Canvas>> {
    let Some(camera) = replay.recording.of_camera() else { return Ok(None) };
    let Some(own) = camera.frames.get(frame) else { return Ok(None) };
    let lifted = camera_3d::lifted(camera, own, &settings.estimators.camera_3d)?;
    Ok(Some(camera_view::draw(&View {
        intrinsics: camera.intrinsics,
        pose: camera.pose,
        map: estimator.map(),
        boxes: &own.boxes,
        lifted: &lifted,
        title: title(replay, estimator.name(), frame),
        caption: caption(replay),
    })))
}

/// A point with its intervals: FVR, FIR.
type Rates = [(Option<f64>, Option<[f64; 2]>); 2];

fn rates(row: &Row) -> Rates {
    let i = &row.intervals;
    [(row.counts.fvr(), i.fvr.as_ref().map(|i| [i.0, i.1])), (row.counts.fir(), i.fir.as_ref().map(|i| [i.0, i.1]))]
}

fn cell_rates(row: &Row) -> Rates {
    let i = &row.intervals;
    [
        (row.cell_fvr(), i.cell_fvr.as_ref().map(|i| [i.0, i.1])),
        (row.cell_fir(), i.cell_fir.as_ref().map(|i| [i.0, i.1])),
    ]
}

/// The chart, unless there is nothing to draw.
fn trade_off(replay: &Replay, counted: Counted, of: impl Fn(&Row) -> (&Vec<CurvePoint>, Rates)) -> Option<Canvas> {
    let what = match counted {
        Counted::Objects => "objects",
        Counted::Cells => "road cells",
    };
    let mut chart = TradeOff {
        curves: Vec::new(),
        markers: Vec::new(),
        counted,
        span: Span::Full,
        title: format!(
            "{} · {what} · false visible against false invisible, by the threshold on the grade",
            replay.recording.name
        ),
        caption: caption(replay),
    };
    for row in &replay.summary.rows {
        let (points, [(fvr, fvr_interval), (fir, fir_interval)]) = of(row);
        if !points.is_empty() && row.name != "radar-2d-first" {
            // both readings of the flat grid lie on one curve
            let points = points.iter().map(|p| tradeoff::CurvePoint {
                threshold: Some(f64::from(p.threshold)),
                fvr: p.fvr,
                fir: p.fir,
            });
            chart.curves.push(Curve { name: row.name.clone(), points: points.collect() });
        }
        let (Some(fvr), Some(fir)) = (fvr, fir) else { continue };
        let kind = match row.name.as_str() {
            bounds::SLICE => MarkerKind::Slice,
            bounds::BOX => MarkerKind::Box,
            _ => MarkerKind::OperatingPoint,
        };
        chart.markers.push(Marker { name: row.name.clone(), kind, fvr, fir, fvr_interval, fir_interval });
    }
    (!chart.markers.is_empty()).then(|| tradeoff::draw(&chart))
}

#[cfg(test)]
mod tests {
    use viewshed::map::query::Footprint;
    use viewshed::map::{CellState, Visibility, VisibilityMap};

    use super::*;
    use crate::evaluation::Options;
    use crate::evaluation::samples::made_up;
    use crate::recording::Frame;

    /// Visible to the right of the road's axis.
    struct Half;

    impl VisibilityMap for Half {
        fn at(&self, point: RoadPoint) -> CellState {
            let visibility = if point.y_cm < 0 { Visibility::Visible } else { Visibility::Invisible };
            CellState { visibility, grade: 255, occupancy: 0, occupied: false }
        }

        fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    impl Estimator for Half {
        fn name(&self) -> &str {
            "half"
        }
        fn reset(&mut self) {}
        fn step(&mut self, _: &Frame) {}
        fn map(&self) -> &dyn VisibilityMap {
            self
        }
    }

    fn replay(recording: crate::recording::Recording) -> Replay {
        Replay::new(recording, &mut [], &Options { warm_up_s: 0.0, bootstrap: 0, ..Options::default() }, &|| ())
    }

    #[test]
    fn all_that_is_said_of_a_site_has_a_picture() {
        for name in ["radar-2d", "radar-3d-narrow", "radar-3d-site", "radar-3d-small", "radar-3d-ground", at_risk::NAME]
        {
            assert!(also_drawn(name), "{name}");
        }
        // both readings of the flat grid are one map
        assert!(!also_drawn("radar-2d-first"));
        assert!(has_given_lanes("radar-3d-small-lanes") && !has_given_lanes("radar-3d-learning"));
    }

    #[test]
    fn the_cells_that_make_an_object_visible_are_counted() {
        // 4.6 x 1.8 m: five or six cells long, y from -0.9 to 0.9
        let replay = replay(made_up::recording(2, 1));
        let (visible, all) = cells_in_sight(&replay, &Half, 0, 0).unwrap();
        assert!(2 * visible == all && all >= 10, "{visible} of {all}");
        assert_eq!(cells_in_sight(&replay, &Half, 0, 7), None, "nobody of that name");
    }
}
