//! What a vehicle is: class and size, from SUMO's `vType` elements or by the name of its class.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use quick_xml::events::{BytesStart, Event};

use super::opened;
use crate::recording::labels::class_size;

/// The classes of RECORDINGS.md.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    Car,
    Van,
    Truck,
    Bus,
    Motorcycle,
    Bicycle,
    Pedestrian,
}

impl Class {
    pub const ALL: [Self; 7] =
        [Self::Car, Self::Van, Self::Truck, Self::Bus, Self::Motorcycle, Self::Bicycle, Self::Pedestrian];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Car => "car",
            Self::Van => "van",
            Self::Truck => "truck",
            Self::Bus => "bus",
            Self::Motorcycle => "motorcycle",
            Self::Bicycle => "bicycle",
            Self::Pedestrian => "pedestrian",
        }
    }

    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.name() == name)
    }

    /// Length, width, height where nobody says, metres.
    pub fn size(self) -> [f64; 3] {
        // every class is one of the labels' own
        class_size(self.name()).unwrap_or([4.6, 1.8, 1.5])
    }
}

/// Class and size of one vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    pub class: Class,
    /// Length, width, height, metres.
    pub size: [f64; 3],
}

/// Longest, widest and highest a vehicle may be, metres: an overlong combination, with room.
const LARGEST_M: [f64; 3] = [40.0, 5.0, 6.0];

/// SUMO's vehicle classes with the size a `vType` has that gives none.
///
/// # References
/// SUMO documentation, "Vehicle Type Parameter Defaults".
const VEHICLE_CLASSES: [(&str, Class, [f64; 3]); 18] = [
    ("passenger", Class::Car, [5.0, 1.8, 1.5]),
    ("private", Class::Car, [5.0, 1.8, 1.5]),
    ("taxi", Class::Car, [5.0, 1.8, 1.5]),
    ("evehicle", Class::Car, [5.0, 1.8, 1.5]),
    ("hov", Class::Car, [5.0, 1.8, 1.5]),
    ("vip", Class::Car, [5.0, 1.8, 1.5]),
    ("authority", Class::Car, [5.0, 1.8, 1.5]),
    ("army", Class::Car, [5.0, 1.8, 1.5]),
    ("delivery", Class::Van, [6.5, 2.16, 2.86]),
    ("emergency", Class::Van, [6.5, 2.16, 2.86]),
    ("truck", Class::Truck, [7.1, 2.4, 2.4]),
    ("trailer", Class::Truck, [16.5, 2.55, 4.0]),
    ("bus", Class::Bus, [12.0, 2.5, 3.4]),
    ("coach", Class::Bus, [14.0, 2.6, 4.0]),
    ("motorcycle", Class::Motorcycle, [2.2, 0.9, 1.5]),
    ("moped", Class::Motorcycle, [2.1, 0.8, 1.7]),
    ("bicycle", Class::Bicycle, [1.6, 0.65, 1.7]),
    ("pedestrian", Class::Pedestrian, [0.215, 0.478, 1.719]),
];

/// SUMO's own type of vehicles that are given none.
const DEFAULT_TYPE: &str = "DEFAULT_VEHTYPE";

/// Every type that has been defined.
#[derive(Debug, Clone, Default)]
pub struct VehicleTypes {
    defined: BTreeMap<String, Kind>,
}

impl VehicleTypes {
    /// Reads the `vType` elements of SUMO files (routes or additional).
    ///
    /// # Errors
    /// Names file, line and type: a class nobody knows, a size that is no size.
    pub fn read(paths: &[PathBuf]) -> Result<Self> {
        let mut types = Self::default();
        for path in paths {
            let before = types.defined.len();
            types.read_file(path)?;
            ensure!(types.defined.len() > before, "vehicle types {}: it has no <vType> element", path.display());
        }
        Ok(types)
    }

    fn read_file(&mut self, path: &Path) -> Result<()> {
        let text = opened::open(path).context("vehicle types")?;
        let line = text.line();
        let mut xml = quick_xml::Reader::from_reader(text);
        let mut buffer = Vec::new();
        loop {
            buffer.clear();
            let place = || format!("{}, line {}", path.display(), line.number());
            match xml.read_event_into(&mut buffer).with_context(place)? {
                Event::Start(e) | Event::Empty(e) if e.name().as_ref() == "vType" => {
                    let (id, kind) = definition(&e).with_context(place)?;
                    self.defined.insert(id, kind);
                }
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    /// The kind a type name means: as defined, by its own name where that is a class, or SUMO's default.
    ///
    /// # Errors
    /// A name that is none of these, with what would be.
    pub fn kind(&self, name: &str) -> Result<Kind> {
        // members of a distribution carry their own id; SUMO appends nothing to it
        if let Some(kind) = self.defined.get(name) {
            return Ok(*kind);
        }
        if let Some(class) = Class::named(name) {
            return Ok(Kind { class, size: class.size() });
        }
        if name == DEFAULT_TYPE {
            return Ok(Kind { class: Class::Car, size: [5.0, 1.8, 1.5] });
        }
        let known: Vec<&str> =
            self.defined.keys().map(String::as_str).chain(Class::ALL.iter().map(|c| c.name())).collect();
        bail!("unknown vehicle type `{name}`; known are {}. Name the file with its <vType>.", known.join(", "));
    }
}

fn definition(element: &BytesStart) -> Result<(String, Kind)> {
    let text = |key: &str| opened::attribute(element, key);
    let id = text("id")?.context("<vType> without an id")?;
    let vehicle_class = text("vClass")?.unwrap_or_else(|| "passenger".into());
    let Some(&(_, class, mut size)) = VEHICLE_CLASSES.iter().find(|(name, ..)| *name == vehicle_class) else {
        bail!("<vType id=\"{id}\">: vClass `{vehicle_class}` is none that drives on a road here");
    };
    for (k, key) in ["length", "width", "height"].into_iter().enumerate() {
        if let Some(value) = text(key)? {
            size[k] = value.parse().with_context(|| format!("<vType id=\"{id}\">: {key} `{value}` is no number"))?;
        }
        ensure!(
            size[k] > 0.0 && size[k] <= LARGEST_M[k],
            "<vType id=\"{id}\">: {key} {} m is outside 0 to {} m",
            size[k],
            LARGEST_M[k]
        );
    }
    Ok((id, Kind { class, size }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(attributes: &str) -> Result<(String, Kind)> {
        definition(&BytesStart::from_content(format!("vType {attributes}"), 5))
    }

    #[test]
    fn a_type_takes_the_size_of_its_class_where_it_gives_none() {
        let (id, kind) = of(r#"id="t" vClass="trailer" length="18.75""#).unwrap();
        assert_eq!((id.as_str(), kind.class, kind.size), ("t", Class::Truck, [18.75, 2.55, 4.0]));
        assert_eq!(of(r#"id="c""#).unwrap().1.class, Class::Car);
    }

    #[test]
    fn impossible_types_are_named() {
        let error = |attributes: &str| format!("{:#}", of(attributes).unwrap_err());
        assert!(error(r#"id="s" vClass="ship""#).contains("`ship`"));
        assert!(error(r#"id="s" length="-3""#).contains("length -3 m"));
        assert!(error(r#"id="s" width="nan""#).contains("width NaN m"));
        assert!(error(r#"id="s" height="high""#).contains("`high` is no number"));
        assert!(error(r#"vClass="bus""#).contains("without an id"));
    }

    #[test]
    fn an_unknown_type_says_what_is_known() {
        let types = VehicleTypes::default();
        assert_eq!(types.kind("truck").unwrap().size, [16.5, 2.55, 4.0]);
        let error = types.kind("rocket").unwrap_err().to_string();
        assert!(error.contains("`rocket`") && error.contains("pedestrian"), "{error}");
    }
}
