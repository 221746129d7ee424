//! Authenticated messages: other keys, repeated and forged messages, restarts of either side.

use crate::shadows::{A, Map, Random, Shadows, W, header};
use viewshed::fixed::time::Time;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::e2e::Profile;
use viewshed::wire::message::{Addresses, Epoch, Message, NotAuthentic, Packet, Plane, data_id};
use viewshed::wire::receive::{Counters, Receiver, ReceiverLimits, Refused, SecuredReceiver, SenderCondition};
use viewshed::wire::secoc::Sealer;

type Secured = SecuredReceiver<[u8; 16], 1, A, W>;

const SENSOR: u8 = 5;
const KEY: [u8; 16] = *b"a key of 16 byte";
const MEDIA: [Medium; 2] = [Medium::CanFd(Addresses::STANDARD), Medium::Serial];
/// Milliseconds between scans.
const PERIOD: u64 = 67;

fn ms(ms: u64) -> Time {
    Time::from_micros(ms * 1000)
}

/// A sender with its key, its maps and its clock.
struct Sender {
    broadcaster: Broadcaster<A, W>,
    sealer: Sealer<[u8; 16]>,
    shadows: Shadows,
    map: Map,
}

impl Sender {
    fn new(medium: Medium, key: [u8; 16], freshness: u64, epoch: u8, start: u64) -> Self {
        let config = BroadcastConfig { secured: true, ..BroadcastConfig::new(SENSOR, medium) };
        Self {
            broadcaster: Broadcaster::new(config, header(7), Epoch::new(epoch), ms(start)).unwrap(),
            sealer: Sealer::new(key, freshness),
            shadows: Shadows::new(4),
            map: Map(Vec::new()),
        }
    }

    /// What is sent in a millisecond.
    fn send(&mut self, now: u64) -> Option<Packet> {
        if now.is_multiple_of(PERIOD) {
            self.map = self.shadows.next();
            let _ = self.broadcaster.scan(ms(now), &self.map);
        }
        self.broadcaster.next_sealed(ms(now), &mut self.sealer)
    }
}

fn receiver() -> Secured {
    Secured::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT, &KEY)
}

/// As the medium carries it.
fn deliver(receiver: &mut Secured, medium: Medium, now: u64, packet: &Packet) -> Option<Refused> {
    match medium {
        Medium::Serial => receiver.message(ms(now), packet.bytes()).err(),
        _ => receiver.frame(ms(now), &packet.frame(&Addresses::STANDARD).unwrap()).err(),
    }
}

fn counters(receiver: &Secured) -> Counters {
    *receiver.receiver().sensor(SENSOR).unwrap().counters()
}

/// Whether the sender's last map is the receiver's, cell by cell.
fn equal(receiver: &Secured, sender: &Sender, now: u64) -> bool {
    let map = receiver.receiver().map(SENSOR, ms(now));
    map.header().is_some() && (0..A).all(|a| map.ray(Plane::Visibility, a) == sender.map.0[a])
}

/// Whether anything is shown.
fn shows(receiver: &Secured, now: u64) -> bool {
    receiver.receiver().map(SENSOR, ms(now)).header().is_some()
}

#[test]
fn the_right_key_brings_every_cell_of_every_scan() {
    for medium in MEDIA {
        let (mut sender, mut receiver, mut compared) = (Sender::new(medium, KEY, 1 << 20, 3, 0), receiver(), 0);
        for now in 0..20_000 {
            if let Some(packet) = sender.send(now) {
                deliver(&mut receiver, medium, now, &packet);
            }
            if now > 1500 && now % PERIOD == PERIOD - 1 {
                assert!(equal(&receiver, &sender, now), "{medium:?} {now}");
                compared += 1;
            }
        }
        assert!(compared > 270);
        assert_eq!(counters(&receiver).not_authentic, 0, "freshness comes first");
        assert_eq!(receiver.freshness(SENSOR), Some(sender.sealer.freshness()));
    }
}

#[test]
fn another_key_brings_nothing_and_every_message_is_counted() {
    for medium in MEDIA {
        let (mut sender, mut receiver, mut sent) = (Sender::new(medium, [1; 16], 1 << 20, 3, 0), receiver(), 0);
        receiver.resume(SENSOR, 5);
        for now in 0..5000 {
            let Some(packet) = sender.send(now) else { continue };
            sent += 1;
            let refused = deliver(&mut receiver, medium, now, &packet);
            assert_eq!(refused, Some(Refused::NotAuthentic(NotAuthentic::Code)));
            assert!(!shows(&receiver, now));
        }
        assert_eq!((counters(&receiver).not_authentic, counters(&receiver).accepted), (sent, 0));
        assert_eq!(receiver.receiver().sensor(SENSOR).unwrap().epoch(), None, "not even its epoch");
        assert_eq!(receiver.freshness(SENSOR), Some(5));
    }
}

#[test]
fn without_an_authenticator_nothing_is_taken() {
    let medium = MEDIA[0];
    let mut receiver = receiver();
    for medium in [medium, Medium::Can(Addresses::STANDARD)] {
        let mut bare =
            Broadcaster::<A, W>::new(BroadcastConfig::new(SENSOR, medium), header(7), Epoch::new(3), ms(0)).unwrap();
        let (mut shadows, mut sent) = (Shadows::new(4), 0);
        for now in 0..3000 {
            if now % PERIOD == 0 {
                let _ = bare.scan(ms(now), &shadows.next());
            }
            let Some(frame) = bare.next_frame(ms(now)) else { continue };
            sent += 1;
            assert_eq!(receiver.frame(ms(now), &frame), Err(Refused::NotAuthentic(NotAuthentic::Bare)));
        }
        assert!(sent > 50 && !shows(&receiver, 2999));
    }
    // and who has no key leaves authenticated ones alone
    let mut keyless = Receiver::<1, A, W>::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let packet = Sender::new(medium, KEY, 9, 3, 0).send(0).unwrap();
    assert_eq!(keyless.message(ms(0), packet.bytes()), Err(Refused::Sealed));
    assert_eq!(keyless.sensor(SENSOR).unwrap().counters().not_authentic, 1);
}

#[test]
fn repeated_messages_are_counted_and_do_nothing() {
    for medium in MEDIA {
        let (mut sender, mut receiver) = (Sender::new(medium, KEY, 1 << 20, 3, 0), receiver());
        let (mut recorded, mut repeated) = (Vec::new(), 0);
        for now in 0..15_000 {
            if let Some(packet) = sender.send(now) {
                deliver(&mut receiver, medium, now, &packet);
                recorded.push((now, packet));
            }
            // a recorded past again, with the steps of its own time, from a whole period of the scan numbers before
            if now > 7000 {
                let past = recorded.iter().filter(|(sent, _)| sent + 5120 == now);
                for (_, packet) in past {
                    let refused = deliver(&mut receiver, medium, now, packet).unwrap();
                    let old = [NotAuthentic::Old, NotAuthentic::Code].map(Refused::NotAuthentic);
                    assert!(old.contains(&refused), "{refused:?}");
                    repeated += 1;
                }
            }
            if now > 1500 && now % PERIOD == PERIOD - 1 {
                assert!(equal(&receiver, &sender, now), "{medium:?} {now}");
            }
        }
        assert!(repeated > 200);
        assert_eq!(counters(&receiver).not_authentic, repeated);
        assert_eq!(
            receiver.receiver().sensor(SENSOR).unwrap().condition(ms(15_000), &ReceiverLimits::DEFAULT),
            SenderCondition::Ok
        );
    }
}

/// Milliseconds from a restart until maps are shown again and equal.
fn until_equal(
    medium: Medium,
    sender: &mut Sender,
    receiver: &mut Secured,
    from: u64,
    mut see: impl FnMut(u64, &Secured),
) -> u64 {
    for now in from..from + 20_000 {
        if let Some(packet) = sender.send(now) {
            deliver(receiver, medium, now, &packet);
        }
        see(now, receiver);
        if now % PERIOD == PERIOD - 1 && equal(receiver, sender, now) {
            return now - from;
        }
    }
    panic!("never");
}

#[test]
fn a_restarted_sender_is_understood_again_within_a_second() {
    for medium in MEDIA {
        let (mut sender, mut receiver) = (Sender::new(medium, KEY, 1_000_000, 3, 0), receiver());
        until_equal(medium, &mut sender, &mut receiver, 0, |_, _| {});
        // from a clock in microseconds, and by one: kept over the restart
        for (n, freshness) in
            [9_000_000_000, 9_000_100_000, sender.sealer.freshness().max(9_000_200_000)].into_iter().enumerate()
        {
            let start = 10_000 * (n as u64 + 1);
            sender = Sender::new(medium, KEY, freshness, 4 + n as u8, start);
            let mut stale = false;
            let took = until_equal(medium, &mut sender, &mut receiver, start, |now, receiver| {
                stale |= now > start + 400
                    && receiver.receiver().sensor(SENSOR).unwrap().epoch() != Some(Epoch::new(4 + n as u8));
            });
            assert!(took < 1000 && !stale, "{medium:?}: {took} ms");
        }
        // one that begins below what it used is not believed
        sender = Sender::new(medium, KEY, 5, 9, 60_000);
        for now in 60_000..65_000 {
            if let Some(packet) = sender.send(now) {
                assert!(deliver(&mut receiver, medium, now, &packet).is_some());
            }
        }
        assert!(!shows(&receiver, 64_999));
    }
}

#[test]
fn a_restarted_receiver_has_everything_within_a_second() {
    let authentic = |refused: Option<Refused>| !matches!(refused, Some(Refused::NotAuthentic(_)));
    for medium in MEDIA {
        let mut slowest = 0;
        // whatever part of the sender's second it begins in
        for start in (3000..4000).step_by(100) {
            let mut sender = Sender::new(medium, KEY, 77, 3, 0);
            let past: Vec<Packet> = (0..start).filter_map(|now| sender.send(now)).collect();
            let mut receiver = receiver();
            slowest = slowest.max(until_equal(medium, &mut sender, &mut receiver, start, |_, _| {}));
            // with the value it kept it goes on at once, and a recorded past is no use
            let kept = receiver.freshness(SENSOR).unwrap();
            let now = start + 3000;
            let next = (now..).find_map(|now| sender.send(now)).unwrap();
            let mut again = self::receiver();
            again.resume(SENSOR, kept);
            assert!(past.iter().all(|packet| !authentic(deliver(&mut again, medium, now, packet))));
            assert!(authentic(deliver(&mut again, medium, now, &next)));
            assert_eq!(again.freshness(SENSOR), Some(sender.sealer.freshness()));
        }
        // a second for the freshness message, half a second for the header, A + D, and a scan
        // half a second for header and freshness message, A + D, and a scan
        assert!((500..1000).contains(&slowest), "{medium:?}: {slowest} ms");
    }
}

#[test]
fn of_a_hundred_thousand_forged_messages_none_passes_and_all_are_counted() {
    let medium = Medium::Serial;
    let (mut sender, mut receiver) = (Sender::new(medium, KEY, 1 << 20, 3, 0), receiver());
    let begun = until_equal(medium, &mut sender, &mut receiver, 0, |_, _| {});
    let before = counters(&receiver);
    let genuine = (1..).find_map(|k| sender.send(begun + k)).unwrap();
    let mut random = Random::new(3);
    let forgeries = if cfg!(debug_assertions) { 10_000 } else { 100_000 };
    for _ in 0..forgeries {
        // the sender's own bytes with some changed, a random authenticator, and a check sum that is right
        let mut bytes = genuine.bytes().to_vec();
        let own = bytes.len() - 8;
        for _ in 0..=random.below(3) {
            bytes[6 + random.below(own as u64 - 6) as usize] ^= 1 + random.below(255) as u8;
        }
        bytes[own + 2..].iter_mut().for_each(|byte| *byte = random.next() as u8);
        let message = Message::from_number(bytes[3]).unwrap();
        Profile::P05.protect(&mut bytes, data_id(SENSOR, message), random.next() as u8);
        assert_eq!(receiver.message(ms(begun), &bytes), Err(Refused::NotAuthentic(NotAuthentic::Code)));
    }
    let after = counters(&receiver);
    assert_eq!(after, Counters { not_authentic: before.not_authentic + forgeries, ..before });
    assert_eq!(receiver.message(ms(begun), genuine.bytes()).err(), None, "and the sender's is still taken");
}
