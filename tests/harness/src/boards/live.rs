//! The live program of the serial boards, run here: the same bytes in, the bytes it has to send.

use viewshed::inputs::native::{Medium as Native, Sender};
use viewshed::pil::flash::Flash;
use viewshed::pil::record::FrameRecord;
use viewshed::polar::PolarMap;
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::service::Request;
use viewshed::session::{Flow, Line, Session};
use viewshed::settings::Settings;
use viewshed::time::Time;
use viewshed::unit::{Unit, bench_sender};
use viewshed::wire::broadcast::{Broadcaster, Medium};
use viewshed::wire::serial::{MOST_STUFFED, stuff};

use super::Profile;
use super::scans::Scan;

/// The sensor's number on both lines.
pub const SENSOR: u8 = 0;

/// Time of the first scan on the line: the format has no room for a calendar's.
const FIRST_US: u64 = 1_000_000;

/// What a board sends, and when.
pub struct Answered {
    pub bytes: Vec<u8>,
    /// How many bytes there were at which time of the scans.
    pub times: Vec<(usize, Time)>,
}

/// What the board sends for these bytes.
pub fn answer(profile: Profile, bytes: &[u8]) -> Answered {
    match profile {
        Profile::Reference => work::<200, 120, 16, 7, 64, 256>(bytes),
        Profile::Small => work::<100, 64, 8, 4, 28, 176>(bytes),
    }
}

fn work<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    bytes: &[u8],
) -> Answered {
    let mut flash = Flash::ERASED;
    let mut line = Answer(Vec::new());
    let mut state = Box::new(Radar3d::<R, A, E, W, N, D>::new());
    let mut map = Box::new(PolarMap::<R, A>::NOWHERE);
    let mut sender: Box<Option<Broadcaster<A, W>>> = Box::new(None);
    let (mut rest, mut times) = (bytes, Vec::new());
    'start: loop {
        let epoch = flash.start();
        let mut session = Session::<D>::start(SENSOR, &flash, &mut line);
        let settings = session.settings();
        let parameters = settings.and_then(|s| Radar3dParameters::<R, A, E>::new(&s.sensor, &s.radar_3d()).ok());
        let found = settings.zip(parameters.as_ref());
        *sender = found.and_then(|(s, p)| bench_sender(s, p, Medium::Serial, epoch, session.now()));
        let sender = (*sender).as_mut();
        let mut unit = parameters.as_ref().zip(sender).map(|(p, sender)| Unit::new(p, &mut state, &mut map, sender));
        while let Some((byte, behind)) = rest.split_first() {
            rest = behind;
            if session.take(&[*byte], &mut unit, &mut flash, &mut line) == Flow::Restart {
                continue 'start;
            }
            if times.last().is_none_or(|(n, _)| *n < line.0.len()) {
                times.push((line.0.len(), session.now()));
            }
        }
        return Answered { bytes: line.0, times };
    }
}

struct Answer(Vec<u8>);

impl Line for Answer {
    fn send(&mut self, bytes: &[u8]) -> bool {
        self.0.extend_from_slice(bytes);
        true
    }

    fn ticks(&mut self) -> u32 {
        0
    }

    fn trace(&mut self, _: &FrameRecord) {}
}

/// Bytes for the board's line, message by message.
pub struct Script {
    radar: Sender,
    counter: u8,
    pub bytes: Vec<u8>,
}

impl Default for Script {
    fn default() -> Self {
        Self { radar: Sender::new(SENSOR), counter: 0, bytes: Vec::new() }
    }
}

impl Script {
    /// A configuration and a start with it.
    pub fn configure(&mut self, settings: &Settings) {
        self.request(&Request::Write(&settings.to_block(1)));
        self.request(&Request::Restart);
    }

    pub fn request(&mut self, request: &Request<'_>) {
        let message = request.message(SENSOR, self.counter);
        self.counter = self.counter.wrapping_add(1);
        self.stuffed(message.bytes());
    }

    /// A scan; its time is from the first one of the recording.
    pub fn scan(&mut self, scan: &Scan, first: Time) {
        let time = on_the_line(scan.time, first);
        let messages: Vec<_> = self.radar.scan(time, false, &scan.detections, Native::Serial).collect();
        messages.iter().for_each(|m| self.stuffed(m.bytes()));
    }

    /// The time, as scans have it.
    pub fn time(&mut self, time: Time, first: Time) {
        self.request(&Request::Time(on_the_line(time, first)));
    }

    fn stuffed(&mut self, message: &[u8]) {
        let mut line = [0; MOST_STUFFED];
        let length = stuff(message, &mut line).unwrap_or(0);
        self.bytes.extend_from_slice(&line[..length]);
    }
}

/// A scan's time as it stands on the line.
pub fn on_the_line(time: Time, first: Time) -> Time {
    Time::from_micros(FIRST_US + time.since(first).unwrap_or(0))
}
