//! Instructions of decoding one scan of 120 detections, counted by callgrind:
//! `cargo bench -p viewshed-harness --bench inputs`.

use std::hint::black_box;
use std::process::{Command, ExitCode};

use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::ars408::message::Message;
use viewshed::inputs::{ars408, native, ti};
use viewshed::wire::frame::CanFrame;

const INPUTS: [&str; 5] = ["ars408", "native-can-fd", "native-serial", "native-sender", "ti"];
const DETECTIONS: u16 = 120;
const NOW: Time = Time::from_micros(1_000_000);

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().collect();
    if let Some([_, input]) = args.iter().position(|a| a == "--work").and_then(|i| args.get(i..i + 2)) {
        work(input);
        return ExitCode::SUCCESS;
    }
    if Command::new("valgrind").arg("--version").output().is_err() {
        eprintln!("valgrind is not installed; on Debian and Ubuntu: apt-get install valgrind");
        return ExitCode::FAILURE;
    }
    println!("{:<16} {:>8} {:>14}", "input", "bytes", "instructions");
    for input in INPUTS {
        let (bytes, count) = measure(input);
        println!("{input:<16} {bytes:>8} {count:>14}");
    }
    ExitCode::SUCCESS
}

/// Bytes of a scan and instructions of decoding it.
fn measure(input: &str) -> (String, u64) {
    let out = std::env::temp_dir().join(format!("viewshed-inputs-{}", std::process::id()));
    let me = std::env::current_exe().expect("the path of this program");
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--toggle-collect=inputs::measured_*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(me)
        .args(["--work", input])
        .output()
        .expect("valgrind");
    assert!(output.status.success(), "valgrind failed on {input}");
    let text = std::fs::read_to_string(&out).expect("callgrind's file");
    let _ = std::fs::remove_file(&out);
    let total = text.lines().rev().find_map(|line| line.strip_prefix("totals: ")).expect("a total");
    (String::from_utf8_lossy(&output.stdout).trim().to_owned(), total.trim().parse().expect("a number"))
}

fn detections() -> Vec<Detection> {
    let one = |i: u16| Detection {
        range_cm: 1000 + 100 * i,
        azimuth: Angle::from_raw(50 * i as i16),
        elevation: Some(Angle::ZERO),
        radial_velocity_cm_s: -500,
        rcs_half_dbsm: Some(3),
        snr_half_db: Some(40),
        marked: false,
    };
    (0..DETECTIONS).map(one).collect()
}

/// Decodes one scan; this is what runs under callgrind.
fn work(input: &str) {
    let detections = detections();
    let mut sender = native::NativeSender::new(1);
    let (bytes, found) = match input {
        "ars408" => {
            let frames = clusters();
            let mut radar = ars408::Ars408::new(ars408::Ars408Config::sensor(0));
            (frames.iter().map(|f| f.data().len()).sum(), measured_ars408(&mut radar, &frames))
        }
        "native-can-fd" => {
            let messages = sender.scan(NOW, false, &detections, native::NativeMedium::CanFd);
            let frames: Vec<CanFrame> = messages.filter_map(|m| m.frame(native::id(1))).collect();
            let mut receiver = native::NativeReceiver::new(native::NativeConfig::sensor(1));
            (frames.iter().map(|f| f.data().len()).sum(), measured_can_fd(&mut receiver, &frames))
        }
        "native-serial" => {
            let mut line = Vec::new();
            for message in sender.scan(NOW, false, &detections, native::NativeMedium::Serial) {
                let mut stuffed = [0; 300];
                let n = message.stuff(&mut stuffed).expect("room");
                line.extend(&stuffed[..n]);
            }
            (
                line.len(),
                measured_serial(&mut native::NativeSerialReceiver::new(native::NativeConfig::sensor(1)), &line),
            )
        }
        "native-sender" => (measured_sender(&mut sender, &detections), usize::from(DETECTIONS)),
        _ => {
            let frame = ti_frame();
            let config = ti::TiConfig { family: Some(ti::TiFamily::Bytes40), ..ti::TiConfig::LEARN };
            (frame.len(), measured_ti(&mut ti::Ti::new(config), &frame))
        }
    };
    assert_eq!(found, usize::from(DETECTIONS), "{input}");
    println!("{bytes}");
}

/// A scan of clusters with quality: 241 frames.
fn clusters() -> Vec<CanFrame> {
    let frame = |message: Message, bytes: &[u8]| CanFrame::classic(message.id(0), bytes).expect("8 bytes");
    let numbers = 0..DETECTIONS as u8;
    let general = numbers.clone().map(|n| frame(Message::ClusterGeneral, &[n, 0x55, 0xF1, 0xCD, 0x6C, 0x20, 2, 0x94]));
    let quality = numbers.map(|n| frame(Message::ClusterQuality, &[n, 0, 0, 1, 3]));
    let half = DETECTIONS as u8 / 2;
    [frame(Message::ClusterStatus, &[half, half, 0, 2, 0x10])].into_iter().chain(general).chain(quality).collect()
}

/// Points and side info of SDK 3.
fn ti_frame() -> Vec<u8> {
    let n = u32::from(DETECTIONS);
    let words = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let points = (0..n).flat_map(|i| [1.0, 20.0 + i as f32, -1.0, -5.0]).flat_map(f32::to_le_bytes);
    let items: Vec<u8> =
        [words(&[1, 16 * n]), points.collect(), words(&[7, 4 * n]), [200, 0, 0, 0].repeat(n as usize)].concat();
    let total = (40 + items.len()).next_multiple_of(32);
    let mut bytes = vec![2, 1, 4, 3, 6, 5, 8, 7];
    bytes.extend(words(&[0x0305_0004, total as u32, 0, 1, 0, n, 2, 0]));
    bytes.extend(items);
    bytes.resize(total, 0);
    bytes
}

#[inline(never)]
fn measured_ars408(radar: &mut ars408::Ars408<256>, frames: &[CanFrame]) -> usize {
    let mut found = 0;
    for frame in frames {
        if let ars408::Ars408Outcome::Scan(scan) = radar.push(black_box(frame), NOW) {
            found += scan.detections.len();
        }
    }
    // whether quality follows is learnt from the first of it
    assert!(found > 0);
    found
}

#[inline(never)]
fn measured_can_fd(receiver: &mut native::NativeReceiver<256>, frames: &[CanFrame]) -> usize {
    let mut found = 0;
    for frame in frames {
        if let native::NativeOutcome::Scan(scan) = receiver.push_frame(black_box(frame), NOW) {
            found += scan.detections.len();
        }
    }
    found
}

#[inline(never)]
fn measured_serial(receiver: &mut native::NativeSerialReceiver<256>, mut bytes: &[u8]) -> usize {
    let mut found = 0;
    while !bytes.is_empty() {
        let (taken, outcome) = receiver.push(black_box(bytes), NOW);
        bytes = &bytes[taken..];
        if let native::NativeOutcome::Scan(scan) = outcome {
            found += scan.detections.len();
        }
    }
    found
}

#[inline(never)]
fn measured_sender(sender: &mut native::NativeSender, detections: &[Detection]) -> usize {
    sender
        .scan(NOW, false, black_box(detections), native::NativeMedium::Serial)
        .map(|m| black_box(m).bytes().len())
        .sum()
}

#[inline(never)]
fn measured_ti(radar: &mut ti::Ti<256>, mut bytes: &[u8]) -> usize {
    let mut found = 0;
    while !bytes.is_empty() {
        let (taken, outcome) = radar.push(black_box(bytes), NOW);
        bytes = &bytes[taken..];
        if let ti::TiOutcome::Scan(scan) = outcome {
            found += scan.detections.len();
        }
    }
    found
}
