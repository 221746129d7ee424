//! A sender's authenticated messages lost, repeated, delayed and changed: each counts at most once, in its order,
//! and none that was changed.

use std::sync::OnceLock;

use viewshed::fixed::angle::Angle;
use viewshed::fixed::bits::Bits;
use viewshed::fixed::time::Time;
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::e2e::Profile;
use viewshed::wire::header::{Header, WireMount};
use viewshed::wire::message::{Addresses, Epoch, Message, NotAuthentic, Plane, data_id};
use viewshed::wire::planes::Planes;
use viewshed::wire::receive::{ReceiverLimits, Refused, SecuredReceiver};
use viewshed::wire::secoc::Sealer;

const SENSOR: u8 = 1;
const KEY: [u8; 16] = [0x5A; 16];

struct Map(u32);

impl Planes<1> for Map {
    fn ray(&self, _: Plane, azimuth: usize) -> Ray<1> {
        Ray::new(Known::new(2, 30), Bits::from_words([self.0.rotate_left(azimuth as u32)]))
    }
}

/// What a sender sends in some seconds, with the freshness value of each message.
fn sent() -> &'static [(Vec<u8>, u64)] {
    static SENT: OnceLock<Vec<(Vec<u8>, u64)>> = OnceLock::new();
    SENT.get_or_init(|| {
        let angle = Angle::from_raw(0);
        let header = Header {
            mount: WireMount { origin: RoadPoint::new(0, 0), height_cm: 500, yaw: angle, pitch: angle, roll: angle },
            azimuth_origin: angle,
            azimuth_span: 900,
            narrow: viewshed::map::azimuths::Narrow::NONE,
            azimuths: 8,
            cell_cm: 100,
            ranges: 32,
            usual: Known::new(2, 30),
            planes: 1,
            fingerprint: 0,
            probability: None,
        };
        let config = BroadcastConfig { secured: true, ..BroadcastConfig::new(SENSOR, Medium::Serial) };
        let mut sender = Broadcaster::<8, 1>::new(config, header, Epoch::new(1), Time::from_micros(0)).unwrap();
        // over the edge of the sixteen bits
        let mut sealer = Sealer::new(KEY, 0x7FFF0);
        let mut all = Vec::new();
        for ms in 0..8000 {
            let now = Time::from_micros(1000 * ms);
            if ms % 100 == 0 {
                let _ = sender.scan(now, &Map((ms as u32).wrapping_mul(0x9E37_79B9)));
            }
            if let Some(packet) = sender.next_sealed(now, &mut sealer) {
                all.push((packet.bytes().to_vec(), sealer.freshness()));
            }
        }
        all
    })
}

/// One input: of every four bytes which message, what happens to it, where and how it is changed.
pub fn run(bytes: &[u8]) {
    let sent = sent();
    let mut receiver =
        SecuredReceiver::<[u8; 16], 1, 8, 1>::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT, &KEY);
    let (mut next, mut now_ms) = (0, 0);
    for four in bytes.chunks_exact(4) {
        let [step, what, place, change] = [four[0], four[1], four[2], four[3]];
        // mostly on, now and then back; the receiver starts anew with what it knew, or without
        next = if step < 224 { next + usize::from(step % 8) } else { next.saturating_sub(usize::from(step)) };
        let Some((message, freshness)) = sent.get(next) else { break };
        now_ms += u64::from(what >> 2);
        let known = receiver.freshness(SENSOR);
        if what & 3 == 3 && change == 0 {
            receiver = SecuredReceiver::new([SENSOR], Addresses::STANDARD, ReceiverLimits::DEFAULT, &KEY);
            known.into_iter().for_each(|last| receiver.resume(SENSOR, last));
        }
        let mut message = message.clone();
        let at = usize::from(place) % message.len();
        if what & 1 == 1 {
            message[at] ^= change;
            if let Some(named) = Message::from_number(message[3]) {
                let id = data_id(message[4], named);
                Profile::P05.protect(&mut message, id, change);
            }
        }
        // check sum and counter are not the authenticator's business
        let changed = what & 1 == 1 && change != 0 && at >= 3;
        match receiver.message(Time::from_micros(1000 * now_ms), &message) {
            Err(Refused::NotAMessage(_)) => assert!(changed && receiver.freshness(SENSOR) == known),
            Err(Refused::NotAuthentic(why)) => {
                assert_eq!(receiver.freshness(SENSOR), known);
                let fresh = message[3] == 3;
                let old = known.is_some_and(|last| *freshness <= last || *freshness > last + 0x1_0000);
                assert!(
                    changed || old || (why == NotAuthentic::NoFreshness && !fresh),
                    "{why:?} {freshness} {known:?}"
                );
            }
            _ => {
                assert!(!changed && known.is_none_or(|last| *freshness > last));
                assert_eq!(receiver.freshness(SENSOR), Some(*freshness));
            }
        }
    }
}
