//! Pictures of files and folders.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use image::{ImageReader, RgbImage};

/// Endings of files that are taken for pictures in a folder.
const ENDINGS: [&str; 3] = ["jpg", "jpeg", "png"];

/// Sides no camera has more of, pixels.
const LARGEST_PX: u32 = 20_000;

/// The pictures these are or hold, folders in the order of names.
///
/// # Errors
/// A path that is not there, a folder without pictures.
pub fn find(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in paths {
        if !path.is_dir() {
            ensure!(path.exists(), "{}: there is no such picture or folder", path.display());
            all.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).with_context(|| format!("cannot read the folder {}", path.display()))?;
        let entries = entries.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>();
        let mut own = entries.with_context(|| format!("cannot read the folder {}", path.display()))?;
        own.retain(|file| is_picture(file) && file.is_file());
        if own.is_empty() {
            bail!("{}: no picture in this folder (.jpg, .jpeg and .png are looked for)", path.display());
        }
        own.sort();
        all.extend(own);
    }
    Ok(all)
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    ending.is_some_and(|e| ENDINGS.contains(&e.as_str()))
}

/// Reads a picture, whatever its name says it is.
///
/// # Errors
/// It cannot be read, is none, or is too large.
pub fn read(path: &Path) -> Result<RgbImage> {
    let place = || path.display().to_string();
    let mut reader = ImageReader::open(path).with_context(place)?.with_guessed_format().with_context(place)?;
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LARGEST_PX), Some(LARGEST_PX));
    reader.limits(limits);
    let picture = reader
        .decode()
        .with_context(|| format!("{}: no picture that can be read (JPEG and PNG can)", path.display()))?;
    Ok(picture.to_rgb8())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_read_in_the_order_of_names_and_what_is_no_picture_is_told() {
        let folder = std::env::temp_dir().join(format!("viewshed-pictures-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let error = |paths: &[PathBuf]| format!("{:#}", find(paths).unwrap_err());
        assert!(error(std::slice::from_ref(&folder)).contains("no picture in this folder"));
        assert!(error(&[folder.join("none.png")]).contains("no such picture or folder"));
        RgbImage::from_pixel(3, 2, image::Rgb([1, 2, 3])).save(folder.join("b.png")).unwrap();
        std::fs::write(folder.join("a.JPG"), "no picture").unwrap();
        std::fs::write(folder.join("notes.txt"), "").unwrap();
        let found = find(std::slice::from_ref(&folder)).unwrap();
        assert_eq!(found, [folder.join("a.JPG"), folder.join("b.png")]);
        let broken = format!("{:#}", read(&found[0]).unwrap_err());
        assert!(broken.contains("a.JPG: no picture that can be read"), "{broken}");
        assert_eq!(read(&found[1]).unwrap().get_pixel(2, 1).0, [1, 2, 3]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
