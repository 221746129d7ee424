//! What a block is built on: nothing, or a refresh.

/// What a block is built on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Basis {
    /// Decodes alone.
    Refresh,
    /// On the refresh this many ticks older, 1 to 16.
    Delta {
        /// Its age before this scan.
        ticks: u8,
    },
}
