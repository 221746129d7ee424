//! Values of options: what is read of each, and what is refused.

use viewshed::NoiseConfig;
use viewshed::inputs::ars408::profile::Ars408Profile;
use viewshed::inputs::ars408::quality::Ars408Wanted;
use viewshed::inputs::ti::{Entries, PolarPoints, TiAngleUnit, TiDialect, TiFamily};

use crate::estimators::{FarRoad, GroundError, MOST_RANGE_M};
use crate::recording::{FieldOfView, LabelsFrom};

pub fn far_road(text: &str) -> Result<FarRoad, String> {
    match text {
        "along-road" => Ok(FarRoad::AlongRoad),
        _ => text
            .parse()
            .map(FarRoad::Degrees)
            .map_err(|_| format!("`{text}` is not a whole number of degrees, -128 to 127")),
    }
}

pub fn labels(text: &str) -> Result<LabelsFrom, String> {
    Ok(match text {
        "recording" => LabelsFrom::Recording,
        "beside" => LabelsFrom::Beside,
        "" => return Err("neither `recording` nor `beside` nor a file".into()),
        file => LabelsFrom::File(file.into()),
    })
}

pub fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
    if value.is_finite() { Ok(value) } else { Err(format!("`{text}` is not finite")) }
}

/// `N` numbers between commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values = text.split(',').map(finite).collect::<Result<Vec<_>, _>>()?;
    let found = values.len();
    values.try_into().map_err(|_| format!("{found} values, {N} are needed"))
}

pub fn profile(text: &str) -> Result<&'static Ars408Profile, String> {
    let names = || Ars408Profile::ALL.map(|p| p.name).join(", ");
    Ars408Profile::named(text).ok_or_else(|| format!("no radar `{text}`; there are {}", names()))
}

/// States between commas, in decimal or as 0x1F.
pub fn cluster_states(text: &str) -> Result<Ars408Wanted, String> {
    let number = |part: &str| {
        let part = part.trim();
        part.strip_prefix("0x").map_or_else(|| part.parse(), |digits| u8::from_str_radix(digits, 16)).ok()
    };
    let states: Option<Vec<u8>> = text.split(',').map(number).collect();
    let wanted = states.and_then(|states| Ars408Wanted::default().with_clusters(states));
    wanted.ok_or_else(|| format!("`{text}` are no numbers from 0 to 31 between commas"))
}

pub fn ti_header(text: &str) -> Result<TiFamily, String> {
    let bytes = text.trim().parse().unwrap_or(0);
    TiFamily::ALL
        .into_iter()
        .find(|f| f.header() == bytes)
        .ok_or_else(|| format!("`{text}` is not 36, 40, 44, 48 or 52"))
}

pub fn ti_dialect(text: &str) -> Result<TiDialect, String> {
    text.split(',').map(str::trim).try_fold(TiDialect::USUAL, |mut dialect, word| {
        match (word, word.strip_prefix("doppler=").map(finite)) {
            ("degrees", _) => dialect.angles = TiAngleUnit::Degrees,
            ("raised", _) => dialect.polar_points = PolarPoints::Raised,
            ("no-elevation", _) => dialect.has_elevation = false,
            ("targets", _) => dialect.entries = Entries::Targets,
            (_, Some(Ok(step))) if step > 0.0 => dialect.doppler_step_mps = Some(step as f32),
            (_, Some(_)) => return Err(format!("`{word}`: a Doppler step is a number of m/s above 0")),
            _ => return Err(format!("no `{word}`; there are degrees, raised, no-elevation, targets, doppler=M/S")),
        }
        Ok(dialect)
    })
}

/// How long something is to last.
pub fn seconds(text: &str) -> Result<f64, String> {
    let seconds = finite(text)?;
    if (0.1..=86_400.0).contains(&seconds) {
        Ok(seconds)
    } else {
        Err(format!("{seconds} s is not within 0.1 to 86400"))
    }
}

pub fn period(text: &str) -> Result<f64, String> {
    let seconds = finite(text)?;
    if (1e-3..=10.0).contains(&seconds) { Ok(seconds) } else { Err(format!("{seconds} s is not within 0.001 to 10")) }
}

pub fn velocity_scale(text: &str) -> Result<f64, String> {
    let factor = finite(text)?;
    let within = (1e-4..=1e4).contains(&factor);
    if within {
        Ok(factor)
    } else {
        Err(format!("{factor} is not within 0.0001 to 10000; --velocity-sign turns velocities"))
    }
}

pub fn noise(text: &str) -> Result<NoiseConfig, String> {
    let [range_m, azimuth_deg, elevation_deg, radial_velocity_mps] = numbers(text)?.map(|v| v as f32);
    let config = NoiseConfig { range_m, azimuth_deg, elevation_deg, radial_velocity_mps, ..NoiseConfig::default() };
    config.noise().map(|_| config).map_err(|e| e.to_string())
}

pub fn ground_error(text: &str) -> Result<GroundError, String> {
    let [times, ahead_m] = numbers(text)?;
    if (0.0..=3.0).contains(&times) && (-200.0..=200.0).contains(&ahead_m) {
        Ok(GroundError { times, ahead_m })
    } else {
        Err(format!("{times} times is not within 0 to 3, or {ahead_m} m not within -200 to 200"))
    }
}

pub fn mount(text: &str) -> Result<[f64; 6], String> {
    let [x, y, z, yaw, pitch, roll] = numbers(text)?;
    if z <= 0.0 {
        return Err(format!("the mount's height z = {z} m is not above the road"));
    }
    Ok([x, y, z, yaw.to_radians(), pitch.to_radians(), roll.to_radians()])
}

pub fn field_of_view(text: &str) -> Result<FieldOfView, String> {
    let [az0, az1, el0, el1, r0, r1] = numbers(text)?;
    for (what, lo, hi) in [("azimuth", az0, az1), ("elevation", el0, el1), ("range", r0, r1)] {
        if lo >= hi {
            return Err(format!("{what} from {lo} to {hi} is no interval: the lower limit comes first"));
        }
    }
    if r1 > MOST_RANGE_M {
        return Err(format!(
            "range to {r1} m: grids go to {MOST_RANGE_M} m; give that, and what is farther is left out"
        ));
    }
    Ok(FieldOfView {
        azimuth_rad: [az0.to_radians(), az1.to_radians()],
        elevation_rad: [el0.to_radians(), el1.to_radians()],
        range_m: [r0, r1],
    })
}
