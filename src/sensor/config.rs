//! Checking a configuration in SI units, once, before the loop.

/// The numbers of a configuration, in the order in which its fields are named. A field that is not named does not compile;
/// what is no number comes last and is left out.
#[cfg(feature = "tuned")]
macro_rules! numbers {
    ($of:expr => $config:ident: $($number:ident),+ $(; but $other:ident)?) => {{
        let &$config { $($number,)+ $($other: _,)? } = $of;
        [$($number),+]
    }};
}
#[cfg(feature = "tuned")]
pub(crate) use numbers;

/// A parameter that cannot be worked with.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigError {
    /// Path of the parameter, as in `gate.max_speed_mps`.
    pub parameter: &'static str,
    /// Its value.
    pub value: f32,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Problem {
    /// Infinite or not a number.
    NotFinite,
    /// Outside the limits.
    OutOfLimits {
        /// Smallest value allowed.
        min: f32,
        /// Largest value allowed.
        max: f32,
    },
    /// Of radars only, and this is a camera.
    OfRadars,
    /// With this mount nothing at slice height is in view.
    NothingInView,
    /// Not above its lower neighbour.
    NotAscending {
        /// The neighbour's value.
        lower: f32,
    },
    /// More lanes than there is room for.
    TooManyLanes,
    /// More segments of lanes than there is room for.
    TooManyPoints,
    /// A lane of fewer than two points.
    OnePoint,
    /// A lane with a point that is, or nearly is, the one before it.
    PointTwice,
    /// A lane with a point far outside of what any sensor reaches.
    TooFar,
    /// A lane that crosses itself.
    CrossesItself,
    /// More heights of the road than there is room for.
    TooManyHeights,
    /// Two heights of the road with more than 12 % between them, or less than a metre of road.
    TooSteep,
    /// A bit rate that no divider of a controller's clock meets.
    NoDivider {
        /// The clock.
        clock_hz: u32,
    },
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { parameter, value, problem } = self;
        match problem {
            Problem::NotFinite => write!(f, "{parameter} is {value}, not a finite number"),
            Problem::OutOfLimits { min, max } => write!(f, "{parameter} is {value}, outside {min} to {max}"),
            Problem::OfRadars => write!(f, "{parameter} is {value}, which a camera has no use for"),
            Problem::NothingInView => write!(
                f,
                "{parameter} is {value}: with this mount no point at slice height is in view, check height and pitch"
            ),
            Problem::NotAscending { lower } => write!(f, "{parameter} is {value}, not above {lower}"),
            Problem::TooManyLanes => write!(f, "{parameter}: lane {value} is one more than there is room for"),
            Problem::TooManyPoints => write!(f, "{parameter}: lane {value} has more points than there is room for"),
            Problem::OnePoint => write!(f, "{parameter}: lane {value} has fewer than two points"),
            Problem::PointTwice => write!(f, "{parameter}: lane {value} has two points within half a metre"),
            Problem::TooFar => write!(f, "{parameter}: lane {value} reaches farther than 400 m from the sensor"),
            Problem::CrossesItself => write!(f, "{parameter}: lane {value} crosses itself"),
            Problem::TooManyHeights => write!(f, "{parameter}: point {value} is one more than there is room for"),
            Problem::TooSteep => write!(f, "{parameter}: before point {value} the road is steeper than 12 %"),
            Problem::NoDivider { clock_hz } => {
                write!(f, "{parameter} is {value}, which no divider of {clock_hz} Hz meets")
            }
        }
    }
}

impl core::error::Error for ConfigError {}

/// A value within limits.
///
/// # Errors
/// Names the parameter.
#[inline(never)] // called for every parameter, once
pub(crate) fn within(parameter: &'static str, value: f32, min: f32, max: f32) -> Result<f32, ConfigError> {
    let problem = if !value.is_finite() {
        Problem::NotFinite
    } else if value < min || value > max {
        Problem::OutOfLimits { min, max }
    } else {
        return Ok(value);
    };
    Err(ConfigError { parameter, value, problem })
}

/// A value above another.
///
/// # Errors
/// Names the parameter.
#[inline(never)]
pub(crate) fn above(parameter: &'static str, value: f32, lower: f32) -> Result<f32, ConfigError> {
    if value > lower {
        Ok(value)
    } else {
        Err(ConfigError { parameter, value, problem: Problem::NotAscending { lower } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn the_parameter_is_named_with_its_limits() {
        let e = within("mount.height_m", -1.0, 0.1, 20.0).unwrap_err();
        assert_eq!(e.to_string(), "mount.height_m is -1, outside 0.1 to 20");
        assert_eq!(within("a", f32::NAN, 0.0, 1.0).unwrap_err().problem, Problem::NotFinite);
        assert_eq!(above("b", 1.0, 1.0).unwrap_err().to_string(), "b is 1, not above 1");
    }
}
