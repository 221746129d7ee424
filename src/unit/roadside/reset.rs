//! Why a controller started, from what its reset logic remembers.

use crate::wire::status::ResetCause;

/// What is remembered; several things at once, as each reset also pulls the pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ResetFlags {
    /// Power came.
    pub power_on: bool,
    /// The supply fell too low.
    pub brown_out: bool,
    /// A watchdog ran out.
    pub watchdog: bool,
    /// The program asked for it.
    pub software: bool,
    /// The program asked for it after a panic or a fault.
    pub crash: bool,
    /// The reset pin.
    pub pin: bool,
}

impl From<ResetFlags> for ResetCause {
    /// The one that says most.
    fn from(flags: ResetFlags) -> Self {
        // memory says anything when power comes, so the mark of a crash counts only with a reset by software
        match flags {
            ResetFlags { power_on: true, .. } => Self::PowerOn,
            ResetFlags { brown_out: true, .. } => Self::BrownOut,
            ResetFlags { watchdog: true, .. } => Self::Watchdog,
            ResetFlags { software: true, crash: true, .. } => Self::Crash,
            ResetFlags { software: true, .. } => Self::Software,
            ResetFlags { pin: true, .. } => Self::External,
            _ => Self::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flag_that_says_most_names_the_cause() {
        let none = ResetFlags::default();
        let pin = ResetFlags { pin: true, ..none };
        for (flags, cause) in [
            (none, ResetCause::Unknown),
            (pin, ResetCause::External),
            (ResetFlags { software: true, ..pin }, ResetCause::Software),
            (ResetFlags { software: true, crash: true, ..pin }, ResetCause::Crash),
            (ResetFlags { crash: true, ..pin }, ResetCause::External),
            (ResetFlags { watchdog: true, crash: true, ..pin }, ResetCause::Watchdog),
            (ResetFlags { brown_out: true, ..pin }, ResetCause::BrownOut),
            (ResetFlags { power_on: true, brown_out: true, crash: true, ..pin }, ResetCause::PowerOn),
        ] {
            assert_eq!(ResetCause::from(flags), cause, "{flags:?}");
        }
    }
}
