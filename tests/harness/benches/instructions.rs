//! Instructions a frame, counted by callgrind: `cargo bench -p viewshed-harness`.
//!
//! Counts everything from the gate to the map, for the shipped recording, for a crossing and a queue of the twin, and for
//! four adversarial scans of 256 detections; and sending and receiving the maps, from map to packets and back. Names
//! behind `--` measure only those, `--recording PATH` takes another recording. Counts repeat exactly and do not
//! depend on the machine's speed.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use viewshed::camera::boxes::ImageBox;
use viewshed::camera::map::{AZIMUTHS, CameraMap};
use viewshed::camera::{Camera3dConfig, Camera3dParameters, CameraProfile, MOST_BOXES};
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::fusion::{
    Alignment, AlignmentConfig, Fixtures, FixturesConfig, Fusion, FusionConfig, Monitor, MonitorConfig,
};
use viewshed::map::VisibilityMap;
use viewshed::map::polar::PolarMap;
use viewshed::radar_2d::{Radar2d, Radar2dConfig, Radar2dParameters};
use viewshed::radar_3d::{Radar3d, Radar3dConfig, Radar3dParameters};
use viewshed::sensor::Sensor;
use viewshed::sensor::noise::NoiseConfig;
use viewshed::sensor::road::RoadPoint;
use viewshed::unit::profile::{reference, small};
use viewshed::wire::broadcast::{BroadcastConfig, Medium};
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::header::Header;
use viewshed::wire::message::{Addresses, Epoch, Packet, Plane};
use viewshed::wire::planes::Planes;
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed_harness::boards::stress;
use viewshed_harness::estimators::{self, FarRoad, camera_3d};
use viewshed_harness::recording::Recording;
use viewshed_harness::recording::read;
use viewshed_harness::studies::experiment::scenes;
use viewshed_harness::twin::simulate::Simulation;

/// `radar-3d-narrow` has azimuths that are narrower along the road; `radar-3d-blurred` has the largest range noise that may
/// be set: evidence spreads widest.
const ESTIMATORS: [&str; 5] = ["radar-3d", "radar-3d-narrow", "radar-3d-small", "radar-3d-blurred", "radar-2d"];
const SCENES: [&str; 7] = ["recording", CROSSING, QUEUE, "one-ray", "all-rays", "everywhere", "crowd"];

/// Instructions that a frame of radar-3d may take on the reference grid: in the mean of what is driven, and in the worst frame of all.
const RADAR_3D_BUDGET: u64 = 1_500_000;
const RADAR_3D_WORST: u64 = 2_600_000;
/// Those of the small grid, in the mean of what is driven.
const SMALL_BUDGET: u64 = 700_000;

/// Training scenes of the twin, the first of each plan.
const CROSSING: &str = "crossing";
const QUEUE: &str = "queue";

/// The camera: the recording's boxes, and as many as a frame may have.
const CAMERA: [(&str, &str); 2] = [("camera-3d", SCENES[0]), ("camera-3d", CROWDED)];
const CROWDED: &str = "crowded";

/// Two of the recording's maps onto 200 m by 32 m of road, cells of one metre.
const FUSION: &str = "fusion";

/// Instructions that fusing two maps may take: every cell of the road is the worst of all polar cells it touches.
const FUSION_BUDGET: u64 = 4_500_000;

/// Two sensors watched by each other's obstacles, and what stands in the view of one: monitors, alignment and fixtures
/// together.
const MONITOR: &str = "monitor";

/// What is measured on the recording's maps only, or their sending and receiving; `narrow` those of `radar-3d-narrow`.
const WIRE: [&str; 8] = [
    "send-can",
    "receive-can",
    "send-can-narrow",
    "receive-can-narrow",
    "send-fd",
    "receive-fd",
    "send-long",
    "receive-long",
];

type Road = Fusion<2, 200, 32>;

/// Instructions a scan that sending and receiving may take, median, on every bus.
const WIRE_BUDGET: u64 = 160_000;
/// The same of azimuths of which some are narrow: of a road that is drawn finer there is more to say.
const NARROW_WIRE_BUDGET: u64 = 180_000;

/// The function whose instructions are counted, as callgrind names it.
fn measured(estimator: &str) -> &'static str {
    match estimator {
        "radar-2d" => "instructions::measured_frame_2d",
        "camera-3d" => "instructions::measured_frame_camera",
        FUSION => "instructions::measured_fusion",
        MONITOR => "instructions::measured_monitor",
        name if name.starts_with("send-") => "instructions::measured_send",
        name if name.starts_with("receive-") => "instructions::measured_receive",
        _ => "instructions::measured_frame_3d",
    }
}

fn main() -> ExitCode {
    let mut args: Vec<String> = std::env::args().collect();
    if let Some([_, estimator, scene, recording]) =
        args.iter().position(|a| a == "--work").and_then(|i| args.get(i..i + 4))
    {
        work(estimator, scene, Path::new(recording));
        return ExitCode::SUCCESS;
    }
    let recording = args.iter().position(|a| a == "--recording").map(|i| args.drain(i..(i + 2).min(args.len())));
    let recording = recording.and_then(|mut option| option.nth(1));
    let recording =
        recording.unwrap_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap").into());
    if Command::new("valgrind").arg("--version").output().is_err() {
        eprintln!("valgrind is not installed; on Debian and Ubuntu: apt-get install valgrind");
        return ExitCode::FAILURE;
    }
    println!("{:<16} {:<12} {:>9} {:>12} {:>12} {:>12}", "estimator", "scene", "frames", "mean", "median", "worst");
    let estimators = ESTIMATORS.iter().flat_map(|e| SCENES.map(|scene| (*e, scene)));
    let asked: Vec<&String> = args.iter().skip(1).filter(|a| !a.starts_with("--")).collect();
    let scenes = asked.is_empty() || asked.iter().any(|a| a.starts_with("radar"));
    let simulated = if scenes { [CROSSING, QUEUE].map(|scene| (scene, simulated(scene))).to_vec() } else { vec![] };
    let several = [FUSION, MONITOR].into_iter().chain(WIRE).map(|estimator| (estimator, SCENES[0]));
    let mut code = ExitCode::SUCCESS;
    for (estimator, scene) in estimators.chain(CAMERA).chain(several) {
        if !asked.is_empty() && !asked.iter().any(|a| *a == estimator) {
            continue;
        }
        let of_scene = simulated.iter().find(|(name, _)| *name == scene).map(|(_, file)| file.display().to_string());
        let counts = measure(estimator, scene, of_scene.as_ref().unwrap_or(&recording));
        let Some(worst) = counts.last() else {
            eprintln!("callgrind counted nothing for {estimator} on {scene}");
            return ExitCode::FAILURE;
        };
        let mean = counts.iter().sum::<u64>() / counts.len() as u64;
        let median = counts[counts.len() / 2];
        println!("{estimator:<16} {scene:<12} {:>9} {mean:>12} {median:>12} {worst:>12}", counts.len());
        if let Some(excess) = excess(estimator, scene, [mean, median, *worst]) {
            eprintln!("{excess}");
            code = ExitCode::FAILURE;
        }
    }
    simulated.iter().for_each(|(_, file)| _ = std::fs::remove_file(file));
    code
}

/// What is more than it may be.
fn excess(estimator: &str, scene: &str, [mean, median, worst]: [u64; 3]) -> Option<String> {
    let wire = if estimator.ends_with("narrow") { NARROW_WIRE_BUDGET } else { WIRE_BUDGET };
    let is_driven = [SCENES[0], CROSSING, QUEUE].contains(&scene);
    let (what, takes, most) = match estimator {
        "radar-3d" if worst > RADAR_3D_WORST => ("in the worst frame", worst, RADAR_3D_WORST),
        "radar-3d" if is_driven => ("in the mean", mean, RADAR_3D_BUDGET),
        "radar-3d-small" if is_driven => ("in the mean", mean, SMALL_BUDGET),
        FUSION => ("for two maps", median, FUSION_BUDGET),
        _ if WIRE.contains(&estimator) => ("a scan", median, wire),
        _ => return None,
    };
    (takes > most).then(|| format!("{estimator} takes {takes} instructions {what} of {scene}, more than {most}"))
}

/// The recording of a training scene, in a file of its own.
fn simulated(name: &str) -> PathBuf {
    let plan = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings")).join(name).join("scenes.toml");
    let plan = scenes::Plan::read(&plan).expect("the plan");
    let scene = plan.scenes(&plan.training).expect("its scenes").swap_remove(0);
    let file = std::env::temp_dir().join(format!("viewshed-bench-{}-{name}.mcap", std::process::id()));
    let sink = std::fs::File::create(&file).expect("a file for a recording");
    Simulation::new(scene, None).and_then(|twin| twin.record(sink, &|| ())).expect("a simulation");
    file
}

/// Instructions of every frame, ascending.
fn measure(estimator: &str, scene: &str, recording: &str) -> Vec<u64> {
    let folder = std::env::temp_dir().join(format!("viewshed-bench-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder for callgrind's files");
    let me = std::env::current_exe().expect("the path of this program");
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--collect-atstart=no"])
        .arg(format!("--toggle-collect={}", measured(estimator)))
        .arg(format!("--dump-after={}", measured(estimator)))
        .arg(format!("--callgrind-out-file={}", folder.join("out").display()))
        .arg(me)
        .args(["--work", estimator, scene, recording])
        .stderr(std::process::Stdio::null())
        .status();
    assert!(status.is_ok_and(|s| s.success()), "valgrind failed on {estimator} {scene}");
    let mut counts: Vec<u64> = std::fs::read_dir(&folder)
        .expect("callgrind's files")
        .filter_map(|entry| totals(&entry.ok()?.path()))
        .filter(|n| *n > 0)
        .collect();
    let _ = std::fs::remove_dir_all(&folder);
    counts.sort_unstable();
    counts
}

fn totals(path: &Path) -> Option<u64> {
    let text = std::fs::read_to_string(path).ok()?;
    text.lines().rev().find_map(|line| line.strip_prefix("totals: "))?.trim().parse().ok()
}

/// Runs an estimator over a scene; this is what runs under callgrind.
fn work(estimator: &str, scene: &str, recording: &Path) {
    let recording = read(recording, &Default::default()).expect("the recording");
    if estimator == "camera-3d" {
        return run_camera(&recording, scene == CROWDED);
    }
    let sensor = estimators::sensor(&recording, &Default::default());
    let frames: Vec<(Time, Vec<Detection>)> = if [SCENES[0], CROSSING, QUEUE].contains(&scene) {
        let time = |ns: i64| Time::from_micros(u64::try_from(ns / 1000).unwrap_or(0));
        recording
            .frames
            .iter()
            .map(|f| (time(f.time_ns), f.detections.iter().filter_map(detection).collect()))
            .collect()
    } else {
        stress::scans(scene).into_iter().map(|s| (s.time, s.detections)).collect()
    };
    let (even, mut narrow) = (Radar3dConfig::default(), Radar3dConfig::default());
    narrow.visibility.far_road_deg = Some(FarRoad::AlongRoad.degrees(&sensor));
    match estimator {
        "radar-3d-blurred" => {
            let noise = NoiseConfig { range_m: 5.0, ..sensor.noise };
            of_reference(&Sensor { noise, ..sensor }, &even, &frames);
        }
        "radar-3d" => of_reference(&sensor, &even, &frames),
        "radar-3d-narrow" => of_reference(&sensor, &narrow, &frames),
        "send-can" | "receive-can" => run_wire(&sensor, &even, &frames, Medium::Can(Addresses::STANDARD)),
        "send-can-narrow" | "receive-can-narrow" => {
            run_wire(&sensor, &narrow, &frames, Medium::Can(Addresses::STANDARD));
        }
        "send-fd" | "receive-fd" => run_wire(&sensor, &even, &frames, Medium::CanFd(Addresses::STANDARD)),
        "send-long" | "receive-long" => run_wire(&sensor, &even, &frames, Medium::Serial),
        FUSION => run_fusion(&sensor, &frames),
        MONITOR => run_monitor(&sensor, &frames),
        "radar-3d-small" => of_small(&sensor, &even, &frames),
        _ => run_2d(&sensor, &frames),
    }
}

fn detection(d: &viewshed_harness::recording::RadarDetection) -> Option<Detection> {
    Detection::new(&estimators::measurement(d)).ok()
}

fn of_reference(sensor: &Sensor, config: &Radar3dConfig, frames: &[(Time, Vec<Detection>)]) {
    run_3d::<
        { reference::State::RANGES },
        { reference::State::AZIMUTHS },
        { reference::State::ELEVATIONS },
        { reference::State::WORDS },
        { reference::State::OBSTACLES },
        { reference::State::DETECTIONS },
    >(sensor, config, frames);
}

fn of_small(sensor: &Sensor, config: &Radar3dConfig, frames: &[(Time, Vec<Detection>)]) {
    run_3d::<
        { small::State::RANGES },
        { small::State::AZIMUTHS },
        { small::State::ELEVATIONS },
        { small::State::WORDS },
        { small::State::OBSTACLES },
        { small::State::DETECTIONS },
    >(sensor, config, frames);
}

fn run_3d<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    sensor: &Sensor,
    config: &Radar3dConfig,
    frames: &[(Time, Vec<Detection>)],
) {
    let parameters = Radar3dParameters::<R, A, E>::new(sensor, config).expect("defaults are valid");
    let mut state = Box::new(Radar3d::<R, A, E, W, N, D>::new());
    let mut map = Box::new(parameters.map());
    for (now, detections) in frames {
        measured_frame_3d(&mut state, &parameters, *now, detections, &mut map);
    }
    black_box(&map);
}

#[inline(never)]
fn measured_frame_3d<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Radar3d<R, A, E, W, N, D>,
    parameters: &Radar3dParameters<R, A, E>,
    now: Time,
    detections: &[Detection],
    map: &mut PolarMap<R, A>,
) {
    black_box(state.process(parameters, now, detections, false, map));
}

/// Radar-3d's map as that of two sensors, a scan at a time.
fn run_fusion(sensor: &Sensor, frames: &[(Time, Vec<Detection>)]) {
    let parameters = reference::Parameters::new(sensor, &Radar3dConfig::default()).expect("defaults are valid");
    let mut state = Box::new(reference::State::new());
    let mut map = Box::new(parameters.map());
    let mut road = Box::new(Road::NOWHERE);
    road.set(RoadPoint::new(0, -1600), 100, FusionConfig::default()).expect("defaults are valid");
    for (now, detections) in frames {
        state.process(&parameters, *now, detections, false, &mut map);
        measured_fusion(&mut road, *now, &map);
    }
    black_box(&road);
}

#[inline(never)]
fn measured_fusion(road: &mut Road, now: Time, map: &reference::Map) {
    for sensor in 0..2 {
        let _ = black_box(road.offer_polar(sensor, now, now, map));
    }
}

/// What watches two sensors that hang at the same place.
struct Watch {
    monitors: [Monitor<6>; 2],
    alignment: Alignment<2>,
    fixtures: Fixtures<64, 6>,
}

/// Radar-3d's obstacles as those of two sensors, a scan at a time.
fn run_monitor(sensor: &Sensor, frames: &[(Time, Vec<Detection>)]) {
    let parameters = reference::Parameters::new(sensor, &Radar3dConfig::default()).expect("defaults are valid");
    let mut state = Box::new(reference::State::new());
    let mut map = Box::new(parameters.map());
    let levelling = sensor.mount.levelling().expect("the recording's mount");
    let view = [sensor.field_of_view.azimuth_min_deg, sensor.field_of_view.azimuth_max_deg];
    let monitor = || Monitor::new(&sensor.mount, view, &MonitorConfig::default()).expect("defaults are valid");
    let config = FixturesConfig { learned_windows: 20, ..FixturesConfig::default() };
    let mut watch = Watch {
        monitors: [monitor(), monitor()],
        alignment: Alignment::new(&[Some(sensor.mount); 2], &AlignmentConfig::default()).expect("defaults are valid"),
        fixtures: Fixtures::new(&sensor.mount, view, &config).expect("defaults are valid"),
    };
    for (now, detections) in frames {
        state.process(&parameters, *now, detections, false, &mut map);
        let solids = state.obstacles().solids(parameters.tracking());
        let places: Vec<RoadPoint> = solids.map(|s| levelling.unplace(s.x_cm, s.y_cm)).collect();
        measured_monitor(&mut watch, *now, &places, detections, &map);
    }
    let [one, _] = &watch.monitors;
    black_box((one.is_blind(0), watch.fixtures.learned()));
}

#[inline(never)]
fn measured_monitor(
    watch: &mut Watch,
    now: Time,
    places: &[RoadPoint],
    detections: &[Detection],
    map: &reference::Map,
) {
    for place in places {
        for monitor in &mut watch.monitors {
            black_box(monitor.observe(now, *place, map.at(*place), true));
        }
        watch.alignment.observe(0, *place, 1, *place);
    }
    detections.iter().for_each(|detection| watch.fixtures.observe(detection));
    watch.monitors.iter_mut().for_each(|monitor| monitor.advance(now));
    watch.alignment.advance(now);
    watch.fixtures.advance(now, |place| map.at(place).visible());
}

type OneReceiver = Receiver<1, { reference::State::AZIMUTHS }, { reference::State::WORDS }>;

/// Radar-3d's maps from a sender to a receiver, a scan at a time.
fn run_wire(sensor: &Sensor, config: &Radar3dConfig, frames: &[(Time, Vec<Detection>)], medium: Medium) {
    let parameters = reference::Parameters::new(sensor, config).expect("defaults are valid");
    let mut state = Box::new(reference::State::new());
    let mut map = Box::new(parameters.map());
    let config = BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(0, medium) };
    let view = parameters.axes().view(60);
    let usual = Known::new(view.start, view.end);
    let header = Header::new::<{ reference::State::RANGES }, { reference::State::AZIMUTHS }>(
        &sensor.mount,
        map.geometry(),
        usual,
        1,
        0,
    )
    .expect("sendable");
    let begin = frames.first().map_or(Time::from_micros(0), |f| f.0);
    let mut sender =
        Box::new(reference::Sender::new(config, header, Epoch::new(1), begin).expect("defaults are valid"));
    let mut receiver = Box::new(OneReceiver::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT));
    for (now, detections) in frames {
        state.process(&parameters, *now, detections, false, &mut map);
        let mut packets = Vec::with_capacity(1000);
        measured_send(&mut sender, *now, &map, &mut packets);
        measured_receive(&mut receiver, *now, &packets, medium);
    }
    black_box(&receiver);
}

#[inline(never)]
fn measured_send(sender: &mut reference::Sender, now: Time, map: &reference::Map, packets: &mut Vec<Packet>) {
    let _ = black_box(sender.scan(now, map));
    while let Some(packet) = sender.next_packet(now) {
        packets.push(packet);
    }
}

#[inline(never)]
fn measured_receive(receiver: &mut OneReceiver, now: Time, packets: &[Packet], medium: Medium) {
    for packet in packets {
        let _ = black_box(match medium {
            Medium::Serial => receiver.message(now, packet.bytes()),
            Medium::Can(addresses) | Medium::CanFd(addresses) => {
                receiver.frame(now, &packet.frame(&addresses).expect("an identifier"))
            }
        });
    }
}

/// Boxes to a map, and that to rays for the wire; crowded, with the boxes of some frames together.
fn run_camera(recording: &Recording, crowded: bool) {
    let camera = recording.camera.as_ref().expect("a camera in the recording");
    let calibration = camera_3d::calibration(camera);
    let parameters = Camera3dParameters::<200, 60>::new(&calibration, &Camera3dConfig::default()).expect("valid");
    let mut state = Box::new(CameraProfile::new());
    let mut map = Box::new(parameters.map());
    let frames: Vec<(i64, Vec<ImageBox>)> =
        camera.frames.iter().map(|f| (f.time_ns, camera_3d::vehicles(f).0)).collect();
    for (k, (time_ns, boxes)) in frames.iter().enumerate() {
        let now = Time::from_micros(u64::try_from(time_ns / 1000).unwrap_or(0));
        if crowded {
            let all: Vec<ImageBox> =
                frames[k..].iter().flat_map(|f| &f.1).chain(boxes).copied().take(MOST_BOXES).collect();
            measured_frame_camera(&mut state, &parameters, now, &all, &mut map);
        } else {
            measured_frame_camera(&mut state, &parameters, now, boxes, &mut map);
        }
    }
    black_box(&map);
}

#[inline(never)]
fn measured_frame_camera(
    state: &mut CameraProfile,
    parameters: &Camera3dParameters<200, 60>,
    now: Time,
    boxes: &[ImageBox],
    map: &mut CameraMap<200, 60>,
) {
    black_box(state.process(parameters, now, boxes, false, map));
    // every ray as it goes to the sender
    for azimuth in 0..AZIMUTHS {
        let ray: Ray<7> = map.ray(Plane::Visibility, azimuth);
        black_box(&ray);
    }
}

fn run_2d(sensor: &Sensor, frames: &[(Time, Vec<Detection>)]) {
    let parameters =
        Radar2dParameters::new::<208, 45, 320>(sensor, &Radar2dConfig::default()).expect("defaults are valid");
    let mut state = Box::new(Radar2d::<208, 45, 320, 256>::new());
    for (now, detections) in frames {
        measured_frame_2d(&mut state, &parameters, *now, detections);
    }
    black_box(&state);
}

#[inline(never)]
fn measured_frame_2d(
    state: &mut Radar2d<208, 45, 320, 256>,
    parameters: &Radar2dParameters,
    now: Time,
    detections: &[Detection],
) {
    black_box(state.process(parameters, now, detections, false));
}
