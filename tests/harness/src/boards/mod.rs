//! Processor in the loop: the same scans through the library here and on a controller, every frame compared.

#[cfg(unix)]
pub mod can;
pub mod can_twin;
pub mod check;
pub mod cycles;
pub mod firmware;
pub mod host;
pub mod image;
pub mod listener;
pub mod live;
#[cfg(unix)]
pub mod live_check;
pub mod machine;
pub mod report;
pub mod scans;
#[cfg(unix)]
pub mod serial;
pub mod stress;

use anyhow::Result;
use clap::ValueEnum;
use viewshed::camera::boxes::ImageBox;
use viewshed::unit::settings::Settings;

/// Which firmware, by its grid.
pub use crate::estimators::Grid as Profile;

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

/// What is run on which board.
pub struct Run<'a> {
    pub board: Board,
    pub profile: Profile,
    /// The recording's name.
    pub name: &'a str,
    pub settings: &'a Settings,
    pub scans: &'a [Scan],
}

/// Runs a camera's boxes here and on a board and compares.
///
/// # Errors
/// Those of [`Run::check`].
pub fn check_camera(board: Board, settings: &Settings, scans: &[Scan<ImageBox>]) -> Result<Checked> {
    let image = firmware::build(board, Profile::Reference, "camera")?;
    let here = host::camera_answer(settings, scans)?;
    let answer = machine::batch(board, &image, settings, scans, None)?;
    let mut checked = check::compare(&answer, &here, scans.len())?;
    checked.image = Some(image::Image::read(&image)?);
    Ok(checked)
}

impl Run<'_> {
    /// Runs the scans here and there and compares.
    ///
    /// # Errors
    /// No image, no emulator, an answer that makes no sense. A frame that differs is no error here.
    pub fn check(&self) -> Result<Checked> {
        let image = firmware::build(self.board, self.profile, "batch")?;
        let (here, geometry) = host::answer(self.profile, self.settings, self.scans, None)?;
        let answer = machine::batch(self.board, &image, self.settings, self.scans, None)?;
        let mut checked = check::compare(&answer, &here, self.scans.len())?;
        checked.image = Some(image::Image::read(&image)?);
        if let Some(frame) = checked.first_difference {
            let (here, _) = host::answer(self.profile, self.settings, self.scans, Some(frame))?;
            let answer = machine::batch(self.board, &image, self.settings, self.scans, Some(frame))?;
            checked.difference = Some(check::difference(&answer, &here, frame, &geometry)?);
        }
        Ok(checked)
    }
}
