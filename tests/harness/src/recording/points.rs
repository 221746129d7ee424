//! Radar points out of `PointCloud2` and `RadarScan` messages.
//!
//! A cloud tells range and angles, or x, y and z in its own frame (x ahead, y left, z up), of which they are computed.
//! Values are metres, radians and metres per second as they stand: nothing is converted.

use super::RadarDetection;
use super::ros::{PointCloud2, RadarScan};

/// Names a field goes by: ours first, then those of drivers.
const RANGE: &[&str] = &["range"];
const AZIMUTH: &[&str] = &["azimuth", "azimuth_angle"];
const ELEVATION: &[&str] = &["elevation", "elevation_angle"];
const RADIAL_VELOCITY: &[&str] = &[
    "radial_velocity",
    "radial_speed",
    "velocity",
    "doppler",
    "doppler_velocity",
    "v_r",
    "vr",
    "v_radial",
    "range_rate",
    "speed_radial",
];
const X: &[&str] = &["x"];
const Y: &[&str] = &["y"];
const Z: &[&str] = &["z"];
const RCS: &[&str] = &["rcs"];
const SNR: &[&str] = &["snr"];

/// Why a point was not taken.
pub const NOT_FINITE: &str = "detection with a value that is not finite, dropped";
pub const NOT_A_RANGE: &str = "detection with a range of zero or below, dropped";

/// Points of one message, and how many were dropped for which reason.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Points {
    pub detections: Vec<RadarDetection>,
    pub not_finite: u64,
    pub not_a_range: u64,
    /// Of these, places in which nothing is filled: NaN or zero throughout.
    pub blank_nan: u64,
    pub blank_zero: u64,
    /// Fields that are there and cannot be read; points are taken without them.
    pub unread: Vec<String>,
}

impl Points {
    fn push(&mut self, d: RadarDetection) {
        let needed = [d.range_m, d.azimuth_rad, d.radial_velocity_mps, d.elevation_rad.unwrap_or(0.0)];
        let all = |what: fn(f32) -> bool| what(d.range_m) && what(d.azimuth_rad);
        let blank = (all(f32::is_nan) || all(|v| v == 0.0)) && needed[2..].iter().all(|v| v.is_nan() || *v == 0.0);
        if needed.iter().any(|v| !v.is_finite()) {
            self.not_finite += 1;
            self.blank_nan += u64::from(blank);
        } else if d.range_m <= 0.0 {
            self.not_a_range += 1;
            self.blank_zero += u64::from(blank);
        } else {
            self.detections.push(d);
        }
    }

    /// Points of the message, taken or not.
    pub fn places(&self) -> u64 {
        self.detections.len() as u64 + self.not_finite + self.not_a_range
    }
}

/// How a value is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Datatype {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Float32,
    Float64,
}

impl Datatype {
    /// As `sensor_msgs/msg/PointField` numbers them.
    fn of(number: u8) -> Option<Self> {
        use Datatype::{Float32, Float64, Int8, Int16, Int32, Uint8, Uint16, Uint32};
        [Int8, Uint8, Int16, Uint16, Int32, Uint32, Float32, Float64].get(usize::from(number).checked_sub(1)?).copied()
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    fn is_float(self) -> bool {
        matches!(self, Self::Float32 | Self::Float64)
    }
}

/// Where one field lies in a point, and how it is written.
#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    datatype: Datatype,
}

impl Column {
    /// A field of real numbers; whole ones would be of a unit that nobody tells.
    fn find(cloud: &PointCloud2, names: &[&str]) -> Result<Option<Self>, String> {
        let found = Self::of_any_type(cloud, names)?;
        match found {
            Some((column, name)) if !column.datatype.is_float() => {
                Err(format!("field `{name}` has whole numbers, not FLOAT32 (7) or FLOAT64 (8)"))
            }
            found => Ok(found.map(|(column, _)| column)),
        }
    }

    /// A field with its name.
    fn of_any_type<'a>(cloud: &'a PointCloud2, names: &[&str]) -> Result<Option<(Self, &'a str)>, String> {
        let Some(field) = names.iter().find_map(|n| cloud.fields.iter().find(|f| f.name == *n)) else {
            return Ok(None);
        };
        let Some(datatype) = Datatype::of(field.datatype) else {
            return Err(format!("field `{}` has datatype {}, which is none", field.name, field.datatype));
        };
        let offset = field.offset as usize;
        if offset.saturating_add(datatype.bytes()) > cloud.point_step as usize {
            return Err(format!("field `{}` ends beyond point_step {}", field.name, cloud.point_step));
        }
        Ok(Some((Self { offset, datatype }, &field.name)))
    }

    /// A field that points may lack, in any type; one that cannot be read is noted and left out.
    fn optional(cloud: &PointCloud2, names: &[&str], unread: &mut Vec<String>) -> Option<Self> {
        match Self::of_any_type(cloud, names) {
            Ok(found) => found.map(|(column, _)| column),
            Err(what) => {
                unread.push(what);
                None
            }
        }
    }

    fn needed(cloud: &PointCloud2, names: &[&str]) -> Result<Self, String> {
        let found = || self::names(cloud);
        Self::find(cloud, names)?
            .ok_or_else(|| format!("no field `{}`; fields found: {}", names.join("` or `"), found()))
    }

    fn read(self, point: &[u8], big_endian: bool) -> f32 {
        let mut b = [0; 8];
        let bytes = &point[self.offset..self.offset + self.datatype.bytes()];
        // as if all were little-endian
        for (place, byte) in b.iter_mut().zip(bytes) {
            *place = *byte;
        }
        if big_endian {
            b[..bytes.len()].reverse();
        }
        let [b0, b1, b2, b3, ..] = b;
        match self.datatype {
            Datatype::Int8 => f32::from(b0 as i8),
            Datatype::Uint8 => f32::from(b0),
            Datatype::Int16 => f32::from(i16::from_le_bytes([b0, b1])),
            Datatype::Uint16 => f32::from(u16::from_le_bytes([b0, b1])),
            Datatype::Int32 => i32::from_le_bytes([b0, b1, b2, b3]) as f32,
            Datatype::Uint32 => u32::from_le_bytes([b0, b1, b2, b3]) as f32,
            Datatype::Float32 => f32::from_le_bytes([b0, b1, b2, b3]),
            Datatype::Float64 => f64::from_le_bytes(b) as f32,
        }
    }
}

/// Points of a cloud; the error names the field that is missing or malformed.
pub fn from_cloud(cloud: &PointCloud2) -> Result<Points, String> {
    let mut points = Points::default();
    let place = Place::find(cloud, &mut points.unread)?;
    let velocity = Column::needed(cloud, RADIAL_VELOCITY)?;
    let rcs = Column::optional(cloud, RCS, &mut points.unread);
    let snr = Column::optional(cloud, SNR, &mut points.unread);

    let (width, step, row) = (cloud.width as usize, cloud.point_step as usize, cloud.row_step as usize);
    let row = if cloud.height <= 1 { width.saturating_mul(step) } else { row };
    if step == 0 || row < width.saturating_mul(step) {
        return Err(format!("row_step {row} is shorter than {width} points of {step} bytes"));
    }
    let needed = row.saturating_mul(cloud.height as usize);
    // rows may be padded to the next point, and not by a whole one
    if cloud.data.len() < needed || cloud.data.len() >= needed.saturating_add(step) {
        return Err(format!(
            "{} bytes of data, {needed} announced by width {width}, height {} and point_step {step}: it is no empty scan, and which of them is wrong is not known",
            cloud.data.len(),
            cloud.height
        ));
    }
    for line in cloud.data[..needed].chunks_exact(row.max(1)) {
        for point in line[..width * step].chunks_exact(step) {
            let get = |c: Column| c.read(point, cloud.is_bigendian);
            let measured = |c: Option<Column>| c.map(get).filter(|v| !v.is_nan());
            let [range_m, azimuth_rad, elevation_rad] = place.read(get);
            points.push(RadarDetection {
                range_m,
                azimuth_rad,
                elevation_rad: Some(elevation_rad).filter(|e| !e.is_nan()),
                radial_velocity_mps: get(velocity),
                rcs_dbsm: measured(rcs).filter(|v| v.is_finite()),
                snr_db: measured(snr).filter(|v| v.is_finite()),
            });
        }
    }
    // a radar that measures no elevation puts all of its points into its own plane
    if matches!(place, Place::Cartesian(..)) && points.detections.iter().all(|d| d.elevation_rad == Some(0.0)) {
        points.detections.iter_mut().for_each(|d| d.elevation_rad = None);
    }
    Ok(points)
}

/// How a cloud says where its points are.
enum Place {
    /// Range, azimuth and, where measured, elevation.
    Polar(Column, Column, Option<Column>),
    Cartesian(Column, Column, Column),
}

impl Place {
    fn find(cloud: &PointCloud2, unread: &mut Vec<String>) -> Result<Self, String> {
        let find = |names| Column::find(cloud, names);
        if let (Some(range), Some(azimuth)) = (find(RANGE)?, find(AZIMUTH)?) {
            let elevation = find(ELEVATION).unwrap_or_else(|what| {
                unread.push(what);
                None
            });
            return Ok(Self::Polar(range, azimuth, elevation));
        }
        match (find(X)?, find(Y)?, find(Z)?) {
            (Some(x), Some(y), Some(z)) => Ok(Self::Cartesian(x, y, z)),
            _ => Err(format!("neither range and azimuth nor x, y and z; fields found: {}", names(cloud))),
        }
    }

    /// Range, azimuth, elevation; NaN where that is not measured.
    fn read(&self, get: impl Fn(Column) -> f32) -> [f32; 3] {
        match *self {
            Self::Polar(range, azimuth, elevation) => [get(range), get(azimuth), elevation.map_or(f32::NAN, get)],
            Self::Cartesian(x, y, z) => {
                let [x, y, z] = [x, y, z].map(|c| f64::from(get(c)));
                let flat = x.hypot(y);
                // without a z the height is not measured
                let range = if z.is_nan() { flat } else { flat.hypot(z) };
                [range as f32, y.atan2(x) as f32, z.atan2(flat) as f32]
            }
        }
    }
}

fn names(cloud: &PointCloud2) -> String {
    cloud.fields.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ")
}

/// Points of a `RadarScan`; its amplitude in dB stands for the SNR.
pub fn from_scan(scan: &RadarScan) -> Points {
    let mut points = Points::default();
    for r in &scan.returns {
        points.push(RadarDetection {
            range_m: r.range,
            azimuth_rad: r.azimuth,
            elevation_rad: Some(r.elevation).filter(|e| !e.is_nan()),
            radial_velocity_mps: r.doppler_velocity,
            rcs_dbsm: None,
            snr_db: Some(r.amplitude).filter(|a| a.is_finite()),
        });
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::ros::{Header, PointField, RadarReturn};

    fn cloud(names: &[&str], points: &[&[f32]]) -> PointCloud2 {
        let step = 4 * names.len() as u32;
        PointCloud2 {
            header: Header::default(),
            height: 1,
            width: points.len() as u32,
            fields: names
                .iter()
                .enumerate()
                .map(|(i, n)| PointField {
                    name: (*n).into(),
                    offset: 4 * i as u32,
                    datatype: PointField::FLOAT32,
                    count: 1,
                })
                .collect(),
            is_bigendian: false,
            point_step: step,
            row_step: step * points.len() as u32,
            data: points.iter().flat_map(|p| p.iter().flat_map(|v| v.to_le_bytes())).collect(),
            is_dense: true,
        }
    }

    #[test]
    fn smartmicro_names_are_understood() {
        let c = cloud(
            &["x", "range", "azimuth_angle", "elevation_angle", "radial_speed", "rcs"],
            &[&[0.0, 50.0, 0.1, -0.2, -3.0, 7.0]],
        );
        let p = from_cloud(&c).unwrap();
        assert_eq!(
            p.detections,
            [RadarDetection {
                range_m: 50.0,
                azimuth_rad: 0.1,
                elevation_rad: Some(-0.2),
                radial_velocity_mps: -3.0,
                rcs_dbsm: Some(7.0),
                snr_db: None
            }]
        );
    }

    #[test]
    fn range_and_angles_are_computed_of_x_y_and_z() {
        let one = |xyz: &[f32], velocity: &str| {
            from_cloud(&cloud(&["x", "y", "z", velocity], &[&[xyz, &[-3.0]].concat()])).unwrap()
        };
        let d = one(&[30.0, 40.0, -50.0], "velocity").detections[0];
        let elevation = d.elevation_rad.unwrap();
        assert!((d.range_m - 70.710_68).abs() < 1e-4, "{d:?}");
        assert!((d.azimuth_rad - 0.927_295).abs() < 1e-6, "to the left is +: {d:?}");
        assert!((elevation + std::f32::consts::FRAC_PI_4).abs() < 1e-6, "below is -: {d:?}");
        assert_eq!(d.radial_velocity_mps, -3.0);
        for name in ["doppler", "v_r", "range_rate", "doppler_velocity"] {
            assert_eq!(one(&[30.0, -40.0, 0.0], name).detections[0].elevation_rad, None, "all in the radar's plane");
        }
        assert_eq!(one(&[f32::NAN, 1.0, 1.0], "vr").not_finite, 1);
        assert_eq!(one(&[1.0, 1.0, f32::INFINITY], "vr").not_finite, 1);
        let flat = one(&[3.0, 4.0, f32::NAN], "vr").detections[0];
        assert_eq!((flat.range_m, flat.elevation_rad), (5.0, None), "a height that is not measured");
        assert_eq!(one(&[0.0, 0.0, 0.0], "vr").not_a_range, 1);
    }

    #[test]
    fn range_and_angles_go_before_x_y_and_z() {
        let names = ["x", "y", "z", "range", "azimuth", "radial_velocity"];
        let d = from_cloud(&cloud(&names, &[&[1.0, 2.0, 3.0, 50.0, 0.25, 1.0]])).unwrap().detections[0];
        assert_eq!((d.range_m, d.azimuth_rad, d.elevation_rad), (50.0, 0.25, None));
    }

    #[test]
    fn a_missing_field_is_named_with_what_was_found() {
        let e = from_cloud(&cloud(&["x", "range", "azimuth"], &[])).unwrap_err();
        assert!(e.contains("radial_velocity") && e.contains("x, range, azimuth"), "{e}");
    }

    #[test]
    fn values_that_are_no_measurement_are_counted() {
        let names = ["range", "azimuth", "radial_velocity", "elevation"];
        let c = cloud(
            &names,
            &[
                &[f32::NAN, 0.0, 0.0, 0.0],
                &[-1.0, 0.0, 0.0, 0.0],
                &[10.0, f32::INFINITY, 0.0, 0.0],
                &[10.0, 0.0, 0.0, f32::NAN],
            ],
        );
        let p = from_cloud(&c).unwrap();
        assert_eq!((p.not_finite, p.not_a_range, p.detections.len()), (2, 1, 1));
        assert_eq!(p.detections[0].elevation_rad, None, "NaN elevation is not measured, not wrong");
    }

    #[test]
    fn announced_bytes_that_are_missing_are_an_error() {
        let mut c = cloud(&["range", "azimuth", "radial_velocity"], &[&[1.0, 0.0, 0.0]]);
        c.width = 2;
        assert!(from_cloud(&c).is_err());
        c.width = u32::MAX;
        assert!(from_cloud(&c).is_err());
        c.point_step = 0;
        assert!(from_cloud(&c).is_err());
    }

    #[test]
    fn data_that_contradict_their_size_are_no_empty_scan() {
        let names = ["range", "azimuth", "radial_velocity"];
        let points = [[1.0, 0.0, 0.0_f32]; 6];
        let c = cloud(&names, &points.each_ref().map(|p| &p[..]));
        for (width, height) in [(0, 1), (6, 0), (0, 0), (5, 1), (1, 1), (1, 2)] {
            let wrong = PointCloud2 { width, height, ..c.clone() };
            assert!(from_cloud(&wrong).is_err_and(|e| e.contains("72 bytes of data")), "{width} x {height}");
        }
        let empty = PointCloud2 { width: 0, data: Vec::new(), ..c.clone() };
        assert_eq!(from_cloud(&empty), Ok(Points::default()));
        assert_eq!(
            from_cloud(&PointCloud2 { width: 2, height: 3, row_step: 24, ..c }).map(|p| p.detections.len()),
            Ok(6)
        );
    }

    #[test]
    fn fields_that_points_may_lack_are_read_in_any_type() {
        for (datatype, bytes, value) in [
            (1, vec![0xF8], -8.0),
            (2, vec![0xF8], 248.0),
            (3, vec![0xFF, 0xFE], -2.0),
            (4, vec![0x01, 0x02], 258.0),
            (5, vec![0xFF, 0xFF, 0xFF, 0xFE], -2.0),
            (6, vec![0, 0, 1, 0], 256.0),
            (7, 2.5_f32.to_be_bytes().to_vec(), 2.5),
            (8, (-2.5_f64).to_be_bytes().to_vec(), -2.5),
        ] {
            for is_bigendian in [false, true] {
                let mut c = cloud(&["range", "azimuth", "radial_velocity"], &[&[10.0, 0.5, 2.0]]);
                let extra = bytes.len() as u32;
                c.fields.push(PointField { name: "rcs".into(), offset: 12, datatype, count: 1 });
                (c.point_step, c.row_step, c.is_bigendian) = (12 + extra, 12 + extra, is_bigendian);
                let mut extra = bytes.clone();
                if is_bigendian {
                    c.data.chunks_exact_mut(4).for_each(<[u8]>::reverse);
                } else {
                    extra.reverse();
                }
                c.data.extend(extra);
                let d = from_cloud(&c).unwrap().detections[0];
                assert_eq!((d.range_m, d.rcs_dbsm), (10.0, Some(value)), "{datatype} {is_bigendian}");
            }
        }
    }

    #[test]
    fn a_field_that_cannot_be_read_is_told_and_the_points_are_taken() {
        let mut c = cloud(&["range", "azimuth", "radial_velocity", "snr"], &[&[10.0, 0.5, 2.0, 3.0]]);
        c.fields[3].datatype = 99;
        let p = from_cloud(&c).unwrap();
        assert_eq!((p.detections[0].snr_db, p.unread.len()), (None, 1));
        assert!(p.unread[0].contains("field `snr` has datatype 99"), "{:?}", p.unread);
        // whole numbers of what is needed are of a unit that nobody tells
        c.fields[0].datatype = 6;
        assert!(from_cloud(&c).unwrap_err().contains("field `range` has whole numbers"));
    }

    #[test]
    fn places_without_a_point_are_told_from_measurements_that_failed() {
        let names = ["x", "y", "z", "velocity"];
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let rows: [&[f32]; 6] = [
            &[nan; 4],
            &[nan, nan, nan, 0.0],
            &[0.0; 4],
            &[nan, 1.0, 1.0, 1.0],
            &[inf, 1.0, 1.0, 1.0],
            &[0.0, 0.0, 0.0, 7.0],
        ];
        let p = from_cloud(&cloud(&names, &rows)).unwrap();
        assert_eq!((p.not_finite, p.blank_nan, p.not_a_range, p.blank_zero, p.places()), (4, 2, 2, 1, 6));
    }

    #[test]
    fn big_endian_and_double_fields_are_read() {
        let mut c = cloud(&["range", "azimuth", "radial_velocity"], &[&[0.0; 3]]);
        c.is_bigendian = true;
        c.fields = vec![
            PointField { name: "range".into(), offset: 0, datatype: PointField::FLOAT64, count: 1 },
            PointField { name: "azimuth".into(), offset: 8, datatype: PointField::FLOAT32, count: 1 },
            PointField { name: "radial_velocity".into(), offset: 12, datatype: PointField::FLOAT32, count: 1 },
        ];
        c.point_step = 16;
        c.data = [12.5_f64.to_be_bytes().to_vec(), 0.25_f32.to_be_bytes().to_vec(), (-2.0_f32).to_be_bytes().to_vec()]
            .concat();
        let d = from_cloud(&c).unwrap().detections[0];
        assert_eq!((d.range_m, d.azimuth_rad, d.radial_velocity_mps), (12.5, 0.25, -2.0));
    }

    #[test]
    fn radar_scan_keeps_its_signs() {
        let s = RadarScan {
            header: Header::default(),
            returns: vec![RadarReturn {
                range: 5.0,
                azimuth: 0.5,
                elevation: 0.1,
                doppler_velocity: 2.0,
                amplitude: 20.0,
            }],
        };
        let d = from_scan(&s).detections[0];
        assert_eq!((d.azimuth_rad, d.radial_velocity_mps, d.snr_db), (0.5, 2.0, Some(20.0)));
    }
}
