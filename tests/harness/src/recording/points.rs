//! Radar points out of `PointCloud2` and `RadarScan` messages.
//!
//! A cloud tells range and angles, or x, y and z in its own frame (x ahead, y left, z up), of which they are computed.
//! Values are metres, radians and metres per second as they stand: nothing is converted.

use super::RadarDetection;
use super::ros::{PointCloud2, PointField, RadarScan};

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
#[derive(Debug, Default, PartialEq)]
pub struct Points {
    pub detections: Vec<RadarDetection>,
    pub not_finite: u64,
    pub not_a_range: u64,
}

impl Points {
    fn push(&mut self, d: RadarDetection) {
        let needed = [d.range_m, d.azimuth_rad, d.radial_velocity_mps, d.elevation_rad.unwrap_or(0.0)];
        if needed.iter().any(|v| !v.is_finite()) {
            self.not_finite += 1;
        } else if d.range_m <= 0.0 {
            self.not_a_range += 1;
        } else {
            self.detections.push(d);
        }
    }
}

/// Where one field lies in a point, and how it is written.
#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    double: bool,
}

impl Column {
    fn find(cloud: &PointCloud2, names: &[&str]) -> Result<Option<Self>, String> {
        let Some(field) = names.iter().find_map(|n| cloud.fields.iter().find(|f| f.name == *n)) else {
            return Ok(None);
        };
        let double = match field.datatype {
            PointField::FLOAT32 => false,
            PointField::FLOAT64 => true,
            other => {
                return Err(format!("field `{}` has datatype {other}, not FLOAT32 (7) or FLOAT64 (8)", field.name));
            }
        };
        let offset = field.offset as usize;
        if offset.saturating_add(if double { 8 } else { 4 }) > cloud.point_step as usize {
            return Err(format!("field `{}` ends beyond point_step {}", field.name, cloud.point_step));
        }
        Ok(Some(Self { offset, double }))
    }

    fn needed(cloud: &PointCloud2, names: &[&str]) -> Result<Self, String> {
        let found = || self::names(cloud);
        Self::find(cloud, names)?
            .ok_or_else(|| format!("no field `{}`; fields found: {}", names.join("` or `"), found()))
    }

    fn read(self, point: &[u8], big_endian: bool) -> f32 {
        let wide = |n: usize| -> [u8; 8] {
            let mut b = [0; 8];
            b[..n].copy_from_slice(&point[self.offset..self.offset + n]);
            b
        };
        if self.double {
            let b = wide(8);
            (if big_endian { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) }) as f32
        } else {
            let [b0, b1, b2, b3, ..] = wide(4);
            let b = [b0, b1, b2, b3];
            if big_endian { f32::from_be_bytes(b) } else { f32::from_le_bytes(b) }
        }
    }
}

/// Points of a cloud; the error names the field that is missing or malformed.
pub fn from_cloud(cloud: &PointCloud2) -> Result<Points, String> {
    let place = Place::find(cloud)?;
    let velocity = Column::needed(cloud, RADIAL_VELOCITY)?;
    let rcs = Column::find(cloud, RCS)?;
    let snr = Column::find(cloud, SNR)?;

    let (width, step, row) = (cloud.width as usize, cloud.point_step as usize, cloud.row_step as usize);
    let row = if cloud.height <= 1 { width.saturating_mul(step) } else { row };
    if step == 0 || row < width.saturating_mul(step) {
        return Err(format!("row_step {row} is shorter than {width} points of {step} bytes"));
    }
    let needed = row.saturating_mul(cloud.height as usize);
    if cloud.data.len() < needed {
        return Err(format!("{} bytes of data, {needed} announced", cloud.data.len()));
    }
    let mut points = Points::default();
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
    fn find(cloud: &PointCloud2) -> Result<Self, String> {
        let find = |names| Column::find(cloud, names);
        if let (Some(range), Some(azimuth)) = (find(RANGE)?, find(AZIMUTH)?) {
            return Ok(Self::Polar(range, azimuth, find(ELEVATION)?));
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
                // a point that is not finite stays so
                [flat.hypot(z) as f32, y.atan2(x) as f32, if z.is_nan() { f32::INFINITY } else { z.atan2(flat) as f32 }]
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
    use crate::recording::ros::{Header, RadarReturn};

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
        assert_eq!(one(&[1.0, 1.0, f32::NAN], "vr").not_finite, 1);
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
