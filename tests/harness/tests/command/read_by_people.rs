//! What commands print and draw for people: it fits a terminal, says whose data it is, and what was left out.

use std::path::Path;
use std::process::Output;

use viewshed_harness::recording::labels::{read_labels, read_occlusion};

use crate::scene::{Scene, folder, json, replay, stderr, stdout, viewshed};

const RECORDINGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings");
const GUIDE: &str = include_str!("../../../GUIDE.md");

fn good(output: &Output) -> String {
    assert!(output.status.success(), "{}{}", stdout(output), stderr(output));
    stdout(output)
}

/// Columns of the widest line of a table.
fn widest(text: &str) -> usize {
    text.lines().filter(|line| line.contains('│')).map(|line| line.chars().count()).max().unwrap_or(0)
}

#[test]
fn tables_fit_a_terminal_and_are_wide_on_demand() {
    let folder = folder("terminal");
    let all = |name: &str| format!("{RECORDINGS}/{name}");
    let motorway = format!("{} --bootstrap 100 --breakdown --mount-error", all("motorway.mcap"));
    let narrow = good(&viewshed(&folder, &format!("replay {motorway}")));
    assert!((60..=80).contains(&widest(&narrow)), "{narrow}");
    for word in ["radar-3d", "camera-3d", "TVR %", "motorcycle", "150-200", "-0.2 m"] {
        assert!(narrow.contains(word), "{word}: {narrow}");
    }
    let wide = good(&viewshed(&folder, &format!("replay {motorway} --wide")));
    assert!(widest(&wide) > 100 && wide.contains("slice, points") && !narrow.contains("slice, points"));
    for arguments in [
        format!(
            "bus {} --to 4 --key 000102030405060708090a0b0c0d0e0f --log b.log --bus fd-500k-2M",
            all("motorway.mcap")
        ),
        format!("doctor {}", all("ars408-made-up.log")),
        format!("detections {}", all("motorway.mcap")),
        format!("site {} --every 10", all("motorway.toml")),
        format!("site {} --every 10 --height 6 --lateral -15 --along 0,100 --yaw 0,10 --pitch 2", all("motorway.toml")),
    ] {
        let text = good(&viewshed(&folder, &arguments));
        assert!((40..=80).contains(&widest(&text)), "{arguments}: {} in\n{text}", widest(&text));
    }
}

#[test]
fn synthetic_is_said_of_synthetic_recordings_only() {
    let folder = folder("synthetic");
    let mut scene = Scene::default();
    assert!(scene.sensor.synthetic);
    scene.save(&folder, "simulated");
    scene.sensor.synthetic = false;
    scene.save(&folder, "measured");
    for (name, said) in [("simulated", true), ("measured", false)] {
        let output = replay(
            &folder,
            &[&format!("{name}.mcap"), "--bootstrap", "0", "--out", name, "--json", "r.json", "--force"],
        );
        let table = std::fs::read_to_string(folder.join(name).join("table.txt")).unwrap();
        let report = json(&folder.join("r.json"));
        let places = [good(&output), table, report["origin"].to_string()];
        assert_eq!(places.map(|text| text.to_lowercase().contains("synthetic")), [said; 3], "{name}");
    }
}

#[test]
fn the_shipped_recording_says_that_it_is_synthetic() {
    let folder = folder("shipped");
    let text = good(&viewshed(&folder, &format!("replay {RECORDINGS}/motorway.mcap --bootstrap 0 --to 3")));
    assert!(text.contains("Synthetic recordings are synthetic"), "{text}");
    // what estimators left out, in words and with its total
    let line = text.lines().find(|line| line.contains(" left out ")).unwrap();
    assert!(line.contains("radar-3d left out ") && line.contains(" detections: "), "{line}");
    assert!(line.contains(" above or below the field of view"), "{line}");
    let numbers: Vec<u64> = line.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect();
    // 2 and 3 of the names, then the sum, the total and the reasons
    let at = numbers.iter().position(|n| *n > 10).unwrap();
    assert_eq!(numbers[at], numbers[at + 2..].iter().sum::<u64>(), "{line}");
    assert!(numbers[at + 1] > numbers[at], "{line}");
}

#[test]
fn a_time_picks_the_frame_that_is_drawn() {
    let folder = folder("picked");
    Scene::default().save(&folder, "a");
    let drawn = |time: &str| {
        good(&replay(&folder, &["a.mcap", "--bootstrap", "0", "--out", time, "--time", time]));
        std::fs::read(folder.join(time).join("birdseye-radar-3d.png")).unwrap()
    };
    assert_ne!(drawn("1.2"), drawn("2.5"));
    let late = replay(&folder, &["a.mcap", "--out", "late", "--time", "99"]);
    assert_eq!(late.status.code(), Some(2));
    assert!(stderr(&late).contains("--time 99: a lasts 2.9 s"), "{}", stderr(&late));
    assert!(!folder.join("late").exists());
    let alone = replay(&folder, &["a.mcap", "--time", "1"]);
    assert!(stderr(&alone).contains("--out"), "{}", stderr(&alone));
}

#[test]
fn the_columns_of_labels_are_in_the_help_in_the_page_and_in_an_example() {
    let folder = folder("columns");
    let help = good(&viewshed(&folder, "replay --help"));
    let example = |name: &str| std::fs::read_to_string(format!("{RECORDINGS}/example.{name}.csv")).unwrap();
    for name in ["labels", "occlusion"] {
        let text = example(name);
        let heading = text.lines().find(|line| !line.starts_with('#')).unwrap();
        assert!(help.contains(&format!("NAME.{name}.csv")));
        for column in heading.split(',') {
            assert!(help.contains(column) && GUIDE.contains(column), "{column}");
        }
    }
    // the page shows rows as they can be
    let shown = GUIDE.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    assert_eq!(shown.lines().next(), example("labels").lines().nth(1));
    let read = read_labels(Path::new(&format!("{RECORDINGS}/example.labels.csv")), 0, 2_000_000_000).unwrap();
    assert_eq!((read.labels.len(), read.sized_by_class), (5, 2));
    assert_eq!(read.labels[2].solid.size, [16.5, 2.55, 4.0]);
    let grades = read_occlusion(Path::new(&format!("{RECORDINGS}/example.occlusion.csv"))).unwrap();
    assert_eq!(grades.into_iter().collect::<Vec<_>>(), [("17".to_owned(), 0), ("18".to_owned(), 2)]);
}

#[test]
fn traffic_that_ends_early_is_told() {
    let folder = folder("early");
    let step = |k: u32| {
        let (time, x) = (0.5 * f64::from(k), 60 + 10 * k);
        format!("<timestep time=\"{time}\"><vehicle id=\"a\" x=\"{x}\" y=\"0\" angle=\"90\" type=\"car\"/></timestep>")
    };
    std::fs::write(folder.join("t.xml"), format!("<fcd-export>{}</fcd-export>", (0..8).map(step).collect::<String>()))
        .unwrap();
    let scene = "name = \"s\"\nduration_s = 60.0\n[traffic]\nfcd = \"t.xml\"\n[radar]\nname = \"r\"\nrate_hz = 15.0\n\
                 mount = { height_m = 6.0 }\nfield_of_view = { azimuth_deg = [-60.0, 60.0], \
                 elevation_deg = [-16.0, 16.0], range_m = [3.0, 200.0] }\n";
    std::fs::write(folder.join("s.toml"), scene).unwrap();
    let text = good(&viewshed(&folder, "simulate s.toml --out r.mcap"));
    assert!(text.contains("traffic ends at 3.5 s of 60 s"), "{text}");
    let text = good(&viewshed(&folder, "simulate s.toml --out q.mcap --duration 4"));
    assert!(!text.contains("traffic ends"), "{text}");
}
