//! Rows of what a unit is told of its site.

use viewshed::radar_3d::Radar3dConfig;

use super::{Options, own_name};

/// The same unit that is told nothing of its site.
pub(super) fn untold(told: &Radar3dConfig, options: &Options) -> Radar3dConfig {
    Radar3dConfig { visibility: options.radar_3d.visibility, ground: &[], lanes: &[], ..*told }
}

/// What is said of the site, each alone, and where there is more than one, all of it.
pub(super) fn said<'a>(usual: &Radar3dConfig, told: &Radar3dConfig) -> Vec<(&'a str, Radar3dConfig)> {
    let each = [
        ("narrow", Radar3dConfig { visibility: told.visibility, ..*usual }),
        ("ground", Radar3dConfig { ground: told.ground, ..*usual }),
        ("lanes", Radar3dConfig { lanes: told.lanes, ..*usual }),
    ];
    let mut said: Vec<_> = each.into_iter().filter(|(_, config)| config != usual).collect();
    if said.len() > 1 {
        said.push(("site", *told));
    }
    said
}

/// How many rows of tables `said` makes, of so many things that are said of a site.
pub const fn site_rows(said: u64) -> u64 {
    if said > 1 { said + 1 } else { said }
}

/// The row of `replay`'s table that a [unit](super::unit) of this configuration is: told all that is said of its site.
pub fn unit_row(told: &Radar3dConfig, options: &Options) -> String {
    let (name, said) = (own_name(options), said(&untold(told, options), told));
    said.last().map_or_else(|| name.to_owned(), |(what, _)| format!("{name}-{what}"))
}
