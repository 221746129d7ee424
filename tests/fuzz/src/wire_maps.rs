//! Any maps, one after another, from a sender to a receiver: what was sent whole comes back.

use viewshed::fixed::angle::Angle;
use viewshed::fixed::bits::Bits;
use viewshed::fixed::time::Time;
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::header::{Header, WireMount};
use viewshed::wire::message::{Addresses, Epoch, Plane};
use viewshed::wire::planes::Planes;
use viewshed::wire::receive::{Receiver, ReceiverLimits};

const A: usize = 9;
const W: usize = 2;

struct Map([Ray<W>; A]);

impl Planes<W> for Map {
    fn ray(&self, _: Plane, azimuth: usize) -> Ray<W> {
        self.0.get(azimuth).copied().unwrap_or(Ray::UNKNOWN)
    }
}

/// Changes a map: which azimuth, what limits, which bits.
fn change(map: &mut Map, b: &[u8]) {
    let ray = &mut map.0[usize::from(b[0]) % A];
    let known =
        if b[1] & 0x80 == 0 { ray.known } else { Known::new(usize::from(b[1] & 63), usize::from(b[2] & 63) + 1) };
    let mut words = *ray.bits().words();
    words[usize::from(b[2] >> 7)] ^= u32::from_be_bytes([b[3], b[4], b[5], b[6]]);
    *ray = Ray::new(known, Bits::from_words(words));
}

/// One input.
pub fn run(bytes: &[u8]) {
    let Some((medium, changes)) = bytes.split_first() else { return };
    let medium = if medium & 1 == 0 { Medium::Can(Addresses::STANDARD) } else { Medium::CanFd(Addresses::STANDARD) };
    let angle = Angle::from_raw(0);
    let header = Header {
        mount: WireMount { origin: RoadPoint::new(0, 0), height_cm: 500, yaw: angle, pitch: angle, roll: angle },
        azimuth_origin: angle,
        azimuth_span: 900,
        narrow: viewshed::map::azimuths::Narrow::NONE,
        azimuths: A as u8,
        cell_cm: 100,
        ranges: 64,
        usual: Known::new(3, 64),
        planes: 1,
        fingerprint: 0,
        probability: None,
    };
    let config = BroadcastConfig { gap_us: 0, ..BroadcastConfig::new(0, medium) };
    let mut sender = Broadcaster::<A, W>::new(config, header, Epoch::new(1), Time::from_micros(0)).unwrap();
    let mut receiver = Receiver::<1, A, W>::new([0], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let mut map = Map([Ray::clear(header.usual); A]);
    let mut changes = changes.chunks_exact(7);
    for scan in 0..50_u64 {
        let now = Time::from_micros(67_000 * scan);
        // a while to settle, then everything the input has to say
        if scan > 20 {
            changes.by_ref().take(3).for_each(|b| change(&mut map, b));
        }
        let _ = sender.scan(now, &map);
        for ms in 0..60 {
            let now = Time::from_micros(67_000 * scan + 1000 * ms);
            while let Some(frame) = sender.next_frame(now) {
                let _ = receiver.frame(now, &frame);
            }
        }
        if scan > 20 {
            assert!(sender.idle());
            let received = receiver.map(0, Time::from_micros(67_000 * scan + 60_000));
            for azimuth in 0..A {
                assert_eq!(received.ray(Plane::Visibility, azimuth), map.0[azimuth]);
            }
        }
    }
}
