//! How much of a wave the road throws on, mirror-like.
//!
//! # Model
//! Fresnel's coefficient of a flat, lossless surface times the loss by roughness,
//! `exp(-2 (2 pi sigma sin(psi) / lambda)^2)`, psi the grazing angle, sigma the rms height. The sign is kept:
//! near grazing the road turns the phase by half a turn.
//!
//! # References
//! - V. Kurz et al., "Road Surface Characteristics for the Automotive 77 GHz Band", Adv. Radio Sci. 19
//!   (2021) 165: permittivity of asphalt and concrete from reflection measured at 77 GHz.
//! - R. Schneider, "Modellierung der Wellenausbreitung für ein bildgebendes Kfz-Radar", thesis, Karlsruhe 1998.
//! - P. Beckmann, A. Spizzichino, "The Scattering of Electromagnetic Waves from Rough Surfaces", 1963.

use serde::{Deserialize, Serialize};

/// Plane of the electric field, seen along the road.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Polarisation {
    Horizontal,
    Vertical,
}

/// A road surface at the radar's wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Road {
    /// Relative permittivity, real part; 0 for a road that reflects nothing.
    pub permittivity: f64,
    /// Rms height of the surface, millimetres.
    pub roughness_mm: f64,
    pub polarisation: Polarisation,
}

impl Default for Road {
    fn default() -> Self {
        Self { permittivity: 3.2, roughness_mm: 0.5, polarisation: Polarisation::Vertical }
    }
}

impl Road {
    /// Ratio of the reflected field to the incoming one at a grazing angle given by its sine.
    pub fn reflection(&self, sine: f64, wavelength_m: f64) -> f64 {
        if self.permittivity < 1.0 {
            return 0.0;
        }
        let refracted = (self.permittivity - (1.0 - sine * sine)).sqrt();
        let fresnel = match self.polarisation {
            Polarisation::Horizontal => (sine - refracted) / (sine + refracted),
            Polarisation::Vertical => (self.permittivity * sine - refracted) / (self.permittivity * sine + refracted),
        };
        let phase = std::f64::consts::TAU * self.roughness_mm * 1e-3 * sine / wavelength_m;
        fresnel * (-2.0 * phase * phase).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WAVELENGTH_M: f64 = 0.0039;

    #[test]
    fn grazing_reflects_nearly_all_and_turned() {
        for polarisation in [Polarisation::Horizontal, Polarisation::Vertical] {
            let road = Road { polarisation, ..Road::default() };
            assert!(road.reflection(0.001, WAVELENGTH_M) < -0.99);
        }
    }

    #[test]
    fn vertical_waves_vanish_at_brewsters_angle_and_horizontal_do_not() {
        // sin(psi) = 1 / sqrt(1 + permittivity) = cos(Brewster's angle)
        let sine = 1.0 / 4.2_f64.sqrt();
        assert!(Road::default().reflection(sine, WAVELENGTH_M).abs() < 1e-9);
        let horizontal = Road { polarisation: Polarisation::Horizontal, roughness_mm: 0.0, ..Road::default() };
        assert!(horizontal.reflection(sine, WAVELENGTH_M) < -0.5);
    }

    #[test]
    fn rough_roads_scatter_the_wave_away() {
        let at = |roughness_mm| Road { roughness_mm, ..Road::default() }.reflection(0.1, WAVELENGTH_M).abs();
        assert!(at(0.0) > at(1.0) && at(1.0) > at(4.0) && at(4.0) < 0.3);
        assert_eq!(Road { permittivity: 0.0, ..Road::default() }.reflection(0.1, WAVELENGTH_M), 0.0);
    }
}
