//! An estimator that watches its own radar by what usually stands in its view.
//!
//! # Model
//! The estimator works as it does alone. Then [`Fixtures`] are asked: a sector in which nothing of what stands is seen
//! becomes unknown on the map before anybody gets it, and the condition says that it is so, that the mount has moved, or
//! that everything reflects less. Of several the first in this order. What the estimator takes from its last map it
//! takes from the one with unknown sectors: evidence there does not fade while the radar is blind.
//!
//! # Limits
//! Those of [`Fixtures`]. What was learned is forgotten with the map: a unit that starts over learns anew, and what is
//! wrong by then is taken for usual.

use crate::estimator::{Estimator, Progress};
use crate::fixed::time::Time;
use crate::frame::detection::Detection;
use crate::frame::health::{Condition, Continuity, FrameStatus};
use crate::map::VisibilityMap;
use crate::map::polar::PolarMap;
use crate::sensor::config::ConfigError;
use crate::sensor::mount::Mount;

use super::fixtures::{Fixtures, FixturesConfig, FixturesLimits};

/// What there is room for.
const FIXTURES: usize = 64;
/// Sectors of the view.
const SECTORS: usize = 6;

type Standing = Fixtures<FIXTURES, SECTORS>;

/// What watches a radar: its mount, the edges of its view in degrees, and when something is wrong.
pub type Supervision = (Mount, [f32; 2], FixturesConfig);

/// An estimator, supervised if its configuration says so.
#[derive(Debug)]
pub struct Supervised<E> {
    estimator: E,
    standing: Standing,
    /// Whether `standing` is of this radar; a flag, so that all bytes of a new state are 0 and it takes none of the flash.
    is_watched: bool,
}

impl<E> Supervised<E> {
    /// To be placed in static memory.
    pub const fn new(estimator: E) -> Self {
        Self { estimator, standing: Standing::NOTHING, is_watched: false }
    }

    /// The estimator itself.
    pub const fn estimator(&self) -> &E {
        &self.estimator
    }

    /// What was learned to stand, and what is wrong with it; none before the first frame, and of a radar that is not
    /// supervised.
    pub fn standing(&self) -> Option<&Standing> {
        self.is_watched.then_some(&self.standing)
    }

    /// What the radar is watched by, checked.
    ///
    /// # Errors
    /// Names the parameter that cannot be worked with.
    pub fn limits(supervision: Option<&Supervision>) -> Result<Option<FixturesLimits>, ConfigError> {
        let fixtures = |(mount, azimuth_deg, config): &Supervision| FixturesLimits::new(mount, *azimuth_deg, config);
        supervision.map(fixtures).transpose()
    }

    /// What is to be said of a radar that is healthy otherwise.
    fn condition(&self, own: Condition) -> Condition {
        let Some(standing) = self.standing().filter(|_| matches!(own, Condition::Healthy | Condition::Settling)) else {
            return own;
        };
        if standing.any_blind() {
            Condition::SectorBlind
        } else if standing.turned().is_some() || standing.tilted().is_some() {
            Condition::Misaligned
        } else if standing.weaker_half_db().is_some() || standing.fewer().is_some() {
            Condition::Weaker
        } else {
            own
        }
    }
}

impl<E, const R: usize, const A: usize> Estimator for Supervised<E>
where
    E: Estimator<Input = [Detection], Map = PolarMap<R, A>>,
{
    type Config = (E::Config, Option<Supervision>);
    type Parameters = (E::Parameters, Option<FixturesLimits>);
    type Input = [Detection];
    type Map = PolarMap<R, A>;

    fn parameters((config, supervision): &Self::Config) -> Result<Self::Parameters, ConfigError> {
        Ok((E::parameters(config)?, Self::limits(supervision.as_ref())?))
    }

    fn prepare((parameters, _): &Self::Parameters, map: &mut Self::Map) {
        E::prepare(parameters, map);
    }

    fn forget(&mut self, map: &mut Self::Map) {
        self.estimator.forget(map);
        self.is_watched = false;
    }

    fn process(
        &mut self,
        (parameters, limits): &Self::Parameters,
        measured: Time,
        input: &[Detection],
        status: FrameStatus,
        map: &mut Self::Map,
        ended: &mut impl FnMut(),
    ) -> Progress {
        let progress = self.estimator.process(parameters, measured, input, status, map, ended);
        if let Some(limits) = limits.as_ref().filter(|_| !self.is_watched) {
            self.standing.begin(limits);
            self.is_watched = true;
        }
        if self.is_watched && progress.continuity != Continuity::Unjudged {
            let standing = &mut self.standing;
            input.iter().for_each(|detection| standing.observe(detection));
            // a radar that is blind or silent as a whole says nothing of what stands
            if matches!(progress.condition, Condition::Healthy | Condition::Settling) {
                standing.advance(measured, |at| map.at(at).visible());
            }
            // nearly never
            let azimuths = if standing.any_blind() { A } else { 0 };
            for azimuth in 0..azimuths {
                if standing.is_blind_at(map.geometry().middle_of(azimuth, A)) {
                    map.forget_azimuth(azimuth);
                }
            }
        }
        Progress { condition: self.condition(progress.condition), ..progress }
    }

    fn expire(&mut self, (parameters, _): &Self::Parameters, now: Time, map: &mut Self::Map) -> Condition {
        let own = self.estimator.expire(parameters, now, map);
        self.condition(own)
    }
}
