//! A receiver in C, written from the specification alone, makes the same maps of the same log.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::shadows::{A, Map, Random, Shadows, W, header};
use crate::skipped::skipped;
use viewshed::fixed::time::Time;
use viewshed::map::Visibility;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Epoch, Packet};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer, stuff};

/// What a bus does to frames, shares of them.
#[derive(Debug, Clone, Copy)]
struct Faults {
    lost: f64,
    late: f64,
    repeated: f64,
    flipped: f64,
    restarts: f64,
}

const NONE: Faults = Faults { lost: 0.0, late: 0.0, repeated: 0.0, flipped: 0.0, restarts: 0.0 };
const ALL: Faults = Faults { lost: 0.05, late: 0.02, repeated: 0.03, flipped: 0.02, restarts: 0.005 };

/// What travels: a frame, or bytes of a serial line.
#[derive(Debug, Clone)]
enum Sent {
    Frame(CanFrame),
    Bytes(Vec<u8>),
}

impl Sent {
    /// With a bit turned over.
    fn flipped(&self, bit: u64) -> Self {
        let flip = |data: &[u8]| {
            let (mut data, bit) = (data.to_vec(), (bit % (8 * data.len() as u64)) as usize);
            data[bit / 8] ^= 1 << (bit % 8);
            data
        };
        match self {
            Self::Bytes(bytes) => Self::Bytes(flip(bytes)),
            Self::Frame(frame) if frame.fd => Self::Frame(CanFrame::fd(frame.id, &flip(frame.data())).unwrap()),
            Self::Frame(frame) => Self::Frame(CanFrame::classic(frame.id, &flip(frame.data())).unwrap()),
        }
    }
}

/// A sender, with a key or without.
struct Sender {
    medium: Medium,
    broadcaster: Broadcaster<A, W>,
    #[cfg(feature = "secoc")]
    sealer: Option<viewshed::wire::secoc::Sealer<[u8; 16]>>,
}

impl Sender {
    fn new(sensor: u8, medium: Medium, key: Option<[u8; 16]>, epoch: Epoch, us: u64) -> Self {
        let secured = key.is_some();
        let config = BroadcastConfig { visible_range_ms: Some(500), secured, ..BroadcastConfig::new(sensor, medium) };
        Self {
            medium,
            broadcaster: Broadcaster::new(config, header(3), epoch, Time::from_micros(us)).unwrap(),
            // above every value of an earlier start
            #[cfg(feature = "secoc")]
            sealer: key.map(|key| viewshed::wire::secoc::Sealer::new(key, us)),
        }
    }

    fn packet(&mut self, now: Time) -> Option<Packet> {
        #[cfg(feature = "secoc")]
        if let Some(sealer) = &mut self.sealer {
            return self.broadcaster.next_sealed(now, sealer);
        }
        self.broadcaster.next_packet(now)
    }

    fn next(&mut self, now: Time) -> Option<Sent> {
        let packet = self.packet(now)?;
        let (Medium::Can(addresses) | Medium::CanFd(addresses)) = self.medium else {
            let mut line = [0; MOST_STUFFED];
            let n = stuff(packet.bytes(), &mut line).unwrap();
            return Some(Sent::Bytes(line[..n].to_vec()));
        };
        Some(Sent::Frame(packet.frame(&addresses).unwrap()))
    }
}

/// A sensor, what it sends on, and its key.
type Sensor = (u8, Medium, Option<[u8; 16]>);

const CLASSIC: Sensor = (1, Medium::Can(Addresses::STANDARD), None);
const FD: Sensor = (6, Medium::CanFd(Addresses::STANDARD), None);
const SERIAL: Sensor = (3, Medium::Serial, None);

/// What some sensors send, with the times it arrives.
fn traffic(sensors: &[Sensor], scans: u64, faults: Faults, seed: u64) -> Vec<(u64, Sent)> {
    let mut random = Random::new(seed);
    let mut all = Vec::new();
    for &(sensor, medium, key) in sensors {
        let start = |epoch, us| Sender::new(sensor, medium, key, epoch, us);
        let mut sender = start(Epoch::new(sensor), 50_000_000);
        let mut shadows = Shadows::new(seed + u64::from(sensor));
        let mut map = Map(Vec::new());
        for ms in 0..67 * scans {
            let us = 1_000_000_000 + 1000 * ms + u64::from(sensor);
            let clock = Time::from_micros(50_000_000 + 1000 * ms);
            if ms % 67 == 0 {
                if random.chance(faults.restarts) {
                    sender = start(sender.broadcaster.epoch().next(), clock.micros());
                }
                map = shadows.next();
                let _ = sender.broadcaster.scan(clock, &map);
            }
            let Some(mut sent) = sender.next(clock) else { continue };
            if random.chance(faults.flipped) {
                sent = sent.flipped(random.below(1 << 20));
            }
            if !random.chance(faults.lost) {
                all.push((us + if random.chance(faults.late) { random.below(2_000_000) } else { 0 }, sent.clone()));
            }
            if random.chance(faults.repeated) {
                all.push((us + random.below(2_000_000), sent));
            }
        }
        assert!(!map.0.is_empty());
    }
    all.sort_by_key(|(us, _)| *us);
    all
}

/// The log as candump -L writes it, serial lines as the receiver wants them.
fn log(sent: &[(u64, Sent)]) -> String {
    sent.iter().fold(String::new(), |mut text, (us, sent)| {
        let (s, us) = (us / 1_000_000, us % 1_000_000);
        let data = match sent {
            Sent::Frame(frame) => {
                let CanId::Standard(id) = frame.id else { panic!("11 bits are meant") };
                let _ = write!(text, "({s}.{us:06}) can0 {id:03X}#{}", if frame.fd { "#1" } else { "" });
                frame.data()
            }
            Sent::Bytes(bytes) => {
                let _ = write!(text, "({s}.{us:06}) ttyS0 ");
                bytes
            }
        };
        data.iter().for_each(|byte| {
            let _ = write!(text, "{byte:02X}");
        });
        text.push('\n');
        text
    })
}

type Sensors = Receiver<8, 128, 8>;
const ALL_SENSORS: [u8; 8] = [0, 1, 2, 3, 4, 5, 6, 7];

/// The library's receiver: bare, or with a key.
enum Ours {
    Bare(Box<Sensors>),
    #[cfg(feature = "secoc")]
    Secured(Box<viewshed::wire::receive::SecuredReceiver<[u8; 16], 8, 128, 8>>),
}

impl Ours {
    fn frame(&mut self, now: Time, frame: &CanFrame) {
        let _ = match self {
            Self::Bare(receiver) => receiver.frame(now, frame),
            #[cfg(feature = "secoc")]
            Self::Secured(receiver) => receiver.frame(now, frame),
        };
    }

    fn message(&mut self, now: Time, bytes: &[u8]) {
        let _ = match self {
            Self::Bare(receiver) => receiver.message(now, bytes),
            #[cfg(feature = "secoc")]
            Self::Secured(receiver) => receiver.message(now, bytes),
        };
    }

    fn receiver(&self) -> &Sensors {
        match self {
            Self::Bare(receiver) => receiver,
            #[cfg(feature = "secoc")]
            Self::Secured(receiver) => receiver.receiver(),
        }
    }

    /// What it makes of a log, in the C receiver's words.
    fn listen(mut self, sent: &[(u64, Sent)]) -> String {
        let (mut text, mut next, mut unstuffer) = (String::new(), None, Unstuffer::new());
        for (us, sent) in sent {
            let due = *next.get_or_insert(us + 100_000);
            if *us >= due {
                ALL_SENSORS.iter().for_each(|sensor| maps(self.receiver(), *sensor, *us, &mut text));
                next = Some(us + 100_000);
            }
            let now = Time::from_micros(*us);
            match sent {
                Sent::Frame(frame) => self.frame(now, frame),
                Sent::Bytes(bytes) => {
                    let mut rest = &bytes[..];
                    while !rest.is_empty() {
                        let (taken, message) = unstuffer.push(rest);
                        message.into_iter().for_each(|message| self.message(now, message));
                        rest = &rest[taken..];
                    }
                }
            }
        }
        text
    }
}

fn maps(receiver: &Sensors, sensor: u8, us: u64, text: &mut String) {
    let map = receiver.map(sensor, Time::from_micros(us));
    let Some(header) = map.header() else { return };
    let (mut visible, mut invisible, mut hash) = (0, 0, 14_695_981_039_346_656_037_u64);
    for azimuth in 0..usize::from(header.azimuths) {
        for range in 0..usize::from(header.ranges) {
            let state = map.cell(azimuth, range).visibility;
            visible += u32::from(state == Visibility::Visible);
            invisible += u32::from(state == Visibility::Invisible);
            hash = (hash ^ state as u64).wrapping_mul(1_099_511_628_211);
        }
    }
    let _ = writeln!(text, "{us} {sensor} {visible} {invisible} {hash:016x}");
}

/// The C receiver, built; `None` without a compiler.
fn built(name: &str) -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/receiver/receiver.c");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("receiver-{name}"));
    if Command::new("cc").arg("--version").output().is_err() {
        skipped("cc", &format!("the receiver in C, {name}: no C compiler (apt-get install gcc libc6-dev)"));
        return None;
    }
    let output = Command::new("cc")
        .args(["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&target)
        .arg(source)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(target)
}

/// Both receivers on one log; how many maps of each sensor they tell.
fn compare(name: &str, ours: Ours, key: Option<&str>, sent: &[(u64, Sent)]) -> Option<[u64; 8]> {
    // one file for each test, as tests run side by side
    let receiver = built(name)?;
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.log"));
    std::fs::write(&path, log(sent)).unwrap();
    let output = Command::new(&receiver).arg(&path).args(key).output().unwrap();
    assert!(output.status.success());
    let theirs = String::from_utf8(output.stdout).unwrap();
    let ours = ours.listen(sent);
    let differing = ours.lines().zip(theirs.lines()).find(|(a, b)| a != b);
    assert_eq!(differing, None, "{name}");
    assert_eq!(ours.lines().count(), theirs.lines().count(), "{name}");
    let of = |sensor: u8| ours.lines().filter(|line| line.split(' ').nth(1) == Some(&sensor.to_string())).count();
    Some(ALL_SENSORS.map(|sensor| of(sensor) as u64))
}

#[test]
fn a_receiver_written_from_the_specification_makes_the_same_maps() {
    for (name, scans, faults) in [("clean", 150, NONE), ("faulty", 1500, ALL)] {
        let sent = traffic(&[CLASSIC, FD, SERIAL], scans, faults, 5);
        let bare = Ours::Bare(Box::new(Receiver::new(ALL_SENSORS, Addresses::STANDARD, ReceiverLimits::DEFAULT)));
        let Some(shown) = compare(name, bare, None, &sent) else { return };
        // most of the 100 ms there are
        for sensor in [1, 6, 3] {
            assert!(shown[sensor] > scans * 67 / 100 * 4 / 10, "{name}: {} maps of sensor {sensor}", shown[sensor]);
        }
    }
}

#[cfg(feature = "secoc")]
#[test]
fn with_a_key_it_makes_the_same_maps_of_authenticated_messages_and_of_no_others() {
    use viewshed::wire::receive::SecuredReceiver;
    let key: [u8; 16] = std::array::from_fn(|i| 0xA0 + i as u8);
    let digits = "a0a1a2a3a4a5a6a7a8a9aaabacadaeaf";
    let with = |(sensor, medium, _): Sensor, key| (sensor, medium, Some(key));
    let other = (2, Medium::CanFd(Addresses::STANDARD), Some([5; 16]));
    // beside them a classic one, one without and one with another key
    let sensors = [with(FD, key), with(SERIAL, key), CLASSIC, (0, FD.1, None), other];
    for (name, scans, faults) in [("secured-clean", 150, NONE), ("secured-faulty", 1500, ALL)] {
        let sent = traffic(&sensors, scans, faults, 5);
        let secured = || {
            let receiver = SecuredReceiver::new(ALL_SENSORS, Addresses::STANDARD, ReceiverLimits::DEFAULT, &key);
            Ours::Secured(Box::new(receiver))
        };
        let Some(shown) = compare(name, secured(), Some(digits), &sent) else { return };
        for sensor in [6, 3] {
            assert!(shown[sensor] > scans * 67 / 100 * 4 / 10, "{name}: {} maps of sensor {sensor}", shown[sensor]);
        }
        assert_eq!([shown[0], shown[1], shown[2]], [0; 3], "{name}");
        // the receiver starts anew in the middle; and the keyless one hears the others only
        let begun = sent.len() / 2;
        let shown = compare(name, secured(), Some(digits), &sent[begun..]).unwrap();
        assert!(shown[6] > scans * 67 / 100 * 4 / 10 / 2 - 20, "{shown:?}");
        let bare = Ours::Bare(Box::new(Receiver::new(ALL_SENSORS, Addresses::STANDARD, ReceiverLimits::DEFAULT)));
        let shown = compare(name, bare, None, &sent).unwrap();
        assert!(shown[1] > 0 && shown[0] > 0 && shown[2] + shown[3] + shown[6] == 0, "{shown:?}");
    }
}

#[test]
fn its_authentication_codes_are_those_of_rfc_4493() {
    let Some(receiver) = built("cmac") else { return };
    let message = "6bc1bee22e409f96e93d7e117393172aae2d8a571e03ac9c9eb76fac45af8e51\
                   30c81c46a35ce411e5fbc1191a0a52eff69f2445df4f9b17ad2b417be66c3710";
    let vectors = [
        (0, "bb1d6929e95937287fa37d129b756746"),
        (16, "070a16b46b4d4144f79bdd9dd04a287c"),
        (40, "dfa66747de9ae63030ca32611497c827"),
        (64, "51f0bebf7e3b9d92fc49741779363cfe"),
    ];
    for (length, code) in vectors {
        let arguments = ["--cmac", "2b7e151628aed2a6abf7158809cf4f3c", &message[..2 * length]];
        let output = Command::new(&receiver).args(arguments).output().unwrap();
        assert_eq!(String::from_utf8(output.stdout).unwrap(), code, "{length} bytes");
    }
}
