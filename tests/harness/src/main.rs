//! The `viewshed` command.

fn main() {}
