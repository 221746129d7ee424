//! The loop and its inputs on the grid of 200 x 128 x 12 cells; `small` has the same two files with another size.

use viewshed::reference as size;

/// radar-3d on this grid, with its sender.
type Unit<'u> = viewshed::Unit<'u, size::supervised::State, size::QuantisedSender>;

#[path = "input.rs"]
mod input;
#[path = "run.rs"]
pub mod run;
