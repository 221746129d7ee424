//! What a receiver makes of a bus that loses frames.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::Serialize;
use viewshed::fixed::time::Time;
use viewshed::wire::broadcast::Medium;
use viewshed::wire::message::{Addresses, Plane};
use viewshed::wire::receive::ReceiverLimits;
use viewshed::wire::serial::Unstuffer;

use super::ears::{Ears, Key};
use super::traffic::{A, Maps, Traffic, W};

/// Shares of frames lost.
pub const LOSSES: [f64; 4] = [0.0, 0.01, 0.05, 0.2];

/// Time a receiver is given to settle, microseconds.
const SETTLING_US: u64 = 1_500_000;

/// What arrived at one rate of loss.
#[derive(Debug, Clone, Serialize)]
pub struct Arrived {
    pub name: &'static str,
    /// Share of frames lost.
    pub loss: f64,
    /// Scans compared, each when the next one was measured.
    pub scans: usize,
    /// Share of the sender's visible cells reported visible: median and lowest twentieth of the scans that have any;
    /// none where no scan has.
    pub visible_median: Option<f64>,
    pub visible_p05: Option<f64>,
    /// Share of scans in which every cell is the same; none where none was compared.
    pub equal: Option<f64>,
    /// Cells reported visible that no scan of the last A + D had visible, in all.
    pub wrongly_visible: u64,
}

impl Arrived {
    /// Feeds what was sent into a receiver and compares after every scan.
    pub fn new(maps: &Maps, traffic: &Traffic, loss: f64, sensor: u8, key: Option<&Key>) -> Self {
        let addresses = match traffic.bus.medium {
            Medium::Can(addresses) | Medium::CanFd(addresses) => addresses,
            Medium::Serial => Addresses::STANDARD,
        };
        let mut ears = Ears::<1, A, W, 1>::new([sensor], addresses, ReceiverLimits::DEFAULT, key);
        let mut unstuffer = Unstuffer::new();
        let mut random = Pcg64::seed_from_u64(1);
        let (mut shares, mut scans, mut equal, mut wrongly_visible) = (Vec::new(), 0, 0_usize, 0);
        let settled = maps.scans.first().map_or(0, |scan| scan.measured.micros()) + SETTLING_US;
        let mut sent = traffic.sent.iter().peekable();
        for (k, scan) in maps.scans.iter().enumerate() {
            while let Some(one) = sent.next_if(|one| one.scans <= k + 1) {
                if (f64::from(random.next_u32()) + 0.5) / 4_294_967_296.0 < loss {
                    continue;
                }
                let at = Time::from_micros(one.at.micros() + (one.duration_s * 1e6) as u64);
                match &one.frame {
                    Some(frame) => drop(ears.frame(at, frame).is_ok()),
                    None => {
                        if let (_, Some(message)) = unstuffer.push(&one.bytes) {
                            let _ = ears.message(at, message);
                        }
                    }
                }
            }
            let Some(next) = maps.scans.get(k + 1).filter(|_| scan.measured.micros() >= settled) else { continue };
            let map = ears.receiver().map(sensor, next.measured);
            let (mut visible, mut arrived, mut same) = (0, 0, true);
            for (azimuth, ray) in scan.rays.iter().enumerate() {
                let received = map.ray(Plane::Visibility, azimuth);
                visible += ray.bits().count();
                arrived += ray.bits().and(received.bits()).count();
                same &= received == *ray;
                let lately = maps.scans[..=k].iter().rev();
                let lately = lately.take_while(|s| next.measured.since(s.measured).is_some_and(|us| us <= 400_000));
                let ever = lately.fold([0; W], |mut all, s| {
                    all.iter_mut().zip(s.rays[azimuth].bits().words()).for_each(|(a, b)| *a |= b);
                    all
                });
                let words = received.bits().words().iter().zip(ever);
                wrongly_visible += words.map(|(r, e)| u64::from((r & !e).count_ones())).sum::<u64>();
            }
            scans += 1;
            equal += usize::from(same);
            if visible > 0 {
                shares.push(f64::from(arrived) / f64::from(visible));
            }
        }
        shares.sort_by(f64::total_cmp);
        let at = |share: f64| shares.get((shares.len() as f64 * share) as usize).copied();
        Self {
            name: traffic.bus.name,
            loss,
            scans,
            visible_median: at(0.5),
            visible_p05: at(0.05),
            equal: (scans > 0).then(|| equal as f64 / scans as f64),
            wrongly_visible,
        }
    }
}

#[cfg(test)]
mod tests {
    use viewshed::fixed::bits::Bits;
    use viewshed::wire::code::ray::{Known, Ray};

    use super::super::traffic::{BUSES, Scan};
    use viewshed::wire::status::{Reason, UnitState};

    use super::*;
    use crate::estimators::Options;
    use crate::evaluation::samples::made_up::recording;

    #[test]
    fn maps_without_a_visible_cell_have_no_share_of_them_and_are_compared_all_the_same() {
        let like = Maps::new(&recording(3, 1), &Options::default(), None, &|| ()).unwrap();
        let scan = |k: u64| Scan {
            measured: Time::from_micros(500_000 + k * 66_667),
            rays: vec![Ray::new(Known::new(3, 100), Bits::NONE); A],
            probable: Vec::new(),
            state: (UnitState::Ok, Reason::None),
        };
        let arrived = |count: u64| {
            let scans = (0..count).map(scan).collect();
            let maps = Maps { estimator: String::new(), header: like.header, scans, holes: 0 };
            let traffic = Traffic::new(&maps, BUSES[0], None, 0, None).unwrap();
            Arrived::new(&maps, &traffic, 0.0, 0, None)
        };
        let all = arrived(60);
        assert_eq!((all.visible_median, all.visible_p05, all.equal), (None, None, Some(1.0)));
        // those from 1.5 s on that have a next one
        assert_eq!(all.scans, 60 - 23 - 1);
        assert_eq!(arrived(20).equal, None);
    }
}
