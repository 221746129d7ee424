//! A radar-3d with all that belongs to it: parameters, state and map in one `static`.
//!
//! ```
//! use viewshed::query::{self, Answer};
//! use viewshed::{Detection, Radar3dConfig, RoadPoint, Sensor, Time, small};
//!
//! fn is_free(radar: &mut small::Radar, now: Time, detections: &[Detection], place: RoadPoint) -> bool {
//!     query::point(radar.process(now, detections), place) == Answer::VisibleFree
//! }
//! # let mut radar = Box::new(small::Radar::new());
//! # assert!(!is_free(&mut radar, Time::from_micros(0), &[], RoadPoint::from_metres(20.0, 0.0).unwrap()), "not begun");
//! ```
//!
//! Who has another place for each of the three takes them apart: [`Radar3d`], [`Radar3dParameters`], [`PolarMap`].

use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::frame::health::{Condition, FrameStatus};
use crate::map::polar::PolarMap;
use crate::radar_3d::{FrameReport, Radar3d, Radar3dConfig, Radar3dParameters};
use crate::sensor::Sensor;
use crate::sensor::config::ConfigError;
use crate::unit::build::of_radar;
use crate::wire::header::Header;

/// Too large for a controller's stack: it lies in a `static`. Its numbers are those of [`Radar3d`].
#[derive(Debug)]
pub struct Radar<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> {
    parameters: Option<Radar3dParameters<R, A, E>>,
    state: Radar3d<R, A, E, W, N, D>,
    map: PolarMap<R, A>,
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> Default
    for Radar<R, A, E, W, N, D>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>
    Radar<R, A, E, W, N, D>
{
    /// Of no sensor yet: its map is unknown whatever comes.
    pub const fn new() -> Self {
        Self { parameters: None, state: Radar3d::new(), map: PolarMap::NOWHERE }
    }

    /// Begins with a sensor as it is installed, and forgets what was before; what receivers of its maps have to know, for a
    /// [`Broadcaster`](crate::Broadcaster). Its fingerprint of settings is 0, none.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with; there is no sensor then.
    pub fn start(&mut self, sensor: &Sensor, config: &Radar3dConfig) -> Result<Header, ConfigError> {
        self.parameters = None;
        self.map.forget();
        let parameters = self.parameters.insert(Radar3dParameters::new(sensor, config)?);
        self.state.reset();
        parameters.prepare(&mut self.map);
        of_radar(&sensor.mount, parameters)
    }

    /// Takes a frame measured at this time and brings the map up to it.
    pub fn process<'a>(
        &mut self,
        now: Time,
        detections: impl IntoIterator<Item = &'a Detection, IntoIter: Clone>,
    ) -> &PolarMap<R, A> {
        self.report(now, detections, false);
        &self.map
    }

    /// The same with what the sensor says of itself; what was done with the frame. `None` before the start.
    pub fn report<'a>(
        &mut self,
        now: Time,
        detections: impl IntoIterator<Item = &'a Detection, IntoIter: Clone>,
        status: impl Into<FrameStatus>,
    ) -> Option<FrameReport> {
        let parameters = self.parameters.as_ref()?;
        Some(self.state.process(parameters, now, detections, status, &mut self.map))
    }

    /// Makes the map unknown when its time has run out; to be called when no frame comes. `None` before the start.
    pub fn expire(&mut self, now: Time) -> Option<Condition> {
        let parameters = self.parameters.as_ref()?;
        Some(self.state.expire(parameters, now, &mut self.map))
    }

    /// The map after the last frame.
    pub fn map(&self) -> &PolarMap<R, A> {
        &self.map
    }

    /// What it works with, once started.
    pub fn parameters(&self) -> Option<&Radar3dParameters<R, A, E>> {
        self.parameters.as_ref()
    }

    /// What it followed and counted.
    pub fn state(&self) -> &Radar3d<R, A, E, W, N, D> {
        &self.state
    }
}
