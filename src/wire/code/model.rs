//! The frequencies of the code's symbols, of 256.
//!
//! Counted on radar-3d's maps of the training recordings; `viewshed bus --count-symbols` prints
//! them anew. Other maps decode just as exactly and take a little more room.

/// How far an edge may lie from the expected one to be encoded as a shift.
pub const REACH: usize = 5;

/// Symbols of [`Model::edge`]: shifts of -5 to 5 cells, then these two.
pub const GONE: usize = 2 * REACH + 1;
/// An edge where none is expected.
pub const NEW: usize = 2 * REACH + 2;

/// Symbols of [`Model::ray`].
pub const AS_EXPECTED: usize = 0;
/// Known cells as expected, edges encoded.
pub const EDGES: usize = 1;
/// Known cells encoded, then edges.
pub const KNOWN: usize = 2;

/// Symbols of [`Model::limit`]: the limit is as expected, one cell nearer, one farther, or encoded.
pub const IN_FULL: usize = 3;

/// Room from which on each of the [`Model::stop`] tables but the first holds.
pub const STOP_CLASSES: [u32; 7] = [8, 12, 16, 20, 26, 34, 48];

/// With less room than this a message is over without saying so.
pub const STOPS_BELOW: u32 = 4;

/// All tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Model {
    /// How a ray is encoded, by what went before (see `Before`) and whether edges are expected.
    pub ray: [[[u8; 3]; 2]; 8],
    /// Whether the first known cell's bit is the expected one (0) or not, by the expected bit.
    pub first: [[u8; 2]; 2],
    /// The next edge, where one is expected: by kind (refresh, delta), by the bit before it, by the
    /// edge before (see `Last`).
    pub edge: [[[[u8; 13]; 5]; 2]; 2],
    /// Whether the ray has no further edge (0) or a new one, where none is expected any more: by
    /// kind, by the bit, by whether the edge before was a shift (0) or not.
    pub end: [[[[u8; 2]; 2]; 2]; 2],
    /// The number of bits of a new edge's distance, less one, by the bit before it.
    pub distance: [[u8; 8]; 2],
    /// A limit of the known cells.
    pub limit: [u8; 4],
    /// Whether another ray follows (0) or none, by room.
    pub stop: [[u8; 2]; 8],
}

/// The tables of wire version 1.
pub static MODEL: Model = VERSION_1;

/// For each symbol of [`MODEL`], the frequencies of those before it in its table.
pub static BELOW: Model = VERSION_1.below();

const VERSION_1: Model = include!("model.in");

impl Model {
    const fn below(mut self) -> Self {
        add_up(self.ray.as_flattened_mut());
        add_up(&mut self.first);
        add_up(self.edge.as_flattened_mut().as_flattened_mut());
        add_up(self.end.as_flattened_mut().as_flattened_mut());
        add_up(&mut self.distance);
        add_up(core::slice::from_mut(&mut self.limit));
        add_up(&mut self.stop);
        self
    }
}

#[allow(clippy::indexing_slicing)] // evaluated by the compiler
const fn add_up<const N: usize>(tables: &mut [[u8; N]]) {
    let mut table = 0;
    while table < tables.len() {
        let (mut below, mut symbol) = (0, 0);
        while symbol < N {
            let frequency = tables[table][symbol];
            tables[table][symbol] = below;
            below = below.wrapping_add(frequency);
            symbol += 1;
        }
        // sums to 256
        assert!(below == 0);
        table += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums_to_256(table: &[u8]) {
        assert_eq!(table.iter().map(|f| u32::from(*f)).sum::<u32>(), 256, "{table:?}");
        assert!(table.iter().all(|f| *f > 0), "every symbol can be encoded: {table:?}");
    }

    #[test]
    fn every_table_sums_to_256_and_leaves_room_for_every_symbol() {
        MODEL.ray.as_flattened().iter().for_each(|t| sums_to_256(t));
        MODEL.first.iter().for_each(|t| sums_to_256(t));
        MODEL.edge.as_flattened().as_flattened().iter().for_each(|t| sums_to_256(t));
        MODEL.end.as_flattened().as_flattened().iter().for_each(|t| sums_to_256(t));
        MODEL.distance.iter().for_each(|t| sums_to_256(t));
        sums_to_256(&MODEL.limit);
        MODEL.stop.iter().for_each(|t| sums_to_256(t));
    }

    #[test]
    fn below_a_symbol_are_those_before_it() {
        assert_eq!((MODEL.ray[2][1], BELOW.ray[2][1]), ([58, 196, 2], [0, 58, 254]));
        assert_eq!((MODEL.stop[7], BELOW.stop[7], BELOW.limit), ([255, 1], [0, 255], [0, 100, 124, 183]));
        assert_eq!(BELOW.edge[1][1][4], [0, 1, 8, 23, 40, 54, 108, 129, 147, 162, 170, 171, 240]);
    }

    #[test]
    fn the_tables_take_less_than_half_a_kilobyte() {
        assert_eq!(size_of::<Model>(), 364);
    }
}
