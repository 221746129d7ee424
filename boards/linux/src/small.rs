//! The loop and its inputs on the grid of 100 x 96 x 4 cells; `reference` has the same two files with another size.

use viewshed::small as size;

/// radar-3d on this grid, with its sender.
type Unit<'u> = viewshed::Unit<'u, size::supervised::State, size::QuantisedSender>;

#[path = "input.rs"]
mod input;
#[path = "run.rs"]
pub mod run;
