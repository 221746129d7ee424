//! The fail-safe sentence as a property: whatever the bus does, visible means it was visible lately.
//!
//! A bus that loses, truncates, delays, repeats and reorders frames, senders and receivers that start
//! anew, queues that stand still and drain, clocks that drift, maps in which more than 5 % of the cells change per scan. Whenever the
//! receiver shows an azimuth, the test looks for the scan it shows: of the receiver's epoch, measured
//! at most A + D ago, with the same cells visible; never older than what was shown or taken before.
//!
//! A hundredth of a million scans by default, all of them with
//! `cargo test --release --test wire fail_safe -- --include-ignored`.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use crate::shadows::{A, Map, R, Random, Shadows, W, header};
use viewshed::fixed::time::Time;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::code::block::Basis;
use viewshed::wire::code::ray::Ray;
use viewshed::wire::code::reading::{self, Reader};
use viewshed::wire::frame::CanFrame;
use viewshed::wire::map_message;
use viewshed::wire::message::{Addresses, Epoch, Message, Packing, Part, Plane, Received};
use viewshed::wire::receive::{Accepted, Receiver, ReceiverLimits};
use viewshed::wire::scan_number::ScanNumber;

const SENSOR: u8 = 2;
const LIMITS: ReceiverLimits = ReceiverLimits::DEFAULT;
const AGE_AND_DELAY_US: u64 = 400_000;
const DELAY_US: u64 = 100_000;
/// Frames are displaced by so much; in every fifth world by almost the period of the scan numbers, less D, which
/// is as safe, but shows little.
const MOST_DISPLACED_US: [u64; 5] = [3_500_000, 3_500_000, 2_450_000, 3_500_000, 4_900_000];
/// A bus or gateway stands still for at most as long.
const MOST_STANDSTILL_US: u64 = 3_000_000;

/// A frame on its way: when it arrives, in which order it was sent, and the frame.
type OnItsWay = Reverse<(u64, u64, Vec<u8>, u32)>;

#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    scans: u64,
    shown: u64,
    cells: u64,
    changed_up: u64,
    changed_down: u64,
    visible: u64,
    arrived: u64,
}

struct World {
    seed: u64,
    random: Random,
    medium: Medium,
    shadows: Shadows,
    sender: Broadcaster<A, W>,
    receiver: Receiver<1, A, W>,
    /// Microseconds the sender's clock is ahead.
    sender_ahead: u64,
    fingerprint: u32,
    /// Measured when, in which epoch, under which number, what.
    history: VecDeque<(u64, Epoch, ScanNumber, Map)>,
    on_its_way: BinaryHeap<OnItsWay>,
    sent: u64,
    /// When the queue is empty.
    queue_us: u64,
    drained: u64,
    loss: f64,
    /// The newest scan of each azimuth that was shown, or taken from a refresh that decodes alone; with
    /// its epoch.
    newest: Vec<Option<(Epoch, u64)>>,
    tally: Tally,
}

/// Finds out which azimuths a refresh is about.
struct Azimuths(Vec<usize>);

impl Reader<W> for Azimuths {
    fn was(&self, _: usize) -> Option<Ray<W>> {
        None
    }
    fn take(&mut self, azimuth: usize, _: &Ray<W>) {
        self.0.push(azimuth);
    }
}

impl World {
    fn new(seed: u64, medium: Medium) -> Self {
        let config = BroadcastConfig::new(SENSOR, medium);
        Self {
            seed,
            random: Random::new(seed),
            medium,
            shadows: Shadows::new(seed),
            sender: Broadcaster::new(config, header(1), Epoch::new(seed as u8), Time::from_micros(3_000_000)).unwrap(),
            receiver: Receiver::new([SENSOR], addresses(medium), LIMITS),
            sender_ahead: 3_000_000,
            fingerprint: 1,
            history: VecDeque::new(),
            on_its_way: BinaryHeap::new(),
            sent: 0,
            queue_us: 0,
            drained: 0,
            loss: 0.0,
            newest: vec![None; A],
            tally: Tally::default(),
        }
    }

    /// The sender's clock runs 100 ppm slow, the receiver's 100 ppm fast.
    fn sender_time(&self, us: u64) -> Time {
        Time::from_micros(us + self.sender_ahead - us / 10_000)
    }

    fn receiver_time(us: u64) -> Time {
        Time::from_micros(us + 7_777_000 + us / 10_000)
    }

    fn put(&mut self, us: u64, measured: u64, frame: &CanFrame) {
        self.sent += 1;
        let r = &mut self.random;
        if us < self.queue_us {
            // the queue shortens by more than D in A + D: the premise
            self.queue_us += if frame.fd { 3000 } else { 1000 };
            self.drained += 1;
            if !r.chance(self.loss) {
                let (id, data) = (frame.id.raw(), frame.data().to_vec());
                self.on_its_way.push(Reverse((self.queue_us, self.sent, data, id)));
            }
            return;
        }
        let in_time = (us + r.below(8000)).min(us.max(measured + DELAY_US));
        let most_us = MOST_DISPLACED_US[(self.seed / 2 % 5) as usize];
        let late = |r: &mut Random| us + r.below(most_us);
        let mut data = frame.data().to_vec();
        if r.chance(0.01) {
            data.truncate(r.below(data.len() as u64) as usize);
        }
        let mut on = |at: u64| self.on_its_way.push(Reverse((at, self.sent, data.clone(), frame.id.raw())));
        if !r.chance(self.loss) {
            match r.below(100) {
                0..5 => on(late(r)),
                5..15 => on((us + r.below(60_000)).min(in_time.max(measured + DELAY_US))),
                _ => on(in_time),
            }
        }
        // a copy, of what was lost too
        if r.chance(0.04) {
            on(late(r));
        }
    }

    fn deliver(&mut self, us: u64) {
        while let Some(Reverse((at, ..))) = self.on_its_way.peek() {
            if *at > us {
                return;
            }
            let Some(Reverse((at, _, data, id))) = self.on_its_way.pop() else { return };
            let addresses = addresses(self.medium);
            let (sensor, message) =
                addresses.message(viewshed::wire::frame::CanId::standard(id as u16).unwrap()).unwrap();
            let id = addresses.id(sensor, message).unwrap();
            let long = self.medium.packing(false) == Packing::Long;
            let frame = if long { CanFrame::fd(id, &data) } else { CanFrame::classic(id, &data) }.unwrap();
            let outcome = self.receiver.frame(Self::receiver_time(at), &frame);
            // what decodes alone and was taken must not be shown older afterwards
            if let (true, Ok(Accepted::Map { scan })) = (long, outcome) {
                self.note_refresh(&frame, scan);
            }
        }
    }

    fn note_refresh(&mut self, frame: &CanFrame, scan: ScanNumber) {
        let addresses = addresses(self.medium);
        let received = Received::from_frame(frame, &addresses).unwrap();
        if received.message != Message::Map(Plane::Visibility, Part::Refresh) {
            return;
        }
        let Some((measured, ..)) = self.find(received.epoch, scan) else { return };
        let map = map_message::parse(received.own, true).unwrap();
        let mut azimuths = Azimuths(Vec::new());
        let context = header(0).context(received.packing.form());
        let _ = reading::decode(
            map.words(),
            &context,
            Basis::Refresh,
            map.start,
            &mut { reading::Resume::START },
            &mut azimuths,
        );
        for azimuth in azimuths.0 {
            let newest = &mut self.newest[azimuth];
            if newest.is_none_or(|(epoch, newest)| epoch != received.epoch || newest < measured) {
                *newest = Some((received.epoch, measured));
            }
        }
    }

    /// The latest scan of an epoch with this number.
    fn find(&self, epoch: Epoch, scan: ScanNumber) -> Option<(u64, &Map)> {
        let mut all = self.history.iter().rev();
        all.find(|(_, e, number, _)| (*e, *number) == (epoch, scan)).map(|(measured, .., map)| (*measured, map))
    }

    /// The sentence, for every azimuth.
    fn check(&mut self, us: u64) {
        let now = Self::receiver_time(us);
        let map = self.receiver.map(SENSOR, now);
        let Some(epoch) = self.receiver.sensor(SENSOR).unwrap().epoch() else { return };
        let mut shown_azimuths = 0;
        for azimuth in 0..A {
            let Some(scan) = map.scan(azimuth) else { continue };
            let shown = map.ray(Plane::Visibility, azimuth);
            let Some((measured, sent)) = self.find(epoch, scan) else {
                panic!("azimuth {azimuth} shows {scan:?}, which {epoch:?} never sent in the last seconds")
            };
            let sent = &sent.0[azimuth];
            shown_azimuths += 1;
            assert!(
                us - measured <= AGE_AND_DELAY_US,
                "azimuth {azimuth} is {} us old in world {}",
                us - measured,
                self.seed
            );
            assert_eq!(shown.bits().and(sent.bits()), *shown.bits(), "visible what was not");
            if let Some((e, newest)) = self.newest[azimuth] {
                assert!(e != epoch || newest <= measured, "azimuth {azimuth} went back by {} us", newest - measured);
            }
            self.newest[azimuth] = Some((epoch, measured));
        }
        self.tally.shown += shown_azimuths;
    }

    /// How much of the newest map is there.
    fn count(&mut self, us: u64) {
        let Some((.., map)) = self.history.back() else { return };
        let received = self.receiver.map(SENSOR, Self::receiver_time(us));
        for (azimuth, sent) in map.0.iter().enumerate() {
            let ray = received.ray(Plane::Visibility, azimuth);
            self.tally.visible += u64::from(sent.bits().count());
            self.tally.arrived += u64::from(sent.bits().and(ray.bits()).count());
        }
    }

    fn compare(&mut self, map: &Map) {
        let Some((.., before)) = self.history.back() else { return };
        for (now, was) in map.0.iter().zip(&before.0) {
            for (now, was) in now.bits().words().iter().zip(was.bits().words()) {
                self.tally.changed_up += u64::from((now & !was).count_ones());
                self.tally.changed_down += u64::from((was & !now).count_ones());
            }
        }
        self.tally.cells += (A * R) as u64;
    }

    fn restarts(&mut self, us: u64) {
        // not before the last one is empty for a while, or its delay would stay
        if us > self.queue_us + AGE_AND_DELAY_US && self.random.chance(0.003) {
            self.queue_us = us + self.random.below(MOST_STANDSTILL_US);
            if self.random.chance(0.3) {
                // a receiver that starts while it drains
                self.receiver = Receiver::new([SENSOR], addresses(self.medium), LIMITS);
                self.newest.fill(None);
            }
        }
        if self.random.chance(0.003) {
            self.fingerprint += 1;
            self.sender.restart(header(self.fingerprint), self.sender_time(us)).unwrap();
        }
        if self.random.chance(0.003) {
            // its clock begins anew as well
            self.sender_ahead = 1_000_000 + self.random.below(4_000_000);
            let config = BroadcastConfig::new(SENSOR, self.medium);
            let (epoch, now) = (self.sender.epoch().next(), self.sender_time(us));
            self.sender = Broadcaster::new(config, header(self.fingerprint), epoch, now).unwrap();
        }
        if self.random.chance(0.003) {
            self.receiver = Receiver::new([SENSOR], addresses(self.medium), LIMITS);
            self.newest.fill(None);
        }
    }

    fn run(&mut self, scans: u64) {
        let mut us = 1_000_000;
        for _ in 0..scans {
            self.restarts(us);
            let map = self.shadows.next();
            self.compare(&map);
            let measured = us;
            if self.sender.scan(self.sender_time(measured), &map).is_ok() {
                let number = ScanNumber::at(self.sender_time(measured));
                self.history.push_back((measured, self.sender.epoch(), number, map));
            }
            if self.history.len() > 120 {
                self.history.pop_front();
            }
            let next = us + 60_000 + self.random.below(14_000);
            us += self.random.below(20_000);
            let checked = us + self.random.below(60_000);
            while us < next {
                if let Some(frame) = self.sender.next_frame(self.sender_time(us)) {
                    self.put(us, measured, &frame);
                }
                self.deliver(us);
                if (checked..checked + 1000).contains(&us) {
                    self.check(us);
                }
                us += 1000;
            }
            self.check(us);
            self.count(us);
            self.tally.scans += 1;
        }
    }
}

fn addresses(medium: Medium) -> Addresses {
    match medium {
        Medium::Can(addresses) | Medium::CanFd(addresses) => addresses,
        Medium::Serial => Addresses::STANDARD,
    }
}

/// Many worlds, a thousand scans each.
fn worlds(count: u64) {
    for loss in [0.0, 0.01, 0.05, 0.2, 0.6] {
        let (mut all, mut drained) = (Tally::default(), 0);
        for seed in 0..count / 5 {
            let medium =
                if seed % 2 == 0 { Medium::Can(Addresses::STANDARD) } else { Medium::CanFd(Addresses::STANDARD) };
            let mut world = World::new(seed + (loss * 1e6) as u64, medium);
            world.loss = loss;
            world.run(1000);
            let t = world.tally;
            all.scans += t.scans;
            all.shown += t.shown;
            all.cells += t.cells;
            all.changed_up += t.changed_up;
            all.changed_down += t.changed_down;
            all.visible += t.visible;
            all.arrived += t.arrived;
            drained += world.drained;
        }
        let share = |n: u64, of: u64| 100.0 * n as f64 / of as f64;
        let arrived = share(all.arrived, all.visible);
        let (up, down) = (share(all.changed_up, all.cells), share(all.changed_down, all.cells));
        println!(
            "loss {:>4.1} %: {} scans, {:.1} % of the visible cells arrived; {up:.1} % of the cells became visible a scan, \
             {down:.1} % ceased; {} azimuths looked at",
            100.0 * loss,
            all.scans,
            arrived,
            all.shown
        );
        assert!(drained > 10 * count, "{drained} frames out of queues");
        assert!(up + down >= 5.0 && up > 2.0 && down > 2.0);
        // the senders start anew all the time, and every time they are quiet and nothing is trusted
        let least = if loss < 0.1 {
            50.0
        } else if loss < 0.5 {
            30.0
        } else {
            1.0
        };
        assert!(arrived > least, "a receiver that says nothing is safe and useless: {arrived} %");
    }
}

#[test]
fn visible_means_it_was_visible_lately_whatever_the_bus_does() {
    worlds(10);
}

#[test]
#[ignore = "a million scans take some minutes; a hundredth of them always runs"]
fn a_million_scans() {
    worlds(1000);
}
