//! A run on a controller as text, JSON and, where a frame differs, pictures.

use std::path::PathBuf;

use anyhow::Result;
use serde::Serialize;
use viewshed::bench::stage::Stage;
use viewshed::map::{CellState, Visibility};

use super::Run;
use super::check::{Checked, Difference};
use super::image::Image;
use crate::results::files::Folder;
use crate::results::pictures::cells::Carries;
use crate::results::pictures::polar::{self, PolarGrid};
use crate::results::report::table::{Extent, tables};

/// Median and worst of a number of instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cost {
    pub median: u32,
    pub worst: u32,
}

impl Cost {
    /// Of all counts; `None` of none.
    pub fn of(counts: impl Iterator<Item = u32>) -> Option<Self> {
        let mut counts: Vec<u32> = counts.collect();
        counts.sort_unstable();
        Some(Self { median: *counts.get(counts.len() / 2)?, worst: *counts.last()? })
    }

    /// In thousands.
    pub fn text(cost: Option<Self>) -> String {
        let thousands = |n: u32| format!("{:.1}", f64::from(n) / 1000.0);
        cost.map_or_else(|| "–".into(), |c| format!("{} / {}", thousands(c.median), thousands(c.worst)))
    }
}

/// One run, with stable keys.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    pub recording: String,
    pub board: &'static str,
    pub profile: &'static str,
    pub frames: usize,
    pub equal: usize,
    pub first_difference: Option<usize>,
    /// Instructions a frame of the estimator in all, and by stage in the order they run.
    pub instructions: Option<Cost>,
    pub stages: Vec<(&'static str, Option<Cost>)>,
    pub state_bytes: u32,
    pub parameter_bytes: u32,
    pub map_bytes: u32,
    pub stack_used_bytes: u32,
    pub stack_bytes: u32,
    /// The image in flash, and its variables in RAM, stack and test buffers not counted.
    pub flash_bytes: u64,
    pub ram_bytes: u64,
}

impl Row {
    pub fn new(run: &Run, checked: &Checked) -> Self {
        let stage = |s: Stage| Cost::of(checked.instructions.iter().map(|f| f[s as usize]));
        let [state_bytes, parameter_bytes, map_bytes] = checked.opening.bytes;
        let [stack_used_bytes, stack_bytes] = checked.closing.stack;
        Self {
            recording: run.name.to_owned(),
            board: run.board.name(),
            profile: run.profile.name(),
            frames: checked.frames,
            equal: checked.equal,
            first_difference: checked.first_difference,
            instructions: Cost::of(checked.instructions.iter().map(|f| f[..Stage::ESTIMATOR].iter().sum())),
            stages: Stage::ALL.iter().map(|s| (s.name(), stage(*s))).collect(),
            state_bytes,
            parameter_bytes,
            map_bytes,
            stack_used_bytes,
            stack_bytes,
            flash_bytes: checked.image.as_ref().map_or(0, Image::flash_bytes),
            ram_bytes: checked.image.as_ref().map_or(0, Image::ram_bytes),
        }
    }
}

/// Headings of the memory an image takes, bytes.
const MEMORY: [&str; 3] = ["flash", "RAM", "stack\nused"];

/// All runs as one table, or as several of the width of a terminal below each other.
pub fn table(rows: &[Row], extent: Extent) -> String {
    let fixed = ["recording", "board", "profile", "equal frames", "1000 instructions\nmedian / worst"];
    let heading = fixed.into_iter().chain(Stage::ALL.map(Stage::name)).chain(MEMORY);
    let cells = |row: &Row| -> Vec<String> {
        let words = [row.recording.clone(), row.board.into(), row.profile.into()];
        let stack = if row.stack_bytes > 0 { row.stack_used_bytes.to_string() } else { "–".into() };
        let numbers = [format!("{} / {}", row.equal, row.frames), Cost::text(row.instructions)];
        let stages = row.stages.iter().map(|(_, cost)| Cost::text(*cost));
        let memory = [row.flash_bytes.to_string(), row.ram_bytes.to_string(), stack];
        words.into_iter().chain(numbers).chain(stages).chain(memory).collect()
    };
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    tables(&heading.collect::<Vec<_>>(), &rows, 3, extent) + "\n"
}

impl Difference {
    /// What differs, in a sentence.
    pub fn text(&self) -> String {
        let mut cells = self.differing();
        let Some(first) = cells.next() else {
            return format!("frame {}: every cell is equal, only the fingerprints differ", self.frame);
        };
        let (host, board) = (self.host[first], self.board[first]);
        format!(
            "frame {}: {} cells differ, first azimuth {} range {}: grade and occupancy {} {} here, {} {} there",
            self.frame,
            1 + cells.count(),
            first / self.ranges,
            first % self.ranges,
            host[0],
            host[1],
            board[0],
            board[1],
        )
    }

    fn differing(&self) -> impl Iterator<Item = usize> {
        let differs = |k: &usize| self.host[*k] != self.board[*k];
        (0..self.host.len().min(self.board.len())).filter(differs)
    }

    fn state(&self, [grade, occupancy]: [u8; 2]) -> CellState {
        match grade {
            0 => CellState::UNKNOWN,
            g => CellState {
                visibility: if g >= self.visible_from { Visibility::Visible } else { Visibility::Invisible },
                grade: g,
                occupancy,
                occupied: occupancy >= 128,
            },
        }
    }

    /// Draws the map here, the map there, and only what differs; gives the files.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn draw(&self, folder: &Folder, title: &str) -> Result<Vec<PathBuf>> {
        let host = |k: usize| self.state(self.host[k]);
        let board = |k: usize| self.state(self.board[k]);
        let only = |k: usize| if self.host[k] == self.board[k] { CellState::UNKNOWN } else { board(k) };
        let pictures: [(&str, &dyn Fn(usize) -> CellState); 3] =
            [("host", &host), ("board", &board), ("difference", &only)];
        let mut files = Vec::new();
        for (name, of) in pictures {
            let grid = PolarGrid {
                azimuths: self.host.len() / self.ranges,
                ranges: self.ranges,
                azimuth_rad: self.azimuth_rad,
                narrow: self.narrow,
                range_m: [0.0, self.cell_m * self.ranges as f64],
                state: &|row, column| of(row * self.ranges + column),
                carries: Carries::ALL,
                title: format!("{title}, frame {}: {name}", self.frame),
                caption: Some(self.text()),
            };
            let file = folder.file(format!("frame-{:05}-{name}.png", self.frame))?;
            polar::draw(&grid).save(&file)?;
            files.push(file.path().to_owned());
        }
        Ok(files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::files::OutputArgs;

    #[test]
    fn the_first_cell_that_differs_is_named_and_drawn() {
        let mut board = vec![[255, 0]; 12];
        board[7] = [1, 3];
        let d = Difference {
            frame: 5,
            ranges: 4,
            azimuth_rad: [-0.5, 0.5],
            narrow: crate::geometry::azimuths::EVEN,
            cell_m: 2.0,
            host: vec![[255, 0]; 12],
            board,
            visible_from: 128,
        };
        assert_eq!(
            d.text(),
            "frame 5: 1 cells differ, first azimuth 1 range 3: grade and occupancy 255 0 here, 1 3 there"
        );
        let folder = std::env::temp_dir().join(format!("viewshed-difference-{}", std::process::id()));
        let files = d.draw(&OutputArgs::default().beside([]).folder("--out", &folder).unwrap(), "scene").unwrap();
        assert_eq!(files.len(), 3);
        let bytes = |k: usize| std::fs::read(&files[k]).unwrap();
        assert!(bytes(0) != bytes(1) && bytes(1) != bytes(2));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn the_table_fits_a_terminal_unless_it_is_asked_for_wide() {
        let cost = Some(Cost { median: 123_400, worst: 2_345_600 });
        let row = Row {
            recording: "roadside".into(),
            board: "nucleo-h743zi",
            profile: "reference",
            frames: 896,
            equal: 896,
            first_difference: None,
            instructions: cost,
            stages: Stage::ALL.iter().map(|s| (s.name(), cost)).collect(),
            state_bytes: 0,
            parameter_bytes: 0,
            map_bytes: 0,
            stack_used_bytes: 1000,
            stack_bytes: 9000,
            flash_bytes: 123_456,
            ram_bytes: 345_678,
        };
        let widest = |extent| table(std::slice::from_ref(&row), extent).lines().map(|line| line.chars().count()).max();
        assert!(widest(Extent::Terminal).unwrap() <= 80, "{}", table(std::slice::from_ref(&row), Extent::Terminal));
        assert!(widest(Extent::Wide).unwrap() > 200);
    }

    #[test]
    fn costs_are_median_and_worst() {
        assert_eq!(Cost::of([5, 1, 9].into_iter()), Some(Cost { median: 5, worst: 9 }));
        assert_eq!(Cost::of([].into_iter()), None);
        assert_eq!(Cost::text(Cost::of([1500, 2500].into_iter())), "2.5 / 2.5");
    }
}
