//! The command on pictures and networks made here, and on a real network where one was fetched.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use image::{Rgb, RgbImage};
use prost::Message;
use tract_onnx::pb::tensor_shape_proto::{Dimension, dimension};
use tract_onnx::pb::{
    AttributeProto, GraphProto, ModelProto, NodeProto, OperatorSetIdProto, TensorProto, TensorShapeProto, TypeProto,
    ValueInfoProto, attribute_proto, type_proto,
};
use viewshed_harness::recording::camera::Box2d;
use viewshed_harness::recording::{self, ReadOptions};

#[path = "../../../common/skipped.rs"]
mod skipped;
use skipped::skipped;

const FLOAT: i32 = 1;

fn tensor(name: &str, dims: &[i64], values: &[f32]) -> TensorProto {
    TensorProto {
        name: name.into(),
        dims: dims.to_vec(),
        data_type: FLOAT,
        float_data: values.to_vec(),
        ..Default::default()
    }
}

fn value(name: &str, dims: &[i64]) -> ValueInfoProto {
    let dim = |d: &i64| Dimension { value: Some(dimension::Value::DimValue(*d)), ..Default::default() };
    let shape = TensorShapeProto { dim: dims.iter().map(dim).collect() };
    let tensor = type_proto::Tensor { elem_type: FLOAT, shape: Some(shape) };
    let r#type = TypeProto { value: Some(type_proto::Value::TensorType(tensor)), ..Default::default() };
    ValueInfoProto { name: name.into(), r#type: Some(r#type), ..Default::default() }
}

/// A convolution of four by four pixels into one cell.
fn cells(output: &str) -> NodeProto {
    let ints = |name: &str| AttributeProto {
        name: name.into(),
        r#type: attribute_proto::AttributeType::Ints.into(),
        ints: vec![4, 4],
        ..Default::default()
    };
    NodeProto {
        op_type: "Conv".into(),
        input: vec!["image".into(), format!("{output}_weights"), format!("{output}_bias")],
        output: vec![output.into()],
        attribute: vec![ints("kernel_shape"), ints("strides")],
        ..Default::default()
    }
}

fn write(path: &Path, nodes: Vec<NodeProto>, weights: Vec<TensorProto>, outputs: Vec<ValueInfoProto>) {
    let graph = GraphProto {
        name: "made".into(),
        node: nodes,
        initializer: weights,
        input: vec![value("image", &[1, 3, SIDE, SIDE])],
        output: outputs,
        ..Default::default()
    };
    let opset = OperatorSetIdProto { version: 13, ..Default::default() };
    let model = ModelProto { ir_version: 8, graph: Some(graph), opset_import: vec![opset], ..Default::default() };
    std::fs::write(path, model.encode_to_vec()).unwrap();
}

/// Side of the networks' input.
const SIDE: i64 = 64;

/// A CenterNet that takes red for cars and blue for buses, and all for 16 by 8 pixels of its input.
fn sees_colours(path: &Path) {
    let mut weights = vec![0.0; 80 * 3 * 16];
    for (class, channel) in [(2, 0), (5, 2)] {
        weights[(class * 3 + channel) * 16..][..16].fill(1.0 / 16.0 / 255.0);
    }
    let sizes: Vec<f32> = [8.0, 4.0, 8.0, 4.0].to_vec();
    let cell = SIDE / 4;
    write(
        path,
        vec![cells("heat"), cells("wh")],
        vec![
            tensor("heat_weights", &[80, 3, 4, 4], &weights),
            tensor("heat_bias", &[80], &[0.0; 80]),
            tensor("wh_weights", &[4, 3, 4, 4], &[0.0; 4 * 3 * 16]),
            tensor("wh_bias", &[4], &sizes),
        ],
        vec![value("heat", &[1, 80, cell, cell]), value("wh", &[1, 4, cell, cell])],
    );
}

/// A network with one output that is of no head.
fn knows_nothing(path: &Path) {
    let weights =
        vec![tensor("logits_weights", &[7, 3, 4, 4], &[0.0; 7 * 3 * 16]), tensor("logits_bias", &[7], &[0.0; 7])];
    write(path, vec![cells("logits")], weights, vec![value("logits", &[1, 7, SIDE / 4, SIDE / 4])]);
}

fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(folder.join("pictures")).unwrap();
    folder
}

fn detect(folder: &Path, arguments: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_viewshed-detect");
    Command::new(program).args(arguments.split_whitespace()).current_dir(folder).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// 256 by 128 pixels of grass with squares of a colour, four pixels of the network's input wide where the whole picture
/// is looked at.
fn picture(path: &Path, squares: &[([u32; 2], [u8; 3])]) {
    let mut picture = RgbImage::from_pixel(256, 128, Rgb([40, 60, 40]));
    for ([left, top], colour) in squares {
        for (x, y) in (0..16).flat_map(|x| (0..16).map(move |y| (x, y))) {
            picture.put_pixel(left + x, top + y, Rgb(*colour));
        }
    }
    picture.save(path).unwrap();
}

const RED: [u8; 3] = [255, 0, 0];
const BLUE: [u8; 3] = [0, 0, 255];

const CAMERA: &str = "mount = { x_m = 0.0, y_m = 0.0, height_m = 6.0, yaw_deg = 0.0, pitch_deg = 12.0, roll_deg = 0.0 }\n\
    intrinsics = { size_px = [256, 128], focal_px = [200.0, 200.0], center_px = [128.0, 64.0] }\n";

#[test]
fn boxes_of_pictures_are_a_recording() {
    let folder = folder("recording");
    sees_colours(&folder.join("m.onnx"));
    // the whole is scaled by a quarter and lies 16 pixels down in the input
    picture(&folder.join("pictures/1.png"), &[([32, 64], RED), ([160, 96], BLUE)]);
    picture(&folder.join("pictures/2.png"), &[]);
    std::fs::write(folder.join("c.toml"), CAMERA).unwrap();
    let common = "pictures --model m.onnx --score 0.6 --rate 5 --camera c.toml --bottom-offset 0.125";
    let output = detect(&folder, &format!("{common} --csv a.boxes.csv --mcap a.mcap"));
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("2 pictures, 2 boxes"), "{}", stderr(&output));

    // cell 2, 8 of the input at 8, 32: 8 pixels to each side, 4 up and down, four of the picture each
    let red = [0.0, 48.0, 64.0, 80.0 + 0.125 * 32.0];
    let blue = [160.0 - 32.0, 80.0, 192.0, 112.0 + 0.125 * 32.0];
    for name in ["a.boxes.csv", "a.mcap"] {
        let recording = recording::read(&folder.join(name), &ReadOptions::default()).unwrap();
        let camera = recording.of_camera().unwrap();
        assert_eq!(camera.frames.iter().map(|f| f.time_ns).collect::<Vec<_>>(), [0, 200_000_000], "{name}");
        assert_eq!((camera.intrinsics.size_px, camera.pose.position[2]), ([256, 128], 6.0));
        let boxes: Vec<(&str, [f64; 4])> = camera.frames[0].boxes.iter().map(|b| (b.class.as_str(), b.edges)).collect();
        assert_eq!(boxes, [("car", red), ("bus", blue)], "{name}");
        assert!(camera.frames[1].boxes.is_empty());
    }
    let again = detect(&folder, &format!("{common} --csv a.boxes.csv"));
    assert!(stderr(&again).contains("exists; add --force"), "{}", stderr(&again));
    let own = detect(&folder, "pictures --model m.onnx --camera a.camera.toml --csv a.boxes.csv --force");
    assert!(own.status.success(), "the camera lies there already: {}", stderr(&own));
}

#[test]
fn tiles_find_what_is_too_small_for_the_whole() {
    let folder = folder("tiles");
    sees_colours(&folder.join("m.onnx"));
    let mut small = RgbImage::from_pixel(256, 128, Rgb([40, 60, 40]));
    for (x, y) in (0..6).flat_map(|x| (0..6).map(move |y| (x, y))) {
        small.put_pixel(100 + x, 50 + y, Rgb(RED));
    }
    small.save(folder.join("small.png")).unwrap();
    let boxes = |more: &str| {
        let output = detect(&folder, &format!("small.png --model m.onnx --score 0.6 {more}"));
        assert!(output.status.success(), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap().lines().skip(1).filter(|row| row.contains("car")).count()
    };
    assert_eq!((boxes("--tiles 1"), boxes("--tiles 4")), (0, 1));
}

#[test]
fn what_cannot_be_used_is_told() {
    let folder = folder("bad");
    sees_colours(&folder.join("m.onnx"));
    knows_nothing(&folder.join("logits.onnx"));
    std::fs::write(folder.join("text.onnx"), "no model").unwrap();
    std::fs::write(folder.join("broken.jpg"), "no picture").unwrap();
    std::fs::write(folder.join("c.toml"), CAMERA.replace("size_px = [256, 128]", "size_px = [1920, 1080]")).unwrap();
    picture(&folder.join("a.png"), &[]);
    std::fs::create_dir_all(folder.join("two")).unwrap();
    picture(&folder.join("two/a.png"), &[]);
    RgbImage::new(64, 64).save(folder.join("two/b.png")).unwrap();
    for (arguments, expected) in [
        ("pictures --model m.onnx", "pictures: no picture in this folder"),
        ("none.png --model m.onnx", "none.png: there is no such picture"),
        ("broken.jpg --model m.onnx", "broken.jpg: no picture that can be read"),
        ("a.png --model none.onnx", "--model none.onnx: there is no such file"),
        ("a.png --model text.onnx", "--model text.onnx: no ONNX model that can be read"),
        (
            "a.png --model logits.onnx",
            "outputs of no head that is known: `logits` [1, 7, 16, 16]. Known are\n  centernet",
        ),
        (
            "a.png --model m.onnx --head yolo",
            "outputs of no head that is known by that name: `heat` [1, 80, 16, 16], `wh`",
        ),
        ("a.png --model m.onnx --size 128x64", "its input has a width of 64, --size says 128"),
        (
            "a.png --model m.onnx --camera c.toml",
            "a.png has 256 x 128 pixels, and the camera's calibration is for 1920 x 1080",
        ),
        ("two --model m.onnx", "two/b.png has 64 x 64 pixels, and two/a.png has 256 x 128"),
        ("a.png --model m.onnx --mcap a.mcap", "--mcap needs the camera's calibration"),
        ("a.png --model m.onnx --csv a.csv --camera c.toml", "name it NAME.boxes.csv"),
    ] {
        let output = detect(&folder, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {}", stderr(&output));
        assert!(stderr(&output).contains(expected), "{arguments}: {}", stderr(&output));
    }
}

/// What ONNX Runtime 1.30 makes of the same network and picture: a bus across the street and three people before it.
const BUS: [f64; 4] = [19.3, 223.9, 787.9, 734.4];

#[test]
fn a_real_network_finds_a_bus() {
    let Some(fetched) =
        std::env::var_os("VIEWSHED_DETECTOR").map(PathBuf::from).filter(|f| f.join("centernet.onnx").exists())
    else {
        return skipped("network", "the detector on a real network (tests/detector.sh fetches one)");
    };
    let folder = folder("real");
    let (model, picture) = (fetched.join("centernet.onnx"), fetched.join("bus.jpg"));
    let output = detect(&folder, &format!("{} --model {}", picture.display(), model.display()));
    assert!(output.status.success(), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|row| row.split(',').collect()).collect();
    let named = |class: &str| rows.iter().filter(|row| row[1] == class).count();
    assert_eq!((named("bus"), named("pedestrian"), rows.len()), (1, 3, 4), "{text}");
    let bus = rows.iter().find(|row| row[1] == "bus").unwrap();
    let own: Vec<f64> = bus[2..6].iter().map(|v| v.parse().unwrap()).collect();
    let b = |edges| Box2d { class: String::new(), score: 1.0, edges };
    let overlap = b([own[0], own[1], own[2], own[3]]).overlap(&b(BUS));
    assert!(overlap > 0.97, "{overlap} {own:?}");
}
