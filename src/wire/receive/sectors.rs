//! One plane of a map as received: the newest of every azimuth, and the refresh deltas build on.

use crate::fixed::bits::Bits;
use crate::wire::code::ray::{Known, Ray};
use crate::wire::map_message::Plain;
use crate::wire::message::Azimuths;
use crate::wire::scan_number::ScanNumber;

/// Azimuths by ranges, the newest and its refresh.
///
/// # ReceiverLimits
/// `8 W + 4` bytes an azimuth: the known cells are those of both.
#[derive(Debug, Clone)]
pub(super) struct Sectors<const A: usize, const W: usize> {
    known: [Known; A],
    now: [Bits<W>; A],
    was: [Bits<W>; A],
    now_scan: [ScanNumber; A],
    was_scan: [ScanNumber; A],
    there: Azimuths,
    refreshed: Azimuths,
}

impl<const A: usize, const W: usize> Sectors<A, W> {
    pub const fn new() -> Self {
        Self {
            known: [Known::NONE; A],
            now: [Bits::NONE; A],
            was: [Bits::NONE; A],
            now_scan: [ScanNumber::from_byte(0); A],
            was_scan: [ScanNumber::from_byte(0); A],
            there: Azimuths::NONE,
            refreshed: Azimuths::NONE,
        }
    }

    pub fn forget(&mut self) {
        (self.there, self.refreshed) = (Azimuths::NONE, Azimuths::NONE);
    }

    /// The newest of an azimuth and its scan.
    pub fn now(&self, azimuth: usize) -> Option<(Ray<W>, ScanNumber)> {
        let ray = Ray::within(*self.known.get(azimuth)?, *self.now.get(azimuth)?);
        Some((ray, *self.now_scan.get(azimuth)?)).filter(|_| self.there.get(azimuth))
    }

    /// An azimuth of the refresh of exactly this scan.
    pub fn refresh(&self, azimuth: usize, scan: ScanNumber) -> Option<Ray<W>> {
        let there = self.refreshed.get(azimuth) && self.was_scan.get(azimuth) == Some(&scan);
        let ray = Ray::within(*self.known.get(azimuth)?, *self.was.get(azimuth)?);
        there.then_some(ray)
    }

    /// Whether an azimuth is of an older scan than this, or there is none.
    fn is_older(&self, azimuth: usize, scan: ScanNumber) -> bool {
        !self.there.get(azimuth) || self.now_scan.get(azimuth).is_none_or(|now| scan.newer_than(*now))
    }

    fn set(&mut self, azimuth: usize, scan: ScanNumber, ray: &Ray<W>) {
        let place = (self.known.get_mut(azimuth), self.now.get_mut(azimuth), self.now_scan.get_mut(azimuth));
        let (Some(known), Some(now), Some(now_scan)) = place else { return };
        if *known != ray.known {
            // what was is of other cells
            self.refreshed.clear(azimuth);
        }
        (*known, *now, *now_scan) = (ray.known, *ray.bits(), scan);
        self.there.set(azimuth);
    }

    /// Takes a ray from a block; order follows the scans.
    pub fn take(&mut self, azimuth: usize, scan: ScanNumber, ray: &Ray<W>, refresh: bool) {
        let same = self.now_scan.get(azimuth) == Some(&scan);
        if same || self.is_older(azimuth, scan) {
            self.set(azimuth, scan, ray);
        }
        if !refresh {
            return;
        }
        let newest = !self.refreshed.get(azimuth) || self.was_scan.get(azimuth).is_none_or(|was| !was.newer_than(scan));
        let same_cells = self.known.get(azimuth) == Some(&ray.known);
        if newest && same_cells && self.there.get(azimuth) {
            let place = (self.was.get_mut(azimuth), self.was_scan.get_mut(azimuth));
            if let (Some(was), Some(was_scan)) = place {
                (*was, *was_scan) = (*ray.bits(), scan);
                self.refreshed.set(azimuth);
            }
        }
    }

    /// Takes plain cells. Known cells that have not come count as not visible, and before the limits
    /// have come nothing is known.
    pub fn take_plain(&mut self, azimuth: usize, scan: ScanNumber, plain: &Plain<W>) {
        if self.is_older(azimuth, scan) {
            self.set(azimuth, scan, &Ray::UNKNOWN);
            self.refreshed.clear(azimuth);
        }
        let Some((ray, now)) = self.now(azimuth) else { return };
        if now != scan {
            return;
        }
        let ray = match plain {
            Plain::Whole(whole) => *whole,
            Plain::Limits(known) => Ray::new(*known, *ray.bits()),
            Plain::Cells(cells) => {
                let mut all = *ray.bits();
                cells.iter().for_each(|cell| all.set(cell));
                Ray::new(ray.known, all)
            }
        };
        self.set(azimuth, scan, &ray);
    }

    /// Drops what is too old, before its number comes again.
    pub fn purge(&mut self, too_old: impl Fn(ScanNumber) -> bool) {
        for (azimuth, (now, was)) in self.now_scan.iter().zip(&self.was_scan).enumerate() {
            if too_old(*now) {
                self.there.clear(azimuth);
                self.refreshed.clear(azimuth);
            }
            if too_old(*was) {
                self.refreshed.clear(azimuth);
            }
        }
    }
}
