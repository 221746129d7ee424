//! Resolution cells: what lies in one of range, Doppler and azimuth is one signal.
//!
//! # Model
//! Cells are half a resolution wide (the FFT bins), in azimuth uniform in the sine as an array's are. The
//! fields of a cell's echoes add up with their phases and the noise; a cell counts only where it is the
//! greatest among its neighbours (one to each side in each of the three), so two scatterers nearer than
//! the resolution are one detection, at the power's middle. Beside a much stronger one of the same range
//! and Doppler, a weaker drowns in the array's side lobes.
//!
//! # References
//! M. Richards, "Fundamentals of Radar Signal Processing", chapters 3 (Doppler) and 9 (beamforming).

use std::collections::BTreeMap;

use super::Radar;
use super::echo::Echo;
use crate::twin::random::Dice;

/// Range, Doppler and azimuth bin.
pub type Bin = [i32; 3];

/// A signal of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    pub bin: Bin,
    /// Power over the mean noise.
    pub power: f64,
    pub range_m: f64,
    pub azimuth_rad: f64,
    pub elevation_rad: f64,
    pub velocity_mps: f64,
}

/// Sums of one cell; places weighted by power.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    amplitude: [f64; 2],
    power: f64,
    weight: f64,
    /// Range, azimuth, elevation, velocity times weight.
    moments: [f64; 4],
}

/// The greatest cells, in the order of their bins.
pub fn resolve(radar: &Radar, echoes: Vec<Echo>, dice: &mut Dice) -> Vec<Peak> {
    let resolution = &radar.model.resolution;
    let steps =
        [resolution.range_m / 2.0, resolution.velocity_mps / 2.0, resolution.azimuth_deg.to_radians().sin() / 2.0];
    let mut cells: BTreeMap<Bin, Cell> = BTreeMap::new();
    for e in echoes {
        let place = [e.range_m, e.velocity_mps, e.azimuth_rad.sin()];
        let bin = [0, 1, 2].map(|k| (place[k] / steps[k]).floor() as i32);
        let cell = cells.entry(bin).or_default();
        let weight = e.power();
        cell.amplitude = [cell.amplitude[0] + e.amplitude[0], cell.amplitude[1] + e.amplitude[1]];
        cell.weight += weight;
        for (moment, value) in cell.moments.iter_mut().zip([e.range_m, e.azimuth_rad, e.elevation_rad, e.velocity_mps])
        {
            *moment += weight * value;
        }
    }
    for cell in cells.values_mut() {
        // complex noise of power 1
        let noise = [dice.normal(), dice.normal()].map(|v| v * std::f64::consts::FRAC_1_SQRT_2);
        cell.power = (cell.amplitude[0] + noise[0]).powi(2) + (cell.amplitude[1] + noise[1]).powi(2);
    }
    greatest(&cells, 10_f64.powf(-resolution.azimuth_side_lobe_db / 10.0))
}

fn greatest(cells: &BTreeMap<Bin, Cell>, side_lobe: f64) -> Vec<Peak> {
    // strongest of each range and Doppler
    let mut strongest: BTreeMap<[i32; 2], f64> = BTreeMap::new();
    for (bin, cell) in cells {
        let entry = strongest.entry([bin[0], bin[1]]).or_default();
        *entry = entry.max(cell.power);
    }
    let mut peaks = Vec::new();
    for (&bin, cell) in cells {
        let mut sum = *cell;
        let beaten = neighbours(bin).any(|n| {
            let Some(other) = cells.get(&n) else { return false };
            sum.weight += other.weight;
            for (own, their) in sum.moments.iter_mut().zip(other.moments) {
                *own += their;
            }
            // of equals the first stays
            other.power > cell.power || (other.power == cell.power && n < bin)
        });
        let drowned = cell.power < side_lobe * strongest[&[bin[0], bin[1]]];
        if beaten || drowned {
            continue;
        }
        let [range_m, azimuth_rad, elevation_rad, velocity_mps] = sum.moments.map(|m| m / sum.weight);
        peaks.push(Peak { bin, power: cell.power, range_m, azimuth_rad, elevation_rad, velocity_mps });
    }
    peaks
}

fn neighbours([range, doppler, azimuth]: Bin) -> impl Iterator<Item = Bin> {
    let near = |v: i32| v.saturating_sub(1)..=v.saturating_add(1);
    near(range)
        .flat_map(move |r| near(doppler).flat_map(move |d| near(azimuth).map(move |a| [r, d, a])))
        .filter(move |n| *n != [range, doppler, azimuth])
}

#[cfg(test)]
mod tests {
    use super::super::made_up::radar;
    use super::*;
    use crate::twin::random::Use;

    fn echo(range_m: f64, azimuth_deg: f64, velocity_mps: f64, amplitude: f64) -> Echo {
        let azimuth_rad = azimuth_deg.to_radians();
        Echo { range_m, azimuth_rad, elevation_rad: 0.0, velocity_mps, amplitude: [amplitude, 0.0] }
    }

    fn peaks(echoes: &[Echo]) -> Vec<Peak> {
        let all = resolve(&radar(), echoes.to_vec(), &mut Dice::new(1, Use::RadarFrame, 1));
        all.into_iter().filter(|p| p.power > 16.0).collect()
    }

    #[test]
    fn nearer_than_the_resolution_is_one_detection_in_the_middle() {
        // resolutions: 0.5 m, 1.6 degrees, 0.15 m/s
        let base = echo(100.0, 3.0, 10.0, 30.0);
        for (dr, da, dv) in [(0.2, 0.0, 0.0), (0.0, 0.7, 0.0), (0.0, 0.0, 0.06)] {
            let merged = peaks(&[base, echo(100.0 + dr, 3.0 + da, 10.0 + dv, 30.0)]);
            assert_eq!(merged.len(), 1, "{dr} {da} {dv}");
            assert!((merged[0].range_m - 100.0 - dr / 2.0).abs() < 1e-9);
            assert!((merged[0].azimuth_rad.to_degrees() - 3.0 - da / 2.0).abs() < 1e-9);
            assert!((merged[0].velocity_mps - 10.0 - dv / 2.0).abs() < 1e-9);
        }
        for (dr, da, dv) in [(0.8, 0.0, 0.0), (0.0, 2.5, 0.0), (0.0, 0.0, 0.25)] {
            assert_eq!(peaks(&[base, echo(100.0 + dr, 3.0 + da, 10.0 + dv, 30.0)]).len(), 2, "{dr} {da} {dv}");
        }
    }

    #[test]
    fn opposite_phases_cancel() {
        let mut other = echo(100.0, 3.0, 10.0, 30.0);
        other.amplitude = [-30.0, 0.0];
        assert!(peaks(&[echo(100.0, 3.0, 10.0, 30.0), other]).is_empty());
    }

    #[test]
    fn a_weak_one_drowns_beside_a_strong_one_of_the_same_range_and_doppler() {
        let weak = echo(100.0, 20.0, 10.0, 10.0);
        assert_eq!(peaks(&[weak, echo(100.0, 0.0, 10.0, 50.0)]).len(), 2);
        assert_eq!(peaks(&[weak, echo(100.0, 0.0, 10.0, 500.0)]).len(), 1);
        assert_eq!(peaks(&[weak, echo(100.0, 0.0, 12.0, 500.0)]).len(), 2, "other Doppler");
    }
}
