//! Any frames whose check sums are right, from any senders at any time: nothing is told that was not said.

use viewshed::fixed::time::Time;
use viewshed::map::VisibilityMap;
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::frame::{CanFrame, CanId};
use viewshed::wire::message::{Addresses, Message, Packing, Plane, data_id};
use viewshed::wire::receive::{Receiver, ReceiverLimits};

/// One input.
pub fn run(bytes: &[u8]) {
    let mut receiver = Receiver::<2, 32, 4, 2>::new([0, 1], Addresses::STANDARD, ReceiverLimits::DEFAULT);
    let mut now_us = 10_000_000_u64;
    let mut rest = bytes;
    while let [kind, wait, length, more @ ..] = rest {
        // up to 250 ms, now and then a step back or seconds
        now_us = match wait {
            255 => now_us.saturating_sub(3_000_000),
            254 => now_us + 3_000_000,
            _ => now_us + 1000 * u64::from(*wait),
        };
        let now = Time::from_micros(now_us);
        let long = kind & 0x80 != 0;
        let length = if long { 7 + usize::from(*length) % 57 } else { 8 };
        let Some((data, left)) = more.split_at_checked(length) else { break };
        rest = left;
        let (number, sensor) = (kind & 31, kind >> 5 & 1);
        let Some(message) = Message::from_number(number) else { continue };
        let id = CanId::Standard(0x400 + 32 * u16::from(sensor) + u16::from(number));
        let mut data = data.to_vec();
        let packing = if long { Packing::Long } else { Packing::Classic };
        if long {
            (data[3], data[4]) = (number, sensor);
            data[5] &= 0x83;
            data.resize(viewshed::wire::frame::fd_length(data.len()).unwrap_or(64), 0);
        } else {
            data[1] &= 0x3F;
        }
        // most headers are of the version there is
        let own = if long { 6 } else { 2 };
        if message == Message::Header && data[own] & 0x0F < 12 {
            data[own] = data[own] & 0xF0 | 1;
        }
        packing.profile().protect(&mut data, data_id(sensor, message), 3);
        let frame = if long { CanFrame::fd(id, &data) } else { CanFrame::classic(id, &data) };
        let Some(frame) = frame else { continue };
        let _ = receiver.frame(now, &frame);
        for sensor in [0, 1] {
            let map = receiver.map(sensor, now);
            let Some(header) = map.header() else { continue };
            assert!(usize::from(header.azimuths) <= 32 && header.ranges <= 128);
            for azimuth in 0..32 {
                let ray = map.ray(Plane::Visibility, azimuth);
                assert!(ray.known.end() <= 128 && ray.bits().iter().all(|cell| ray.known.contains(cell)));
                // only where something is known, and never more than the greatest level
                let most = header.probability.map(|levels| levels.of(true, true));
                for range in [ray.known.near(), ray.known.end().saturating_sub(1), 127] {
                    let p = map.probability(azimuth, range);
                    assert!(p.is_none() || ray.known.contains(range) && p <= most);
                }
            }
        }
        let _ = receiver.together(now).at(RoadPoint::new(1000, 100));
    }
}
