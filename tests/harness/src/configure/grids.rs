//! Whether units can be configured with a file: by grid, and by what the boards have room for.

use viewshed::probability::{TableError, fitted_with};
use viewshed::unit::profile::{reference, small};
use viewshed::unit::settings::{BlockError, BlockKind, Settings, SettingsCheck, UnitConfig};

use super::file::{FITTED_ON, UnitFile};
use super::kept::{self, KINDS};

/// A grid that units run on.
pub struct Grid {
    pub name: &'static str,
    cells: [u8; 2],
    pub check: SettingsCheck,
    boards: &'static [Board],
}

/// What a board's firmware of a grid has room for (boards/README.md); all have it for heights.
struct Board {
    name: &'static str,
    lanes: bool,
    table: bool,
    learns: bool,
}

/// All of them.
#[allow(clippy::cast_possible_truncation)] // 100 x 96
pub const GRIDS: [Grid; 2] = [
    Grid {
        name: "reference",
        cells: FITTED_ON,
        check: reference::CHECK,
        boards: &[
            Board { name: "mps2-an386", lanes: true, table: true, learns: true },
            Board { name: "zcu102-r5", lanes: true, table: false, learns: true },
            Board { name: "nucleo-h743zi", lanes: true, table: true, learns: true },
        ],
    },
    Grid {
        name: "small",
        cells: [small::State::RANGES as u8, small::State::AZIMUTHS as u8],
        check: small::CHECK,
        boards: &[
            Board { name: "mps2-an386", lanes: true, table: true, learns: false },
            Board { name: "zcu102-r5", lanes: true, table: false, learns: false },
            Board { name: "nucleo-g474re", lanes: false, table: false, learns: false },
        ],
    },
];

impl Grid {
    /// The one with so many ranges and azimuths.
    pub fn of(cells: [u8; 2]) -> Option<&'static Self> {
        GRIDS.iter().find(|grid| grid.cells == cells)
    }

    /// Why no controller with it can be configured with a file.
    pub fn refused(&self, file: &UnitFile) -> Option<String> {
        if let Err(error) = self.check.settings(&file.settings) {
            return Some(error.to_string());
        }
        if let Some(why) = table_refused(file, self.cells) {
            return Some(why);
        }
        let learns_on_none = file.settings.unit.learn_lanes && self.boards.iter().all(|board| !board.learns);
        learns_on_none.then(|| "learn_lanes: no controller has room for it with this grid, the daemon alone".into())
    }

    /// Boards of this grid that have no room for all of a file, and what for.
    pub fn not_on(&self, file: &UnitFile) -> Vec<(&'static str, String)> {
        let has = |kind: BlockKind| KINDS.into_iter().zip(&file.blocks).any(|(k, block)| k == kind && block.is_some());
        let missing = |board: &Board| {
            let parts = [
                (has(BlockKind::Lanes) && !board.lanes, kept::key(BlockKind::Lanes)),
                (has(BlockKind::Probabilities) && !board.table, kept::key(BlockKind::Probabilities)),
                (file.settings.unit.learn_lanes && !board.learns, "learn_lanes"),
            ];
            parts.into_iter().filter(|(lacks, _)| *lacks).map(|(_, key)| key).collect::<Vec<_>>()
        };
        let boards = self.boards.iter().map(|board| (board.name, missing(board)));
        boards.filter(|(_, missing)| !missing.is_empty()).map(|(name, missing)| (name, missing.join(", "))).collect()
    }
}

/// Why a unit with so many ranges and azimuths takes no table of a file's, as the unit itself would find only after its
/// settings were written.
pub fn table_refused(file: &UnitFile, cells: [u8; 2]) -> Option<String> {
    let table = file.fitted_with?;
    let key = kept::key(BlockKind::Probabilities);
    if file.settings.unit.learn_lanes {
        return Some(format!(
            "{key}: tables are fitted without learn_lanes, and fit no unit that learns; take one out"
        ));
    }
    if cells != FITTED_ON {
        return Some(format!("{key}: {}", BlockError::Grid(FITTED_ON)));
    }
    // what watches the radar changes no grade
    let unit = UnitConfig { supervise: false, ..file.settings.unit };
    let unit = fitted_with(Settings { unit, ..file.settings }.fingerprint());
    (table != unit).then(|| format!("{key}: {}", TableError::Configuration { table, unit }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configure::file;

    /// The example with other lines, and a table fitted with its settings (0) or with others.
    fn example(from: &str, to: &str, table: Option<u32>) -> UnitFile {
        let folder = std::env::temp_dir().join(format!("viewshed-grids-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(format!("{:?}.toml", std::thread::current().id()));
        assert!(file::EXAMPLE.contains(from));
        std::fs::write(&path, file::EXAMPLE.replacen(from, to, 1)).unwrap();
        let mut file = file::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        if let Some(other) = table {
            let unit = UnitConfig { supervise: false, ..file.settings.unit };
            file.fitted_with = Some(fitted_with(Settings { unit, ..file.settings }.fingerprint()) ^ other);
            file.blocks[2] = Some(Vec::new());
        }
        file
    }

    fn refusals(file: &UnitFile) -> [Option<String>; 2] {
        GRIDS.map(|grid| grid.refused(file))
    }

    fn boards(file: &UnitFile) -> [Vec<(&'static str, String)>; 2] {
        GRIDS.map(|grid| grid.not_on(file))
    }

    const LANES: &str = "\n[[lanes]]\npoints = [[0.0, -1.75], [60.0, -1.75]]\n\n[mount]\n";

    #[test]
    fn the_example_is_for_every_board() {
        let file = example("[mount]", "[mount]", None);
        assert_eq!((refusals(&file), boards(&file)), ([None, None], [vec![], vec![]]));
    }

    #[test]
    fn a_table_of_another_mount_or_of_a_unit_that_learns_is_refused() {
        let [reference, small] = refusals(&example("[mount]", "[mount]", Some(0)));
        assert_eq!(reference, None);
        assert!(small.unwrap().contains("the probability table was fitted on a grid of 200 x 128"));
        let [reference, _] = refusals(&example("[mount]", "[mount]", Some(1)));
        assert!(reference.unwrap().starts_with("[probability]: the probability table was fitted with configuration"));
        // what only watches changes no grade
        assert_eq!(refusals(&example("#[unit]", "[unit]\nsupervise = true", Some(0)))[0], None);
        for refused in refusals(&example("#[unit]", "[unit]\nlearn_lanes = true", Some(0))) {
            assert!(refused.unwrap().contains("fit no unit that learns"));
        }
    }

    #[test]
    fn boards_without_room_are_named() {
        let of_lanes = boards(&example("\n[mount]\n", LANES, Some(0)));
        let expected = [
            vec![("zcu102-r5", "[probability]".to_owned())],
            vec![("zcu102-r5", "[probability]".to_owned()), ("nucleo-g474re", "[[lanes]], [probability]".to_owned())],
        ];
        assert_eq!(of_lanes, expected);
        let learns = example("#[unit]", "[unit]\nlearn_lanes = true", None);
        assert_eq!(boards(&learns)[0], vec![]);
        let [reference, small] = refusals(&learns);
        assert_eq!(reference, None);
        assert!(small.unwrap().contains("no controller has room for it with this grid"));
    }

    /// What a product's firmware is built with says what it has room for.
    #[test]
    fn boards_have_the_features_that_are_told() {
        for (name, manifest) in [
            ("nucleo-h743zi", include_str!("../../../../boards/nucleo-h743zi/Cargo.toml")),
            ("nucleo-g474re", include_str!("../../../../boards/nucleo-g474re/Cargo.toml")),
        ] {
            let features = manifest.lines().find(|line| line.starts_with("viewshed = ")).unwrap();
            let has = |feature: &str| features.contains(&format!("\"{feature}\""));
            let board = GRIDS.iter().flat_map(|grid| grid.boards).find(|board| board.name == name).unwrap();
            assert_eq!(board.learns, has("learning"), "{name}");
            assert_eq!(board.lanes, has("lanes") || has("learning"), "{name}");
            assert_eq!(board.table, has("probability"), "{name}");
            assert!(has("ground"), "{name}");
        }
    }
}
