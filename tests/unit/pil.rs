//! The loop a controller runs, here on the host: jobs in, records out.

use viewshed::bench::fingerprint::Fingerprint;
use viewshed::bench::job::{Job, JobEntry, JobError, ScanBuffer, ScanHead};
use viewshed::bench::record::{RECORD_LEN, Record};
use viewshed::bench::{Bench, run};
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::frame::health::Condition;
use viewshed::radar_3d::Radar3dParameters;
use viewshed::sensor::Sensor;
use viewshed::unit::Unit;
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::serial::MOST_STUFFED;
use viewshed::wire::status::{Reason, UnitState};

use crate::common::{SmallSender, SmallState, Vehicle, gantry, small_unit};

/// Streams in memory that give and take a few bytes at a time; a counter that goes one up a look.
struct Streams {
    job: Vec<u8>,
    answer: Vec<u8>,
    ticks: u32,
}

impl Bench for Streams {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let n = buffer.len().min(17).min(self.job.len());
        buffer[..n].copy_from_slice(&self.job[..n]);
        self.job.drain(..n);
        n
    }

    fn write(&mut self, bytes: &[u8]) {
        self.answer.extend_from_slice(bytes);
    }

    fn ticks(&mut self) -> u32 {
        self.ticks += 1;
        self.ticks
    }

    fn ticks_per_256(&self) -> u32 {
        256
    }

    fn stack(&self) -> [u32; 2] {
        [1, 2]
    }
}

fn sensor() -> Sensor {
    gantry(6.0, 0.0)
}

fn unit(settings: &Settings) -> (Radar3dParameters<50, 40, 8>, SmallSender) {
    small_unit(settings, Medium::Serial, 0, Time::from_micros(0))
}

/// Long enough for azimuths to settle within a few scans, and for no map to run out between two.
const PERIOD_US: u64 = 450_000;

fn scans() -> Vec<Vec<Detection>> {
    let car = Vehicle::car(40.0, 2.0, 22.0);
    (0..8).map(|k| car.at(f64::from(k) * PERIOD_US as f64 * 1e-6).detections(&sensor(), true)).collect()
}

fn job(dump: Option<u32>, scans: &[Vec<Detection>]) -> Vec<u8> {
    let mut bytes = Job { settings: Settings::of(sensor()), dump }.to_bytes().to_vec();
    for (k, scan) in scans.iter().enumerate() {
        let time = Time::from_micros(k as u64 * PERIOD_US);
        let head = ScanHead { time, detections: scan.len() as u16, fault: false, reset: k == 5 };
        bytes.extend(head.to_bytes());
        bytes.extend(scan.iter().flat_map(JobEntry::to_bytes));
    }
    bytes
}

fn answer(job: Vec<u8>) -> (Result<(), JobError>, Vec<u8>) {
    let mut streams = Streams { job, answer: Vec::new(), ticks: 0 };
    let outcome = Job::read(&mut streams).and_then(|job| {
        let (parameters, mut sender) = unit(&job.settings);
        let (mut state, mut map, mut scan) = (Box::new(SmallState::new()), parameters.map(), ScanBuffer::<64>::new());
        let mut unit = Unit::new(&parameters, &mut *state, &mut map, &mut sender);
        run(&mut streams, &job, [50, 40, 8, 64], &mut unit, &mut scan)
    });
    (outcome, streams.answer)
}

fn records(bytes: &[u8]) -> Vec<Record> {
    bytes.chunks_exact(RECORD_LEN).map_while(|r| Record::from_bytes(r.try_into().unwrap())).collect()
}

#[test]
fn every_frame_is_answered_with_the_fingerprint_of_its_map() {
    let scans = scans();
    let (outcome, bytes) = answer(job(None, &scans));
    assert_eq!(outcome, Ok(()));
    let records = records(&bytes);
    assert_eq!(records.len(), scans.len() + 2);
    let settings = Settings::of(sensor());
    let (parameters, mut sender) = unit(&settings);
    let (mut state, mut map) = (Box::new(SmallState::new()), parameters.map());
    let mut line = [0; MOST_STUFFED];
    let (mut seen, mut messages) = (std::collections::BTreeSet::new(), 0);
    for (k, scan) in scans.iter().enumerate() {
        if k == 5 {
            state.reset();
            map.forget();
        }
        let now = Time::from_micros(k as u64 * PERIOD_US);
        let report = state.process(&parameters, now, scan, false, &mut map);
        let _ = sender.scan(now, &map);
        let status = sender.status_mut();
        (status.state, status.reason) = match report.condition {
            Condition::Settling => (UnitState::Degraded, Reason::Settling),
            _ => (UnitState::Ok, Reason::None),
        };
        let mut fingerprint = Fingerprint::of_map(&map);
        while let Some(n) = sender.next_line(now, &mut line) {
            fingerprint.bytes(&line[..n]);
            messages += 1;
        }
        let Record::Frame(frame) = records[k + 1] else { panic!("{:?}", records[k + 1]) };
        assert_eq!(frame.fingerprint, fingerprint.value(), "frame {k}");
        assert_eq!((frame.frame, frame.used, frame.condition), (k as u32, report.used, report.condition));
        assert_eq!(frame.ticks[..7], [1; 7], "one look at the counter a stage");
        seen.insert(frame.fingerprint);
    }
    assert!(messages >= 5, "the quiet period is over and maps are sent: {messages}");
    assert!(seen.len() >= 5, "the maps differ: {}", seen.len());
    assert!(matches!(records.last(), Some(Record::Closing(c)) if (c.reason, c.frames) == (0, 8)));
}

#[test]
fn a_map_is_sent_when_asked_for() {
    let (_, bytes) = answer(job(Some(4), &scans()));
    let at = 6 * RECORD_LEN;
    let record = Record::from_bytes(bytes[at..at + RECORD_LEN].try_into().unwrap());
    assert_eq!(record, Some(Record::Map { frame: 4, cells: [50, 40] }));
    let grades = &bytes[at + RECORD_LEN..][..50 * 40];
    assert!(grades.contains(&255) && grades.contains(&0), "clear and unknown cells");
    assert_eq!(bytes.len(), 11 * RECORD_LEN + 2 * 50 * 40);
}

#[test]
fn what_is_no_job_is_refused_and_a_cut_one_ends_with_its_reason() {
    let whole = job(None, &scans());
    assert_eq!(answer(b"anything else, long enough or not".to_vec()).0, Err(JobError::NotAJob));
    let mut other = whole.clone();
    other[20] ^= 1;
    assert!(matches!(answer(other).0, Err(JobError::Block(_))));
    let (outcome, bytes) = answer(whole[..whole.len() - 5].to_vec());
    assert_eq!(outcome, Err(JobError::Cut));
    assert!(matches!(records(&bytes).last(), Some(Record::Closing(c)) if (c.reason, c.frames) == (2, 7)));
    let many: Vec<Detection> = scans().concat().into_iter().cycle().take(65).collect();
    assert_eq!(answer(job(None, &[many])).0, Err(JobError::TooMany(65)));
}
