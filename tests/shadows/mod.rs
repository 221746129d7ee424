//! Maps of moving shadows, and a bus that loses, delays, repeats and reorders.

#![allow(dead_code)] // each test file uses a part

use viewshed::fixed::angle::Angle;
use viewshed::fixed::bits::Bits;
use viewshed::sensor::road::RoadPoint;
use viewshed::wire::code::ray::{Known, Ray};
use viewshed::wire::header::{Header, WireMount};
use viewshed::wire::message::Plane;
use viewshed::wire::planes::Planes;

pub const A: usize = 40;
pub const R: usize = 64;
pub const W: usize = 2;
pub const USUAL: Known = Known::new(4, R);

/// A permuted congruential generator; the same numbers everywhere.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut new = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        new.next();
        new
    }

    pub fn next(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mixed = (((old >> 18) ^ old) >> 27) as u32;
        mixed.rotate_right((old >> 59) as u32)
    }

    pub fn below(&mut self, n: u64) -> u64 {
        (u64::from(self.next()) * n) >> 32
    }

    pub fn chance(&mut self, share: f64) -> bool {
        f64::from(self.next()) < share * f64::from(u32::MAX)
    }
}

pub fn header(fingerprint: u32) -> Header {
    Header {
        mount: WireMount {
            origin: RoadPoint::new(0, 0),
            height_cm: 600,
            yaw: Angle::from_raw(0),
            pitch: Angle::from_raw(0),
            roll: Angle::from_raw(0),
        },
        azimuth_origin: Angle::from_raw(-10_000),
        azimuth_span: 20_000,
        narrow: viewshed::map::azimuths::Narrow::NONE,
        azimuths: A as u8,
        cell_cm: 200,
        ranges: R as u16,
        usual: USUAL,
        planes: 0,
        fingerprint,
        probability: None,
    }
}

/// The rays of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Map(pub Vec<Ray<W>>);

impl Planes<W> for Map {
    fn ray(&self, plane: Plane, azimuth: usize) -> Ray<W> {
        // other planes: the same cells, turned over
        let ray = self.0.get(azimuth).copied().unwrap_or(Ray::UNKNOWN);
        match plane {
            Plane::Visibility => ray,
            Plane::Grade => Ray::new(ray.known, Bits::from_words(ray.bits().words().map(|w| !w))),
            Plane::Occupancy => Ray::new(ray.known, Bits::from_words(ray.bits().words().map(|w| w ^ (w << 1)))),
        }
    }
}

impl Map {
    pub fn visible(&self) -> u32 {
        self.0.iter().map(|ray| ray.bits().count()).sum()
    }
}

#[derive(Debug, Clone, Copy)]
struct Shadow {
    /// Sixteenths of a cell.
    azimuth: i64,
    range: i64,
    speed: (i64, i64),
    width: i64,
    length: i64,
}

/// Shadows that drift over the map and now and then begin somewhere else.
#[derive(Debug, Clone)]
pub struct Shadows {
    random: Random,
    shadows: Vec<Shadow>,
    scans: u64,
}

impl Shadows {
    pub fn new(seed: u64) -> Self {
        let mut new = Self { random: Random::new(seed), shadows: Vec::new(), scans: 0 };
        new.shadows = (0..8).map(|_| new.shadow()).collect();
        new
    }

    fn shadow(&mut self) -> Shadow {
        let r = &mut self.random;
        let mut signed = |n: u64| r.below(2 * n + 1) as i64 - n as i64;
        let speed = (signed(12), signed(40));
        Shadow {
            azimuth: self.random.below(16 * A as u64) as i64,
            range: self.random.below(16 * R as u64) as i64,
            speed,
            width: 2 + self.random.below(5) as i64,
            length: if self.random.chance(0.5) { 100 } else { 4 + self.random.below(20) as i64 },
        }
    }

    /// The next scan's map.
    pub fn next(&mut self) -> Map {
        self.scans += 1;
        for k in 0..self.shadows.len() {
            let s = &mut self.shadows[k];
            s.azimuth += s.speed.0;
            s.range += s.speed.1;
            let outside = !(-64..16 * A as i64 + 64).contains(&s.azimuth) || !(0..16 * R as i64).contains(&s.range);
            if outside || self.random.chance(0.03) {
                self.shadows[k] = self.shadow();
            }
        }
        // now and then the known cells change, or there are none
        let blind = self.scans % 211 > 205;
        let short = (self.scans / 37) % 3 == 1;
        let rays = (0..A).map(|azimuth| {
            let known = match () {
                () if blind => Known::NONE,
                () if short && azimuth % 9 == 2 => Known::new(6, 50),
                () => USUAL,
            };
            let mut words = *Bits::<W>::span(0, R).words();
            for s in &self.shadows {
                let place = s.azimuth / 16;
                if (place..place + s.width).contains(&(azimuth as i64)) {
                    let from = (s.range / 16) as usize;
                    let dark = Bits::<W>::span(from, (from + s.length as usize).min(R));
                    words.iter_mut().zip(dark.words()).for_each(|(w, d)| *w &= !d);
                }
            }
            Ray::new(known, Bits::from_words(words))
        });
        let mut rays: Vec<_> = rays.collect();
        if self.scans % 17 == 3 {
            // too ragged for a block
            let noise = Bits::from_words([self.random.next(), self.random.next()]);
            let azimuth = self.random.below(A as u64) as usize;
            rays[azimuth] = Ray::new(rays[azimuth].known, noise);
        }
        Map(rays)
    }
}
