//! `viewshed experiment --calibration`, the table it writes in `viewshed replay --risk`, `viewshed compare` and
//! `viewshed tune`, on seconds of the motorway.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::scene::{folder, json, stderr, stdout};

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").canonicalize().unwrap()
}

fn viewshed(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).args(arguments.split(' ')).output().unwrap()
}

fn refused(folder: &Path, arguments: &str) -> String {
    let output = viewshed(folder, arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments}: {}", stdout(&output));
    stderr(&output)
}

fn done(folder: &Path, arguments: &str) -> String {
    let output = viewshed(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", stderr(&output));
    stdout(&output)
}

/// A plan of one unit, the motorway's gantry, with days of 6 s.
fn plan(folder: &Path) {
    let day = |n: u32| format!("{{ fcd = \"{}/motorway/day-{n}.fcd.xml.gz\", seed = {n} }}", shipped().display());
    let text = format!(
        "[[unit]]\nname = \"gantry\"\nscene = \"{}/motorway.toml\"\nduration_s = 6.0\nwarm_up_s = 2.0\nfit = [{}, {}]\nreport = [{}, {}]\n",
        shipped().display(),
        day(6),
        day(7),
        day(8),
        day(9)
    );
    std::fs::write(folder.join("plan.toml"), text).unwrap();
    std::fs::copy(shipped().join("motorway.mcap"), folder.join("a.mcap")).unwrap();
    std::fs::copy(shipped().join("motorway.mcap"), folder.join("b.mcap")).unwrap();
}

#[test]
fn a_table_is_fitted_judged_and_taken_by_a_replay_of_its_unit_alone() {
    let folder = folder("calibration");
    plan(&folder);
    let text = done(&folder, "experiment plan.toml --calibration --bootstrap 50 --tables t --json c.json");
    assert!(text.contains("gantry: fitted on 2 days, ") && text.contains("judged on 2 days, "), "{text}");
    assert!(text.contains("two-sample") && text.contains("risk asked"), "{text}");
    assert!(folder.join("t/gantry.png").exists());
    let unit = &json(&folder.join("c.json"))["units"][0];
    let ece = |k: usize| unit["predictors"][k]["metrics"]["ece"].as_f64().unwrap();
    assert!(ece(0) < ece(1), "the table is nearer to the truth than the grade: {} {}", ece(0), ece(1));
    assert_eq!(unit["diagram"].as_array().unwrap().len(), 15);

    let replay = "replay a.mcap --to 6 --bootstrap 50 --probability t/gantry.probability.toml";
    let text = done(&folder, &format!("{replay} --risk 0.05 --json r.json"));
    assert!(text.contains("radar-3d-risk, asked for a risk of 5.0 %: visible is what has p >= "), "{text}");
    let report = json(&folder.join("r.json"));
    let row = |name: &str| {
        report["estimators"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap()["fir"].as_f64().unwrap()
    };
    assert!(row("radar-3d-risk") != row("radar-3d") && row("radar-3d-risk") < 0.5);
    assert!(done(&folder, &format!("{replay} --risk 0.9")).contains("everything known: it keeps the risk"));
    assert!(done(&folder, &format!("{replay} --risk 0.0001")).contains("nothing: no threshold keeps the risk"));

    let other_mount = refused(&folder, &format!("{replay} --risk 0.1 --mount 0,0,6.5,0,4,0"));
    assert!(other_mount.contains("a: the probability table was fitted with configuration"), "{other_mount}");
    assert!(refused(&folder, &format!("{replay} --risk 10")).contains("0.1 is 10 %"));
    assert!(refused(&folder, replay).contains("--risk"));
    let table = std::fs::read_to_string(folder.join("t/gantry.probability.toml")).unwrap();
    std::fs::write(folder.join("cut.toml"), &table[..table.len() / 2]).unwrap();
    let cut = refused(&folder, "replay a.mcap --to 3 --probability cut.toml --risk 0.1");
    assert!(cut.contains("probability table cut.toml"), "{cut}");
    assert!(refused(&folder, "experiment --calibration --scene queue").contains("--scene"));
}

#[test]
fn two_runs_are_compared_track_by_track_and_refused_where_they_are_of_other_samples() {
    let folder = folder("compare");
    plan(&folder);
    std::fs::write(folder.join("c.toml"), "[estimators.radar_3d.visibility]\nvisible_from = 0.9\n").unwrap();
    done(&folder, "replay a.mcap --to 6 --bootstrap 0 --json a.json");
    done(&folder, "replay a.mcap --to 6 --bootstrap 0 --json b.json --config c.toml");
    done(&folder, "replay a.mcap --to 5 --bootstrap 0 --json short.json");
    let text = done(&folder, "compare a.json b.json --estimator radar-3d --json d.json");
    let differences = &json(&folder.join("d.json"))[0]["differences"];
    assert!(differences[1]["points"].as_f64().unwrap() > 0.0 && differences[0]["points"].as_f64().unwrap() <= 0.0);
    assert!(differences[3]["points"].as_f64().unwrap() > 0.0, "less is visible, so more is falsely invisible: {text}");
    let too_short = "blocks of 1 s are too short for an interval, which takes 80";
    assert!(differences[3]["interval"].is_null() && text.contains(too_short), "{text}");
    let same = done(&folder, "compare a.json a.json");
    assert!(!same.contains("worse") && !same.contains("better\n") && !same.contains("Not compared"), "{same}");
    done(&folder, "replay a.mcap b.mcap --to 6 --bootstrap 0 --json both.json");
    let partly = done(&folder, "compare both.json a.json");
    assert!(partly.contains("Not compared, in both.json alone: b; b, camera."), "{partly}");
    let other = refused(&folder, "compare a.json short.json");
    assert!(other.contains("a.json and short.json: `a`"), "{other}");
    assert!(refused(&folder, "compare a.json c.toml").contains("c.toml"));
    assert!(refused(&folder, "compare a.json b.json --estimator radar-4d").contains("no estimator `radar-4d`"));
}

#[test]
fn a_search_is_judged_on_others_and_goes_on_where_it_stopped() {
    let folder = folder("tune");
    plan(&folder);
    let space = "[[parameter]]\nkey = \"radar_3d.visibility.visible_from\"\nlow = 0.3\nhigh = 0.9\n";
    std::fs::write(folder.join("space.toml"), space).unwrap();
    let tune = "tune a.mcap --test b.mcap --to 4 --bootstrap 50 --space space.toml --state s.json";
    done(&folder, &format!("{tune} --evaluations 3"));
    let text = done(&folder, &format!("{tune} --evaluations 5 --out o"));
    assert!(text.contains("5 evaluations (bayes search, seed 1)") && text.contains("Gap: "), "{text}");
    assert!(folder.join("o/front-cells.png").exists());
    let at_once = done(&folder, &tune.replace("s.json", "other.json").replace("--to", "--evaluations 5 --to"));
    assert_eq!(text.lines().next(), at_once.lines().next(), "a search that was stopped finds what one at once finds");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert_eq!(read("s.json"), read("other.json"));
    done(&folder, "replay a.mcap --to 3 --bootstrap 0 --config o/tuned.toml");

    let other = refused(&folder, &format!("{tune} --search-seed 2"));
    assert!(other.contains("--state s.json") && other.contains("other --seed"), "{other}");
    assert!(refused(&folder, "tune a.mcap --test a.mcap --to 3").contains("a is both trained and judged on"));
    std::fs::write(folder.join("none.toml"), "parameter = []\n").unwrap();
    assert!(refused(&folder, "tune a.mcap --test b.mcap --space none.toml").contains("names no parameter"));
    let log = shipped().join("ars408-made-up.log");
    std::fs::copy(log, folder.join("log.log")).unwrap();
    let unlabelled = "tune log.log --test b.mcap --mount 0,0,6,0,4,0 --fov=-60,60,-16,16,3,200 --sensor-id 0";
    assert!(refused(&folder, unlabelled).contains("log has no labels"), "{}", refused(&folder, unlabelled));
}

#[test]
fn a_plan_is_simulated_tuned_and_judged_and_both_searches_are_compared() {
    let folder = folder("tune-plan");
    let run = |seed: u32, mount: &str| {
        let at = shipped().display().to_string();
        format!("{{ scene = \"{at}/motorway.toml\", seed = {seed}{mount} }}")
    };
    let unit = |name: &str, report: &str| {
        let train = run(1, "");
        format!("[[unit]]\nname = \"{name}\"\nwarm_up_s = 1.0\ntrain = [{train}]\nreport = [{report}]\n")
    };
    let side = run(2, ", mount = { y_m = -19.0, height_m = 5.0, yaw_deg = 5.0, pitch_deg = 4.0 }");
    std::fs::write(folder.join("plan.toml"), unit("gantry", &side)).unwrap();
    let tune = "tune --plan plan.toml --to 3 --bootstrap 50 --evaluations 2";
    let text = done(&folder, &format!("{tune} --unit gantry --against-random 2 --state s --out o --ablation"));
    assert_eq!(text.matches(" again: ").count(), 12, "{text}");
    assert!(text.contains("2 evaluations (bayes search, seed 1)"), "{text}");
    let won = text.split("less loss than chance with ").nth(1).unwrap();
    assert!(won.starts_with("0 of 2 seeds"), "one random point is the same for both: {won}");
    for state in ["s.bayes-1", "s.random-1", "s.bayes-2", "s.random-2"] {
        assert!(folder.join(state).exists(), "{state}");
    }
    let tuned = std::fs::read_to_string(folder.join("o/tuned.toml")).unwrap();
    assert!(tuned.contains("on motorway-1; seed 1") && tuned.contains("[estimators.radar_3d.obstacles]"), "{tuned}");
    let daemon = std::fs::read_to_string(folder.join("o/daemon.toml")).unwrap();
    assert!(daemon.contains("\n[obstacles]\n") && daemon.contains("\n[visibility]\n"), "{daemon}");
    assert!(refused(&folder, &format!("{tune} --unit tunnel")).contains("no unit `tunnel`, but gantry"));
    std::fs::write(folder.join("plan.toml"), unit("gantry", &run(1, ""))).unwrap();
    let refused = refused(&folder, &format!("{tune} --unit gantry"));
    assert!(refused.contains("has the seed 1 of another recording"), "{refused}");
}

#[test]
fn what_was_tuned_and_is_shipped_is_taken_by_a_replay() {
    let folder = folder("tuned");
    std::fs::copy(shipped().join("motorway.mcap"), folder.join("a.mcap")).unwrap();
    let rates = |config: &str| {
        done(&folder, &format!("replay a.mcap --to 3 --bootstrap 0 --force --json r.json{config}"));
        let report = json(&folder.join("r.json"));
        let rows = report["estimators"].as_array().unwrap().clone();
        rows.into_iter().find(|row| row["name"] == "radar-3d").unwrap()["cells"].clone()
    };
    let usual = rates("");
    for unit in ["motorway", "crossing", "queue"] {
        let file = shipped().join(format!("tuned/{unit}.toml"));
        assert_ne!(rates(&format!(" --config {}", file.display())), usual, "{unit}");
    }
}
