//! A replay as JSON with stable keys.
//!
//! Rates are shares, 0 to 1; `null` is n/a: nothing to divide by. Distances and differences are in
//! points (hundredths). Intervals are `[low, high]`, 95 %.

use anyhow::Result;
use serde::Serialize;
use serde_json::{Map, Value, json};
use viewshed::{Ars408Wanted, ESTIMATOR_VERSION};

use super::ORIGIN;
use crate::estimators;
use crate::evaluation::breakdown::{Breakdown, band_name};
use crate::evaluation::causes::Causes;
use crate::evaluation::cells::CellCounts;
use crate::evaluation::comparison::Comparison;
use crate::evaluation::counts::Counts;
use crate::evaluation::curve::CurvePoint;
use crate::evaluation::examples::Example;
use crate::evaluation::mount_error::Sensitivity;
use crate::evaluation::replay::Replay;
use crate::evaluation::summary::{Distance, Intervals, Row, Summary};
use crate::evaluation::units::RUN_BLOCKS;
use crate::evaluation::{self, Grid};
use crate::geometry::pose::SensorPose;
use crate::recording::problems::Problem;
use crate::recording::{FieldOfView, LabelsFrom, ReadOptions, Recording};

/// Everything one recording gave.
#[derive(Serialize)]
pub struct Report {
    /// File stem.
    pub recording: String,
    /// Counted frames.
    pub frames: usize,
    /// Distinct tracks counted.
    pub objects: usize,
    pub coverage_rate: Option<f64>,
    pub estimators: Vec<Estimator>,
    /// The same of a camera beside the radar, judged in its own field of view.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    coverage_interval: Option<Value>,
    comparisons: Vec<Comparison>,
    mount_error: Option<Vec<Sensitivity>>,
    /// Why cells are wrong, where that was asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<Value>,
    examples: Vec<Example>,
    resampling: Resampling,
    /// What was drawn again for object rates, in the order of `by_unit`.
    units: Vec<String>,
    sensor: Value,
    input: Input,
    options: Value,
    /// Of the library's estimators, with another of which the same recording may give other figures.
    estimator_version: u16,
    origin: Option<&'static str>,
    /// Of all sensors of the file, with the first of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fused: Option<Value>,
}

/// The camera of a recording.
#[derive(Serialize)]
pub struct Camera {
    frames: usize,
    objects: usize,
    coverage_rate: Option<f64>,
    pub estimators: Vec<Estimator>,
    resampling: Resampling,
    units: Vec<String>,
    sensor: Value,
}

/// One row of the table.
#[derive(Serialize)]
pub struct Estimator {
    pub name: String,
    #[serde(flatten)]
    rates: Rates,
    pub cell_fvr: Option<f64>,
    pub cell_fir: Option<f64>,
    /// Cell-time-steps: `blocked`, `blocked_visible`, `clear`, `clear_not_visible`.
    cells: Option<Value>,
    intervals: Intervals,
    distance_to_geometry_slice: Distance,
    distance_to_geometry_box: Distance,
    /// Object-time-steps with no known cell.
    unknown: u64,
    grid: Grid,
    breakdown: Value,
    curve: Vec<CurvePoint>,
    cell_curve: Vec<CurvePoint>,
    counters: Map<String, Value>,
    /// Azimuth's noise that the estimator worked with at the end, degrees, where it learns that.
    #[serde(skip_serializing_if = "Option::is_none")]
    azimuth_noise_deg: Option<f64>,
    /// Places at which it has learnt a lane.
    #[serde(skip_serializing_if = "Option::is_none")]
    learnt_lanes: Option<usize>,
    /// Frames whose map had settled since the start and since gaps, of how many, and the rates over these alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    settled: Option<Value>,
    /// Frames in which points came and could not be used, so that all was unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    unusable_frames: Option<usize>,
    /// `TV FV TI FI` of each unit, a line each: what `viewshed compare` draws again.
    by_unit: Vec<String>,
    /// `blocked blocked_visible clear clear_not_visible` of each block of 1 s, in the order of time.
    by_block: Vec<String>,
}

/// Counts and the rates made of them.
#[derive(Serialize)]
pub(super) struct Rates {
    tv: u64,
    fv: u64,
    ti: u64,
    fi: u64,
    tvr: Option<f64>,
    fvr: Option<f64>,
    tir: Option<f64>,
    fir: Option<f64>,
}

/// What the intervals were drawn from.
#[derive(Serialize)]
pub(super) struct Resampling {
    objects_over: &'static str,
    object_units: usize,
    cells_over: &'static str,
    /// Blocks, and how many of them are drawn together.
    cell_units: usize,
    cell_units_in_a_run: usize,
}

/// What was read.
#[derive(Serialize)]
struct Input {
    frames: usize,
    detections: u64,
    duration_s: f64,
    labelled: bool,
    problems: Vec<Problem>,
}

/// Options as they were used.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    pub reading: &'a ReadOptions,
    pub evaluation: &'a evaluation::Options,
    pub estimators: &'a estimators::Options,
}

/// One report for one recording.
pub fn report(replay: &Replay, mount_error: Option<&[Sensitivity]>, examples: &[Example], options: Options) -> Report {
    let Replay { recording, summary, .. } = replay;
    Report {
        recording: recording.name.clone(),
        frames: summary.frames,
        objects: summary.objects,
        coverage_rate: summary.coverage_rate,
        estimators: summary.rows.iter().map(estimator).collect(),
        camera: replay.camera.as_deref().map(camera),
        coverage_interval: summary.coverage_interval.map(|i| json!(i)),
        comparisons: summary.comparisons.clone(),
        mount_error: mount_error.map(<[_]>::to_vec),
        causes: Vec::new(),
        examples: examples.to_vec(),
        resampling: resampling(summary),
        units: summary.unit_names.clone(),
        sensor: sensor(recording),
        input: Input {
            frames: recording.count(),
            detections: recording.extent().detections,
            duration_s: recording.duration_s(),
            labelled: recording.truth.is_some(),
            problems: recording.problems.iter().collect(),
        },
        options: json!({
            "evaluation": options.evaluation,
            "reading": reading(options.reading),
            "estimators": options.estimators,
        }),
        estimator_version: ESTIMATOR_VERSION,
        origin: recording.sensor.synthetic.then_some(ORIGIN),
        fused: None,
    }
}

/// What adds up to the rates of cells, in points.
pub fn causes(all: &[Causes]) -> Vec<Value> {
    let of = |c: &Causes| {
        json!({
            "estimator": c.estimator,
            "cell_fvr": c.cells.fvr(),
            "cell_fir": c.cells.fir(),
            "wrongly_visible": c.wrongly_visible(),
            "wrongly_invisible": c.wrongly_invisible(),
        })
    };
    all.iter().map(of).collect()
}

fn camera(replay: &Replay) -> Camera {
    let summary = &replay.summary;
    Camera {
        frames: summary.frames,
        objects: summary.objects,
        coverage_rate: summary.coverage_rate,
        estimators: summary.rows.iter().map(estimator).collect(),
        resampling: resampling(summary),
        units: summary.unit_names.clone(),
        sensor: sensor(&replay.recording),
    }
}

/// The file for one recording.
pub fn object(report: &Report) -> Result<String> {
    Ok(serde_json::to_string_pretty(report)? + "\n")
}

/// The file for several.
pub fn array(reports: &[Report]) -> Result<String> {
    Ok(serde_json::to_string_pretty(reports)? + "\n")
}

pub(super) fn estimator(row: &Row) -> Estimator {
    Estimator {
        name: row.name.clone(),
        rates: rates(&row.counts),
        cell_fvr: row.cell_fvr(),
        cell_fir: row.cell_fir(),
        cells: row.cells.map(|c| json!(c)),
        intervals: row.intervals.clone(),
        distance_to_geometry_slice: row.to_slice.clone(),
        distance_to_geometry_box: row.to_box.clone(),
        unknown: row.unknown,
        grid: row.grid,
        breakdown: breakdown(&row.breakdown),
        curve: row.curve.clone(),
        cell_curve: row.cell_curve.clone(),
        counters: row.counters.iter().map(|(reason, n)| (reason.clone(), json!(n))).collect(),
        azimuth_noise_deg: row.azimuth_noise_deg,
        learnt_lanes: row.learnt_lanes.filter(|places| *places > 0),
        settled: row.settled.map(|s| {
            json!({
                "frames": s.frames,
                "of": s.of,
                "rates": rates(&s.counts),
                "cells": s.cells,
                "cell_fvr": s.cells.fvr(),
                "cell_fir": s.cells.fir(),
            })
        }),
        unusable_frames: Some(row.unusable).filter(|frames| *frames > 0),
        by_unit: row.by_unit.iter().map(|c| format!("{} {} {} {}", c.tv, c.fv, c.ti, c.fi)).collect(),
        by_block: row.cells.iter().flat_map(|_| row.by_block.iter().map(block)).collect(),
    }
}

fn block(c: &CellCounts) -> String {
    format!("{} {} {} {}", c.blocked, c.blocked_visible, c.clear, c.clear_not_visible)
}

pub(super) fn rates(c: &Counts) -> Rates {
    Rates { tv: c.tv, fv: c.fv, ti: c.ti, fi: c.fi, tvr: c.tvr(), fvr: c.fvr(), tir: c.tir(), fir: c.fir() }
}

fn breakdown(groups: &Breakdown) -> Value {
    let group = |name: String, counts: &Counts| {
        let mut value = json!(rates(counts));
        if let Value::Object(map) = &mut value {
            map.insert("group".into(), name.into());
            map.insert("coverage_rate".into(), json!(counts.coverage()));
        }
        value
    };
    json!({
        "class": groups.class.iter().map(|(class, c)| group(class.clone(), c)).collect::<Vec<_>>(),
        "distance_m": groups.distance.iter().map(|(&band, c)| group(band_name(band), c)).collect::<Vec<_>>(),
        "occlusion": groups.occlusion.iter().map(|(grade, c)| group(grade.to_string(), c)).collect::<Vec<_>>(),
    })
}

pub(super) fn resampling(summary: &Summary) -> Resampling {
    Resampling {
        objects_over: summary.drawn,
        object_units: summary.drawn_units,
        cells_over: "runs of blocks of 1 s",
        cell_units: summary.blocks,
        cell_units_in_a_run: RUN_BLOCKS,
    }
}

fn sensor(recording: &Recording) -> Value {
    let sensor = &recording.sensor;
    json!({
        "name": sensor.name,
        "mount": mount(&recording.pose),
        "field_of_view": field_of_view(&sensor.field_of_view),
        "has_elevation": sensor.has_elevation,
        "frames_independent": sensor.frames_independent,
        "platform_moving": sensor.platform_moving,
        "synthetic": sensor.synthetic,
        "licence": sensor.licence,
    })
}

fn mount(pose: &SensorPose) -> Value {
    let [x, y, z] = pose.position;
    json!({
        "x_m": x, "y_m": y, "z_m": z,
        "yaw_deg": pose.yaw_rad().to_degrees(),
        "pitch_deg": pose.pitch_rad().to_degrees(),
        "roll_deg": pose.roll_rad().to_degrees(),
    })
}

fn field_of_view(view: &FieldOfView) -> Value {
    json!({
        "azimuth_deg": view.azimuth_rad.map(f64::to_degrees),
        "elevation_deg": view.elevation_rad.map(f64::to_degrees),
        "range_m": view.range_m,
    })
}

/// Numbers of the cluster states that are wanted.
fn cluster_states(wanted: Ars408Wanted) -> Vec<u32> {
    (0..u32::BITS).filter(|state| wanted.invalid_states >> state & 1 == 1).collect()
}

/// Reading options as given; `null` where the file itself decided.
pub fn reading(options: &ReadOptions) -> Value {
    let mount = options.mount.map(|[x, y, z, yaw, pitch, roll]| {
        json!({
            "x_m": x, "y_m": y, "z_m": z,
            "yaw_deg": yaw.to_degrees(), "pitch_deg": pitch.to_degrees(), "roll_deg": roll.to_degrees(),
        })
    });
    json!({
        "radar_topic": options.radar_topic,
        "truth_topic": options.truth_topic,
        "labels": match &options.labels {
            LabelsFrom::Usual => None,
            LabelsFrom::Beside => Some("beside".to_owned()),
            LabelsFrom::Recording => Some("recording".to_owned()),
            LabelsFrom::File(file) => Some(file.display().to_string()),
        },
        "mount": mount,
        "field_of_view": options.field_of_view.as_ref().map(field_of_view),
        "sensor_id": options.sensor_id,
        "profile": options.profile.map(|p| p.name),
        "cluster_states": options.wanted.map(cluster_states),
        "ti_header": options.ti_header.map(|f| f.header()),
        "frame_period_s": options.frame_period_s,
        "from_s": options.from_s,
        "to_s": options.to_s,
    })
}
