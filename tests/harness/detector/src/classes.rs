//! A network's classes, and which of them are vehicles.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use viewshed::camera::boxes::VehicleClass;

/// COCO's first classes, the vehicles and people among them; what follows is none.
/// T.-Y. Lin et al., "Microsoft COCO: Common Objects in Context", ECCV 2014.
const COCO: [&str; 8] = ["person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck"];

/// How many classes networks trained on it tell apart: 80, or 90 with numbers that were never used. The first are alike.
const COCO_COUNTS: [usize; 2] = [80, 90];

/// Names of a network's classes, by their number.
#[derive(Debug, Clone, PartialEq)]
pub struct Classes {
    names: Vec<Option<&'static str>>,
    /// Whether the user named them.
    told: bool,
}

impl Classes {
    /// Those of COCO.
    pub fn coco() -> Self {
        Self { names: COCO.iter().map(|name| project_name(name)).collect(), told: false }
    }

    /// One name a line, the first class first.
    ///
    /// # Errors
    /// A file that cannot be read, or names no vehicle.
    pub fn read(path: &Path) -> Result<Self> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("--classes: cannot read {}", path.display()))?;
        let names: Vec<_> = text.lines().map(|line| project_name(line.trim())).collect();
        ensure!(
            names.iter().any(Option::is_some),
            "--classes: {} names no vehicle; one name a line, such as car, van, truck, bus, motorcycle, bicycle, person",
            path.display()
        );
        Ok(Self { names, told: true })
    }

    /// What the project calls a class; `None` for what it has no box of.
    pub fn name(&self, number: usize) -> Option<&'static str> {
        self.names.get(number).copied().flatten()
    }

    /// # Errors
    /// A network that tells another number of classes apart than there are names.
    pub fn check(&self, count: usize) -> Result<()> {
        if self.told {
            ensure!(
                count == self.names.len(),
                "the model tells {count} classes apart, --classes has {} names",
                self.names.len()
            );
        } else {
            ensure!(
                COCO_COUNTS.contains(&count),
                "the model tells {count} classes apart, COCO has 80: name them with --classes FILE, one a line"
            );
        }
        Ok(())
    }
}

/// The project's name of a class.
fn project_name(name: &str) -> Option<&'static str> {
    Some(match VehicleClass::named(name)? {
        VehicleClass::Car => "car",
        VehicleClass::Van => "van",
        VehicleClass::Truck => "truck",
        VehicleClass::Bus => "bus",
        VehicleClass::Motorcycle => "motorcycle",
        VehicleClass::Bicycle => "bicycle",
        VehicleClass::Pedestrian => "pedestrian",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vehicles_of_coco_have_the_names_of_the_project() {
        let names: Vec<_> = (0..9).map(|k| Classes::coco().name(k)).collect();
        let expected = ["pedestrian", "bicycle", "car", "motorcycle", "", "bus", "", "truck", ""];
        assert_eq!(names, expected.map(|name| (!name.is_empty()).then_some(name)));
        assert_eq!(Classes::coco().name(79), None);
        assert!(Classes::coco().check(80).is_ok() && Classes::coco().check(90).is_ok());
        assert!(Classes::coco().check(3).unwrap_err().to_string().contains("--classes FILE"));
    }

    #[test]
    fn other_classes_are_read_from_a_file() {
        let file = std::env::temp_dir().join(format!("viewshed-classes-{}", std::process::id()));
        std::fs::write(&file, "lorry\ntruck\n van \n").unwrap();
        let classes = Classes::read(&file).unwrap();
        assert_eq!([0, 1, 2, 3].map(|k| classes.name(k)), [None, Some("truck"), Some("van"), None]);
        assert!(classes.check(80).unwrap_err().to_string().contains("--classes has 3 names"));
        std::fs::write(&file, "cat\n").unwrap();
        assert!(Classes::read(&file).unwrap_err().to_string().contains("names no vehicle"));
        std::fs::remove_file(&file).unwrap();
        assert!(format!("{:#}", Classes::read(&file).unwrap_err()).contains("cannot read"));
    }
}
