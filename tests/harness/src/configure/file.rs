//! Settings of a unit as a TOML file: the tables of the daemon's file, and those only a controller has.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use serde::{Deserialize, Serialize};
use viewshed::frame::gate::GateConfig;
use viewshed::frame::health::HealthConfig;
use viewshed::probability::Threshold;
use viewshed::radar_3d::VisibilityConfig;
use viewshed::sensor::Sensor;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::mount::Mount;
use viewshed::sensor::noise::NoiseConfig;
use viewshed::unit::can_bus::BusConfig;
use viewshed::unit::profile::reference;
use viewshed::unit::settings::{Settings, UnitConfig, table_block};

use super::kept::{self, Blocks};
use crate::evaluation::probability::table_file;

/// A file that explains every key, with their defaults.
pub const EXAMPLE: &str = include_str!("../../../../boards/unit.toml");

/// Cells of the grid that tables are fitted on.
#[allow(clippy::cast_possible_truncation)] // 200, 128
pub const FITTED_ON: [u8; 2] = [reference::State::RANGES as u8, reference::State::AZIMUTHS as u8];

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Tables {
    // at the top of a daemon's file, where a controller's has it in [unit]
    #[serde(default, skip_serializing)]
    learn_lanes: Option<bool>,
    #[serde(default)]
    unit: UnitConfig,
    mount: Mount,
    field_of_view: FieldOfView,
    #[serde(default)]
    noise: NoiseConfig,
    #[serde(default)]
    gate: GateConfig,
    #[serde(default)]
    visibility: VisibilityConfig,
    #[serde(default)]
    health: HealthConfig,
    #[serde(default)]
    radar_bus: BusConfig,
    #[serde(default)]
    broadcast_bus: BusConfig,
    // a daemon's file is taken as it is: these are of the machine it runs on
    #[serde(default, skip_serializing)]
    state_dir: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    grid: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    input: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    output: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    lanes: Vec<PointList>,
    #[serde(default, skip_serializing)]
    obstacles: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    evidence: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    fixtures: Option<toml::Value>,
    #[serde(default, skip_serializing)]
    ground: Option<PointList>,
    #[serde(default, skip_serializing)]
    probability: Option<Given>,
}

/// A lane, or the road's profile.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PointList {
    points: Vec<[f32; 2]>,
}

/// Which table, and what of it is called visible.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    file: PathBuf,
    risk: Option<f64>,
}

/// What a file says.
#[derive(Debug)]
pub struct UnitFile {
    /// With lanes and heights.
    pub settings: Settings,
    /// What a unit keeps beside them.
    pub blocks: Blocks,
    /// The configuration its table of probabilities was fitted with.
    pub fitted_with: Option<u32>,
    /// Keys of the daemon's that no block has.
    pub left_out: Vec<&'static str>,
}

/// Reads a file.
///
/// # Errors
/// Names the file, and line and key of what is wrong.
pub fn read(path: &Path) -> Result<UnitFile> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!("cannot read {}; `viewshed configure --example > unit.toml` writes one to begin with", path.display())
    })?;
    let (mut file, given) = parse(&text).map_err(|(line, what)| anyhow!("{}:{line}: {what}", path.display()))?;
    let in_file = || path.display().to_string();
    let Settings { ground, lanes, .. } = file.settings;
    let heights = (!ground.is_empty()).then(|| kept::of_heights(ground)).transpose().with_context(in_file)?;
    let lanes = (!lanes.is_empty()).then(|| kept::of_lanes(lanes)).transpose().with_context(in_file)?;
    let (table, fitted_with) = given.map(|given| table(&given)).transpose().with_context(in_file)?.unzip();
    file.blocks = [heights, lanes, table];
    file.fitted_with = fitted_with;
    Ok(file)
}

/// The table as a block, and the configuration it was fitted with. Tables are fitted on the reference grid.
fn table(given: &Given) -> Result<(Vec<u8>, u32)> {
    let share = given.risk.is_none_or(|risk| risk > 0.0 && risk < 1.0);
    ensure!(share, "probability.risk is not between 0 and 1: 0.1 is 10 %");
    let read = || -> Result<(Vec<u8>, u32)> {
        let (table, counted) = table_file::parse(&std::fs::read_to_string(&given.file)?)?;
        let threshold = given.risk.map(|risk| Threshold::keeping(risk, &counted));
        Ok((table_block(FITTED_ON, &table, threshold).to_vec(), table.fingerprint()))
    };
    read().with_context(|| format!("probability.file: {}", given.file.display()))
}

/// Reads a text; the line and what is wrong there.
fn parse(text: &str) -> Result<(UnitFile, Option<Given>), (usize, String)> {
    let tables: Tables = toml::from_str(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start.min(text.len()));
        (1 + text[..at].matches('\n').count(), with_advice(error.message()))
    })?;
    let unit = UnitConfig { learn_lanes: tables.learn_lanes.unwrap_or(tables.unit.learn_lanes), ..tables.unit };
    let Tables { mount, field_of_view, noise, gate, visibility, health, radar_bus, broadcast_bus, .. } = tables;
    let sensor = Sensor { mount, field_of_view, noise };
    let keys = [
        ("state_dir", tables.state_dir.is_some()),
        ("grid", tables.grid.is_some()),
        ("[input]", tables.input.is_some()),
        ("[output]", tables.output.is_some()),
        ("[obstacles]", tables.obstacles.is_some()),
        ("[evidence]", tables.evidence.is_some()),
        ("[fixtures]", tables.fixtures.is_some()),
    ];
    let left_out = keys.into_iter().filter(|(_, is_there)| *is_there).map(|(key, _)| key).collect();
    // once a run
    let lanes = tables.lanes.into_iter().map(|lane| &*lane.points.leak()).collect::<Vec<_>>().leak();
    let ground = tables.ground.map_or(&[][..], |ground| ground.points.leak());
    let own = Settings { gate, visibility, health, radar_bus, broadcast_bus, unit, ..Settings::of(sensor) };
    let settings = Settings { lanes, ground, ..own };
    let file = UnitFile { settings, blocks: [None, None, None], fitted_with: None, left_out };
    Ok((file, tables.probability))
}

/// What is wrong, and where a table of another kind of file belongs.
fn with_advice(wrong: &str) -> String {
    if !["estimators", "evaluation"].iter().any(|table| wrong.starts_with(&format!("unknown field `{table}`"))) {
        return wrong.to_owned();
    }
    let what = wrong.split(',').next().unwrap_or_default();
    format!(
        "{what}: [estimators] and [evaluation] are tables of files for --config of `viewshed replay`; lanes of a unit's file are [[lanes]], as `viewshed lanes` writes them without --table"
    )
}

/// What to do with a unit's file, or a part of one, that was given as `--config`.
pub fn for_config(text: &str) -> Option<String> {
    let tables: toml::Table = text.parse().ok()?;
    let has = |keys: &[&str]| keys.iter().any(|key| tables.contains_key(*key));
    if has(&["mount", "field_of_view", "input", "output", "unit"]) {
        return Some(
            "it is a unit's file, for the daemon or `viewshed configure`; --config takes the tables [evaluation] and [estimators], with the keys that --json writes under \"options\". Mount and field of view are the recording's, or --mount and --fov; [noise] is [estimators.noise], [gate], [visibility] and [health] are [estimators.radar_3d.gate] and so on, [[lanes]] and [ground] [[estimators.lanes]] and [estimators.ground]"
                .into(),
        );
    }
    if has(&["lanes"]) {
        return Some(
            "[[lanes]] is a table of a unit's file; for --config write it with `viewshed lanes --table estimators.lanes`"
                .into(),
        );
    }
    let known = [
        ("ground", "estimators.ground"),
        ("noise", "estimators.noise"),
        ("gate", "estimators.radar_3d.gate"),
        ("visibility", "estimators.radar_3d.visibility"),
        ("health", "estimators.radar_3d.health"),
        ("obstacles", "estimators.radar_3d.obstacles"),
        ("evidence", "estimators.radar_3d.evidence"),
    ];
    let (table, here) = known.into_iter().find(|(table, _)| has(&[table]))?;
    Some(format!("[{table}] is a table of a unit's file; for --config it is [{here}]"))
}

/// Settings as a file.
///
/// # Errors
/// None that are known: numbers and flags have a form in TOML.
pub fn text(settings: &Settings) -> Result<String> {
    toml::to_string(&tables(settings)).context("cannot be written as TOML")
}

/// Parameters that two settings have differently: name, and both values.
///
/// # Errors
/// As [`text`].
pub fn differences(a: &Settings, b: &Settings) -> Result<Vec<(String, String, String)>> {
    let value = |settings| toml::Value::try_from(tables(settings)).context("cannot be compared");
    let (a, b) = (value(a)?, value(b)?);
    let (Some(a), Some(b)) = (a.as_table(), b.as_table()) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for (table, of_a) in a {
        for (key, left) in of_a.as_table().into_iter().flatten() {
            let right = b.get(table).and_then(|of_b| of_b.get(key));
            if right != Some(left) {
                let right = right.map_or_else(String::new, ToString::to_string);
                found.push((format!("{table}.{key}"), left.to_string(), right));
            }
        }
    }
    Ok(found)
}

fn tables(settings: &Settings) -> Tables {
    let Settings {
        sensor,
        gate,
        visibility,
        health,
        radar_bus,
        broadcast_bus,
        unit,
        lanes: _,
        ground: _,
        obstacles: _,
        evidence: _,
        fixtures: _,
    } = *settings;
    let Sensor { mount, field_of_view, noise } = sensor;
    let (state_dir, grid, input, output) = (None, None, None, None);
    let (lanes, ground, obstacles, evidence, fixtures, probability) = (Vec::new(), None, None, None, None, None);
    Tables {
        learn_lanes: None,
        unit,
        mount,
        field_of_view,
        noise,
        gate,
        visibility,
        health,
        radar_bus,
        broadcast_bus,
        state_dir,
        grid,
        input,
        output,
        lanes,
        obstacles,
        evidence,
        fixtures,
        ground,
        probability,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_explains_every_key_with_its_default() {
        let example = parse(EXAMPLE).unwrap().0.settings;
        assert_eq!(example, Settings { sensor: example.sensor, ..Settings::of(example.sensor) });
        // what is commented out is what counts without it
        let all: String = EXAMPLE
            .lines()
            .map(|line| line.strip_prefix('#').filter(|rest| !rest.starts_with(' ')).unwrap_or(line))
            .map(|line| format!("{line}\n"))
            .collect();
        assert_eq!(parse(&all).unwrap().0.settings, example);
        for line in text(&example).unwrap().lines().filter(|line| !line.is_empty()) {
            let key = line.split(" = ").next().unwrap();
            assert!(all.lines().any(|l| l.starts_with(key)), "{key} is not explained");
        }
    }

    #[test]
    fn settings_come_back_from_their_own_text() {
        let mut settings = parse(EXAMPLE).unwrap().0.settings;
        settings.sensor.noise.range_m = 0.1;
        settings.unit.serial_baud = 921_600;
        settings.visibility.far_road_deg = Some(-12);
        let text = text(&settings).unwrap();
        assert!(text.contains("range_m = 0.1\n") && text.contains("far_road_deg = -12\n"), "{text}");
        assert_eq!(parse(&text).unwrap().0.settings, settings);
    }

    #[test]
    fn the_daemons_file_is_taken_and_what_is_not_in_a_block_is_told() {
        let (file, _) = parse(include_str!("../../../../boards/linux/viewshed.toml")).unwrap();
        assert_eq!(file.left_out, ["[input]", "[output]"]);
        assert_eq!(file.settings.sensor.mount.height_m, 6.0);
        assert!(!file.settings.unit.learn_lanes);
    }

    #[test]
    fn the_daemons_file_may_ask_for_learnt_lanes_where_it_has_the_key() {
        let daemon = include_str!("../../../../boards/linux/viewshed.toml");
        assert!(daemon.contains("\n#learn_lanes = false\n"));
        let (file, _) = parse(&daemon.replace("\n#learn_lanes = false\n", "\nlearn_lanes = true\n")).unwrap();
        assert!(file.settings.unit.learn_lanes);
        assert_eq!(file.left_out, ["[input]", "[output]"], "it is part of a unit's configuration");
        let (own, _) = parse(&EXAMPLE.replace("#[unit]", "[unit]\nlearn_lanes = true")).unwrap();
        assert!(own.settings.unit.learn_lanes);
    }

    #[test]
    fn tables_of_files_for_replay_are_told_where_they_belong() {
        let lanes = "\n[[estimators.lanes]]\npoints = [[0.0, 0.0], [60.0, 0.0]]\n";
        for (table, key) in [(lanes, "estimators"), ("\n[evaluation]\nmin_speed_mps = 2.0\n", "evaluation")] {
            let (line, said) = parse(&format!("{EXAMPLE}{table}")).unwrap_err();
            assert!(line > EXAMPLE.lines().count(), "{line}");
            assert!(said.starts_with(&format!("unknown field `{key}`: ")), "{said}");
            assert!(
                said.contains("--config") && said.contains("`viewshed lanes` writes them without --table"),
                "{said}"
            );
        }
    }

    #[test]
    fn mistakes_have_their_line() {
        let wrong = |from: &str, to: &str| parse(&EXAMPLE.replacen(from, to, 1)).unwrap_err();
        let line = 1 + EXAMPLE[..EXAMPLE.find("\nheight_m").unwrap() + 1].matches('\n').count();
        for (to, what) in [
            ("\nhight_m", "unknown field `hight_m`"),
            ("\nheight_m = \"high\" #", "invalid type: string \"high\", expected f32"),
        ] {
            let (at, said) = wrong("\nheight_m", to);
            assert_eq!(at, line);
            assert!(said.contains(what), "{said}");
        }
        let (_, said) = wrong("\n[mount]", "\n[mounts]");
        assert!(said.contains("mounts"), "{said}");
    }

    #[test]
    fn differences_have_names_and_both_values() {
        let a = parse(EXAMPLE).unwrap().0.settings;
        let mut b = a;
        b.sensor.mount.height_m = 5.5;
        b.broadcast_bus.bit_rate = 250_000;
        let found = differences(&a, &b).unwrap();
        let found: Vec<String> = found.iter().map(|(name, a, b)| format!("{name} {a} {b}")).collect();
        assert_eq!(found, ["broadcast_bus.bit_rate 500000 250000", "mount.height_m 6.0 5.5"]);
    }
}
