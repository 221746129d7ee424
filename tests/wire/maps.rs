//! From a sender to a receiver over every medium: without loss nothing is lost.

use std::collections::VecDeque;

use crate::shadows::{A, Map, R, Shadows, W, header};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::bits::Bits;
use viewshed::fixed::time::Time;
use viewshed::fixed::trig;
use viewshed::map::VisibilityMap;
use viewshed::map::query::{self, Answer, Footprint};
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium, NotSent};
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::frame::CanFrame;
use viewshed::wire::header::Header;
use viewshed::wire::message::{Addresses, Epoch, Message, Packing, Plane, Received};
use viewshed::wire::planes::Planes;
use viewshed::wire::receive::{Accepted, Receiver, ReceiverLimits, Refused, SenderCondition};
use viewshed::wire::serial::{MOST_STUFFED, Unstuffer};
use viewshed::wire::status::{Reason, UnitState};

const SENSOR: u8 = 5;
const MEDIA: [Medium; 3] = [Medium::Can(Addresses::STANDARD), Medium::CanFd(Addresses::EXTENDED), Medium::Serial];

fn ms(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

fn addresses(medium: Medium) -> Addresses {
    match medium {
        Medium::Can(addresses) | Medium::CanFd(addresses) => addresses,
        Medium::Serial => Addresses::STANDARD,
    }
}

/// A sender and a receiver on a line without loss.
struct Line<const P: usize> {
    medium: Medium,
    sender: Broadcaster<A, W, P>,
    receiver: Receiver<2, A, W, P>,
    unstuffer: Unstuffer,
    refused: Vec<Refused>,
    frames: Vec<CanFrame>,
}

impl<const P: usize> Line<P> {
    fn new(medium: Medium, config: BroadcastConfig) -> Self {
        Self {
            medium,
            sender: Broadcaster::new(config, header(7), Epoch::new(3), ms(0)).unwrap(),
            receiver: Receiver::new([1, SENSOR], addresses(medium), ReceiverLimits::DEFAULT),
            unstuffer: Unstuffer::new(),
            refused: Vec::new(),
            frames: Vec::new(),
        }
    }

    /// One message from here to there; whether there was one.
    fn pass(&mut self, now: Time) -> bool {
        if self.medium == Medium::Serial {
            let mut line = [0; MOST_STUFFED];
            let Some(n) = self.sender.next_line(now, &mut line) else { return false };
            let (taken, message) = self.unstuffer.push(&line[..n]);
            assert_eq!(taken, n);
            self.refused.extend(self.receiver.message(now, message.unwrap()).err());
        } else {
            let Some(frame) = self.sender.next_frame(now) else { return false };
            self.refused.extend(self.receiver.frame(now, &frame).err());
            self.frames.push(frame);
        }
        true
    }

    fn received(&self, plane: Plane, now: Time) -> Vec<Ray<W>> {
        let map = self.receiver.map(SENSOR, now);
        (0..A).map(|azimuth| map.ray(plane, azimuth)).collect()
    }
}

fn run<const P: usize>(medium: Medium, planes: &[Plane]) {
    let mut line = Line::<P>::new(medium, BroadcastConfig::new(SENSOR, medium));
    let mut shadows = Shadows::new(4);
    let mut compared = 0;
    for scan in 0..400 {
        let map = shadows.next();
        let start = 67 * scan;
        let sent = line.sender.scan(ms(start), &map);
        assert_eq!(sent, if start < 400 { Err(NotSent::Quiet) } else { Ok(()) });
        for now in start..start + 66 {
            line.pass(ms(now));
        }
        assert!(line.sender.idle(), "{medium:?} {scan}");
        if start > 1400 {
            compared += 1;
            for &plane in planes {
                let sent: Vec<_> = (0..A).map(|a| map.ray(plane, a)).collect();
                assert_eq!(line.received(plane, ms(start + 66)), sent, "{medium:?} {plane:?} scan {scan}");
            }
        }
    }
    assert!(compared > 370);
    // a session begins with the second message, and the whole header is there before the first map
    assert_eq!(line.refused, [Refused::FirstOfEpoch], "{medium:?}");
    let counters = line.receiver.sensor(SENSOR).unwrap().counters();
    assert_eq!((counters.protection, counters.lost, counters.repeated, counters.out_of_sequence), (0, 0, 0, 0));
}

#[test]
fn without_loss_every_cell_of_every_scan_arrives() {
    MEDIA.into_iter().for_each(|medium| run::<1>(medium, &[Plane::Visibility]));
}

#[test]
fn grade_and_occupancy_travel_beside_visibility() {
    let config = |medium| BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(SENSOR, medium) };
    run::<3>(Medium::CanFd(Addresses::STANDARD), &Plane::ALL);
    let mut line = Line::<3>::new(MEDIA[0], config(MEDIA[0]));
    let map = Shadows::new(1).next();
    for scan in 0..30 {
        let _ = line.sender.scan(ms(67 * scan), &map);
        while !line.sender.idle() {
            line.pass(ms(67 * scan + 1));
        }
        (0..66).for_each(|k| assert!(line.pass(ms(67 * scan + k)) || k > 0 || scan > 0));
    }
    let now = ms(67 * 29 + 66);
    let received = line.receiver.map(SENSOR, now);
    let (azimuth, range) = (20, 20);
    let visible = map.0[azimuth].get(range);
    let cell = received.cell(azimuth, range);
    assert_eq!((cell.visible(), cell.grade), (visible, if visible { 170 } else { 85 }));
    assert_eq!(cell.occupied, map.ray(Plane::Occupancy, azimuth).get(range));
    // straight ahead, 41 m away
    let answer = query::point(&received, RoadPoint::new(4100, 10));
    assert_eq!(answer, cell.into());
    areas_are_no_better_than_their_points(&received);
    areas_are_no_better_than_their_points(&line.receiver.together(now));
}

fn areas_are_no_better_than_their_points(map: &impl VisibilityMap) {
    let mut seen = 0;
    for k in 0..400 {
        let heading = trig::direction(Angle::from_raw((k * 7919) as u16 as i16));
        let centre = RoadPoint::new(300 + (k % 20) * 500, (k / 20 - 10) * 300);
        let area = Footprint { centre, heading, half_length_cm: 230, half_width_cm: 90 };
        let answer = query::area(map, &area);
        for (a, b) in (-9..=9).flat_map(|a| (-4..=4).map(move |b| (a * 25, b * 22))) {
            let (x, y) = (heading.along(a, -b), heading.across(-a, b));
            let here = query::point(map, RoadPoint::new(centre.x_cm + x, centre.y_cm + y));
            assert!(answer <= here, "{answer:?}, and {here:?} at ({a}, {b}) of {area:?}");
        }
        seen += usize::from(answer >= Answer::VisibleOccupied);
    }
    assert!(seen > 20, "{seen}");
}

#[test]
fn who_joins_late_has_everything_within_a_second() {
    for medium in MEDIA {
        for join in (2000..2500).step_by(41) {
            let mut line = Line::<1>::new(medium, BroadcastConfig::new(SENSOR, medium));
            let mut shadows = Shadows::new(join);
            let mut map = Map(Vec::new());
            for now in 0..join + 1000 {
                if now % 67 == 0 {
                    map = shadows.next();
                    let _ = line.sender.scan(ms(now), &map);
                }
                if now == join {
                    line.receiver = Receiver::new([1, SENSOR], addresses(medium), ReceiverLimits::DEFAULT);
                }
                line.pass(ms(now));
            }
            // up to the frames of the scan that is just coming in
            let now = ms(join + 1000);
            let known = line.received(Plane::Visibility, now).iter().filter(|ray| !ray.known.is_empty()).count();
            let sent = map.0.iter().filter(|ray| !ray.known.is_empty()).count();
            assert!(known >= sent, "{medium:?} joined at {join}: {known} of {sent} azimuths");
        }
    }
}

#[test]
fn the_gap_is_kept_and_the_status_comes_twice_a_second_even_in_a_fault() {
    let config = BroadcastConfig { gap_us: 700, ..BroadcastConfig::new(SENSOR, MEDIA[0]) };
    let mut line = Line::<1>::new(MEDIA[0], config);
    line.sender.status_mut().state = UnitState::Fault;
    line.sender.status_mut().reason = Reason::RadarSilent;
    let (mut last, mut status) = (None, Vec::new());
    for us in (0..5_000_000).step_by(100) {
        let now = Time::from_micros(us);
        let Some(frame) = line.sender.next_frame(now) else { continue };
        assert!(last.is_none_or(|last| us - last >= 700));
        last = Some(us);
        let received = Received::from_frame(&frame, &Addresses::STANDARD).unwrap();
        assert!(matches!(received.message, Message::Status | Message::Header), "no map, no frame of one");
        if received.message == Message::Status {
            status.push(us);
            assert_eq!((received.own[0] & 15, received.own[1]), (4, 1), "fault, radar silent");
        }
    }
    assert!(status.windows(2).all(|w| w[1] - w[0] <= 500_000) && status.len() >= 10);
}

#[test]
fn stale_frames_are_dropped_and_every_azimuth_has_its_turn() {
    // a bus that takes a frame every 20 ms
    let mut line =
        Line::<1>::new(MEDIA[0], BroadcastConfig { gap_us: 20_000, ..BroadcastConfig::new(SENSOR, MEDIA[0]) });
    let mut shadows = Shadows::new(9);
    let mut seen = [0_u32; A];
    for now in 0..20_000 {
        if now % 67 == 0 {
            let _ = line.sender.scan(ms(now), &shadows.next());
        }
        line.pass(ms(now));
        if now > 2000 {
            let map = line.receiver.map(SENSOR, ms(now));
            (0..A).filter(|a| map.scan(*a).is_some()).for_each(|a| seen[a] += 1);
        }
    }
    assert!(line.sender.status_mut().dropped > 100);
    assert!(seen.iter().all(|n| *n > 200), "{seen:?}");
    // what waits longer than 100 ms after its measurement is not sent any more
    let mut line = Line::<1>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
    line.sender.scan(ms(1000), &shadows.next()).unwrap();
    assert_eq!(line.sender.deadline(), Some(ms(1100)));
    (1000..1004).for_each(|now| assert!(line.pass(ms(now))));
    assert!(!line.sender.idle());
    let maps = line.frames.len();
    while line.pass(ms(1101 + (line.frames.len() - maps) as u64)) {}
    let late = &line.frames[maps..];
    assert!(late.iter().all(|frame| frame.id.raw() % 32 < 2), "no frame of a map: {late:?}");
    assert!(line.sender.idle() && line.sender.status_mut().dropped > 0);
}

/// Scan numbers come again after 5.12 s. Were late frames enough to keep a session's maps shown, the last map
/// that came in time would be shown once more then.
#[test]
fn late_frames_keep_no_map_until_its_number_comes_again() {
    let medium = Medium::Can(Addresses::STANDARD);
    let mut line = Line::<1>::new(medium, BroadcastConfig::new(SENSOR, medium));
    let mut shadows = Shadows::new(6);
    let mut under_way = VecDeque::new();
    let visible = |line: &Line<1>, now| {
        let rays = line.received(Plane::Visibility, now);
        rays.iter().map(|ray| ray.bits().count()).sum::<u32>()
    };
    let mut late = 0;
    for now in 0..7350 {
        if now % 67 == 0 {
            let _ = line.sender.scan(ms(now), &shadows.next());
        }
        if now < 2000 {
            line.pass(ms(now));
            continue;
        }
        // from here on everything is under way for 200 ms, twice what it may be
        under_way.extend(line.sender.next_frame(ms(now)).map(|frame| (now + 200, frame)));
        while let Some((_, frame)) = under_way.front().copied().filter(|(due, _)| *due <= now) {
            under_way.pop_front();
            late += u32::from(line.receiver.frame(ms(now), &frame) == Err(Refused::Late));
        }
        let shown = visible(&line, ms(now));
        assert!(if now == 2000 { shown > 1000 } else { now < 2300 || shown == 0 }, "{shown} cells at {now} ms");
    }
    assert!(late > 500, "{late}");
}

#[test]
fn after_a_change_the_epoch_is_new_and_nothing_is_sent_for_age_and_delay() {
    let mut line = Line::<1>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
    let map = Shadows::new(2).next();
    assert_eq!(line.sender.scan(ms(399), &map), Err(NotSent::Quiet));
    assert_eq!(line.sender.scan(ms(400), &map), Ok(()));
    assert_eq!(line.sender.scan(ms(419), &map), Err(NotSent::TooSoon));
    line.sender.restart(header(8), ms(500)).unwrap();
    assert!(line.sender.idle() && line.sender.epoch() == Epoch::new(4));
    assert_eq!(line.sender.scan(ms(899), &map), Err(NotSent::Quiet));
    assert_eq!(line.sender.scan(ms(900), &map), Ok(()));
    assert_eq!(line.sender.scan(ms(799), &map), Err(NotSent::Quiet), "the clock stepped back");
    assert_eq!((line.sender.epoch(), line.sender.scan(ms(1199), &map)), (Epoch::new(5), Ok(())));
}

#[test]
fn a_map_that_was_measured_a_little_before_the_last_one_is_left_out_without_a_new_epoch() {
    let mut line = Line::<1>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
    let map = Shadows::new(2).next();
    assert_eq!(line.sender.scan(ms(900), &map), Ok(()));
    // as far back as a map may be old when it is taken
    for measured in [899, 880, 840, 800] {
        assert_eq!(line.sender.scan(ms(measured), &map), Err(NotSent::TooSoon), "{measured}");
    }
    assert_eq!((line.sender.scan(ms(920), &map), line.sender.epoch()), (Ok(()), Epoch::new(3)));
    assert_eq!((line.sender.scan(ms(819), &map), line.sender.epoch()), (Err(NotSent::Quiet), Epoch::new(4)));
}

/// All cells are known and visible.
struct Clear;

impl Planes<W> for Clear {
    fn ray(&self, _: Plane, _: usize) -> Ray<W> {
        Ray::new(Known::new(0, R), Bits::span(0, R))
    }
}

#[test]
fn places_farther_than_maps_reach_are_unknown_whatever_the_header_says() {
    let mut line = Line::<1>::new(MEDIA[1], BroadcastConfig::new(SENSOR, MEDIA[1]));
    line.sender.restart(Header { cell_cm: 3000, ..header(7) }, ms(0)).unwrap();
    for now in 0..2000 {
        if now % 60 == 0 {
            let _ = line.sender.scan(ms(now), &Clear);
        }
        line.pass(ms(now));
    }
    let map = line.receiver.map(SENSOR, ms(2000));
    let answers = [30_000, 44_000, 45_000, 100_000, 150_000].map(|x| query::point(&map, RoadPoint::new(x, 0)));
    assert!(map.cell(A / 2, 40).visible());
    assert_eq!(answers[2..], [Answer::Unknown; 3]);
    assert!(answers[..2].iter().all(|answer| *answer > Answer::Invisible), "{answers:?}");
}

#[test]
fn limits_beyond_what_a_sender_may_say_do_not_make_old_cells_new() {
    for limits in [
        ReceiverLimits { max_age_us: 2_500_000, max_delay_us: 100_000 },
        ReceiverLimits { max_age_us: u32::MAX, max_delay_us: u32::MAX },
    ] {
        let mut line = Line::<2>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
        line.receiver = Receiver::new([1, SENSOR], addresses(MEDIA[0]), limits);
        let mut shadows = Shadows::new(4);
        for now in 0..10_000 {
            if now % 60 == 0 {
                let _ = line.sender.scan(ms(now), &shadows.next());
            }
            // from 4 s on everything is heard but the first plane
            if let Some(frame) = line.sender.next_frame(ms(now)) {
                let message = Received::from_frame(&frame, &addresses(MEDIA[0])).unwrap();
                let first = matches!(message.message, Message::Map(Plane::Visibility, _));
                if now < 4000 || !first {
                    let _ = line.receiver.frame(ms(now), &frame);
                }
            }
            let condition = line.receiver.sensor(SENSOR).unwrap().condition(ms(now), &limits);
            assert!(now < 3500 || condition == SenderCondition::Ok, "{condition:?} at {now} ms");
            let shown = line.receiver.map(SENSOR, ms(now)).scan(0).is_some();
            assert!(if shown { now < 5000 } else { !(3500..4500).contains(&now) }, "at {now} ms");
        }
    }
}

/// Mailboxes that send by identifier: of a whole map the first words come before all second ones.
#[test]
fn words_in_the_order_of_their_identifiers_bring_the_same_maps() {
    let mut line = Line::<1>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
    let (mut shadows, mut waiting) = (Shadows::new(4), Vec::new());
    for scan in 0..60 {
        let map = shadows.next();
        let _ = line.sender.scan(ms(67 * scan), &map);
        waiting.extend((67 * scan..67 * scan + 66).filter_map(|now| line.sender.next_frame(ms(now))));
        waiting.sort_by_key(|frame| frame.id.raw());
        waiting.drain(..).for_each(|frame| _ = line.receiver.frame(ms(67 * scan + 66), &frame));
        if scan > 20 {
            let received = line.received(Plane::Visibility, ms(67 * scan + 66));
            assert_eq!(received, map.0, "scan {scan}");
        }
    }
}

#[test]
fn a_clock_that_steps_back_between_looks_tells_nothing_until_a_new_session() {
    let mut line = Line::<1>::new(MEDIA[1], BroadcastConfig::new(SENSOR, MEDIA[1]));
    let map = Shadows::new(2).next();
    for now in 0..2000 {
        if now % 67 == 0 {
            let _ = line.sender.scan(ms(now), &map);
        }
        line.pass(ms(now));
    }
    let shown = |line: &Line<1>, now| line.received(Plane::Visibility, ms(now)).iter().any(|ray| !ray.known.is_empty());
    assert!(shown(&line, 2000) && shown(&line, 1985), "a look may be handed in a little later than it was");
    // the cable is pulled, the clock is set back, and its old time comes once more
    assert!(!shown(&line, 1500) && !shown(&line, 2001));
    assert_eq!(
        line.receiver.sensor(SENSOR).unwrap().condition(ms(2001), &ReceiverLimits::DEFAULT),
        SenderCondition::Waiting
    );
}

#[test]
fn a_header_whose_check_fails_changes_nothing() {
    let mut line = Line::<1>::new(MEDIA[2], BroadcastConfig::new(SENSOR, MEDIA[2]));
    let map = Shadows::new(2).next();
    for now in 0..2000 {
        if now % 67 == 0 {
            let _ = line.sender.scan(ms(now), &map);
        }
        line.pass(ms(now));
    }
    let clock = viewshed::wire::header::Clock { time_ms: 9_000_000, synchronised: false };
    let (mut own, length) = header(7).emit(&clock);
    own[10] ^= 1;
    let packet =
        viewshed::wire::message::Packet::new(Packing::Long, SENSOR, Message::Header, Epoch::new(3), &own[..length])
            .protect(0, None);
    let outcome = line.receiver.message(ms(2000), packet.bytes());
    assert_eq!(outcome, Err(Refused::NotAHeader(viewshed::wire::header::NotAHeader::Check)));
    assert_eq!(line.received(Plane::Visibility, ms(2000)), map.0, "neither a conflict nor a clock");
}

#[test]
fn a_clock_that_steps_back_while_the_sender_is_quiet_begins_a_new_epoch() {
    let start = ms(100_000);
    let mut sender =
        Broadcaster::<A, W>::new(BroadcastConfig::new(SENSOR, MEDIA[0]), header(1), Epoch::new(3), start).unwrap();
    let map = Shadows::new(2).next();
    assert_eq!(sender.scan(ms(100_100), &map), Err(NotSent::Quiet));
    assert_eq!((sender.scan(ms(90_000), &map), sender.epoch()), (Err(NotSent::Quiet), Epoch::new(4)));
    assert_eq!(sender.scan(ms(90_399), &map), Err(NotSent::Quiet));
    assert_eq!((sender.scan(ms(90_400), &map), sender.epoch()), (Ok(()), Epoch::new(4)));
}

#[test]
fn on_another_clock_a_sender_is_quiet_again_and_its_uptime_begins_anew() {
    let mut sender =
        Broadcaster::<A, W>::new(BroadcastConfig::new(SENSOR, MEDIA[0]), header(1), Epoch::new(3), ms(0)).unwrap();
    let map = Shadows::new(2).next();
    assert_eq!(sender.scan(ms(3000), &map), Ok(()));
    sender.start_over(ms(100_000));
    assert_eq!((sender.epoch(), sender.scan(ms(100_399), &map)), (Epoch::new(4), Err(NotSent::Quiet)));
    assert_eq!((sender.scan(ms(100_400), &map), sender.epoch()), (Ok(()), Epoch::new(4)));
    (100_400..102_400).for_each(|now| _ = sender.next_frame(ms(now)));
    assert!(sender.status_mut().uptime_s <= 2, "{}", sender.status_mut().uptime_s);
}

#[test]
fn an_unknown_version_and_a_larger_map_are_reported_and_unknown() {
    let mut line = Line::<1>::new(MEDIA[2], BroadcastConfig::new(SENSOR, MEDIA[2]));
    let mut small = Receiver::<1, 20, W>::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let map = Shadows::new(2).next();
    for now in 0..2000 {
        if now % 67 == 0 {
            let _ = line.sender.scan(ms(now), &map);
        }
        let Some(packet) = line.sender.next_packet(ms(now)) else { continue };
        let outcome = small.message(ms(now), packet.bytes());
        assert!(!matches!(outcome, Ok(Accepted::Map { .. })));
        // the same, as a later version would send it
        let mut own = packet.bytes()[6..].to_vec();
        if packet.message == Message::Header {
            own[0] = own[0] & 0xF0 | 2;
        }
        let later = viewshed::wire::message::Packet::new(packet.packing, SENSOR, packet.message, Epoch::new(3), &own);
        let later = later.protect(packet.bytes()[2], None);
        let _ = line.receiver.message(ms(now), later.bytes());
    }
    let (now, limits) = (ms(2000), ReceiverLimits::DEFAULT);
    assert_eq!(small.sensor(SENSOR).unwrap().condition(now, &limits), SenderCondition::Unusable);
    assert_eq!(line.receiver.sensor(SENSOR).unwrap().condition(now, &limits), SenderCondition::Unusable);
    assert_eq!(line.receiver.sensor(1).unwrap().condition(now, &limits), SenderCondition::Waiting);
    assert_eq!(query::point(&line.receiver.together(now), RoadPoint::new(4100, 10)), Answer::Unknown);
    assert!(line.receiver.sensor(SENSOR).unwrap().counters().malformed > 0);
}

#[test]
fn two_senders_with_one_number_are_a_conflict() {
    conflict(Epoch::new(8));
}

#[test]
fn and_so_they_are_with_one_epoch_if_their_headers_differ() {
    conflict(Epoch::new(3));
}

fn conflict(others: Epoch) {
    let mut line = Line::<1>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
    let mut other = Broadcaster::<A, W>::new(BroadcastConfig::new(SENSOR, MEDIA[0]), header(9), others, ms(0)).unwrap();
    let map = Shadows::new(2).next();
    for now in 0..8000 {
        if now % 67 == 0 {
            let _ = line.sender.scan(ms(now), &map);
        }
        if now % 67 == 30 {
            let _ = other.scan(ms(now), &map);
        }
        line.pass(ms(now));
        let between = now > 2000 && now < 4000;
        if let Some(frame) = other.next_frame(ms(now)).filter(|_| between) {
            let _ = line.receiver.frame(ms(now), &frame);
        }
        let condition = line.receiver.sensor(SENSOR).unwrap().condition(ms(now), &ReceiverLimits::DEFAULT);
        let visible = line.received(Plane::Visibility, ms(now)).iter().any(|ray| !ray.known.is_empty());
        match now {
            1500..2000 | 7500.. => assert!(visible && condition == SenderCondition::Ok, "{now}"),
            2600..4000 => assert!(!visible && condition == SenderCondition::Conflict, "{now}"),
            _ => {}
        }
    }
}

/// All cells are known, and none is visible.
struct Dark;

impl Planes<W> for Dark {
    fn ray(&self, _: Plane, _: usize) -> Ray<W> {
        Ray::new(Known::new(0, R), Bits::NONE)
    }
}

#[test]
fn of_two_senders_with_one_epoch_and_one_header_the_one_whose_clock_is_ahead_is_shown() {
    // the second sender begins after 2 s, its clock so much after or before the first one's
    for (other_ms, ahead) in [(9000, true), (7000, false)] {
        let mut line = Line::<1>::new(MEDIA[0], BroadcastConfig::new(SENSOR, MEDIA[0]));
        let config = BroadcastConfig::new(SENSOR, MEDIA[0]);
        line.sender = Broadcaster::new(config, header(7), Epoch::new(3), ms(8000)).unwrap();
        let mut other = Broadcaster::<A, W>::new(config, header(7), Epoch::new(3), ms(other_ms + 2000)).unwrap();
        let map = Shadows::new(2).next();
        let mut shown = [0; 2];
        for now in 0..6000 {
            if now % 67 == 0 {
                let _ = line.sender.scan(ms(8000 + now), &map);
            }
            if now % 67 == 30 && now >= 2000 {
                let _ = other.scan(ms(other_ms + now), &Dark);
            }
            if let Some(frame) = line.sender.next_frame(ms(8000 + now)) {
                let _ = line.receiver.frame(ms(now), &frame);
            }
            if let Some(frame) = other.next_frame(ms(other_ms + now)).filter(|_| now >= 2000) {
                let _ = line.receiver.frame(ms(now), &frame);
            }
            let condition = line.receiver.sensor(SENSOR).unwrap().condition(ms(now), &ReceiverLimits::DEFAULT);
            assert!(condition != SenderCondition::Conflict, "nothing contradicts");
            let rays = line.received(Plane::Visibility, ms(now));
            let dark: Ray<W> = Dark.ray(Plane::Visibility, 0);
            let of_other = rays.iter().filter(|ray| **ray == dark).count();
            let of_first = rays.iter().filter(|ray| **ray != dark && !ray.known.is_empty()).count();
            assert!(of_other == 0 || of_first == 0, "never both, {now}");
            if now > 3500 {
                shown[0] += usize::from(of_first > 0);
                shown[1] += usize::from(of_other > 0);
            }
        }
        assert!(shown[usize::from(ahead)] > 2300 && shown[usize::from(!ahead)] == 0, "{shown:?}");
    }
}

#[cfg(feature = "secoc")]
#[test]
fn secured_messages_need_their_key_and_bring_the_same_maps() {
    use viewshed::wire::secoc::{Opener, Sealer};
    const KEY: [u8; 16] = [7; 16];
    for medium in [MEDIA[1], MEDIA[2]] {
        let config = BroadcastConfig { secured: true, ..BroadcastConfig::new(SENSOR, medium) };
        let mut sender = Broadcaster::<A, W>::new(config, header(7), Epoch::new(3), ms(0)).unwrap();
        let (mut sealer, mut opener) = (Sealer::new(KEY, 1000), Opener::new(KEY));
        let mut receiver = Receiver::<1, A, W>::new([SENSOR], addresses(medium), ReceiverLimits::DEFAULT);
        let mut keyless = receiver.clone();
        let mut shadows = Shadows::new(4);
        for scan in 0..100 {
            let map = shadows.next();
            let _ = sender.scan(ms(67 * scan), &map);
            for now in 67 * scan..67 * scan + 66 {
                assert!(sender.next_packet(ms(now)).is_none(), "never without its seal");
                let Some(packet) = sender.next_sealed(ms(now), &mut sealer) else { continue };
                assert_eq!(keyless.message(ms(now), packet.bytes()), Err(Refused::Sealed));
                // before the first freshness message nothing can be opened
                if let Ok(opened) = opener.open(&Received::from_bytes(packet.bytes()).unwrap()) {
                    let _ = receiver.checked(ms(now), &opened);
                }
            }
            if scan > 20 {
                let received = receiver.map(SENSOR, ms(67 * scan + 66));
                (0..A).for_each(|a| assert_eq!(received.ray(Plane::Visibility, a), map.0[a], "{medium:?} {scan}"));
            }
        }
    }
}
