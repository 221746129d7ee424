//! The labelled boxes of a frame as a `foxglove.SceneUpdate`, and what there is to count as `viewshed.Counts`.

use anyhow::Result;
use serde::Serialize;
use serde_json::json;
use viewshed::map::{Visibility, VisibilityMap};
use viewshed::sensor::road::RoadPoint;

use super::geometry::{Pose, Time, Vector3};
use super::grid::Extent;
use crate::evaluation::counts::Counts;
use crate::recording::mcap::ROAD_FRAME;
use crate::results::pictures::canvas::Colour;
use crate::results::pictures::palette::{Outcome, outline};
use crate::results::pictures::scene::TruthBox;

pub const SCENE_SCHEMA_NAME: &str = "foxglove.SceneUpdate";
pub const SCENE_SCHEMA: &str = include_str!("scene.schema.json");
pub const COUNTS_SCHEMA_NAME: &str = "viewshed.Counts";
pub const COUNTS_SCHEMA: &str = include_str!("counts.schema.json");

/// How much of a box hides what is behind it.
const OPACITY: f64 = 0.55;
/// Height of the letters over a box, metres.
const LETTERS_M: f64 = 2.2;

#[derive(Serialize)]
struct Color {
    r: f64,
    g: f64,
    b: f64,
    a: f64,
}

impl Color {
    fn new(colour: Colour, a: f64) -> Self {
        let part = |v: u8| f64::from(v) / 255.0;
        Self { r: part(colour.red), g: part(colour.green), b: part(colour.blue), a }
    }
}

#[derive(Serialize)]
struct Cube {
    pose: Pose,
    size: Vector3,
    color: Color,
}

#[derive(Serialize)]
struct Text {
    pose: Pose,
    billboard: bool,
    font_size: f64,
    scale_invariant: bool,
    color: Color,
    text: &'static str,
}

/// All boxes of a frame as one entity, which the next frame's replaces.
pub fn boxes(boxes: &[TruthBox], time_ns: i64) -> Result<Vec<u8>> {
    let cube = |b: &TruthBox| {
        let [x, y, z] = b.solid.size;
        Cube {
            pose: Pose::of(&b.solid),
            size: Vector3 { x, y, z },
            color: Color::new(outline(b.outcome).colour, OPACITY),
        }
    };
    let text = |b: &TruthBox| {
        let outcome = b.outcome?;
        let [x, y, z] = b.solid.center;
        Some(Text {
            pose: Pose::new([x, y, z + b.solid.size[2] / 2.0 + LETTERS_M], 0.0),
            billboard: true,
            font_size: LETTERS_M,
            scale_invariant: false,
            color: Color::new(outline(Some(outcome)).colour, 1.0),
            text: outcome.short(),
        })
    };
    let none: [(); 0] = [];
    let update = json!({
        "deletions": none,
        "entities": [{
            "timestamp": Time::from_ns(time_ns),
            "frame_id": ROAD_FRAME,
            "id": "boxes",
            "lifetime": Time::from_ns(0),
            "frame_locked": true,
            "metadata": none,
            "arrows": none,
            "cubes": boxes.iter().map(cube).collect::<Vec<_>>(),
            "spheres": none,
            "cylinders": none,
            "lines": none,
            "triangles": none,
            "texts": boxes.iter().filter_map(text).collect::<Vec<_>>(),
            "models": none,
        }],
    });
    Ok(serde_json::to_vec(&update)?)
}

/// Areas of a map and outcomes of its frame's boxes.
pub fn counts(
    map: &dyn VisibilityMap,
    extent: Extent,
    boxes: &[TruthBox],
    detections: usize,
    time_ns: i64,
) -> Result<Vec<u8>> {
    let (mut visible, mut invisible, mut occupied) = (0_u64, 0_u64, 0_u64);
    for (i, j) in extent.cells() {
        let state = map.at(RoadPoint::cell_centre(i, j));
        visible += u64::from(state.visibility == Visibility::Visible);
        invisible += u64::from(state.visibility == Visibility::Invisible);
        occupied += u64::from(state.occupied && state.visibility != Visibility::Unknown);
    }
    let mut c = Counts::default();
    for outcome in boxes.iter().filter_map(|b| b.outcome) {
        let visible = matches!(outcome, Outcome::TrueVisible | Outcome::FalseVisible);
        let detected = matches!(outcome, Outcome::TrueVisible | Outcome::FalseInvisible);
        c.add(visible, detected);
    }
    let message = json!({
        "timestamp": Time::from_ns(time_ns),
        "visible_m2": visible, "invisible_m2": invisible, "occupied_m2": occupied,
        "detections": detections,
        "tv": c.tv, "fv": c.fv, "ti": c.ti, "fi": c.fi,
    });
    Ok(serde_json::to_vec(&message)?)
}

#[cfg(test)]
mod tests {
    use serde_json::Value;
    use viewshed::map::CellState;

    use super::*;
    use crate::geometry::solid::Solid;

    /// Every object of a message has the properties of its schema and no other.
    fn agrees(message: &Value, schema: &Value, at: &str) {
        if let Some(items) = message.as_array() {
            items.iter().for_each(|item| agrees(item, &schema["items"], at));
        } else if let Some(object) = message.as_object() {
            let properties = schema["properties"].as_object().unwrap_or_else(|| panic!("{at} is no object"));
            let keys =
                |o: &serde_json::Map<String, Value>| o.keys().cloned().collect::<std::collections::BTreeSet<_>>();
            assert_eq!(keys(object), keys(properties), "{at}");
            object.iter().for_each(|(name, value)| agrees(value, &properties[name], &format!("{at}.{name}")));
        }
    }

    fn truth() -> Vec<TruthBox> {
        let solid = Solid { center: [50.0, 4.0, 0.75], yaw_rad: std::f64::consts::FRAC_PI_2, size: [4.6, 1.8, 1.5] };
        vec![TruthBox { solid, outcome: Some(Outcome::FalseVisible) }, TruthBox { solid, outcome: None }]
    }

    #[test]
    fn a_box_has_the_colour_of_the_pictures_and_its_place() {
        let message: Value = serde_json::from_slice(&boxes(&truth(), 2_500_000_000).unwrap()).unwrap();
        agrees(&message, &serde_json::from_str(SCENE_SCHEMA).unwrap(), "scene");
        let cube = &message["entities"][0]["cubes"][0];
        let red = f64::from(outline(Some(Outcome::FalseVisible)).colour.red) / 255.0;
        assert_eq!((cube["color"]["r"].as_f64(), cube["pose"]["position"]["x"].as_f64()), (Some(red), Some(50.0)));
        assert!((cube["pose"]["orientation"]["z"].as_f64().unwrap() - 0.5_f64.sqrt()).abs() < 1e-9, "turned left");
        assert_eq!(message["entities"][0]["texts"].as_array().unwrap().len(), 1, "what does not count has no letters");
    }

    /// Visible and occupied where x < 0, else unknown.
    struct Left;

    impl VisibilityMap for Left {
        fn at(&self, p: RoadPoint) -> CellState {
            let known = CellState { visibility: Visibility::Visible, grade: 255, occupancy: 255, occupied: true };
            if p.x_cm < 0 { known } else { CellState { occupied: true, ..CellState::UNKNOWN } }
        }

        fn cells_in(&self, area: &viewshed::query::Footprint, visit: &mut dyn FnMut(CellState)) {
            area.each_cell(|cell| visit(self.at(cell)));
        }
    }

    #[test]
    fn areas_and_outcomes_are_counted() {
        let extent = Extent { corner: (-2, 0), columns: 5, rows: 3 };
        let message: Value = serde_json::from_slice(&counts(&Left, extent, &truth(), 7, 0).unwrap()).unwrap();
        agrees(&message, &serde_json::from_str(COUNTS_SCHEMA).unwrap(), "counts");
        let of = |name: &str| message[name].as_u64().unwrap();
        assert_eq!(["visible_m2", "invisible_m2", "occupied_m2", "detections", "tv", "fv"].map(of), [6, 0, 6, 7, 0, 1]);
    }
}
