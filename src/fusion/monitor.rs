//! Who of several sensors is blind: others see what it should see by its own map, and it does not.
//!
//! # Model
//! The view of the watched sensor is cut into sectors. Whatever moving obstacle another sensor follows there is held
//! against the watched one's own map: where that says hidden or unknown, nothing follows, as a shadow explains why it
//! sees nothing. Where it says visible, the watched sensor either detects it too, or has missed it. A miss counts only
//! of an obstacle that both have detected before, in `confirmed` frames: few of the mirror images and other ghosts of one
//! sensor pass that. Which observations are of one obstacle is told by where the one before would be by
//! now.
//!
//! Each half second (`window_ms`) in which a sector has more misses than hits is a miss, any other with either is a
//! hit; one weighs ln(blind / usual), the other ln((1 - blind) / (1 - usual)), a sequential probability ratio (Page
//! 1954: never below 0). From `threshold` on the sector is blind, and it is so until its evidence is used up again,
//! which is the hysteresis.
//!
//! `blind` is `blind_miss`, the share of misses of a blind sector. `usual` is the sector's own share, learned over
//! `learned_windows` of its windows, and at least `usual_miss`: behind a mast or at the far end of the view a sensor in
//! order misses more than elsewhere. A sector that usually misses nearly as much as a blind one is not judged anew; one
//! that is blind stays so until it sees.
//!
//! [`watched`](Monitor::watched) is the sensor's map without its blind sectors, to be fused in its place.
//!
//! # Limits
//! Silent where nothing moves that both have seen before, and where no other sensor looks. A sensor that loses its
//! sight over hours is taken for usual. Says that a sensor misses, not why. Follows 48 obstacles at once, the latest.
//! 2.2 kB with six sectors.
//!
//! # References
//! Page, "Continuous inspection schemes", Biometrika 41, 1954.

use crate::fixed::angle::Angle;
use crate::fixed::math;
use crate::fixed::time::Time;
use crate::fixed::trig;
use crate::map::azimuths::Columns;
use crate::map::overlap::Seen;
use crate::map::query::Footprint;
use crate::map::{CellState, VisibilityMap};
use crate::sensor::config::{ConfigError, above, within};
use crate::sensor::mount::{Levelling, Mount};
use crate::sensor::road::RoadPoint;

use super::followed::Followed;
use super::polar::edges;
use super::window::Window;

/// When a sector is judged blind.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct MonitorConfig {
    /// Least share of the windows in which a sensor in order misses what it should see.
    pub usual_miss: f32,
    /// Share in which a blind one does.
    pub blind_miss: f32,
    /// Evidence from which a sector is blind, nats.
    pub threshold: f32,
    /// Length of a window, ms.
    pub window_ms: u16,
    /// Windows of a sector over which its usual share of misses is learned; 0: it is `usual_miss` everywhere.
    pub learned_windows: u16,
    /// Frames in which both sensors have detected an obstacle before a miss of it counts; 0: any counts.
    pub confirmed: u8,
}

impl Default for MonitorConfig {
    fn default() -> Self {
        Self { usual_miss: 0.3, blind_miss: 0.97, threshold: 6.0, window_ms: 500, learned_windows: 200, confirmed: 8 }
    }
}

/// What an observation was worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Observed {
    /// Outside of the watched sensor's view.
    Outside,
    /// Its own map says that it cannot see the place.
    Explained,
    /// It does not see it, but has not often enough seen it before: it may be a ghost of the other sensor.
    Unconfirmed,
    /// It should see it, and does.
    Hit,
    /// It should see it, and does not.
    Miss,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Sector {
    hits: u16,
    misses: u16,
    /// 2^-8 nats.
    evidence: i32,
    /// Usual share of windows with a miss, 2^-16.
    usual: u32,
    blind: bool,
}

/// Usual shares of misses that weights are worked out for.
const LEVELS: usize = 16;
/// How much more than usual a blind sector has to miss for it to be judged.
const LEAST_GAP: f32 = 0.05;

/// Watches one sensor in `K` sectors from right to left.
#[derive(Debug, Clone)]
pub struct Monitor<const K: usize> {
    levelling: Levelling,
    right: Angle,
    span: u16,
    /// Of a window with a miss, of one with a hit: 2^-8 nats, by the usual share of misses.
    weights: [[i32; 2]; LEVELS],
    /// Least usual share, 2^-16, and windows that it is learned over.
    usual: u32,
    learned_windows: u16,
    threshold: i32,
    window: Window,
    sectors: [Sector; K],
    confirmed: u8,
    followed: Followed,
}

impl<const K: usize> Monitor<K> {
    /// For a sensor by its mount and the edges of its view from its heading, degrees, + left.
    ///
    /// # Errors
    /// Names the parameter outside its limits.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within limits
    pub fn new(mount: &Mount, azimuth_deg: [f32; 2], config: &MonitorConfig) -> Result<Self, ConfigError> {
        const { assert!(K > 0 && K <= 64) }
        let (right, span) = edges(azimuth_deg)?;
        let usual = within("monitor.usual_miss", config.usual_miss, 0.01, 0.98)?;
        let blind = above("monitor.blind_miss", within("monitor.blind_miss", config.blind_miss, 0.02, 0.99)?, usual)?;
        let threshold = within("monitor.threshold", config.threshold, 0.5, 50.0)?;
        within("monitor.window_ms", f32::from(config.window_ms), 50.0, 10_000.0)?;
        let nats = |v: f32| math::round_i32(v * 256.0);
        let ratio = |a: f32, b: f32| libm::logf(a / b);
        let mut weights = [[0; 2]; LEVELS];
        for (level, weights) in (0_u16..).zip(&mut weights) {
            let usual = ((f32::from(level) + 0.5) / LEVELS as f32).max(usual);
            let miss = if usual + LEAST_GAP < blind { nats(ratio(blind, usual)) } else { 0 };
            *weights = [miss, nats(ratio(1.0 - blind, 1.0 - usual.min(blind))).min(-1)];
        }
        let least = (usual * 65_536.0) as u32;
        Ok(Self {
            levelling: mount.levelling()?,
            right,
            span,
            weights,
            usual: least,
            learned_windows: config.learned_windows,
            threshold: nats(threshold),
            window: Window::of_ms(config.window_ms),
            sectors: [Sector { hits: 0, misses: 0, evidence: 0, usual: least, blind: false }; K],
            confirmed: config.confirmed,
            followed: Followed::NONE,
        })
    }

    /// The sector of a place; none outside of the view.
    pub fn sector(&self, at: RoadPoint) -> Option<usize> {
        let (x, y) = self.levelling.place(at);
        Columns::even(self.span, K).column(trig::bearing(x, y) - self.right)
    }

    /// Another sensor follows an obstacle whose middle is here. `own` is what the watched sensor's map says of the
    /// place (before [`watched`](Self::watched), or a blind sector stays blind), `detected` whether that detects
    /// something there, too. One observation an obstacle and frame.
    pub fn observe(&mut self, now: Time, at: RoadPoint, own: CellState, detected: bool) -> Observed {
        self.advance(now);
        let seen_by_both = self.followed.take(now, at, detected);
        let Some(sector) = self.sector(at).and_then(|k| self.sectors.get_mut(k)) else { return Observed::Outside };
        if !own.visible() {
            return Observed::Explained;
        }
        if !detected && seen_by_both < self.confirmed {
            return Observed::Unconfirmed;
        }
        let (count, observed) =
            if detected { (&mut sector.hits, Observed::Hit) } else { (&mut sector.misses, Observed::Miss) };
        *count = count.saturating_add(1);
        observed
    }

    /// Closes the window when it is over; [`observe`](Self::observe) does so as well. Time that steps back begins a new
    /// one.
    pub fn advance(&mut self, now: Time) {
        if !self.window.is_over(now) {
            return;
        }
        for sector in &mut self.sectors {
            let (hits, misses) = (core::mem::take(&mut sector.hits), core::mem::take(&mut sector.misses));
            if hits == 0 && misses == 0 {
                continue;
            }
            let level = usize::try_from(sector.usual >> 12).unwrap_or(0).min(LEVELS - 1);
            let [miss, hit] = self.weights.get(level).copied().unwrap_or_default();
            let missed = misses > hits;
            let evidence = sector.evidence + if missed { miss } else { hit };
            // towards 1 or 0 by the same part of what is left
            let target: u32 = if missed { 65_535 } else { 0 };
            let step = target.abs_diff(sector.usual).checked_div(u32::from(self.learned_windows)).unwrap_or(0);
            let learned = if missed { sector.usual.saturating_add(step) } else { sector.usual.saturating_sub(step) };
            sector.usual = learned.max(self.usual);
            // no more than what is needed twice over, so that a mended sensor is trusted again soon
            sector.evidence = evidence.min(2 * self.threshold).max(0);
            sector.blind = match sector.evidence {
                0 => false,
                evidence => sector.blind || evidence >= self.threshold,
            };
        }
    }

    /// Whether a sector is judged blind; not one that does not exist.
    pub fn is_blind(&self, sector: usize) -> bool {
        self.sectors.get(sector).is_some_and(|sector| sector.blind)
    }

    /// Whether any part of an area lies in a sector that is judged blind.
    #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // sectors, angles
    fn is_blind_in(&self, area: &Footprint) -> bool {
        let any = || (0..K).any(|sector| self.is_blind(sector));
        let Some(seen) = Seen::new(area, &self.levelling) else { return any() };
        let columns = Columns::even(self.span, K);
        let left = seen.right + Angle::from_raw(seen.width.min(i32::from(i16::MAX)) as i16);
        let at_end = |end: Angle| self.is_blind(columns.nearest(end - self.right));
        // a sector of which neither end of the area is part, but an edge lies in it
        let holds = |sector: usize| {
            let edge = self.right + columns.bearing((sector << 8) as i32);
            i32::from((edge - seen.right).raw() as u16) <= seen.width
        };
        let within = |sector: usize| self.is_blind(sector) && (holds(sector) || holds(sector + 1));
        at_end(seen.right) || at_end(left) || (0..K).any(within)
    }

    /// The sensor's map, unknown in its blind sectors.
    pub fn watched<'m, M: VisibilityMap + ?Sized>(&'m self, map: &'m M) -> Watched<'m, M, K> {
        Watched { monitor: self, map }
    }
}

/// A map without the sectors that are judged blind; what of it lies outside of the view goes with the sector at that edge.
#[derive(Debug, Clone, Copy)]
pub struct Watched<'m, M: ?Sized, const K: usize> {
    monitor: &'m Monitor<K>,
    map: &'m M,
}

impl<M: VisibilityMap + ?Sized, const K: usize> VisibilityMap for Watched<'_, M, K> {
    fn at(&self, point: RoadPoint) -> CellState {
        let (x, y) = self.monitor.levelling.place(point);
        let sector = Columns::even(self.monitor.span, K).nearest(trig::bearing(x, y) - self.monitor.right);
        if self.monitor.is_blind(sector) { CellState::UNKNOWN } else { self.map.at(point) }
    }

    fn cells_in(&self, area: &Footprint, visit: &mut dyn FnMut(CellState)) {
        if self.monitor.is_blind_in(area) {
            visit(CellState::UNKNOWN);
        }
        self.map.cells_in(area, visit);
    }
}
