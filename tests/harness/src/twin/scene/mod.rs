//! The scene file (TOML): which sensors look, what stands beside the road, where the traffic comes from.
//!
//! ```toml
//! name = "motorway"
//! seed = 1                        # of everything that is drawn
//! start_unix_s = 1777874400       # time of the first frame
//! duration_s = 60.0
//! ground = [[-50.0, -2.0], [250.0, 10.0]]   # height over x, metres: climbs by 4 %; left out, the road is flat
//!
//! [traffic]                       # paths from the scene file's folder
//! fcd = "motorway/day-1.fcd.xml.gz"
//! types = ["motorway/motorway.rou.xml"]
//! from_s = 200.0                  # the file's time at the first frame
//!
//! [radar]
//! name = "gantry"
//! mount = { height_m = 6.0, pitch_deg = 4.0 }
//! field_of_view = { azimuth_deg = [-60.0, 60.0], elevation_deg = [-16.0, 16.0], range_m = [3.0, 200.0] }
//! rate_hz = 15.0
//!
//! [radar.model]                   # twin::radar::model, each parameter with a default
//! reference_snr_db = 35.0
//!
//! [[further_radar]]               # like the first, elsewhere; any number
//! name = "opposite"
//! mount = { x_m = 60.0, y_m = 14.0, height_m = 6.0, yaw_deg = 200.0, pitch_deg = 4.0 }
//!
//! [camera]                        # may be left out
//! name = "camera"
//! mount = { height_m = 6.0, pitch_deg = 6.0 }
//! image = { width_px = 1920, height_px = 1080, view_deg = 60.0 }   # or focal_px = [u, v], center_px = [u, v]
//! rate_hz = 15.0
//!
//! [[static]]
//! id = "median"
//! class = "barrier"
//! center = [100.0, 0.0]
//! length_m = 240.0
//! width_m = 0.6
//! height_m = 0.9
//! ```
//!
//! An unknown key is an error with its line. Angles are in degrees here and nowhere else.

pub mod structure;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::camera::detector::DetectorModel;
use super::camera::{Camera, Image};
use super::radar::Radar;
use super::radar::disturbance::{NoiseInterval, OutageInterval};
use super::radar::misses::Misses;
use super::radar::model::RadarModel;
use super::traffic::Source;
use super::traffic::frame::RoadFrame;
use super::traffic::net::{self, Reach};
use crate::estimators::Lane;
use crate::geometry::ground::Ground;
use crate::geometry::pose::SensorPose;
use crate::geometry::solid::Solid;
use crate::recording::{self, mcap::in_topics};
use structure::Structure;

/// A scene as its file has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    pub name: String,
    #[serde(default = "one")]
    pub seed: u64,
    /// Time of the first frame, seconds since 1970.
    #[serde(default)]
    pub start_unix_s: u32,
    /// Length of the recording, seconds.
    pub duration_s: f64,
    /// What the recording says of its licence.
    pub licence: Option<String>,
    /// Where the road is not flat, its height over its length: x and height in the road frame, metres.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ground: Vec<[f64; 2]>,
    pub traffic: Option<TrafficFile>,
    pub radar: RadarSection,
    /// Radars beside the first.
    #[serde(default, rename = "further_radar")]
    pub further_radars: Vec<FurtherRadar>,
    pub camera: Option<CameraSection>,
    #[serde(default, rename = "static")]
    pub structures: Vec<Structure>,
    /// Folder of the file, which its paths start from.
    #[serde(skip)]
    pub folder: PathBuf,
}

fn one() -> u64 {
    1
}

/// Where the traffic comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrafficFile {
    /// SUMO's FCD (XML or CSV) or trajectories (CSV), plain or gzip; `--fcd` replaces it.
    pub fcd: Option<PathBuf>,
    /// SUMO files that define vehicle types.
    #[serde(default)]
    pub types: Vec<PathBuf>,
    /// SUMO net whose offset is taken away.
    pub net: Option<PathBuf>,
    /// The file's time at the first frame, seconds.
    #[serde(default)]
    pub from_s: f64,
    /// Origin of the road frame in the file's coordinates (those before the net's offset), metres.
    #[serde(default)]
    pub origin: [f64; 2],
    /// Direction of the road's x axis from east, counter-clockwise, degrees.
    #[serde(default)]
    pub heading_deg: f64,
}

/// Where a sensor hangs: the road frame of RECORDINGS.md.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    #[serde(default)]
    pub x_m: f64,
    #[serde(default)]
    pub y_m: f64,
    pub height_m: f64,
    /// Positive to the left.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Positive nose down.
    #[serde(default)]
    pub pitch_deg: f64,
    #[serde(default)]
    pub roll_deg: f64,
}

impl Mount {
    pub fn pose(&self) -> SensorPose {
        SensorPose::new(
            [self.x_m, self.y_m, self.height_m],
            self.yaw_deg.to_radians(),
            self.pitch_deg.to_radians(),
            self.roll_deg.to_radians(),
        )
    }

    /// Whether the sensor would hang within a box, from the road up.
    pub fn is_inside(&self, solid: &Solid) -> bool {
        solid.footprint_distance([self.x_m, self.y_m]) <= 0.0 && self.height_m <= solid.top()
    }

    /// # Errors
    /// Names the figure that no mount has.
    pub fn check(&self) -> Result<()> {
        let limits = [
            ("x_m", self.x_m, [-1e5, 1e5]),
            ("y_m", self.y_m, [-1e5, 1e5]),
            ("yaw_deg", self.yaw_deg, [-360.0, 360.0]),
            ("pitch_deg", self.pitch_deg, [-89.0, 89.0]),
            ("roll_deg", self.roll_deg, [-180.0, 180.0]),
        ];
        for (name, value, [low, high]) in limits {
            ensure!((low..=high).contains(&value), "mount.{name} is {value}, it must lie in {low} to {high}");
        }
        ensure!(
            self.height_m > 0.0 && self.height_m <= 50.0,
            "mount.height_m is {}: a sensor hangs above the road and below 50 m",
            self.height_m
        );
        Ok(())
    }
}

/// Static field of view in the sensor frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldOfView {
    pub azimuth_deg: [f64; 2],
    pub elevation_deg: [f64; 2],
    pub range_m: [f64; 2],
}

impl FieldOfView {
    pub fn view(&self) -> recording::FieldOfView {
        recording::FieldOfView {
            azimuth_rad: self.azimuth_deg.map(f64::to_radians),
            elevation_rad: self.elevation_deg.map(f64::to_radians),
            range_m: self.range_m,
        }
    }

    /// # Errors
    /// Names the limits that are no interval.
    pub fn check(&self) -> Result<()> {
        let limits = [
            ("azimuth_deg", self.azimuth_deg, [-90.0, 90.0]),
            ("elevation_deg", self.elevation_deg, [-90.0, 90.0]),
            ("range_m", self.range_m, [0.0, 2000.0]),
        ];
        for (name, [from, to], [low, high]) in limits {
            ensure!(
                from < to && from >= low && to <= high,
                "field_of_view.{name} from {from} to {to} is no interval within {low} to {high}"
            );
        }
        Ok(())
    }
}

/// One radar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadarSection {
    pub name: String,
    pub mount: Mount,
    pub field_of_view: FieldOfView,
    pub rate_hz: f64,
    #[serde(default = "yes")]
    pub has_elevation: bool,
    #[serde(default)]
    pub model: RadarModel,
    #[serde(default)]
    pub interference: Vec<NoiseInterval>,
    #[serde(default)]
    pub outage: Vec<OutageInterval>,
}

fn yes() -> bool {
    true
}

impl RadarSection {
    pub fn radar(&self) -> Radar {
        Radar {
            pose: self.mount.pose(),
            field_of_view: self.field_of_view.view(),
            has_elevation: self.has_elevation,
            model: self.model.clone(),
        }
    }

    fn check(&self) -> Result<()> {
        self.mount.check()?;
        self.field_of_view.check()?;
        self.model.check()?;
        check_rate(self.rate_hz)?;
        let times = self.interference.iter().map(|i| ("interference", i.from_s, i.to_s));
        for (what, from, to) in times.chain(self.outage.iter().map(|o| ("outage", o.from_s, o.to_s))) {
            ensure!(from < to, "{what} from {from} s to {to} s is no interval");
        }
        Ok(())
    }
}

/// A radar like the scene's first, without its interference and outages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FurtherRadar {
    pub name: String,
    pub mount: Mount,
}

/// A sector of the road plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    from: [f64; 2],
    direction_rad: f64,
    half_rad: f64,
}

impl Look {
    /// Vehicles matter this far outside of the sector, and this near in any direction.
    const MARGIN_RAD: f64 = 0.2;
    const NEAR_M: f64 = 30.0;

    /// A radar's, seen from above.
    pub fn new(mount: &Mount, azimuth_deg: [f64; 2]) -> Self {
        Self {
            from: [mount.x_m, mount.y_m],
            direction_rad: (mount.yaw_deg + (azimuth_deg[0] + azimuth_deg[1]) / 2.0).to_radians(),
            half_rad: ((azimuth_deg[1] - azimuth_deg[0]) / 2.0).to_radians(),
        }
    }

    /// Ground distance of the sensor from a place, metres.
    pub fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        (self.from[0] - x).hypot(self.from[1] - y)
    }

    pub fn reaches(&self, [x, y]: [f64; 2]) -> bool {
        let (dx, dy) = (x - self.from[0], y - self.from[1]);
        let turn = dy.atan2(dx) - self.direction_rad;
        let aside = (turn + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        aside.abs() <= self.half_rad + Self::MARGIN_RAD || dx.hypot(dy) <= Self::NEAR_M
    }
}

/// A camera beside the radar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    pub name: String,
    pub mount: Mount,
    pub image: Image,
    pub rate_hz: f64,
    #[serde(default)]
    pub detector: DetectorModel,
}

impl CameraSection {
    pub fn camera(&self) -> Camera {
        Camera { pose: self.mount.pose(), intrinsics: self.image.intrinsics(), model: self.detector }
    }

    fn check(&self) -> Result<()> {
        self.mount.check()?;
        self.detector.check()?;
        check_rate(self.rate_hz)?;
        self.image.check()
    }
}

fn check_rate(rate_hz: f64) -> Result<()> {
    ensure!(rate_hz > 0.0 && rate_hz <= 1000.0, "rate_hz is {rate_hz}, it must lie in 0 to 1000");
    Ok(())
}

impl Scene {
    /// Lets its radars miss so much in place of what it says, where that is given: those beside the first are like it.
    pub fn set_misses(&mut self, misses: Option<&Misses>) {
        if let Some(misses) = misses {
            self.radar.model.misses = misses.clone();
        }
    }

    /// Reads a scene file.
    ///
    /// # Errors
    /// File, line and key of what cannot be read; the element and figure of what cannot be.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read scene {}", path.display()))?;
        let mut scene: Self = toml::from_str(&text).with_context(|| format!("scene {}", path.display()))?;
        scene.folder = path.parent().unwrap_or(Path::new("")).to_owned();
        scene.check().with_context(|| format!("scene {}", path.display()))?;
        Ok(scene)
    }

    /// # Errors
    /// The element and figure of what cannot be.
    pub fn check(&self) -> Result<()> {
        ensure!(
            self.duration_s > 0.0 && self.duration_s <= 86_400.0,
            "duration_s is {}, it must be above 0 and at most 86400",
            self.duration_s
        );
        self.radar.check().with_context(|| format!("radar `{}`", self.radar.name))?;
        let ground = self.ground()?;
        ensure!(ground.is_level() || self.camera.is_none(), "ground: a camera sees flat roads only");
        for radar in &self.further_radars {
            radar.mount.check().with_context(|| format!("radar `{}`", radar.name))?;
        }
        let names: Vec<String> = self.radars().iter().map(|r| in_topics(&r.name)).collect();
        for (k, name) in names.iter().enumerate().skip(1) {
            ensure!(
                !name.is_empty() && !names[..k].contains(name),
                "radar `{}`: each needs a name of its own, of letters and digits",
                self.further_radars[k - 1].name
            );
        }
        if let Some(camera) = &self.camera {
            camera.check().with_context(|| format!("camera `{}`", camera.name))?;
        }
        for structure in &self.structures {
            structure.check()?;
            for (sensor, mount) in self.mounts() {
                let inside = structure.holds([mount.x_m, mount.y_m, mount.height_m]);
                ensure!(!inside, "{sensor}: it is inside of static `{}`", structure.id);
            }
        }
        let mut ids: Vec<&str> = self.structures.iter().map(|s| s.id.as_str()).collect();
        ids.sort_unstable();
        if let Some(twice) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            bail!("two elements of [[static]] have the id `{}`", twice[0]);
        }
        Ok(())
    }

    /// Heights of the road.
    ///
    /// # Errors
    /// What is no road.
    pub fn ground(&self) -> Result<Ground> {
        Ground::new(self.ground.clone())
    }

    /// Every radar, the first first.
    pub fn radars(&self) -> Vec<RadarSection> {
        let further = self.further_radars.iter().map(|radar| RadarSection {
            name: radar.name.clone(),
            mount: radar.mount,
            interference: Vec::new(),
            outage: Vec::new(),
            ..self.radar.clone()
        });
        std::iter::once(self.radar.clone()).chain(further).collect()
    }

    /// Every sensor with its mount.
    pub fn mounts(&self) -> Vec<(String, Mount)> {
        let radars = self.radars().into_iter().map(|r| (format!("radar `{}`", r.name), r.mount));
        let camera = self.camera.as_ref().map(|c| (format!("camera `{}`", c.name), c.mount));
        radars.chain(camera).collect()
    }

    /// Where each sensor looks, seen from above.
    pub fn looks(&self) -> Vec<Look> {
        let radars = self.radars().into_iter().map(|r| Look::new(&r.mount, r.field_of_view.azimuth_deg));
        let camera = self.camera.as_ref().map(|c| {
            let view = c.image.intrinsics().field_of_view(0.0);
            Look::new(&c.mount, view.azimuth_rad.map(f64::to_degrees))
        });
        radars.chain(camera).collect()
    }

    /// The traffic file, `--fcd` first.
    ///
    /// # Errors
    /// None is named.
    pub fn source(&self, fcd: Option<&Path>) -> Result<Source> {
        let section = self.traffic.as_ref();
        let in_folder = |path: &PathBuf| self.folder.join(path);
        let path = match (fcd, section.and_then(|t| t.fcd.as_ref())) {
            (Some(path), _) => path.to_owned(),
            (None, Some(path)) => in_folder(path),
            (None, None) => {
                bail!("scene `{}` names no traffic: give --fcd FILE, or [traffic] fcd in the scene", self.name)
            }
        };
        let Some(section) = section else { return Ok(Source { path, ..Source::default() }) };
        Ok(Source {
            path,
            types: section.types.iter().map(in_folder).collect(),
            net: section.net.as_ref().map(in_folder),
            frame: RoadFrame {
                origin: section.origin,
                heading_rad: section.heading_deg.to_radians(),
                net_offset: [0.0; 2],
            },
        })
    }

    /// Lanes of the net of its traffic, as far as the radar reaches.
    ///
    /// # Errors
    /// No net is named, or what is wrong with it.
    pub fn lanes(&self) -> Result<Vec<Lane>> {
        let source = self.source(None)?;
        let net = source.net.with_context(|| format!("scene `{}` names no net: [traffic] net", self.name))?;
        let Mount { x_m, y_m, .. } = self.radar.mount;
        let reach = Reach { from: [x_m, y_m], reach_m: self.radar.field_of_view.range_m[1] + Lane::BEYOND_RANGE_M };
        net::lanes(&net, &source.frame, &reach)
    }

    /// Every file the scene reads beside its own.
    ///
    /// # Errors
    /// No traffic is named.
    pub fn files(&self, fcd: Option<&Path>) -> Result<Vec<PathBuf>> {
        let Source { path, types, net, .. } = self.source(fcd)?;
        Ok([path].into_iter().chain(types).chain(net).collect())
    }

    /// The traffic file's time at the first frame.
    pub fn from_s(&self) -> f64 {
        self.traffic.as_ref().map_or(0.0, |t| t.from_s)
    }

    pub fn start_ns(&self) -> i64 {
        i64::from(self.start_unix_s) * 1_000_000_000
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: &str = r#"
name = "t"
duration_s = 10.0
[radar]
name = "r"
mount = { height_m = 6.0 }
field_of_view = { azimuth_deg = [-60.0, 60.0], elevation_deg = [-16.0, 16.0], range_m = [3.0, 200.0] }
rate_hz = 15.0
"#;

    fn parse(text: &str) -> Result<Scene> {
        let scene: Scene = toml::from_str(text)?;
        scene.check()?;
        Ok(scene)
    }

    #[test]
    fn little_is_needed_and_angles_are_degrees() {
        let scene = parse(LEAST).unwrap();
        assert_eq!((scene.seed, scene.radar.has_elevation), (1, true));
        assert!((scene.radar.radar().field_of_view.azimuth_rad[1] - 60_f64.to_radians()).abs() < 1e-12);
        assert_eq!(scene.radar.model, RadarModel::default());
        assert!(scene.source(None).unwrap_err().to_string().contains("--fcd"));
        assert_eq!(scene.source(Some(Path::new("x.xml"))).unwrap().path, Path::new("x.xml"));
    }

    #[test]
    fn paths_start_from_the_scenes_folder() {
        let mut scene = parse(&format!("{LEAST}\n[traffic]\nfcd = \"a/b.xml\"\ntypes = [\"t.xml\"]\n")).unwrap();
        scene.folder = "some".into();
        let source = scene.source(None).unwrap();
        assert_eq!(
            (source.path.as_path(), source.types[0].as_path()),
            (Path::new("some/a/b.xml"), Path::new("some/t.xml"))
        );
    }

    #[test]
    fn what_cannot_be_is_named_by_element_and_line() {
        let error = |from: &str, to: &str| format!("{:#}", parse(&LEAST.replace(from, to)).unwrap_err());
        assert!(error("height_m = 6.0", "height_m = -1.0").contains("mount.height_m is -1"));
        assert!(error("[-60.0, 60.0]", "[60.0, -60.0]").contains("azimuth_deg from 60 to -60"));
        assert!(error("rate_hz = 15.0", "rate_hz = 0.0").contains("rate_hz is 0"));
        assert!(error("duration_s = 10.0", "duration_s = nan").contains("duration_s is NaN"));
        let unknown = error("rate_hz = 15.0", "rate_hz = 15.0\nratte = 1");
        assert!(unknown.contains("line 9") && unknown.contains("ratte"), "{unknown}");
        let twice =
            error("rate_hz = 15.0", "rate_hz = 15.0\n[[further_radar]]\nname = \"R!\"\nmount = { height_m = 5.0 }");
        assert!(twice.contains("radar `R!`: each needs a name of its own"), "{twice}");
        let model = error("rate_hz = 15.0", "rate_hz = 15.0\n[radar.model.resolution]\nrange_m = 0.0");
        assert!(model.contains("radar `r`") || model.contains("model.resolution.range_m is 0"), "{model}");
    }
}
