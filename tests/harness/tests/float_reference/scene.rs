//! Sensors and random input that the comparisons share.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};
use viewshed::frame::detection::{Detection, Measurement};
use viewshed::frame::reflection::Reflection;
use viewshed::grid::spherical::SphericalGrid;
use viewshed::sensor::field_of_view::FieldOfView;
use viewshed::sensor::ground::Ground as Level;
use viewshed::sensor::mount::{Levelling, Mount};
use viewshed::sensor::noise::{Noise, NoiseConfig};
use viewshed::unit::profile::reference;

use crate::geometry::{Ground, Levelled, along};
use crate::grid::{Axes, Grid};

/// Range cells, azimuths and elevations of the reference grid.
pub const RANGES: usize = reference::State::RANGES;
pub const AZIMUTHS: usize = reference::State::AZIMUTHS;
pub const ELEVATIONS: usize = reference::State::ELEVATIONS;

pub type IntegerAxes = viewshed::grid::axes::Axes<RANGES, AZIMUTHS, ELEVATIONS>;
pub type IntegerGrid = SphericalGrid<RANGES, AZIMUTHS, ELEVATIONS>;

/// What the library makes of a measurement, its height included.
pub fn reflection(m: &Measurement, noise: &Noise, levelling: &Levelling) -> Reflection {
    let d = Detection::new(m).unwrap();
    noise.place(&d, levelling)
}

pub const VIEW: FieldOfView = FieldOfView {
    azimuth_min_deg: -60.0,
    azimuth_max_deg: 60.0,
    elevation_min_deg: -16.0,
    elevation_max_deg: 16.0,
    range_min_m: 3.0,
    range_max_m: 200.0,
};

/// On a gantry, beside the road and crooked, and at bumper height: every angle has either sign.
pub fn mounts() -> [Mount; 3] {
    [
        Mount { x_m: 0.0, y_m: 0.0, height_m: 6.0, yaw_deg: 0.0, pitch_deg: 4.0, roll_deg: 0.0 },
        Mount { x_m: -20.0, y_m: 8.5, height_m: 3.6, yaw_deg: -15.0, pitch_deg: 2.0, roll_deg: -1.5 },
        Mount { x_m: 12.0, y_m: -3.0, height_m: 0.6, yaw_deg: 40.0, pitch_deg: -1.0, roll_deg: 2.5 },
    ]
}

/// Repeatable random numbers.
pub struct Random(Pcg64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    /// Between two bounds, evenly.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A whole number, bounds included.
    pub fn whole(&mut self, low: i32, high: i32) -> i32 {
        self.between(f64::from(low), f64::from(high) + 1.0).floor() as i32
    }

    /// Normally distributed, by twelve even ones.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.between(0.0, 1.0)).sum::<f64>() - 6.0)
    }

    /// A measurement well inside [`VIEW`].
    pub fn measurement(&mut self) -> Measurement {
        Measurement {
            range_m: self.between(7.0, 199.0) as f32,
            azimuth_rad: self.between(-1.04, 1.04) as f32,
            elevation_rad: Some(self.between(-0.27, 0.27) as f32),
            radial_velocity_mps: self.between(-40.0, 40.0) as f32,
            rcs_dbsm: Some(self.between(-10.0, 40.0) as f32),
            snr_db: Some(self.between(8.0, 40.0) as f32),
        }
    }

    /// What a sensor makes of a point in the levelled frame that moves with a velocity on the ground,
    /// with the library's default noise.
    pub fn measured(&mut self, levelled: &Levelled, point: [f64; 3], velocity: Ground) -> Measurement {
        let (noise, seen) = (NoiseConfig::default(), levelled.seen(point));
        let radial_velocity = along(velocity, [point[0], point[1]]) / seen.range_m;
        let mut noisy = |value: f64, sigma: f32| (value + self.normal(f64::from(sigma))) as f32;
        Measurement {
            range_m: noisy(seen.range_m, noise.range_m),
            azimuth_rad: noisy(seen.azimuth_rad, noise.azimuth_deg.to_radians()),
            elevation_rad: Some(noisy(seen.elevation_rad, noise.elevation_deg.to_radians())),
            radial_velocity_mps: noisy(radial_velocity, noise.radial_velocity_mps),
            rcs_dbsm: Some(10.0),
            snr_db: Some(20.0),
        }
    }

    /// A measurement of something on or beside the road.
    pub fn reflection(&mut self, levelled: &Levelled) -> Measurement {
        let (ground, bearing) = (self.between(10.0, 195.0), self.between(-1.0, 1.0));
        let point = [ground * bearing.cos(), ground * bearing.sin(), self.between(0.2, 3.5)];
        self.measured(levelled, point, [0.0, 0.0])
    }

    /// A measurement around every limit.
    pub fn any_measurement(&mut self) -> Measurement {
        Measurement {
            range_m: self.between(-2.0, 215.0) as f32,
            azimuth_rad: self.between(-1.15, 1.15) as f32,
            elevation_rad: (self.whole(0, 3) > 0).then(|| self.between(-0.36, 0.36) as f32),
            radial_velocity_mps: self.between(-75.0, 75.0) as f32,
            rcs_dbsm: (self.whole(0, 3) > 0).then(|| self.between(-50.0, 40.0) as f32),
            snr_db: (self.whole(0, 3) > 0).then(|| self.between(2.0, 40.0) as f32),
        }
    }
}

/// The library's axes for a mount, and the same in real numbers; of a mount that is turned, columns are narrower along
/// the road.
pub fn axes(mount: &Mount) -> (Box<IntegerAxes>, Axes) {
    let far_road = (mount.yaw_deg != 0.0).then(|| (-mount.yaw_deg).clamp(-60.0, 60.0) as i8);
    let integer = IntegerAxes::on(Level::LEVEL, &mount.levelling().unwrap(), &VIEW, 1.0, far_road).unwrap();
    let exact = Axes::new([RANGES, AZIMUTHS, ELEVATIONS], &Levelled::new(mount), &VIEW, 1.0, integer.narrow);
    (Box::new(integer), exact)
}

/// Differences of two grids in steps of 255 where either holds anything, each with its row.
pub fn differences(integer: &IntegerGrid, exact: &Grid) -> Vec<(f64, usize)> {
    let mut found = Vec::new();
    for (a, column) in integer.columns().enumerate() {
        let mut stacks = vec![[0; ELEVATIONS]; RANGES];
        column.stacks().for_each(|(r, stack)| stacks[r] = *stack);
        for (r, stack) in stacks.iter().enumerate() {
            let pairs = stack.iter().zip(exact.stack(a, r)).enumerate();
            let pairs = pairs.filter(|(_, (got, exact))| **got > 0 || **exact > 0.0);
            found.extend(pairs.map(|(row, (got, exact))| (f64::from(*got) - exact * 255.0, row)));
        }
    }
    found
}

/// Raises a largest absolute difference.
pub fn raise(worst: &mut f64, off: f64) {
    *worst = worst.max(off.abs());
}

/// Fails where a difference passes its limit; `--nocapture` shows how close the others come.
pub fn within(what: &str, found: f64, limit: f64) {
    println!("{what}: {found:.4} of {limit}");
    assert!(found <= limit, "{what}: {found} is above {limit}");
}
