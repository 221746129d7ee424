//! Processor in the loop: the same scans through the library here and on a controller, every frame compared.

pub mod check;
pub mod firmware;
pub mod image;
pub mod machine;
pub mod report;
pub mod scans;
pub mod stress;

use anyhow::Result;
use clap::ValueEnum;
use viewshed::radar_3d::{Radar3d, Radar3dParameters};
use viewshed::settings::Settings;

use check::Checked;
use scans::Scan;

/// An emulated controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// Arm Cortex-M4F
    Mps2An386,
    /// Arm Cortex-M7, with the Cortex-M4F's image
    Mps2An500,
    /// Arm Cortex-R5F of a Zynq UltraScale+
    Zcu102R5,
}

impl Board {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mps2An386 => "mps2-an386",
            Self::Mps2An500 => "mps2-an500",
            Self::Zcu102R5 => "zcu102-r5",
        }
    }

    /// Folder of its firmware in `boards/`.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Mps2An386 | Self::Mps2An500 => "mps2-an386",
            Self::Zcu102R5 => "zcu102-r5",
        }
    }
}

/// Size of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Profile {
    /// 200 x 120 x 16 cells
    Reference,
    /// 100 x 64 x 8 cells
    Small,
}

impl Profile {
    pub const ALL: [Self; 2] = [Self::Reference, Self::Small];

    pub fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Small => "small",
        }
    }
}

/// What is run on which board.
pub struct Run<'a> {
    pub board: Board,
    pub profile: Profile,
    /// The recording's name.
    pub name: &'a str,
    pub settings: &'a Settings,
    pub scans: &'a [Scan],
}

impl Run<'_> {
    /// Runs the scans here and there and compares.
    ///
    /// # Errors
    /// No image, no emulator, an answer that makes no sense. A frame that differs is no error here.
    pub fn check(&self) -> Result<Checked> {
        match self.profile {
            Profile::Reference => self.check_sized::<200, 120, 16, 7, 64, 256>(),
            Profile::Small => self.check_sized::<100, 64, 8, 4, 28, 176>(),
        }
    }

    fn check_sized<const R: usize, const A: usize, const E: usize, const W: usize, const N: usize, const D: usize>(
        &self,
    ) -> Result<Checked> {
        let image = firmware::build(self.board, self.profile)?;
        let parameters = Radar3dParameters::<R, A, E>::new(&self.settings.sensor, &self.settings.radar_3d())?;
        let mut state = Box::new(Radar3d::<R, A, E, W, N, D>::new());
        let expected = check::fingerprints(&mut state, &parameters, self.scans);
        let answer = machine::batch(self.board, &image, self.settings, self.scans, None)?;
        let mut checked = check::compare(&answer, &expected, self.scans.len())?;
        checked.image = Some(image::Image::read(&image)?);
        if let Some(frame) = checked.first_difference {
            let dumped = machine::batch(self.board, &image, self.settings, self.scans, Some(frame))?;
            checked.difference = check::difference(&mut state, &parameters, self.scans, frame, &dumped)?;
        }
        Ok(checked)
    }
}
