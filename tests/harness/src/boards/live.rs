//! The live program of the serial boards, run here: the same bytes in, the bytes it has to send.

use std::cell::RefCell;
use std::io::{Read, Write};
use std::{iter, mem};

use viewshed::bench::flash::Flash;
use viewshed::bench::start_stored;
use viewshed::estimator::Estimator;
use viewshed::fixed::time::Time;
use viewshed::fusion::Supervised;
use viewshed::inputs::native::{NativeMedium, NativeSender};
use viewshed::map::polar::PolarMap;
use viewshed::radar_3d::Radar3d;
use viewshed::unit::identity::Identity;
use viewshed::unit::profile::{reference, small};
use viewshed::unit::quantised::QuantisedSender;
use viewshed::unit::serial_service::SerialLine;
use viewshed::unit::service::{PART_LEN, Request};
use viewshed::unit::session::SerialSession;
use viewshed::unit::settings::{Settings, SettingsCheck, StoredSettings};
use viewshed::unit::{Flow, MapSender, Unit};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::serial::{MOST_STUFFED, stuff};

use super::Profile;
use super::listener::Map;
use super::scans::Scan;

/// The sensor's number on both lines.
pub const SENSOR: u8 = 0;

/// Time of the first scan on the line: the format has no room for a calendar's.
const FIRST_US: u64 = 1_000_000;

/// What a board sends, and when.
#[derive(Default)]
pub struct Answered {
    pub bytes: Vec<u8>,
    /// How many bytes there were at which time of the scans.
    pub times: Vec<(usize, Time)>,
    /// How many bytes there were after each byte that came in.
    pub lengths: Vec<usize>,
    /// The maps that were sent, and how many bytes had come in by then.
    pub maps: Vec<(usize, Map)>,
}

/// What the board sends for these bytes.
pub fn answer(profile: Profile, bytes: &[u8]) -> Answered {
    let mut answered = Answered::default();
    let sent = RefCell::new(Vec::new());
    let mut after = |now: Time, map: Option<Map>| {
        let length = sent.borrow().len();
        answered.lengths.push(length);
        if answered.times.last().is_none_or(|(n, _)| *n < length) {
            answered.times.push((length, now));
        }
        answered.maps.extend(map.map(|map| (answered.lengths.len(), map)));
    };
    run(
        (profile, true),
        &mut bytes.iter().copied(),
        &mut |bytes| sent.borrow_mut().extend_from_slice(bytes),
        &mut after,
    );
    answered.bytes = sent.into_inner();
    answered
}

/// A board of this computer: takes bytes from one stream and answers on the other, until there are no more. One that is
/// not a bench is a product's: asked for its name, it says so.
pub fn device(profile: Profile, is_bench: bool, mut from: impl Read, mut to: impl Write) {
    let mut bytes = iter::from_fn(|| {
        let mut byte = [0];
        from.read_exact(&mut byte).ok().map(|()| byte[0])
    });
    // who does not listen any more misses something
    run((profile, is_bench), &mut bytes, &mut |bytes| drop(to.write_all(bytes)), &mut |_, _| {});
}

/// Called after each byte with the time and the map that it led to.
type After<'a> = &'a mut dyn FnMut(Time, Option<Map>);

fn run(
    (profile, is_bench): (Profile, bool),
    bytes: &mut dyn Iterator<Item = u8>,
    send: &mut dyn FnMut(&[u8]),
    after: After<'_>,
) {
    match profile {
        Profile::Reference => {
            work(&mut Box::new(Supervised::new(reference::State::new())), is_bench, bytes, send, after);
        }
        Profile::Small => work(&mut Box::new(Supervised::new(small::State::new())), is_bench, bytes, send, after),
    }
}

/// Radar-3d of any size, supervised where its settings say so.
type Watched<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> =
    Supervised<Radar3d<R, A, E, W, N, D>>;

fn work<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
    state: &mut Watched<R, A, E, W, N, D>,
    is_bench: bool,
    bytes: &mut dyn Iterator<Item = u8>,
    send: &mut dyn FnMut(&[u8]),
    after: After<'_>,
) {
    let mut flash = Flash::ERASED;
    let mut line = Answer(send);
    let mut map = Box::new(PolarMap::<R, A>::NOWHERE);
    let mut sender: Box<Option<QuantisedSender<A, W>>> = Box::new(None);
    'start: loop {
        let epoch = flash.start();
        let stored =
            StoredSettings::read(&flash, SettingsCheck::of::<Watched<R, A, E, W, N, D>, QuantisedSender<A, W>>());
        // of this computer: a real board names itself
        #[allow(clippy::cast_possible_truncation)] // at most 200
        let identity = Identity { board: "this-computer", chip: 0, is_bench, grid: [R as u8, A as u8] };
        let mut session = SerialSession::<D>::start(stored.unit().sensor, identity, epoch, stored, &mut line);
        let mut parameters: Option<<Watched<R, A, E, W, N, D> as Estimator>::Parameters> = None;
        let now = session.now();
        let lacking = start_stored::<Watched<R, A, E, W, N, D>, _>(
            &mut parameters,
            &mut sender,
            (&stored, &flash),
            Medium::Serial,
            epoch,
            now,
        );
        let sender = (*sender).as_mut();
        let mut unit = parameters.as_ref().zip(sender).map(|(p, sender)| Unit::new(p, &mut *state, &mut *map, sender));
        if let Some((unit, reason)) = unit.as_mut().zip(lacking) {
            unit.lacks(reason);
        }
        let mut last = None;
        for byte in &mut *bytes {
            let flow = session.take(&[byte], &mut unit, &mut flash, &mut line, &mut |_, _| {});
            let offered = unit.as_mut().and_then(|unit| {
                let deadline = MapSender::<PolarMap<R, A>>::deadline(unit.broadcast());
                let new = deadline != mem::replace(&mut last, deadline);
                new.then(|| Map::offered(unit, epoch)).flatten()
            });
            after(session.now(), offered);
            if flow == Flow::Restart {
                continue 'start;
            }
        }
        return;
    }
}

struct Answer<'a>(&'a mut dyn FnMut(&[u8]));

impl SerialLine for Answer<'_> {
    fn send(&mut self, bytes: &[u8]) -> bool {
        (self.0)(bytes);
        true
    }
}

/// Bytes for the board's line, message by message.
pub struct Script {
    radar: NativeSender,
    counter: u8,
    pub bytes: Vec<u8>,
    /// Where scans end, and their times.
    pub marks: Vec<(usize, Time)>,
}

impl Default for Script {
    fn default() -> Self {
        Self { radar: NativeSender::new(SENSOR), counter: 0, bytes: Vec::new(), marks: Vec::new() }
    }
}

impl Script {
    /// A configuration and a start with it.
    pub fn configure(&mut self, settings: &Settings) {
        self.request(&Request::Write(&settings.to_block(1)));
        self.request(&Request::Restart);
    }

    /// A block, in parts where it is longer than a message.
    #[allow(clippy::cast_possible_truncation)] // a kilobyte
    pub fn write(&mut self, block: &[u8]) {
        if block.len() <= PART_LEN {
            return self.request(&Request::Write(block));
        }
        for (k, part) in block.chunks(PART_LEN).enumerate() {
            self.request(&Request::Part((k * PART_LEN) as u16, part));
        }
    }

    pub fn request(&mut self, request: &Request<'_>) {
        let message = request.message(SENSOR, self.counter);
        self.counter = self.counter.wrapping_add(1);
        self.stuffed(message.bytes());
    }

    /// A scan; its time is from the first one of the recording.
    pub fn scan(&mut self, scan: &Scan, first: Time) {
        let time = on_the_line(scan.time, first);
        let messages: Vec<_> = self.radar.scan(time, false, &scan.detections, NativeMedium::Serial).collect();
        messages.iter().for_each(|m| self.stuffed(m.bytes()));
        self.marks.push((self.bytes.len(), time));
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
