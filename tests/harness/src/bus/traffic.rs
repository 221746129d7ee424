//! Everything a sender puts on a bus while a recording runs.

use anyhow::{Result, anyhow, ensure};
use viewshed::fixed::time::Time;
use viewshed::map::polar::PolarMap;
use viewshed::probability::Quantiser;
use viewshed::unit::state_of;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::frame::CanFrame;
use viewshed::wire::header::{Header, fingerprint};
use viewshed::wire::message::{Addresses, Epoch, Plane};
use viewshed::wire::planes::{Planes, Quantised};
use viewshed::wire::secoc::Sealer;
use viewshed::wire::serial::{self, MOST_STUFFED};
use viewshed::wire::status::{Reason, UnitState};

use super::bits;
use super::ears::Key;
use crate::estimators::{self, radar_3d};
use crate::recording::Recording;

/// Azimuths, and words of 32 ranges, of radar-3d's maps.
pub const A: usize = radar_3d::AZIMUTHS;
pub const W: usize = radar_3d::RANGES.div_ceil(32);

/// A bus with its rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bus {
    pub name: &'static str,
    pub medium: Medium,
    /// Bits a second: nominal, and CAN FD's data rate.
    pub rates: [f64; 2],
}

/// The buses of the table.
pub const BUSES: [Bus; 4] = [
    Bus { name: "classic-500k", medium: Medium::Can(Addresses::STANDARD), rates: [500e3; 2] },
    Bus { name: "classic-1M", medium: Medium::Can(Addresses::STANDARD), rates: [1e6; 2] },
    Bus { name: "fd-500k-2M", medium: Medium::CanFd(Addresses::STANDARD), rates: [500e3, 2e6] },
    Bus { name: "serial-230400", medium: Medium::Serial, rates: [230_400.0; 2] },
];

/// The same with authenticated messages, where there is room for them.
pub const AUTHENTICATED: [Bus; 2] =
    [Bus { name: "fd-500k-2M-authenticated", ..BUSES[2] }, Bus { name: "serial-230400-authenticated", ..BUSES[3] }];

/// A scan as it was sent.
#[derive(Debug, Clone)]
pub struct Scan {
    pub measured: Time,
    pub rays: Vec<Ray<W>>,
    /// Those of the plane of probability, where it is sent.
    pub probable: Vec<Ray<W>>,
    /// What a unit says of itself at this scan.
    pub state: (UnitState, Reason),
}

/// The maps of a recording, and what they are of.
pub struct Maps {
    /// The row of `replay`'s table that they are.
    pub estimator: String,
    pub header: Header,
    pub scans: Vec<Scan>,
    /// Unknown cells between known ones; on the wire they are not visible.
    pub holes: u64,
}

impl Maps {
    /// The maps of the recording's [unit](estimators::unit), with a table of probabilities as a unit that has it sends them.
    pub fn new(
        recording: &Recording,
        options: &estimators::Options,
        quantiser: Option<&Quantiser>,
        step: &dyn Fn(),
    ) -> Result<Self> {
        ensure!(
            options.grid.is_reference(),
            "maps on a bus are of the reference grid here: leave out --grid-size; boards with the small grid send theirs"
        );
        let (sensor, config) = estimators::unit(recording, options)?;
        let (mut scans, mut geometry, mut holes) = (Vec::new(), None, 0);
        radar_3d::maps(&recording.frames, &sensor, &config, |measured, map, condition| {
            geometry = Some(*map.geometry());
            let plane = |plane| -> Vec<Ray<W>> {
                let ray = |azimuth| {
                    quantiser.map_or_else(
                        || map.ray(plane, azimuth),
                        |quantiser| Quantised { map, quantiser }.ray(plane, azimuth),
                    )
                };
                (0..A).map(ray).collect()
            };
            let rays = plane(Plane::Visibility);
            holes += holes_of(map, &rays);
            let probable = if quantiser.is_some() { plane(Plane::Grade) } else { Vec::new() };
            let fault = recording.frames.get(scans.len()).is_some_and(|frame| frame.fault);
            scans.push(Scan { measured, rays, probable, state: state_of(condition, fault) });
            step();
        })?;
        let geometry = geometry.ok_or_else(|| anyhow!("{} has no radar frames", recording.name))?;
        let usual = scans.iter().map(|scan| scan.rays[A / 2].known).find(|known| !known.is_empty());
        let configuration = format!("{sensor:?} {config:?}");
        let header = Header::new::<{ radar_3d::RANGES }, A>(
            &sensor.mount,
            &geometry,
            usual.unwrap_or(Known::NONE),
            1,
            fingerprint(configuration.as_bytes()),
        )
        .map_err(|error| anyhow!("the maps of {} cannot be sent: {error:?}", recording.name))?;
        let header = Header { probability: quantiser.map(Quantiser::levels), ..header };
        Ok(Self { estimator: estimators::unit_row(&config, options), header, scans, holes })
    }

    /// The time from the first map to the last, without that which leaps skip, seconds.
    pub fn lasts_s(&self) -> f64 {
        let passed = |pair: &[Scan]| pair[1].measured.since(pair[0].measured).filter(|us| *us <= LEAP_US).unwrap_or(0);
        self.scans.windows(2).map(passed).sum::<u64>() as f64 / 1e6
    }
}

fn holes_of(map: &PolarMap<{ radar_3d::RANGES }, A>, rays: &[Ray<W>]) -> u64 {
    let unknown = |azimuth: usize, ray: &Ray<W>| {
        let grades = map.grades(azimuth).map_or(&[][..], |g| &g[..]);
        grades
            .get(ray.known.near()..ray.known.end().max(ray.known.near()))
            .map_or(0, |g| g.iter().filter(|g| **g == 0).count())
    };
    rays.iter().enumerate().map(|(azimuth, ray)| unknown(azimuth, ray) as u64).sum()
}

/// What was put on the bus at once.
#[derive(Debug, Clone)]
pub struct Sent {
    pub at: Time,
    /// Time on the bus, seconds.
    pub duration_s: f64,
    /// Data bytes; on a serial line all of them.
    pub bytes: Vec<u8>,
    /// `None` on a serial line.
    pub frame: Option<CanFrame>,
    /// How many scans were offered before it.
    pub scans: usize,
}

/// Everything that was sent.
#[derive(Debug, Clone)]
pub struct Traffic {
    pub bus: Bus,
    pub sent: Vec<Sent>,
    /// Scans that were sent, without those of the quiet first moments.
    pub scans: usize,
    /// Azimuths of scans that were to be sent, those of all planes: of a plane of probability a scan has a half.
    pub offered: u64,
    /// Those that were dropped.
    pub dropped: u16,
}

impl Planes<W> for Scan {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        let rays = match plane {
            Plane::Visibility => &self.rays,
            Plane::Grade => &self.probable,
            Plane::Occupancy => return Ray::UNKNOWN,
        };
        rays.get(azimuth).copied().unwrap_or(Ray::UNKNOWN)
    }
}

/// How often the sender is asked, microseconds.
const POLL_US: u64 = 250;

/// A pause longer than this, a clock that leaps among them, is a new start: what a unit would send meanwhile is not counted,
/// so that time and memory follow the number of scans. Microseconds.
pub const LEAP_US: u64 = 5_000_000;

impl Traffic {
    /// Sends maps over a bus, with a key authenticated.
    ///
    /// # Errors
    /// A configuration the library refuses.
    pub fn new(maps: &Maps, bus: Bus, visible_range_ms: Option<u16>, sensor: u8, key: Option<&Key>) -> Result<Self> {
        let begin = maps.scans.first().map_or(Time::from_micros(0), |scan| scan.measured);
        let secured = key.is_some();
        let planes = if maps.header.probability.is_some() { 2 } else { 1 };
        let config = BroadcastConfig { visible_range_ms, secured, planes, ..BroadcastConfig::new(sensor, bus.medium) };
        let mut sender = Broadcaster::<A, W, 2>::new(config, maps.header, Epoch::new(1), begin)
            .map_err(|error| anyhow!("{}: {error}", bus.name))?;
        // a clock in microseconds runs ahead of any number of messages
        let mut sealer = key.map(|key| Sealer::new(*key, begin.micros()));
        let (mut sent, mut scans, mut offered) = (Vec::new(), 0, 0);
        // the bus is busy up to here
        let mut free = begin;
        for (k, scan) in maps.scans.iter().enumerate() {
            let status = sender.status_mut();
            (status.state, status.reason) = scan.state;
            if sender.scan(scan.measured, scan).is_ok() {
                scans += 1;
                offered += u64::from(sender.pending());
            }
            let next = maps.scans.get(k + 1).map_or(scan.measured.micros() + 66_667, |next| next.measured.micros());
            let end = next.min(scan.measured.micros().saturating_add(LEAP_US));
            let mut now = scan.measured.max(free);
            while now.micros() < end {
                if let Some(one) = Sent::next(&mut sender, sealer.as_mut(), &bus, now, k + 1) {
                    free = Time::from_micros(now.micros() + (one.duration_s * 1e6).ceil() as u64);
                    sent.push(one);
                }
                now = Time::from_micros(now.micros() + POLL_US).max(free);
            }
        }
        Ok(Self { bus, sent, scans, offered, dropped: sender.status_mut().dropped })
    }
}

impl Sent {
    fn next(
        sender: &mut Broadcaster<A, W, 2>,
        sealer: Option<&mut Sealer<Key>>,
        bus: &Bus,
        at: Time,
        scans: usize,
    ) -> Option<Self> {
        let packet = match sealer {
            Some(sealer) => sender.next_sealed(at, sealer)?,
            None => sender.next_packet(at)?,
        };
        let (Medium::Can(addresses) | Medium::CanFd(addresses)) = bus.medium else {
            let mut line = [0; MOST_STUFFED];
            let n = serial::stuff(packet.bytes(), &mut line)?;
            // start and stop bit
            let duration_s = 10.0 * n as f64 / bus.rates[0];
            return Some(Self { at, duration_s, bytes: line[..n].to_vec(), frame: None, scans });
        };
        let frame = packet.frame(&addresses)?;
        let bits = bits::of(&frame);
        let duration_s = f64::from(bits.nominal) / bus.rates[0] + f64::from(bits.data) / bus.rates[1];
        Some(Self { at, duration_s, bytes: frame.data().to_vec(), frame: Some(frame), scans })
    }
}

#[cfg(test)]
mod tests {
    use viewshed::grid::settling::SettlingConfig;
    use viewshed::probability::Levels;
    use viewshed::radar_3d::Radar3dConfig;

    use super::*;
    use crate::bus::listening::Listening;
    use crate::estimators::{FarRoad, Grid, Options};
    use crate::evaluation::samples::made_up::recording;
    use crate::recording::RadarDetection;
    use crate::recording::can_log::{Content, Line};

    #[test]
    fn a_scan_offers_an_azimuth_and_half_a_probability_for_each() {
        let offered = |header: Header| {
            let scan = |k: u64| Scan {
                measured: Time::from_micros(500_000 + k * 66_667),
                rays: vec![Ray::clear(Known::new(3, 100)); A],
                probable: vec![Ray::UNKNOWN; A],
                state: (UnitState::Ok, Reason::None),
            };
            let maps = Maps { estimator: String::new(), header, scans: (0..30).map(scan).collect(), holes: 0 };
            let traffic = Traffic::new(&maps, BUSES[0], None, 0, None).unwrap();
            (traffic.scans as u64, traffic.offered)
        };
        let plain = Maps::new(&recording(3, 1), &Options::default(), None, &|| ()).unwrap().header;
        let (scans, azimuths) = offered(plain);
        assert!((20..30).contains(&scans), "without those of the quiet begin: {scans}");
        assert_eq!(azimuths, scans * A as u64);
        let (scans, azimuths) = offered(Header { probability: Levels::from_bytes([61, 178, 242, 0, 1]), ..plain });
        assert_eq!(azimuths, scans * (A + A / 2) as u64);
    }

    #[test]
    fn a_leap_of_the_clock_is_a_new_start() {
        let header = Maps::new(&recording(3, 1), &Options::default(), None, &|| ()).unwrap().header;
        // 30 scans in 1970, 30 some decades later, 30 with a clock that was set back
        let starts = [0, 1_700_000_000_000_000, 1_600_000_000_000_000];
        let scan = |begin: u64, k: u64| Scan {
            measured: Time::from_micros(begin + 500_000 + k * 66_667),
            rays: vec![Ray::clear(Known::new(3, 100)); A],
            probable: Vec::new(),
            state: (UnitState::Ok, Reason::None),
        };
        let scans = starts.into_iter().flat_map(|begin| (0..30).map(move |k| scan(begin, k))).collect();
        let maps = Maps { estimator: String::new(), header, scans, holes: 0 };
        let traffic = Traffic::new(&maps, BUSES[0], None, 0, None).unwrap();
        assert!((60..90).contains(&traffic.scans), "{}", traffic.scans);
        let seconds: std::collections::BTreeSet<u64> = traffic.sent.iter().map(|s| s.at.micros() / 1_000_000).collect();
        assert!(seconds.len() < 3 * 8, "nothing is sent in between: {seconds:?}");
        let load = crate::bus::load::Load::new(&traffic);
        assert!(load.load_median > 0.0 && load.load_worst < 1.0, "{load:?}");
        assert!((maps.lasts_s() - 3.0 * 29.0 / 15.0).abs() < 0.1, "{}", maps.lasts_s());
    }

    #[test]
    fn what_is_sent_is_the_map_of_a_unit_that_is_told_of_its_site() {
        let of = |options: &Options| {
            Maps::new(&recording(3, 1), options, None, &|| ()).map(|maps| (maps.header, maps.estimator))
        };
        let (usual, row) = of(&Options::default()).unwrap();
        assert_eq!(row, "radar-3d");
        let (told, row) = of(&Options { far_road: Some(FarRoad::Degrees(-12)), ..Options::default() }).unwrap();
        assert_eq!(row, "radar-3d-narrow");
        assert_ne!(usual.narrow, told.narrow);
        assert_ne!(usual.fingerprint, told.fingerprint);
        let error = of(&Options { grid: Grid::Small, ..Options::default() }).err().unwrap().to_string();
        assert!(error.contains("leave out --grid-size"), "{error}");
    }

    /// What the last status says to a receiver of maps of so many vehicles that come nearer, with this SNR.
    fn last_status(snr_db: f32) -> (String, String) {
        let mut recording = recording(90, 0);
        for (k, frame) in (0_u8..).zip(&mut recording.frames) {
            frame.time_ns = 1_000_000_000 + i64::from(k) * 66_000_000;
            let one = |i: u8| RadarDetection {
                range_m: 40.0 + f32::from(i) * 10.0 - 0.066 * f32::from(k) * 3.0,
                azimuth_rad: 0.02 * f32::from(i),
                elevation_rad: None,
                radial_velocity_mps: -3.0,
                rcs_dbsm: Some(5.0),
                snr_db: Some(snr_db),
            };
            frame.detections.extend((0..10).map(one));
            // one that can be used now and then: a recording without any is refused
            frame.detections.extend((k < 2).then(|| RadarDetection { snr_db: Some(20.0), ..one(5) }));
        }
        let options = Options {
            radar_3d: Radar3dConfig { settling: SettlingConfig::AT_ONCE, ..Default::default() },
            ..Default::default()
        };
        let maps = Maps::new(&recording, &options, None, &|| ()).unwrap();
        let traffic = Traffic::new(&maps, BUSES[2], None, 0, None).unwrap();
        let mut listening = Listening::new(Addresses::STANDARD, None);
        for sent in &traffic.sent {
            let time_ns = i64::try_from(sent.at.micros()).unwrap() * 1000;
            let content = Content::Data(sent.frame.unwrap());
            listening.take(&Line { time_ns, interface: "can0".into(), content });
        }
        let status = listening.heard(0, Vec::new()).unwrap().status.unwrap();
        (status.state, status.reason)
    }

    #[test]
    fn a_status_says_what_a_unit_would_at_that_scan() {
        assert_eq!(last_status(20.0), ("Ok".into(), "None".into()));
        assert_eq!(last_status(-3.0), ("Blind".into(), "UnusablePoints".into()));
    }
}
