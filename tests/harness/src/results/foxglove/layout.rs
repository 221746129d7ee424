//! A layout for Foxglove and Lichtblick: the panels that show what `--mcap` wrote, with its topics and colours.

use serde_json::{Map, Value, json};

use super::grid::Extent;
use crate::recording::mcap::ROAD_FRAME;
use crate::results::pictures::canvas::Colour;
use crate::results::pictures::palette::{DETECTION, Outcome, outline};

/// What a file holds.
pub struct Topics {
    /// The estimator's map, its boxes and counts.
    pub map: String,
    /// Only where there are labels.
    pub boxes: Option<String>,
    pub counts: String,
    /// Point clouds.
    pub points: Vec<String>,
    pub images: Vec<String>,
}

/// Degrees of the camera's field of view; with the distance it says how much is shown.
const FOVY_DEG: f64 = 45.0;
const BACKGROUND: &str = "#ffffff";

fn hex(colour: Colour) -> String {
    format!("#{:02x}{:02x}{:02x}", colour.red, colour.green, colour.blue)
}

/// The layout as JSON.
pub fn layout(topics: &Topics, extent: Extent) -> Value {
    let mut panels = Map::new();
    let mut shown = Map::new();
    shown.insert(topics.map.clone(), json!({"visible": true, "colorMode": "rgba-fields", "frameLocked": true}));
    if let Some(boxes) = &topics.boxes {
        shown.insert(boxes.clone(), json!({"visible": true}));
    }
    for points in &topics.points {
        let dots = json!({"visible": true, "colorMode": "flat", "flatColor": hex(DETECTION), "pointSize": 4, "pointShape": "circle"});
        shown.insert(points.clone(), dots);
    }
    let (columns, rows) = (f64::from(extent.columns), f64::from(extent.rows));
    let middle = [f64::from(extent.corner.0) + columns / 2.0, f64::from(extent.corner.1) + rows / 2.0, 0.0];
    // from above with x to the right, the whole field of view in sight
    let distance = 0.6 * columns.max(rows) / (FOVY_DEG / 2.0).to_radians().tan();
    let view = json!({
        "cameraState": {
            "perspective": false, "distance": distance, "phi": 0, "thetaOffset": 0,
            "targetOffset": middle, "target": [0, 0, 0], "targetOrientation": [0, 0, 0, 1],
            "fovy": FOVY_DEG, "near": 0.5, "far": 5000,
        },
        "followMode": "follow-none",
        "followTf": ROAD_FRAME,
        "fixedFrame": ROAD_FRAME,
        "scene": {"backgroundColor": BACKGROUND, "transforms": {"axisScale": 4, "labelSize": 0.2}},
        "transforms": {},
        "topics": shown,
        "layers": {},
        "publish": {},
        "imageMode": {},
    });
    panels.insert("3D!map".into(), view);
    let path = |field: &str, label: &str, colour: String| {
        json!({
            "value": format!("{}.{field}", topics.counts), "label": label, "color": colour,
            "enabled": true, "timestampMethod": "receiveTime",
        })
    };
    let plot = |title: &str, paths: Vec<Value>| {
        json!({
            "title": title, "paths": paths, "showXAxisLabels": true, "showYAxisLabels": true, "showLegend": true,
            "legendDisplay": "floating", "showPlotValuesInLegend": true, "isSynced": true, "xAxisVal": "timestamp",
            "sidebarDimension": 240, "minYValue": 0,
        })
    };
    let mut column = Vec::new();
    for (k, image) in topics.images.iter().enumerate() {
        let name = format!("Image!camera{k}");
        panels.insert(name.clone(), json!({"cameraTopic": image, "imageMode": {"imageTopic": image}}));
        column.push(name);
    }
    if topics.boxes.is_some() {
        let of = |outcome: Outcome| {
            path(&outcome.short().to_lowercase(), outcome.meaning(), hex(outline(Some(outcome)).colour))
        };
        let paths =
            [Outcome::FalseVisible, Outcome::FalseInvisible, Outcome::TrueInvisible, Outcome::TrueVisible].map(of);
        panels.insert("Plot!outcomes".into(), plot("Labelled objects of a frame", paths.to_vec()));
        column.push("Plot!outcomes".into());
    }
    let areas = vec![
        path("visible_m2", "visible, m²", "#2f7fb8".into()),
        path("invisible_m2", "invisible, m²", "#c2601a".into()),
        path("occupied_m2", "occupied, m²", "#2a3340".into()),
    ];
    panels.insert("Plot!areas".into(), plot("Areas of the map", areas));
    column.push("Plot!areas".into());
    panels.insert(
        "Plot!detections".into(),
        plot("Detections of a frame", vec![path("detections", "detections", hex(DETECTION))]),
    );
    column.push("Plot!detections".into());
    json!({
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": "3D!map", "second": stacked(&column), "splitPercentage": 66},
    })
}

/// Panels below each other, of one height.
fn stacked(names: &[String]) -> Value {
    match names {
        [] => Value::Null,
        [only] => json!(only),
        [first, rest @ ..] => json!({
            "direction": "column", "first": first, "second": stacked(rest), "splitPercentage": 100.0 / names.len() as f64,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of the panels in a tree.
    fn leaves(tree: &Value, into: &mut Vec<String>) {
        match tree {
            Value::String(name) => into.push(name.clone()),
            tree => ["first", "second"].iter().for_each(|side| leaves(&tree[side], into)),
        }
    }

    fn topics(boxes: bool, images: &[&str]) -> Topics {
        Topics {
            map: "/m".into(),
            boxes: boxes.then(|| "/m/boxes".into()),
            counts: "/m/counts".into(),
            points: vec!["/p".into()],
            images: images.iter().map(|i| (*i).to_owned()).collect(),
        }
    }

    #[test]
    fn every_panel_has_a_place_and_every_place_a_panel() {
        for (boxes, images, panels) in [(true, &["/a", "/b"][..], 6), (false, &[][..], 3)] {
            let layout = layout(&topics(boxes, images), Extent { corner: (0, -10), columns: 100, rows: 20 });
            let mut placed = Vec::new();
            leaves(&layout["layout"], &mut placed);
            placed.sort();
            let configured: Vec<String> = layout["configById"].as_object().unwrap().keys().cloned().collect();
            assert_eq!((placed.len(), placed), (panels, configured));
        }
    }

    #[test]
    fn the_camera_stands_over_the_middle_of_the_map() {
        let layout = layout(&topics(true, &[]), Extent { corner: (0, -10), columns: 100, rows: 20 });
        assert_eq!(layout["configById"]["3D!map"]["cameraState"]["targetOffset"], json!([50.0, 0.0, 0.0]));
    }
}
