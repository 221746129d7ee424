//! What settings make of a unit: the same for a start and for the check of a block that came.

use crate::camera::calibration::Calibration;
use crate::camera::map::AZIMUTHS;
use crate::camera::{Camera3d, Camera3dConfig};
use crate::estimator::Estimator;
#[cfg(feature = "monitoring")]
use crate::frame::detection::Detection;
#[cfg(feature = "monitoring")]
use crate::fusion::Supervised;
use crate::map::polar::PolarGeometry;
#[cfg(feature = "monitoring")]
use crate::map::polar::PolarMap;
use crate::radar_3d::{Radar3d, Radar3dParameters};
use crate::sensor::config::{ConfigError, Problem};
use crate::sensor::mount::Mount;
use crate::sensor::site::Site;
use crate::unit::sender::MapSender;
use crate::unit::settings::{Settings, SettingsCheck};
use crate::wire::code::ray::Known;
use crate::wire::header::{Header, MOST_AZIMUTHS};

/// An estimator that an integrator's settings can set up and whose maps can be broadcast.
pub trait InUnit: Estimator {
    /// Its configuration by the settings; what an integrator does not set is the library's.
    fn config(settings: &Settings) -> Self::Config;

    /// Its parameters by the settings, at the place a unit keeps, which may be another than the settings' own.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with; lanes and heights that it has no use for.
    fn parameters_at(settings: &Settings, place: &Site<'_>) -> Result<Self::Parameters, ConfigError> {
        let Site { mut lanes, mut heights } = *place;
        let without_use = |parameter, problem| Err(ConfigError { parameter, value: 0.0, problem });
        if lanes.next().is_some() {
            return without_use("lanes", Problem::TooManyLanes);
        }
        if heights.next().is_some() {
            return without_use("ground", Problem::TooManyHeights);
        }
        Self::parameters(&Self::config(settings))
    }

    /// Whether the configuration can be made, by the names the settings have.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with.
    fn check(_: &Settings) -> Result<(), ConfigError> {
        Ok(())
    }

    /// What receivers have to know of its maps, but for the fingerprint of the settings, which [`Settings::build`] puts in.
    ///
    /// # Errors
    /// Maps that cannot be sent.
    fn header(settings: &Settings, parameters: &Self::Parameters) -> Result<Header, ConfigError>;
}

impl Settings {
    /// Makes a unit's parameters, where they stay, and the header of its maps. A start and the check of a block
    /// that came are this same function, so that none is accepted that cannot start.
    ///
    /// # Errors
    /// Names the first parameter that cannot be worked with; there are no parameters then.
    pub fn build<E: InUnit>(&self, parameters: &mut Option<E::Parameters>) -> Result<Header, ConfigError> {
        self.build_at::<E>(&self.place(), parameters)
    }

    /// The same at another place than the settings' own.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    #[inline(never)] // what it takes of the stack is free again afterwards
    pub fn build_at<E: InUnit>(
        &self,
        place: &Site<'_>,
        parameters: &mut Option<E::Parameters>,
    ) -> Result<Header, ConfigError> {
        *parameters = None;
        self.radar_bus.check("radar_bus")?;
        self.broadcast_bus.check("broadcast_bus")?;
        self.unit.check()?;
        E::check(self)?;
        // large: moved once
        let made = parameters.insert(E::parameters_at(self, place)?);
        let header = E::header(self, made).map(|header| Header { fingerprint: self.fingerprint_at(place), ..header });
        if header.is_err() {
            *parameters = None;
        }
        header
    }
}

/// Whether a unit with this sender can be made by these settings.
#[inline(never)] // as above
fn check<E: InUnit, S: MapSender<E::Map>>(settings: &Settings, place: &Site<'_>) -> Result<Header, ConfigError> {
    settings.build_at::<E>(place, &mut None).and_then(|header| S::fits(&header).map(|()| header))
}

impl SettingsCheck {
    /// For a unit of this estimator and sender.
    pub const fn of<E: InUnit, S: MapSender<E::Map>>() -> Self {
        Self::by(check::<E, S>, S::TAKES_TABLES)
    }
}

impl<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize> InUnit
    for Radar3d<R, A, E, W, N, D>
{
    fn config(settings: &Settings) -> Self::Config {
        (settings.sensor, settings.radar_3d())
    }

    fn parameters_at(settings: &Settings, place: &Site<'_>) -> Result<Self::Parameters, ConfigError> {
        let (sensor, config) = Self::config(settings);
        Radar3dParameters::at(&sensor, &config, place)
    }

    fn header(settings: &Settings, parameters: &Self::Parameters) -> Result<Header, ConfigError> {
        of_radar(&settings.sensor.mount, parameters)
    }
}

/// What receivers have to know of a radar's maps; without a fingerprint.
///
/// # Errors
/// Maps that cannot be sent.
pub(super) fn of_radar<const R: usize, const A: usize, const E: usize>(
    mount: &Mount,
    parameters: &Radar3dParameters<R, A, E>,
) -> Result<Header, ConfigError> {
    let axes = parameters.axes();
    let view = axes.view(A / 2);
    let geometry = axes.polar(parameters.levelling());
    header::<R, A>(mount, &geometry, Known::new(view.start, view.end))
}

/// A radar's unit, supervised where its settings say so.
#[cfg(feature = "monitoring")]
impl<E, const R: usize, const A: usize> InUnit for Supervised<E>
where
    E: InUnit + Estimator<Input = [Detection], Map = PolarMap<R, A>>,
{
    fn config(settings: &Settings) -> Self::Config {
        let view = &settings.sensor.field_of_view;
        let azimuth_deg = [view.azimuth_min_deg, view.azimuth_max_deg];
        (E::config(settings), settings.fixtures().map(|fixtures| (settings.sensor.mount, azimuth_deg, fixtures)))
    }

    fn parameters_at(settings: &Settings, place: &Site<'_>) -> Result<Self::Parameters, ConfigError> {
        let (_, supervision) = Self::config(settings);
        Ok((E::parameters_at(settings, place)?, Self::limits(supervision.as_ref())?))
    }

    fn check(settings: &Settings) -> Result<(), ConfigError> {
        E::check(settings)
    }

    fn header(settings: &Settings, (parameters, _): &Self::Parameters) -> Result<Header, ConfigError> {
        E::header(settings, parameters)
    }
}

fn header<const R: usize, const A: usize>(
    mount: &Mount,
    geometry: &PolarGeometry,
    usual: Known,
) -> Result<Header, ConfigError> {
    // the mount was checked with the parameters, so it is the grid
    #[allow(clippy::cast_precision_loss)]
    let refused = ConfigError {
        parameter: "header.azimuths",
        value: A as f32,
        problem: Problem::OutOfLimits { min: 1.0, max: MOST_AZIMUTHS as f32 },
    };
    Header::new::<R, A>(mount, geometry, usual, 1, 0).map_err(|_| refused)
}

/// Of the settings a camera takes the mount, the field of view as the angles at which its picture ends along its
/// middle row and column, the slice's height, the share of a column that has to be seen (`visibility.visible_from`) and
/// when maps end; its boxes are those of the native format, shares of the picture. Traffic drives along the road.
impl<const NX: usize, const NY: usize> InUnit for Camera3d<NX, NY> {
    fn config(settings: &Settings) -> Self::Config {
        let view = settings.sensor.field_of_view;
        let config = Camera3dConfig {
            range_max_m: view.range_max_m,
            slice_height_m: settings.visibility.slice_height_m,
            visible_share: settings.visibility.visible_from,
            health: settings.health,
            ..Camera3dConfig::default()
        };
        (Calibration::of_view(&settings.sensor.mount, &view), config)
    }

    fn check(settings: &Settings) -> Result<(), ConfigError> {
        if let Some(far_road) = settings.visibility.far_road_deg {
            let (parameter, value) = ("visibility.far_road_deg", f32::from(far_road));
            return Err(ConfigError { parameter, value, problem: Problem::OfRadars });
        }
        settings.sensor.field_of_view.limits().map(|_| ())
    }

    fn header(settings: &Settings, parameters: &Self::Parameters) -> Result<Header, ConfigError> {
        let [from, to] = parameters.ahead();
        header::<NX, AZIMUTHS>(&settings.sensor.mount, &parameters.geometry(), Known::new(from, to))
    }
}
