//! A visibility map as a `foxglove.Grid` message: 1 m cells in the road frame, coloured.

use anyhow::{Result, ensure};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde::Serialize;
use viewshed::map::{CellState, Visibility, VisibilityMap};
use viewshed::sensor::road::RoadPoint;

use super::geometry::{Pose, Time};
use crate::geometry::pose::Spherical;
use crate::recording::Recording;
use crate::recording::mcap::ROAD_FRAME;

pub const SCHEMA_NAME: &str = "foxglove.Grid";
pub const SCHEMA: &str = include_str!("grid.schema.json");

/// Cells a grid may have: 2 km x 2 km.
const MOST_CELLS: i64 = 4_000_000;
/// `foxglove.NumericType`
const UINT8: u8 = 1;
/// Foxglove colours cells directly by fields of these names.
const CHANNELS: [&str; 4] = ["red", "green", "blue", "alpha"];

const VISIBLE: [u8; 4] = [0x9c, 0xcb, 0xec, 150];
const VISIBLE_OCCUPIED: [u8; 4] = [0x2a, 0x33, 0x40, 220];
const INVISIBLE: [u8; 4] = [0xe2, 0x8f, 0x4e, 180];
const UNKNOWN: [u8; 4] = [0; 4];

/// Corner and size of the cells that cover a field of view on the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Extent {
    /// Cell (i, j) of the lower corner.
    pub corner: (i32, i32),
    pub columns: i32,
    pub rows: i32,
}

impl Extent {
    /// The box around the field of view, taken at the mount's height above the road.
    ///
    /// # Errors
    /// A field of view so large that its cells would not fit a message.
    pub fn covering(recording: &Recording) -> Result<Self> {
        const STEPS: u32 = 64;
        let view = &recording.sensor.field_of_view;
        let pose = &recording.pose;
        let [low, high] = view.azimuth_rad;
        let far = (0..=STEPS).map(|k| low + (high - low) * f64::from(k) / f64::from(STEPS)).map(|azimuth_rad| {
            let s = pose.at_height(view.range_m[1], azimuth_rad, 0.0);
            pose.to_road(Spherical { range_m: view.range_m[1], ..s })
        });
        let (mut min, mut max) = ([pose.position[0], pose.position[1]], [pose.position[0], pose.position[1]]);
        for p in far {
            for k in 0..2 {
                min[k] = min[k].min(p[k]);
                max[k] = max[k].max(p[k]);
            }
        }
        let cells = |k: usize| (min[k].floor() as i64, (max[k].ceil() as i64).saturating_sub(min[k].floor() as i64));
        let ((i, columns), (j, rows)) = (cells(0), cells(1));
        ensure!(
            columns.saturating_mul(rows) <= MOST_CELLS && i.abs() < 1_000_000 && j.abs() < 1_000_000,
            "{}: a field of view of {columns} m x {rows} m is too large to be written as a grid; --fov replaces it",
            recording.name
        );
        Ok(Self { corner: (i as i32, j as i32), columns: columns as i32, rows: rows as i32 })
    }

    /// Every cell, row by row.
    pub fn cells(self) -> impl Iterator<Item = (i32, i32)> {
        let (i, j) = self.corner;
        (j..j + self.rows).flat_map(move |j| (i..i + self.columns).map(move |i| (i, j)))
    }
}

#[derive(Serialize)]
struct Vector2 {
    x: f64,
    y: f64,
}

#[derive(Serialize)]
struct Field {
    name: &'static str,
    offset: usize,
    #[serde(rename = "type")]
    numeric_type: u8,
}

/// `foxglove.Grid`
#[derive(Serialize)]
struct Grid {
    timestamp: Time,
    frame_id: &'static str,
    pose: Pose,
    column_count: i32,
    cell_size: Vector2,
    row_stride: i32,
    cell_stride: i32,
    fields: Vec<Field>,
    data: String,
}

/// The message as JSON.
pub fn message(map: &dyn VisibilityMap, extent: Extent, time_ns: i64) -> Result<Vec<u8>> {
    let (i, j) = extent.corner;
    let cells = extent.cells().map(|(i, j)| RoadPoint::cell_centre(i, j));
    let data: Vec<u8> = cells.flat_map(|centre| colour(&map.at(centre))).collect();
    let stride = CHANNELS.len() as i32;
    let grid = Grid {
        timestamp: Time::from_ns(time_ns),
        frame_id: ROAD_FRAME,
        pose: Pose::new([f64::from(i), f64::from(j), 0.0], 0.0),
        column_count: extent.columns,
        cell_size: Vector2 { x: 1.0, y: 1.0 },
        row_stride: stride * extent.columns,
        cell_stride: stride,
        fields: CHANNELS
            .iter()
            .enumerate()
            .map(|(offset, &name)| Field { name, offset, numeric_type: UINT8 })
            .collect(),
        data: BASE64.encode(data),
    };
    Ok(serde_json::to_vec(&grid)?)
}

fn colour(state: &CellState) -> [u8; 4] {
    match state.visibility {
        Visibility::Visible if state.occupied => VISIBLE_OCCUPIED,
        Visibility::Visible => VISIBLE,
        Visibility::Invisible => INVISIBLE,
        Visibility::Unknown => UNKNOWN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Visible where y > 0, unknown where x < 0, else invisible.
    struct Left;

    impl VisibilityMap for Left {
        fn at(&self, p: RoadPoint) -> CellState {
            match (p.x_cm, p.y_cm) {
                (..0, _) => CellState::UNKNOWN,
                (_, 1..) => CellState { visibility: Visibility::Visible, ..CellState::UNKNOWN },
                _ => CellState { visibility: Visibility::Invisible, ..CellState::UNKNOWN },
            }
        }

        fn cells_in(&self, area: &viewshed::query::Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    #[test]
    fn rows_run_along_y_and_columns_along_x() {
        let extent = Extent { corner: (-1, -1), columns: 3, rows: 2 };
        let json: serde_json::Value = serde_json::from_slice(&message(&Left, extent, 1_500_000_000).unwrap()).unwrap();
        let data = BASE64.decode(json["data"].as_str().unwrap()).unwrap();
        let cells: Vec<&[u8]> = data.chunks(4).collect();
        assert_eq!(cells, [&UNKNOWN, &INVISIBLE, &INVISIBLE, &UNKNOWN, &VISIBLE, &VISIBLE]);
        assert_eq!(json["row_stride"], 12);
        assert_eq!(json["timestamp"], serde_json::json!({"sec": 1, "nsec": 500_000_000}));
        assert_eq!(json["pose"]["position"]["y"], -1.0);
    }

    #[test]
    fn the_message_has_the_properties_of_its_schema_and_no_other() {
        let schema: serde_json::Value = serde_json::from_str(SCHEMA).unwrap();
        let extent = Extent { corner: (0, 0), columns: 1, rows: 1 };
        let json: serde_json::Value = serde_json::from_slice(&message(&Left, extent, 0).unwrap()).unwrap();
        let keys = |v: &serde_json::Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&json), keys(&schema["properties"]));
    }
}
