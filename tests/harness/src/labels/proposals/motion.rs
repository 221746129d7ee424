//! How a vehicle moves: place and velocity in the plane, filtered and smoothed.
//!
//! # Model
//! State x, y, vx, vy; white acceleration; scalar measurements one after another (Kalman). The smoother goes back over
//! the filtered states (Rauch, Tung, Striebel, *Maximum likelihood estimates of linear dynamic systems*, 1965).

/// Acceleration of road users along their way, m/s² (one standard deviation, white).
const ALONG_MPS2: f64 = 2.0;
/// Across it: a turn of this radius (m) at most, up to as much as along it; straight roads at this speed and above.
const TURN_M: f64 = 8.0;
const STRAIGHT_MPS: f64 = 20.0;
const STRAIGHT_MPS2: f64 = 0.2;
/// Below this speed the direction of the next move is not known, m/s.
const UNDIRECTED_MPS: f64 = 1.0;

type Matrix = [[f64; 4]; 4];

/// Place, velocity and their covariance.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// x, y in metres, vx, vy in m/s.
    pub state: [f64; 4],
    pub covariance: Matrix,
}

impl Motion {
    /// A beginning: spread of place (m), of velocity along and across `direction` (m/s).
    pub fn new(place: [f64; 2], velocity: [f64; 2], place_m: f64, direction: [f64; 2], spread: [f64; 2]) -> Self {
        let mut covariance = [[0.0; 4]; 4];
        let [c, s] = direction;
        let [along, across] = spread.map(|v| v * v);
        covariance[0][0] = place_m * place_m;
        covariance[1][1] = place_m * place_m;
        covariance[2][2] = along * c * c + across * s * s;
        covariance[3][3] = along * s * s + across * c * c;
        covariance[2][3] = (along - across) * c * s;
        covariance[3][2] = covariance[2][3];
        Self { state: [place[0], place[1], velocity[0], velocity[1]], covariance }
    }

    pub fn place(&self) -> [f64; 2] {
        [self.state[0], self.state[1]]
    }

    pub fn velocity(&self) -> [f64; 2] {
        [self.state[2], self.state[3]]
    }

    pub fn speed(&self) -> f64 {
        self.state[2].hypot(self.state[3])
    }

    /// Variance of a linear function of the state.
    pub fn variance(&self, h: [f64; 4]) -> f64 {
        (0..4).map(|i| h[i] * dot(self.covariance[i], h)).sum()
    }

    pub fn predict(&mut self, dt_s: f64) {
        for k in 0..2 {
            self.state[k] += dt_s * self.state[k + 2];
        }
        // F P F', with F = 1 + dt in the upper right
        for row in 0..2 {
            for column in 0..4 {
                self.covariance[row][column] += dt_s * self.covariance[row + 2][column];
            }
        }
        for row in 0..4 {
            for column in 0..2 {
                self.covariance[row][column] += dt_s * self.covariance[row][column + 2];
            }
        }
        let speed = self.speed();
        let turn = (speed * speed / TURN_M).min(ALONG_MPS2) * (1.0 - (speed / STRAIGHT_MPS).min(1.0));
        let across = if speed < UNDIRECTED_MPS { ALONG_MPS2 } else { turn.max(STRAIGHT_MPS2) };
        let [along, across] = [ALONG_MPS2, across].map(|a| a * a * dt_s.abs());
        let [c, s] = if speed > 0.1 { self.velocity().map(|v| v / speed) } else { [1.0, 0.0] };
        let q = [
            [along * c * c + across * s * s, (along - across) * c * s],
            [(along - across) * c * s, along * s * s + across * c * c],
        ];
        for (i, row) in q.iter().enumerate() {
            for (j, q) in row.iter().enumerate() {
                self.covariance[i][j] += q * dt_s * dt_s / 3.0;
                self.covariance[i][j + 2] += q * dt_s / 2.0;
                self.covariance[i + 2][j] += q * dt_s / 2.0;
                self.covariance[i + 2][j + 2] += q;
            }
        }
    }

    /// A measurement of `h` times the state.
    pub fn update(&mut self, h: [f64; 4], measured: f64, spread: f64) {
        let ph: [f64; 4] = [0, 1, 2, 3].map(|i| dot(self.covariance[i], h));
        let innovation = measured - dot(h, self.state);
        let total = dot(h, ph) + spread * spread;
        for i in 0..4 {
            self.state[i] += ph[i] / total * innovation;
            for j in 0..4 {
                self.covariance[i][j] -= ph[i] * ph[j] / total;
            }
        }
    }

    /// Measures that it stands, as well as this, m/s.
    pub fn stop(&mut self, spread: f64) {
        self.update([0.0, 0.0, 1.0, 0.0], 0.0, spread);
        self.update([0.0, 0.0, 0.0, 1.0], 0.0, spread);
    }

    /// The smoothed state before a step, from the filtered one before it and the smoothed one after it.
    fn smoothed(&self, dt_s: f64, after: [f64; 4]) -> Self {
        let mut predicted = *self;
        predicted.predict(dt_s);
        // solve P_predicted z = after - predicted, then add P F' z
        let difference = [0, 1, 2, 3].map(|k| after[k] - predicted.state[k]);
        let Some(z) = solve(predicted.covariance, difference) else { return *self };
        let fz = [z[0], z[1], z[2] + dt_s * z[0], z[3] + dt_s * z[1]];
        let mut smoothed = *self;
        for k in 0..4 {
            smoothed.state[k] += dot(self.covariance[k], fz);
        }
        smoothed
    }
}

/// States that use all measurements, from filtered states and their times.
pub fn smooth(filtered: &[(f64, Motion)]) -> Vec<(f64, Motion)> {
    let mut all = filtered.to_vec();
    for k in (0..all.len().saturating_sub(1)).rev() {
        let after = all[k + 1];
        all[k].1 = all[k].1.smoothed(after.0 - all[k].0, after.1.state);
    }
    all
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Solves a symmetric positive system by elimination; `None` if it is singular.
fn solve(mut m: Matrix, mut v: [f64; 4]) -> Option<[f64; 4]> {
    for k in 0..4 {
        if m[k][k] < 1e-12 {
            return None;
        }
        for i in k + 1..4 {
            let pivot = m[k];
            let f = m[i][k] / pivot[k];
            m[i].iter_mut().zip(pivot).skip(k).for_each(|(m, p)| *m -= f * p);
            v[i] -= f * v[k];
        }
    }
    for k in (0..4).rev() {
        let rest: f64 = (k + 1..4).map(|j| m[k][j] * v[j]).sum();
        v[k] = (v[k] - rest) / m[k][k];
    }
    Some(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smoothed_path_is_right_from_its_beginning_and_knows_speed_from_doppler() {
        // at 20 m/s along x, seen from the origin: place to a metre, Doppler exact, velocity unknown at first
        let mut motion = Motion::new([50.0, 5.0], [0.0, 0.0], 2.0, [1.0, 0.0], [30.0, 30.0]);
        let mut filtered = Vec::new();
        for k in 0..60 {
            let t = f64::from(k) / 15.0;
            if k > 0 {
                motion.predict(1.0 / 15.0);
            }
            let (x, y) = (50.0 + 20.0 * t, 5.0);
            let wrong = if k % 2 == 0 { 0.8 } else { -0.8 };
            motion.update([1.0, 0.0, 0.0, 0.0], x + wrong, 1.0);
            motion.update([0.0, 1.0, 0.0, 0.0], y - wrong, 1.0);
            let u = [x / x.hypot(y), y / x.hypot(y)];
            motion.update([0.0, 0.0, u[0], u[1]], 20.0 * u[0], 0.1);
            filtered.push((t, motion));
        }
        for (t, m) in smooth(&filtered) {
            assert!((m.state[0] - (50.0 + 20.0 * t)).abs() < 0.4 && (m.state[1] - 5.0).abs() < 0.5, "{t}: {m:?}");
            assert!((m.state[2] - 20.0).abs() < 0.3 && m.state[3].abs() < 1.0, "{t}: {m:?}");
        }
    }

    #[test]
    fn a_system_is_solved() {
        let m = [[4.0, 1.0, 0.5, 0.0], [1.0, 3.0, 0.2, 0.1], [0.5, 0.2, 2.0, 0.3], [0.0, 0.1, 0.3, 1.0]];
        let v = [1.0, -2.0, 3.0, 0.5];
        let z = solve(m, v).unwrap();
        for k in 0..4 {
            assert!((dot(m[k], z) - v[k]).abs() < 1e-12);
        }
        assert!(solve([[0.0; 4]; 4], v).is_none());
    }
}
