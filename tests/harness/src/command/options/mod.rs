//! Options of the command line and the configuration file, brought together.
//!
//! Defaults are overridden by `--config FILE`, that by single options.

mod given;
mod values;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use serde::Deserialize;
use viewshed::NoiseConfig;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::quality::Ars408Wanted;
use viewshed::inputs::ti::{TiDialect, TiFamily};

pub(super) use self::given::given;
use self::values::{
    cluster_states, far_road, field_of_view, ground_error, labels, mount, noise, period, profile, ti_dialect,
    ti_header, velocity_scale,
};
pub(super) use self::values::{finite, seconds};
use crate::configure::file as unit_file;
use crate::estimators::{self, FarRoad, GroundError};
use crate::evaluation::{self, Grid, Settings};
use crate::recording::{FieldOfView, LabelsFrom, ReadOptions};

/// The tables of a configuration file.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Config {
    evaluation: evaluation::Options,
    estimators: estimators::Options,
}

/// Groups of options that subcommands share: how to read recordings, and how to judge.
#[derive(Debug, Clone, Default, Args)]
pub struct SettingsArgs {
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    judging: JudgingArgs,
}

/// Those of a command that makes maps and judges none.
#[derive(Debug, Clone, Default, Args)]
pub struct MapArgs {
    #[command(flatten)]
    reading: ReadingArgs,
    #[command(flatten)]
    height: HeightArgs,
    #[command(flatten)]
    unit: UnitArgs,
    #[command(flatten)]
    config: ConfigArgs,
}

/// How estimators run and how they are judged, whatever they are given.
#[derive(Debug, Clone, Default, Args)]
pub struct JudgingArgs {
    #[command(flatten)]
    evaluation: EvaluationArgs,
    #[command(flatten)]
    estimators: EstimatorArgs,
    #[command(flatten)]
    config: ConfigArgs,
}

#[derive(Debug, Clone, Default, Args)]
struct ConfigArgs {
    /// TOML file with the tables [evaluation] and [estimators]
    ///
    /// Its keys are those that --json writes under "options", for example
    ///
    ///   [evaluation]
    ///   min_speed_mps = 2.0
    ///
    /// An unknown key is an error. Options of the command line win over the file.
    #[arg(long, value_name = "FILE", help_heading = "Configuration", verbatim_doc_comment)]
    config: Option<PathBuf>,
}

/// What the file does not say, or says wrongly.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Reading")]
pub struct ReadingArgs {
    /// Topic of the radar's points [default: /radar/points, or the only one of a type that radars send]
    ///
    /// A sensor_msgs/msg/PointCloud2 with the fields range, azimuth (or azimuth_angle) and, where measured, elevation (or
    /// elevation_angle), or with x, y and z; with radial_velocity (or radial_speed, velocity, doppler, doppler_velocity,
    /// v_r, vr, v_radial, range_rate, speed_radial) and, where measured, rcs and snr. Or a radar_msgs/msg/RadarScan. Metres,
    /// radians, m/s, dBsm and dB. A topic that is not there makes an error that lists those that are.
    #[arg(long, value_name = "TOPIC")]
    radar_topic: Option<String>,
    /// Topic of the labelled objects, a Detection3DArray in frame `road` [default: /ground_truth/objects]
    ///
    /// A file NAME.labels.csv beside NAME.mcap replaces them. Without labels there are maps and no rates.
    #[arg(long, value_name = "TOPIC")]
    truth_topic: Option<String>,
    /// Labels to judge by: `recording` for those in it, `beside` for NAME.labels.csv beside it, or a file like that
    /// [default: those beside it, or else its own]
    #[arg(long, value_name = "WHICH", value_parser = labels)]
    labels: Option<LabelsFrom>,
    /// Frame of /tf_static that is the road's [default: road]
    #[arg(long, value_name = "FRAME")]
    road_frame: Option<String>,
    /// Frame of /tf_static that is the radar's [default: the one in its messages' headers]
    #[arg(long, value_name = "FRAME")]
    radar_frame: Option<String>,
    /// What a positive radial velocity does [default: recedes]
    #[arg(long, value_name = "WHAT", value_parser = ["receding", "approaching"])]
    velocity_sign: Option<String>,
    /// What makes m/s of the radar's velocities: 0.2778 where they are in km/h [default: 1]
    #[arg(long, value_name = "FACTOR", value_parser = velocity_scale)]
    velocity_scale: Option<f64>,
    /// Where the radar hangs: x,y,z,yaw,pitch,roll in metres and degrees [default: /tf_static of the file]
    ///
    /// In the road frame: x along the road, y to the left, z = height above the road. Yaw + to the left,
    /// pitch + nose down, roll + left side up. A gantry at 6 m looking 4 degrees down: --mount 0,0,6,0,4,0
    #[arg(long, value_name = "X,Y,Z,YAW,PITCH,ROLL", value_parser = mount, allow_hyphen_values = true)]
    mount: Option<[f64; 6]>,
    /// Field of view: az_min,az_max,el_min,el_max,r_min,r_max in degrees and metres [default: the file's metadata]
    ///
    /// In the sensor frame: azimuth + to the left, elevation + up. A radar's ranges end at 256 m at most. Example:
    /// --fov=-60,60,-16,16,3,200
    #[arg(long, value_name = "AZ,AZ,EL,EL,R,R", value_parser = field_of_view, allow_hyphen_values = true)]
    fov: Option<FieldOfView>,
    /// Bus of a CAN log with several: can0, or the channel of an ASC log [default: the one with more frames of the radar]
    #[arg(long, value_name = "NAME")]
    interface: Option<String>,
    /// Sensor id of the radar in a CAN log or capture that has several
    #[arg(long, value_name = "ID")]
    sensor_id: Option<u8>,
    #[command(flatten)]
    kind: KindArgs,
    /// Time between frames of a TI mmWave capture, which holds none [default: 0.1]
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS", value_parser = period)]
    frame_period: Option<f64>,
    /// Begin this many seconds after the first radar frame
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS", value_parser = finite)]
    from: Option<f64>,
    /// End this many seconds after the first radar frame
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS", value_parser = finite)]
    to: Option<f64>,
}

/// What a raw log or capture does not say of its radar.
#[derive(Debug, Clone, Copy, Default, Args)]
pub struct KindArgs {
    /// Kind of the radar in a CAN log: ARS408, or SR75 whose scales differ [default: ARS408]
    #[arg(long, value_name = "NAME", value_parser = profile)]
    pub radar: Option<&'static Ars408Profile>,
    /// Clusters of an ARS408 that are wanted, by the validity states of their quality messages, between commas
    /// [default: those the vendor calls valid, 0x00,0x04,0x08,0x09,0x0A,0x0B,0x0C,0x0F,0x10,0x11]
    #[arg(long, value_name = "STATES", value_parser = cluster_states)]
    pub cluster_states: Option<Ars408Wanted>,
    /// Bytes of the header in a TI mmWave capture: 36, 40, 44, 48 or 52 [default: learnt from three frames]
    #[arg(long, value_name = "BYTES", value_parser = ti_header)]
    pub ti_header: Option<TiFamily>,
    /// What a TI mmWave capture does not say of its firmware, between commas [default: none of it]
    ///
    /// degrees       angles of spherical points (type 1000) are in degrees, not radians
    /// raised        points after 52 bytes have an elevation
    /// no-elevation  the antenna measures none
    /// targets       take the tracked targets in place of the points
    /// doppler=M/S   velocity of a Doppler step, without which SDK 1 and 2 have none
    #[arg(long, value_name = "LIST", value_parser = ti_dialect, verbatim_doc_comment)]
    pub ti_dialect: Option<TiDialect>,
}

/// The rules by which objects and cells are counted.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Evaluation")]
struct EvaluationArgs {
    /// Objects slower than this are not counted, in m/s; they still hide others [default: 1, from 0 to 100]
    #[arg(long, allow_negative_numbers = true, value_name = "M/S")]
    min_speed: Option<f64>,
    #[command(flatten)]
    height: HeightArgs,
    /// Start of each recording that is not counted, in seconds [default: 1, from 0 to 86400; 0 for independent frames]
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS")]
    warm_up: Option<f64>,
    /// A detection belongs to an object within this distance of its footprint, in metres [default: 1, from 0 to 20]
    #[arg(long, allow_negative_numbers = true, value_name = "METRES")]
    growth: Option<f64>,
    /// The footprint grows further across the line of sight, in degrees of azimuth to each side [default: 1, from 0 to 45]
    #[arg(long, allow_negative_numbers = true, value_name = "DEGREES")]
    growth_azimuth: Option<f64>,
    /// A detection's radial velocity must match the object's within this, in m/s [default: 1.5, from 0 to 1000]
    #[arg(long, allow_negative_numbers = true, value_name = "M/S")]
    doppler_tolerance: Option<f64>,
    /// An object is detected from this many detections on [default: 1, from 1 to 1000000]
    ///
    /// More where labels were drawn on what the radar itself saw.
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    min_detections: Option<u32>,
    /// Cells an object's visibility is judged on [default: cartesian]
    #[arg(long, value_enum)]
    grid: Option<Grid>,
    /// Draws behind each 95 % interval; 0 for no intervals [default: 1000, from 0 to 100000]
    ///
    /// Tracks are drawn with replacement (independent frames where the recording has them; for cells
    /// runs of ten seconds), since samples of one track are correlated. All estimators share the draws.
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    bootstrap: Option<u32>,
    /// Seed of the draws [default: 1]
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    seed: Option<u64>,
}

#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Evaluation")]
struct HeightArgs {
    /// Height above the road at which visibility is judged, in metres [default: 1, from 0 to 20]
    #[arg(long, allow_negative_numbers = true, value_name = "METRES")]
    slice_height: Option<f64>,
}

/// What the estimators are given.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Estimators")]
struct EstimatorArgs {
    #[command(flatten)]
    unit: UnitArgs,
    /// Share of a cell that boxes must fill for `true-boxes` to call it occupied [default: 0.5, above 0 to 1]
    #[arg(long, allow_negative_numbers = true, value_name = "SHARE")]
    reference_share: Option<f64>,
}

/// What radar-3d, as units run it, is given.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Estimators")]
struct UnitArgs {
    /// Detections a frame that estimators take, after the gate; of more, those of crowded places are dropped first, and all counted [default: 256, from 1 to 4096]
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    max_detections: Option<usize>,
    /// Grid of radar-3d: on the small one, radar-3d-small runs beside radar-3d in tables, and is what is tuned, watched and
    /// fused [default: reference]
    #[arg(long, value_name = "SIZE")]
    grid_size: Option<estimators::Grid>,
    /// A row radar-3d-narrow beside radar-3d, whose azimuths are four times narrower within ten degrees of where the far road
    /// lies: degrees from the sensor's heading, + left [along the road's axis unless said]
    ///
    /// The same memory, and columns of 0.4 degrees ahead in place of one. `viewshed view`, `bus` and `label` show this map. In a
    /// file, `far_road_deg` of `[estimators.radar_3d.visibility]` is for radar-3d itself; of a unit, that of `[visibility]`.
    #[arg(long, value_name = "DEG", num_args = 0..=1, require_equals = true, default_missing_value = "along-road", value_parser = far_road)]
    far_road: Option<FarRoad>,
    /// How well the radar measures, from its data sheet: standard deviations of range, azimuth, elevation and radial
    /// velocity [default: 0.25,0.5,1,0.15]
    ///
    /// Metres, degrees, degrees, m/s. Vehicles side by side are told apart by it: a radar of 0.15 degrees that is taken
    /// for one of half a degree costs points of every rate.
    #[arg(long, value_name = "M,DEG,DEG,M/S", value_parser = noise)]
    noise: Option<NoiseConfig>,
    /// Heights of the road that estimators are given wrongly: so many times as high, and so far ahead of where they are, to see
    /// what that costs [default: 1,0]
    ///
    /// Of a road that is not flat. `true-boxes` and all that is judged keep the true ones. A survey that takes a grade of 4 %
    /// for 3 %: --ground-error 0.75,0; a crest 15 m too far away: --ground-error 1,15
    #[arg(long, value_name = "TIMES,M", value_parser = ground_error, allow_hyphen_values = true)]
    ground_error: Option<GroundError>,
}

impl SettingsArgs {
    /// Files these options name.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.reading.files().chain(self.judging.files())
    }

    /// Defaults, then the file, then the command line.
    ///
    /// # Errors
    /// Those of [`JudgingArgs::settings`].
    pub fn settings(&self) -> Result<Settings> {
        Ok(Settings { reading: self.reading.options(), ..self.judging.settings()? })
    }
}

impl MapArgs {
    /// Files these options name.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.reading.files().chain(self.config.files())
    }

    /// Defaults, then the file, then the command line.
    ///
    /// # Errors
    /// Those of [`JudgingArgs::settings`].
    pub fn settings(&self) -> Result<Settings> {
        let mut settings = Settings { reading: self.reading.options(), ..self.config.settings()? };
        self.height.apply(&mut settings.evaluation);
        self.unit.apply(&mut settings.estimators);
        checked(settings)
    }
}

impl ConfigArgs {
    fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.config.clone().into_iter()
    }

    /// Defaults, then the file.
    fn settings(&self) -> Result<Settings> {
        let config = self.config.as_deref().map(read_config).transpose()?.unwrap_or_default();
        Ok(Settings { reading: ReadOptions::default(), evaluation: config.evaluation, estimators: config.estimators })
    }
}

/// With values that can be, and one height for truth and estimators.
fn checked(mut settings: Settings) -> Result<Settings> {
    settings.evaluation.check()?;
    settings.estimators.judge_at(settings.evaluation.slice_height_m);
    Ok(settings)
}

impl JudgingArgs {
    /// Files these options name.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        self.config.files()
    }

    /// Defaults, then the file, then the command line; recordings are read as they are.
    ///
    /// # Errors
    /// A file that cannot be read, a key it should not have (with its line), a value out of range.
    pub fn settings(&self) -> Result<Settings> {
        let mut settings = self.config.settings()?;
        self.evaluation.apply(&mut settings.evaluation);
        self.estimators.apply(&mut settings.estimators);
        checked(settings)
    }
}

fn read_config(path: &Path) -> Result<Config> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    toml::from_str(&text)
        .map_err(|error| unit_file::for_config(&text).map_or_else(|| error.into(), anyhow::Error::msg))
        .with_context(|| format!("configuration {}", path.display()))
}

impl ReadingArgs {
    /// Files these options name.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> {
        let labels = if let Some(LabelsFrom::File(file)) = &self.labels { Some(file.clone()) } else { None };
        labels.into_iter()
    }

    pub fn options(&self) -> ReadOptions {
        ReadOptions {
            radar_topic: self.radar_topic.clone(),
            truth_topic: self.truth_topic.clone(),
            labels: self.labels.clone().unwrap_or_default(),
            approaching_is_positive: self.velocity_sign.as_deref() == Some("approaching"),
            velocity_scale: self.velocity_scale,
            road_frame: self.road_frame.clone(),
            radar_frame: self.radar_frame.clone(),
            mount: self.mount,
            field_of_view: self.fov,
            from_s: self.from,
            to_s: self.to,
            interface: self.interface.clone(),
            sensor_id: self.sensor_id,
            profile: self.kind.radar,
            wanted: self.kind.cluster_states,
            ti_header: self.kind.ti_header,
            ti_dialect: self.kind.ti_dialect,
            frame_period_s: self.frame_period,
            one_of_several: false,
        }
    }
}

fn set<T: Copy>(option: Option<T>, place: &mut T) {
    if let Some(value) = option {
        *place = value;
    }
}

impl EvaluationArgs {
    fn apply(&self, options: &mut evaluation::Options) {
        set(self.min_speed, &mut options.min_speed_mps);
        self.height.apply(options);
        set(self.warm_up, &mut options.warm_up_s);
        set(self.growth, &mut options.growth_m);
        set(self.growth_azimuth, &mut options.growth_azimuth_deg);
        set(self.doppler_tolerance, &mut options.doppler_tolerance_mps);
        set(self.min_detections, &mut options.min_detections);
        set(self.grid, &mut options.grid);
        set(self.bootstrap, &mut options.bootstrap);
        set(self.seed, &mut options.seed);
    }
}

impl HeightArgs {
    fn apply(&self, options: &mut evaluation::Options) {
        set(self.slice_height, &mut options.slice_height_m);
    }
}

impl EstimatorArgs {
    fn apply(&self, options: &mut estimators::Options) {
        self.unit.apply(options);
        set(self.reference_share, &mut options.reference_share);
    }
}

impl UnitArgs {
    fn apply(&self, options: &mut estimators::Options) {
        set(self.max_detections, &mut options.max_detections);
        set(self.grid_size, &mut options.grid);
        set(self.ground_error, &mut options.ground_error);
        options.far_road = self.far_road.or(options.far_road);
        if let Some(noise) = self.noise {
            // which is no accuracy, and in no data sheet
            let reflector_height_m = options.noise.reflector_height_m;
            options.noise = NoiseConfig { reflector_height_m, ..noise };
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use viewshed::inputs::ti::{Entries, PolarPoints, TiAngleUnit};

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: SettingsArgs,
    }

    fn parse(line: &[&str]) -> Result<Settings> {
        Line::try_parse_from([&["viewshed"], line].concat())?.settings.settings()
    }

    #[test]
    fn angles_are_given_in_degrees() {
        let s = parse(&["--mount", "-1,2,6,0,4,0", "--fov=-60,60,-16,16,3,200"]).unwrap();
        let [x, .., pitch, _] = s.reading.mount.unwrap();
        assert_eq!((x, pitch), (-1.0, 4_f64.to_radians()));
        assert_eq!(s.reading.field_of_view.unwrap().azimuth_rad[0], -60_f64.to_radians());
    }

    #[test]
    fn the_far_road_lies_along_the_road_or_where_it_is_said() {
        let far_road = |line: &[&str]| parse(line).map(|settings| settings.estimators.far_road);
        assert_eq!(far_road(&[]).unwrap(), None);
        assert_eq!(far_road(&["--far-road"]).unwrap(), Some(FarRoad::AlongRoad));
        assert_eq!(far_road(&["--far-road=-12"]).unwrap(), Some(FarRoad::Degrees(-12)));
        for wrong in ["--far-road=1.5", "--far-road=north", "--far-road=200"] {
            let error = far_road(&[wrong]).unwrap_err().to_string();
            assert!(error.contains("is not a whole number of degrees, -128 to 127"), "{error}");
        }
    }

    #[test]
    fn noise_is_in_the_order_of_a_data_sheet_and_the_default_of_the_help_is_in_force() {
        let usual = parse(&[]).unwrap().estimators;
        assert_eq!(parse(&["--noise", "0.25,0.5,1,0.15"]).unwrap().estimators, usual);
        let noise = parse(&["--noise", "0.1,0.2,0.4,0.05"]).unwrap().estimators.noise;
        assert_eq!((noise.range_m, noise.azimuth_deg), (0.1, 0.2));
        assert_eq!((noise.elevation_deg, noise.radial_velocity_mps), (0.4, 0.05));
        assert_eq!(noise.reflector_height_m, usual.noise.reflector_height_m);
    }

    #[test]
    fn impossible_values_say_what_is_wrong() {
        let error = |line: &[&str]| parse(line).unwrap_err().to_string();
        assert!(error(&["--mount", "0,0,-6,0,4,0"]).contains("not above the road"));
        assert!(error(&["--mount", "0,0,6"]).contains("3 values, 6 are needed"));
        assert!(error(&["--fov", "60,-60,-16,16,3,200"]).contains("azimuth from 60 to -60 is no interval"));
        assert!(error(&["--fov", "nan,60,-16,16,3,200"]).contains("not finite"));
        assert!(error(&["--min-detections", "0"]).contains("`min_detections` is 0"));
        assert!(error(&["--noise", "0.2,0.1"]).contains("2 values, 4 are needed"));
        assert!(error(&["--ground-error", "4,0"]).contains("4 times is not within 0 to 3"));
        assert!(error(&["--noise", "0.2,100,1,0.1"]).contains("noise.azimuth_deg"));
    }

    /// Every `[default: D, from LOW to HIGH...]` of the help is what is in force.
    #[test]
    fn defaults_and_limits_in_the_help_are_those_that_are_enforced() {
        use clap::CommandFactory;

        let command = Line::command();
        let mut found = 0;
        for option in command.get_arguments() {
            let help = option.get_help().map(ToString::to_string).unwrap_or_default();
            let Some((default, rest)) = help.split_once("[default: ").and_then(|(_, h)| h.split_once(", from ")) else {
                continue;
            };
            let number = |text: &str| text.parse::<f64>().unwrap();
            let (low, high) = rest.split_once(" to ").unwrap();
            let high = number(high.split(|c: char| !c.is_ascii_digit()).next().unwrap());
            let (low, name) = (number(low), option.get_long().unwrap());
            let with = |value: f64| parse(&[&format!("--{name}"), &value.to_string()]);
            let (usual, given) = (parse(&[]).unwrap(), with(number(default)).unwrap());
            assert_eq!((usual.evaluation, usual.estimators), (given.evaluation, given.estimators), "{name}");
            assert!(with(low).is_ok() && with(high).is_ok(), "{name}");
            if name != "max-detections" {
                assert!(with(low - 1.0).is_err() && with(high + 1.0).is_err(), "{name}");
            }
            found += 1;
        }
        assert!(found >= 9, "{found}");
        let error = parse(&["--warm-up", "-1"]).unwrap_err().to_string();
        assert_eq!(error, "evaluation option `warm_up_s` is -1, it must lie in 0 to 86400");
        let error = parse(&["--fov=-60,60,-16,16,3,400"]).unwrap_err().to_string();
        assert!(error.contains("grids go to 256 m"), "{error}");
    }

    #[test]
    fn a_units_file_is_told_from_one_for_replay() {
        let told = |text: &str| {
            let folder = std::env::temp_dir().join(format!("viewshed-config-{}", std::process::id()));
            std::fs::create_dir_all(&folder).unwrap();
            let path = folder.join("a.toml");
            std::fs::write(&path, text).unwrap();
            let read = read_config(&path).map_err(|error| format!("{error:#}"));
            std::fs::remove_dir_all(&folder).unwrap();
            read.err()
        };
        let lanes = "[[lanes]]\npoints = [[0.0, 0.0], [60.0, 0.0]]\n";
        assert!(told(lanes).unwrap().contains("write it with `viewshed lanes --table estimators.lanes`"));
        assert_eq!(told(&lanes.replace("lanes", "estimators.lanes")), None);
        for unit in [
            include_str!("../../../../../boards/linux/viewshed.toml"),
            include_str!("../../../../../boards/unit.toml"),
            &format!("[unit]\nlearn_lanes = true\n{lanes}"),
        ] {
            assert!(told(unit).unwrap().contains("a.toml: it is a unit's file"), "{:?}", told(unit));
        }
        let tuned = told("[obstacles]\nheadway_s = 0.4\n").unwrap();
        assert!(tuned.contains("for --config it is [estimators.radar_3d.obstacles]"), "{tuned}");
        assert_eq!(told("[estimators.radar_3d.obstacles]\nheadway_s = 0.4\n"), None);
        assert!(told("[evaluaton]\n").unwrap().contains("unknown field `evaluaton`"));
    }

    #[test]
    fn a_dialect_is_a_list() {
        let dialect = |text: &str| parse(&["--ti-dialect", text]).map(|s| s.reading.ti_dialect.unwrap());
        let all = dialect("degrees,raised, no-elevation,targets,doppler=0.12").unwrap();
        let expected = TiDialect {
            angles: TiAngleUnit::Degrees,
            polar_points: PolarPoints::Raised,
            has_elevation: false,
            doppler_step_mps: Some(0.12),
            entries: Entries::Targets,
        };
        assert_eq!(all, expected);
        assert_eq!(dialect("targets").unwrap(), TiDialect { entries: Entries::Targets, ..TiDialect::USUAL });
        assert!(dialect("radians").unwrap_err().to_string().contains("there are degrees"));
        assert!(dialect("doppler=0").is_err() && dialect("doppler=x").is_err() && dialect("").is_err());
    }

    #[test]
    fn the_command_line_wins_over_the_defaults() {
        let s = parse(&["--min-speed", "3", "--grid", "polar", "--max-detections", "4096"]).unwrap();
        assert_eq!((s.evaluation.min_speed_mps, s.evaluation.grid), (3.0, Grid::Polar));
        assert_eq!(s.evaluation.growth_m, 1.0);
        assert_eq!(s.estimators.max_detections, 4096);
        let s = parse(&["--slice-height", "0.5"]).unwrap();
        assert_eq!(s.estimators.radar_3d.visibility.slice_height_m, 0.5, "truth and estimators share the height");
    }
}
