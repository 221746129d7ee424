//! The configuration file: TOML in, what the daemon works with out, every problem with its key and line.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use viewshed::board::{Ars408Configuration, Ars408Profile, Identity, SettingsCheck, UnitConfig};
use viewshed::fusion::FixturesConfig;
use viewshed::{
    Addresses, Ars408Config, Ars408Wanted, BroadcastConfig, CanId, ConfigError, EvidenceConfig, FieldOfView,
    GateConfig, HealthConfig, Medium, Mount, NoiseConfig, ObstacleConfig, Sensor, Settings, TiAngleUnit, TiConfig,
    TiDialect, TiFamily, VisibilityConfig, reference, small,
};

use crate::locate;
use crate::one_file::is_one_file;
use crate::probability::{Given, Table};
use crate::state;

/// Size of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grid {
    /// 200 x 128 x 12 cells.
    #[default]
    Reference,
    /// 100 x 96 x 4 cells: half the resolution for less than half of the work.
    Small,
}

impl Grid {
    /// Whether a unit of this size can run with settings.
    pub fn check(self) -> SettingsCheck {
        match self {
            Self::Reference => reference::supervised::CHECK,
            Self::Small => small::supervised::CHECK,
        }
    }

    /// Ranges and azimuths.
    fn cells(self) -> [u8; 2] {
        let cells = match self {
            Self::Reference => [reference::State::RANGES, reference::State::AZIMUTHS],
            Self::Small => [small::State::RANGES, small::State::AZIMUTHS],
        };
        cells.map(|n| u8::try_from(n).unwrap_or(u8::MAX))
    }
}

/// The whole file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    #[serde(default)]
    pub grid: Grid,
    /// Whether the unit learns which way traffic goes; without it, as a configuration block says.
    pub learn_lanes: Option<bool>,
    /// Where the epoch and the configuration blocks are kept.
    pub state_dir: Option<PathBuf>,
    pub input: Input,
    pub output: Output,
    pub mount: Option<Mount>,
    pub field_of_view: Option<FieldOfView>,
    pub noise: Option<NoiseConfig>,
    pub gate: Option<GateConfig>,
    pub visibility: Option<VisibilityConfig>,
    pub health: Option<HealthConfig>,
    /// Tuned for the place. Kept as long as the daemon runs, like the lanes.
    #[serde(default, deserialize_with = "kept")]
    pub obstacles: Option<&'static ObstacleConfig>,
    #[serde(default, deserialize_with = "kept")]
    pub evidence: Option<&'static EvidenceConfig>,
    /// What stands in the view tells whether the radar is in order.
    #[serde(default, deserialize_with = "kept")]
    pub fixtures: Option<&'static FixturesConfig>,
    /// How probable it is that vehicles are detected.
    pub probability: Option<Given>,
    /// Which way traffic goes.
    #[serde(default, deserialize_with = "lanes")]
    pub lanes: &'static [&'static [[f32; 2]]],
    /// Height of the road over its length.
    #[serde(default, deserialize_with = "ground")]
    pub ground: &'static [[f32; 2]],
}

fn kept<'de, T: Deserialize<'de>, D: serde::Deserializer<'de>>(table: D) -> Result<Option<&'static T>, D::Error> {
    Ok(Some(Box::leak(Box::new(T::deserialize(table)?))))
}

/// A lane, or the road's profile.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Points {
    points: Vec<[f32; 2]>,
}

fn ground<'de, D: serde::Deserializer<'de>>(table: D) -> Result<&'static [[f32; 2]], D::Error> {
    Ok(Points::deserialize(table)?.points.leak())
}

fn lanes<'de, D: serde::Deserializer<'de>>(tables: D) -> Result<&'static [&'static [[f32; 2]]], D::Error> {
    let tables = Vec::<Points>::deserialize(tables)?;
    Ok(tables.into_iter().map(|lane| &*lane.points.leak()).collect::<Vec<_>>().leak())
}

/// The radar.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    pub radar: Radar,
    pub interface: Option<String>,
    pub port: Option<PathBuf>,
    pub baud: Option<u32>,
    pub candump: Option<PathBuf>,
    #[serde(default)]
    pub sensor_id: u8,
    #[serde(default)]
    pub clock: ClockSource,
    pub ars408: Option<Ars408>,
    pub ti: Option<Ti>,
}

/// Its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Radar {
    Ars408,
    Ti,
    Native,
}

/// Whose time counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClockSource {
    /// The system's monotonic clock.
    #[default]
    System,
    /// What comes in: a test bench.
    Input,
}

/// An ARS408 or its kin.
#[derive(Debug, Clone, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ars408 {
    pub profile: String,
    pub cluster_states: Option<Vec<u8>>,
    pub configure: Option<Wanted>,
}

impl Default for Ars408 {
    fn default() -> Self {
        Self { profile: Ars408Profile::ARS408.name.into(), cluster_states: None, configure: None }
    }
}

impl Ars408 {
    /// The entries that are wanted, if the states are some.
    fn wanted(&self) -> Option<Ars408Wanted> {
        let usual = Ars408Wanted::default();
        self.cluster_states.as_ref().map_or(Some(usual), |states| usual.with_clusters(states.iter().copied()))
    }
}

/// What the radar is configured to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wanted {
    Clusters,
    Objects,
}

/// A TI mmWave radar.
#[derive(Debug, Clone, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ti {
    pub header_bytes: Option<u32>,
    pub has_elevation: bool,
    pub doppler_step_mps: Option<f32>,
    pub angles: Angles,
}

impl Default for Ti {
    fn default() -> Self {
        Self { header_bytes: None, has_elevation: true, doppler_step_mps: None, angles: Angles::Radians }
    }
}

/// Unit of spherical points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Angles {
    Radians,
    Degrees,
}

/// The broadcast.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    pub medium: Carrier,
    pub interface: Option<String>,
    pub port: Option<PathBuf>,
    pub baud: Option<u32>,
    pub candump: Option<PathBuf>,
    #[serde(default)]
    pub sensor: u8,
    #[serde(default)]
    pub listen_first: bool,
    #[serde(default)]
    pub service: bool,
    pub base_id: Option<u32>,
    pub gap_us: Option<u32>,
    pub stale_ms: Option<u16>,
    pub max_age_ms: Option<u16>,
    pub max_delay_ms: Option<u16>,
    pub status_ms: Option<u16>,
    pub header_ms: Option<u16>,
    pub visible_range_ms: Option<u16>,
}

/// What maps are sent over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Carrier {
    Can,
    CanFd,
    Serial,
}

/// Bits per second of a serial port where none are given: what TI's data ports run at.
const USUAL_BAUD: u32 = 921_600;

/// A key and what is wrong with it.
type Problem = (String, String);

impl Config {
    /// Reads and checks a file. Where it names no folder for what is kept, `state_dir` is that.
    ///
    /// # Errors
    /// One line for each problem: file, line, key, what is wrong.
    pub fn read(path: &Path, state_dir: Option<PathBuf>) -> Result<Self, Vec<String>> {
        let shown = path.display();
        let text = std::fs::read_to_string(path).map_err(|e| vec![format!("{shown}: cannot be read: {e}")])?;
        let with_lines = |problems: Vec<(Option<usize>, String)>| -> Vec<String> {
            let line = |(line, what): (Option<usize>, String)| match line {
                Some(line) => format!("{shown}:{line}: {what}"),
                None => format!("{shown}: {what}"),
            };
            problems.into_iter().map(line).collect()
        };
        let mut config = Self::parse(&text).map_err(with_lines)?;
        config.state_dir = config.state_dir.or(state_dir);
        match config.destroyed(path) {
            None => Ok(config),
            Some(what) => {
                let key = "output.candump";
                Err(with_lines(vec![(locate::line_of(&text, key), format!("{key}: {what}"))]))
            }
        }
    }

    /// What the log of the broadcast would destroy, be it through links: a file that is read, or is kept.
    fn destroyed(&self, own: &Path) -> Option<String> {
        let log = self.output.candump.as_ref()?;
        let kept = self.state_dir.iter().flat_map(|folder| state::FILES.map(|name| ("state_dir", folder.join(name))));
        let read = self.input.candump.iter().map(|path| ("input.candump", path.clone()));
        let read = read.chain(self.probability.iter().map(|given| ("probability.file", given.file.clone())));
        let mut files = read.chain(kept).chain([("the configuration", own.to_owned())]);
        let (what, path) = files.find(|(_, path)| is_one_file(path, log))?;
        Some(format!("{} would destroy {} ({what}); name another file", log.display(), path.display()))
    }

    /// Reads and checks a text; problems come with their lines.
    pub fn parse(text: &str) -> Result<Self, Vec<(Option<usize>, String)>> {
        let config: Self = toml::from_str(text).map_err(|e| {
            let at = e.span().map(|span| span.start);
            let key = at.and_then(|at| locate::key_at(text, at)).map_or(String::new(), |key| format!("{key}: "));
            vec![(at.map(|at| locate::line_at(text, at)), format!("{key}{}", e.message().replace('\n', " ")))]
        })?;
        let problems = config.problems();
        if problems.is_empty() {
            return Ok(config);
        }
        Err(problems.into_iter().map(|(key, what)| (locate::line_of(text, &key), format!("{key}: {what}"))).collect())
    }

    fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut add = |key: &str, what: &str| problems.push((key.to_owned(), what.to_owned()));
        let (input, output) = (&self.input, &self.output);
        let on_can = input.radar == Radar::Ars408;
        match (on_can, &input.interface, &input.candump, &input.port) {
            (true, _, _, Some(_)) => {
                add("input.port", "an ARS408 is on a CAN bus: `interface`, or `candump` for a log")
            }
            (true, None, None, _) => add("input.interface", "missing: the CAN interface of the radar, as \"can0\""),
            (false, Some(_), ..) => add("input.interface", "this radar is on a serial line: `port`"),
            (false, _, Some(_), _) => add("input.candump", "logs of CAN buses are for radar = \"ars408\""),
            (false, _, _, None) => add("input.port", "missing: the serial port of the radar, as \"/dev/ttyUSB0\""),
            _ => {}
        }
        if input.clock == ClockSource::Input && input.candump.is_none() && input.radar != Radar::Native {
            add("input.clock", "\"input\" is for logs and the native format, whose input has the time");
        }
        if on_can && input.sensor_id > 7 {
            add("input.sensor_id", "an ARS408's is 0 to 7");
        }
        if let Some(ars408) = &input.ars408 {
            if !on_can {
                add("input.ars408", "this radar is none");
            }
            if Ars408Profile::named(&ars408.profile).is_none() {
                let known: Vec<&str> = Ars408Profile::ALL.iter().map(|p| p.name).collect();
                add("input.ars408.profile", &format!("\"{}\" is none of {}", ars408.profile, known.join(", ")));
            }
            if ars408.wanted().is_none() {
                add("input.ars408.cluster_states", "numbers from 0 to 31, at least one");
            }
        }
        if let Some(ti) = &input.ti {
            if input.radar != Radar::Ti {
                add("input.ti", "this radar is none");
            }
            if ti.header_bytes.is_some_and(|bytes| family(bytes).is_none()) {
                add("input.ti.header_bytes", "36, 40, 44 or 52; without it is learnt");
            }
        }
        let serial = output.medium == Carrier::Serial;
        match (serial, &output.interface, &output.candump, &output.port) {
            (true, Some(_), ..) => add("output.interface", "medium = \"serial\" goes to a `port`"),
            (true, _, Some(_), _) => add("output.candump", "medium = \"serial\" goes to a `port`"),
            (true, _, _, None) if input.radar != Radar::Native => {
                add("output.port", "missing: the serial port maps go to, as \"/dev/ttyS1\"");
            }
            (false, _, _, Some(_)) => add("output.port", "maps on CAN go to an `interface`, or a `candump` log"),
            (false, None, None, _) => add("output.interface", "missing: the CAN interface maps go to, as \"can1\""),
            (false, Some(_), Some(_), _) => add("output.candump", "either this or `interface`"),
            _ => {}
        }
        if output.port.is_some() && output.port == input.port && input.radar != Radar::Native {
            add("output.port", "this is the radar's");
        }
        if input.clock == ClockSource::Input && output.interface.is_some() {
            add("input.clock", "a bus wants \"system\": its time cannot be another's");
        }
        if output.service && output.interface.is_none() {
            add("output.service", "is for a CAN `interface`; the native format's line has it anyway");
        }
        for (key, baud) in [("input.baud", input.baud), ("output.baud", output.baud)] {
            if baud.is_some_and(|baud| !(1_200..=4_000_000).contains(&baud)) {
                add(key, "outside 1200 to 4000000");
            }
        }
        if self.addresses().is_none() {
            add("output.base_id", "not a multiple of 32 within 11 bits, or 29 if above 0x7FF");
        }
        if let Some((key, what)) = self.probability.as_ref().and_then(Given::problem) {
            add(&format!("probability.{key}"), what);
        }
        // whatever the settings come from, maps are to be sent like this
        let refused = self.medium().and_then(|medium| self.broadcast(medium).check().err());
        problems.extend(refused.map(|e| of_library(&e)));
        let missing = [("mount", self.mount.is_none()), ("field_of_view", self.field_of_view.is_none())];
        match self.settings() {
            Some(settings) => problems.extend(self.grid.check().settings(&settings).err().map(|e| of_library(&e))),
            // the integrator's messages can bring them
            None if self.has_service() && missing.iter().all(|(_, missing)| *missing) => {
                problems.extend(self.place_problem().map(|e| of_library(&e)));
            }
            None => {
                let missing = missing.iter().filter(|(_, missing)| *missing);
                problems.extend(missing.map(|(key, _)| ((*key).to_owned(), format!("the table [{key}] is missing"))));
            }
        }
        problems
    }

    /// Whether configuration blocks may come over a line.
    pub fn has_service(&self) -> bool {
        self.input.radar == Radar::Native || self.output.service
    }

    /// What the integrator set; `None` if that is left to a configuration block.
    pub fn settings(&self) -> Option<Settings> {
        let noise = self.noise.unwrap_or_default();
        let sensor = Sensor { mount: self.mount?, field_of_view: self.field_of_view?, noise };
        let gate = self.gate.unwrap_or_default();
        let (visibility, health) = (self.visibility.unwrap_or_default(), self.health.unwrap_or_default());
        Some(self.of_place(Settings { gate, visibility, health, ..Settings::of(sensor) }))
    }

    /// Settings with what the file says of the place and no configuration block does.
    pub fn of_place(&self, settings: Settings) -> Settings {
        let Self { lanes, ground, obstacles, evidence, fixtures, .. } = *self;
        let learn_lanes = self.learn_lanes.unwrap_or(settings.unit.learn_lanes);
        let unit = UnitConfig { learn_lanes, ..settings.unit };
        Settings { unit, lanes, ground, obstacles, evidence, fixtures, ..settings }
    }

    /// The table of probabilities for the file's own settings, if both are given.
    pub fn table(&self) -> Option<anyhow::Result<Table>> {
        self.probability
            .as_ref()
            .zip(self.settings())
            .map(|(given, settings)| given.read(self.grid == Grid::Reference, &settings))
    }

    /// Which program the service says this is; its chip is the machine.
    pub fn identity(&self) -> Identity {
        let machine = std::fs::read("/etc/machine-id").unwrap_or_default();
        let chip = if machine.is_empty() { 0 } else { Identity::number(machine.trim_ascii()) };
        let is_bench = self.input.radar == Radar::Native && self.input.clock == ClockSource::Input;
        Identity { board: "linux", chip, is_bench, grid: self.grid.cells() }
    }

    /// What the file means, in words.
    pub fn summary(&self, path: &Path, ok: bool) -> String {
        let mut lines = vec![format!("{}: {}", path.display(), if ok { "ok" } else { "cannot be run now" })];
        let (input, output) = (&self.input, &self.output);
        let radar = match input.radar {
            Radar::Ars408 => format!("ARS408 of sensor id {}", input.sensor_id),
            Radar::Ti => "TI mmWave radar".to_owned(),
            Radar::Native => format!("native scans of sensor {}", input.sensor_id),
        };
        let place = |interface: &Option<String>, port: &Option<PathBuf>, baud, candump: &Option<PathBuf>| match (
            candump, interface, port,
        ) {
            (Some(log), _, _) => format!("log {}", log.display()),
            (_, Some(name), _) => format!("interface {name}"),
            (_, _, Some(port)) => format!("{} at {baud} baud", port.display()),
            _ => "the radar's own line".to_owned(),
        };
        let from = place(&input.interface, &input.port, input.baud(), &input.candump);
        let to = place(&output.interface, &output.port, output.baud(), &output.candump);
        lines.push(format!("in:    {radar} from {from}"));
        let ids = self.addresses().and_then(|a| a.first(output.sensor)).map(|id| match id {
            CanId::Standard(raw) => format!(", identifiers from 0x{raw:03X}"),
            CanId::Extended(raw) => format!(", identifiers from 0x{raw:08X}"),
        });
        let (medium, ids) = match output.medium {
            Carrier::Can => ("CAN frames", ids.unwrap_or_default()),
            Carrier::CanFd => ("CAN FD frames", ids.unwrap_or_default()),
            Carrier::Serial => ("serial messages", String::new()),
        };
        lines.push(format!("out:   {medium} of sensor {} to {to}{ids}", output.sensor));
        let state = self.state_dir.as_ref().map_or("nowhere".to_owned(), |folder| folder.display().to_string());
        lines.push(format!("state: {state}"));
        match (self.mount, self.field_of_view) {
            (Some(m), Some(v)) => lines.push(format!(
                "mount: {} m high, looks {} degrees down; sees {} to {} degrees, {} to {} m",
                m.height_m, m.pitch_deg, v.azimuth_min_deg, v.azimuth_max_deg, v.range_min_m, v.range_max_m
            )),
            _ => lines.push("mount: from a configuration block; the safe state until there is one".to_owned()),
        }
        lines.extend(self.unused());
        lines.extend(self.table().and_then(Result::ok).map(|table| format!("p:     {}", table.said())));
        lines.extend(self.absent().iter().map(|device| format!("not there now, would be waited for: {device}")));
        lines.join("\n")
    }

    /// Files that the daemon could not read or write: nobody plugs these in.
    pub fn missing_files(&self) -> Vec<String> {
        let mut missing = Vec::new();
        if let Some(log) = self.input.candump.as_ref().filter(|log| !log.is_file()) {
            missing.push(format!("input.candump: {} is not there", log.display()));
        }
        let folder = self.output.candump.as_ref().and_then(|log| log.parent());
        if let Some(folder) = folder.filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
            missing.push(format!("output.candump: the folder {} is not there", folder.display()));
        }
        missing
    }

    /// Devices that are not there at this moment.
    fn absent(&self) -> Vec<String> {
        let interfaces = [(&self.input.interface, &self.input.candump), (&self.output.interface, &self.output.candump)];
        let live = interfaces.into_iter().filter(|(_, candump)| candump.is_none()).filter_map(|(name, _)| name.clone());
        let interfaces = live.filter(|name| !Path::new("/sys/class/net").join(name).exists());
        let ports = [&self.input.port, &self.output.port].into_iter().flatten().filter(|port| !port.exists());
        interfaces.map(|name| format!("interface {name}")).chain(ports.map(|port| port.display().to_string())).collect()
    }

    fn addresses(&self) -> Option<Addresses> {
        let Some(base) = self.output.base_id else { return Some(Addresses::STANDARD) };
        let id = match u16::try_from(base) {
            Ok(base) if base <= 0x7FF => CanId::standard(base),
            _ => CanId::extended(base),
        };
        id.and_then(Addresses::new)
    }

    /// What maps travel on.
    pub fn medium(&self) -> Option<Medium> {
        Some(match self.output.medium {
            Carrier::Can => Medium::Can(self.addresses()?),
            Carrier::CanFd => Medium::CanFd(self.addresses()?),
            Carrier::Serial => Medium::Serial,
        })
    }

    /// How the sender behaves.
    pub fn broadcast(&self, medium: Medium) -> BroadcastConfig {
        let o = &self.output;
        let usual = BroadcastConfig::new(o.sensor, medium);
        BroadcastConfig {
            gap_us: o.gap_us.unwrap_or(usual.gap_us),
            stale_ms: o.stale_ms.unwrap_or(usual.stale_ms),
            max_age_ms: o.max_age_ms.unwrap_or(usual.max_age_ms),
            max_delay_ms: o.max_delay_ms.unwrap_or(usual.max_delay_ms),
            status_ms: o.status_ms.unwrap_or(usual.status_ms),
            header_ms: o.header_ms.unwrap_or(usual.header_ms),
            visible_range_ms: o.visible_range_ms,
            ..usual
        }
    }
}

impl Input {
    pub fn baud(&self) -> u32 {
        self.baud.unwrap_or(USUAL_BAUD)
    }

    /// The ARS408's decoder.
    pub fn ars408(&self) -> Ars408Config {
        let name = self.ars408.as_ref().map_or(Ars408Profile::ARS408.name, |a| &a.profile);
        let profile = *Ars408Profile::named(name).unwrap_or(&Ars408Profile::ARS408);
        let usual = Ars408Config::sensor(self.sensor_id);
        let wanted = self.ars408.as_ref().and_then(Ars408::wanted).unwrap_or(usual.wanted);
        Ars408Config { profile, wanted, ..usual }
    }

    /// What the ARS408 is configured to, if anything.
    pub fn configure(&self) -> Option<Ars408Configuration> {
        Some(match self.ars408.as_ref()?.configure? {
            Wanted::Clusters => Ars408Configuration::CLUSTERS,
            Wanted::Objects => Ars408Configuration::OBJECTS,
        })
    }

    /// TI's decoder.
    pub fn ti(&self) -> TiConfig {
        let given = self.ti.clone().unwrap_or_default();
        let angles = match given.angles {
            Angles::Radians => TiAngleUnit::Radians,
            Angles::Degrees => TiAngleUnit::Degrees,
        };
        let (has_elevation, doppler_step_mps) = (given.has_elevation, given.doppler_step_mps);
        let dialect = TiDialect { angles, has_elevation, doppler_step_mps, ..TiDialect::USUAL };
        TiConfig { family: given.header_bytes.and_then(family), dialect }
    }
}

impl Output {
    pub fn baud(&self) -> u32 {
        self.baud.unwrap_or(USUAL_BAUD)
    }
}

fn family(bytes: u32) -> Option<TiFamily> {
    TiFamily::ALL.into_iter().find(|family| family.header() == bytes)
}

/// The library's name of a parameter is the file's, but for the broadcast's table.
fn of_library(e: &ConfigError) -> Problem {
    let key = e.parameter.replace("broadcast.", "output.");
    let text = e.to_string();
    let what = text.strip_prefix(e.parameter).unwrap_or(&text).trim_start_matches([':', ' ']).to_owned();
    (key, what)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A file with these tables at its end.
    fn with(tables: &str) -> Result<Config, toml::de::Error> {
        toml::from_str(&format!(
            "[input]\nradar = \"ars408\"\ninterface = \"can0\"\n[output]\nmedium = \"can\"\ninterface = \"can1\"\n\
             [mount]\nx_m = 0.0\ny_m = 0.0\nheight_m = 6.0\nyaw_deg = 0.0\npitch_deg = 4.0\nroll_deg = 0.0\n\
             [field_of_view]\nazimuth_min_deg = -60.0\nazimuth_max_deg = 60.0\nelevation_min_deg = -16.0\n\
             elevation_max_deg = 16.0\nrange_min_m = 3.0\nrange_max_m = 200.0\n{tables}"
        ))
    }

    #[test]
    fn the_clusters_that_are_wanted_are_those_called_valid_or_those_of_the_file() {
        let wanted = |tables: &str| with(tables).unwrap().input.ars408().wanted;
        assert_eq!(wanted(""), Ars408Wanted::MEASURED);
        assert_eq!(wanted("[input.ars408]\n"), Ars408Wanted::MEASURED);
        let given = wanted("[input.ars408]\ncluster_states = [0x00, 0x08]\n");
        assert_eq!(given, Ars408Wanted { invalid_states: 0x101, ..Ars408Wanted::MEASURED });
        for states in ["[]", "[0, 32]"] {
            let text = format!("[input.ars408]\ncluster_states = {states}\n");
            let problems = format!("{:?}", with(&text).unwrap().problems());
            assert!(problems.contains("input.ars408.cluster_states"), "{problems}");
        }
    }

    #[test]
    fn lanes_are_a_part_of_the_settings_and_a_bad_one_is_named() {
        let config = |points: &str| with(&format!("[[lanes]]\npoints = {points}\n")).unwrap();
        let lane = config("[[-50.0, 2.0], [50.0, 2.0]]").settings().unwrap();
        assert_eq!(lane.lanes, [&[[-50.0, 2.0], [50.0, 2.0]][..]]);
        let check = |points: &str| Grid::Reference.check().settings(&config(points).settings().unwrap());
        assert!(check("[[-50.0, 2.0], [50.0, 2.0]]").is_ok());
        let refused = check("[[-50.0, 2.0]]").unwrap_err().to_string();
        assert_eq!(refused, "lanes: lane 0 has fewer than two points");
    }

    #[test]
    fn lanes_are_learnt_where_the_file_says_so_or_a_block_and_the_file_does_not() {
        let mut config = with("").unwrap();
        let plain = config.settings().unwrap();
        assert!(!plain.unit.learn_lanes && !config.of_place(plain).unit.learn_lanes);
        let block = Settings { unit: UnitConfig { learn_lanes: true, ..plain.unit }, ..plain };
        assert!(config.of_place(block).unit.learn_lanes);
        config.learn_lanes = Some(false);
        assert!(!config.of_place(block).unit.learn_lanes);
        config.learn_lanes = Some(true);
        let learns = config.settings().unwrap();
        assert_eq!(learns.radar_3d().obstacles.lane_vehicles, 3.0);
        assert_ne!(learns.fingerprint(), plain.fingerprint());
    }

    #[test]
    fn the_roads_heights_are_a_part_of_the_settings_and_of_the_fingerprint_and_a_steep_one_is_named() {
        let config = |points: &str| with(&format!("[ground]\npoints = {points}\n")).unwrap().settings().unwrap();
        let (plain, climbing) = (with("").unwrap().settings().unwrap(), config("[[0.0, 0.0], [100.0, 4.0]]"));
        assert_eq!(climbing.radar_3d().ground, [[0.0, 0.0], [100.0, 4.0]]);
        assert_ne!(plain.fingerprint(), climbing.fingerprint());
        assert!(Grid::Small.check().settings(&climbing).is_ok());
        let refused = Grid::Reference.check().settings(&config("[[0.0, 0.0], [10.0, 4.0]]")).unwrap_err().to_string();
        assert_eq!(refused, "ground: before point 1 the road is steeper than 12 %");
    }

    #[test]
    fn tuned_parameters_are_a_part_of_the_settings_and_of_the_fingerprint_and_a_bad_one_is_named() {
        let config = |tables: &str| with(tables).map(|config| config.settings().unwrap());
        let (plain, tuned) =
            (config("").unwrap(), config("[obstacles]\ngap_m = 5.0\n[evidence]\ngain = 0.4\n").unwrap());
        let made = tuned.radar_3d();
        assert_eq!((made.obstacles.gap_m, made.obstacles.headway_s), (5.0, plain.radar_3d().obstacles.headway_s));
        assert_eq!(made.evidence.gain, 0.4);
        assert_ne!(plain.fingerprint(), tuned.fingerprint());
        assert!(config("[obstacles]\ngap = 5.0\n").unwrap_err().to_string().contains("unknown field `gap`"));
        let refused = Grid::Reference.check().settings(&config("[obstacles]\ngap_m = -1.0\n").unwrap()).unwrap_err();
        assert_eq!(refused.parameter, "obstacles.gap_m");
    }

    #[test]
    fn a_log_that_is_an_input_is_refused_whatever_its_name() {
        let folder = std::env::temp_dir().join(format!("viewshedd-destroyed-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let at = |name: &str| folder.join(name);
        let config = |log: &str| {
            let text = format!(
                "[input]\nradar = \"ars408\"\ncandump = {:?}\n[output]\nmedium = \"can\"\ncandump = {:?}\n\
                 [mount]\nx_m = 0.0\ny_m = 0.0\nheight_m = 6.0\nyaw_deg = 0.0\npitch_deg = 4.0\nroll_deg = 0.0\n\
                 [field_of_view]\nazimuth_min_deg = -60.0\nazimuth_max_deg = 60.0\nelevation_min_deg = -16.0\n\
                 elevation_max_deg = 16.0\nrange_min_m = 3.0\nrange_max_m = 200.0\n",
                at("in.log"),
                at(log)
            );
            fs::write(at("c.toml"), text).unwrap();
            Config::read(&at("c.toml"), Some(folder.clone())).map(|_| ()).map_err(|lines| lines.join("\n"))
        };
        // before there is a log to be read too
        assert!(config("in.log").is_err());
        fs::write(at("in.log"), "(1.0) can0 123#00\n").unwrap();
        fs::hard_link(at("in.log"), at("hard.log")).unwrap();
        std::os::unix::fs::symlink("in.log", at("soft.log")).unwrap();
        for (log, read) in [
            ("in.log", "input.candump"),
            ("hard.log", "input.candump"),
            ("soft.log", "input.candump"),
            ("c.toml", "the configuration"),
            ("slots", "state_dir"),
            ("epoch", "state_dir"),
        ] {
            let error = config(log).unwrap_err();
            assert!(error.contains("c.toml:6: output.candump: ") && error.contains(read), "{log}: {error}");
        }
        assert_eq!(config("out.log"), Ok(()));
        fs::remove_dir_all(folder).unwrap();
    }
}
