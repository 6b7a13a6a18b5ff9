//! Small scenes that give friction-contact problems by hand: `W = Hᵀ M⁻¹ H`, `q = Hᵀ v_free`.

#![allow(dead_code)] // each test binary uses some of them

use friction_contact::problem::{Dimension, FrictionContactProblem};

/// Contacts of a mechanism at one configuration: rows of `Hᵀ`, and a diagonal mass matrix.
#[derive(Clone, Debug)]
pub struct Scene {
    pub dimension: Dimension,
    /// `Hᵀ`, one row per contact component, `n × nv`.
    pub rows: Vec<Vec<f64>>,
    /// Diagonal of `M⁻¹` (nv).
    pub inverse_mass: Vec<f64>,
    pub mu: Vec<f64>,
}

/// A problem that owns its arrays.
#[derive(Clone, Debug)]
pub struct Problem {
    pub dimension: Dimension,
    pub W: Vec<f64>,
    pub q: Vec<f64>,
    pub mu: Vec<f64>,
}

impl Problem {
    pub fn view(&self) -> FrictionContactProblem<'_> {
        FrictionContactProblem::new(self.dimension, &self.W, &self.q, &self.mu)
            .expect("a sound problem")
    }

    /// The same problem with the contacts in another order.
    pub fn permuted(&self, order: &[usize]) -> Self {
        let d = self.dimension.components();
        let n = self.q.len();
        let index: Vec<usize> = order
            .iter()
            .flat_map(|&i| (0..d).map(move |k| d * i + k))
            .collect();
        let mut W = Vec::with_capacity(n * n);
        for &r in &index {
            for &c in &index {
                W.push(self.W[r * n + c]);
            }
        }
        Self {
            dimension: self.dimension,
            W,
            q: index.iter().map(|&k| self.q[k]).collect(),
            mu: order.iter().map(|&i| self.mu[i]).collect(),
        }
    }
}

impl Scene {
    /// Delassus operator, row-major.
    pub fn delassus(&self) -> Vec<f64> {
        let mut W = Vec::with_capacity(self.rows.len().pow(2));
        for a in &self.rows {
            for b in &self.rows {
                W.push(
                    a.iter()
                        .zip(b)
                        .zip(&self.inverse_mass)
                        .map(|((x, y), m)| x * y * m)
                        .sum(),
                );
            }
        }
        W
    }

    /// Local velocities of the generalized velocity `v`.
    pub fn local_velocity(&self, v: &[f64]) -> Vec<f64> {
        self.rows
            .iter()
            .map(|row| row.iter().zip(v).map(|(h, v)| h * v).sum())
            .collect()
    }

    pub fn problem(&self, v_free: &[f64]) -> Problem {
        Problem {
            dimension: self.dimension,
            W: self.delassus(),
            q: self.local_velocity(v_free),
            mu: self.mu.clone(),
        }
    }

    /// `v + M⁻¹ H p`.
    pub fn push(&self, v: &mut [f64], p: &[f64]) {
        for (row, p) in self.rows.iter().zip(p) {
            for ((v, h), m) in v.iter_mut().zip(row).zip(&self.inverse_mass) {
                *v += m * h * p;
            }
        }
    }
}

/// Number of velocities of [`rover`].
pub const ROVER_NV: usize = 15;

/// A rover of six wheels on the flat: trunk (6), front axle about x, two bogies about z, six spins.
///
/// World x forward, y up, z right; wheels FL, FR, ML, BL, MR, BR; contact
/// components normal, rolling, lateral (normal × rolling up to sign). `steering`:
/// angle of each wheel about y, rad. Straight wheels give `W` of rank 14 in 18: six
/// loads, six rolling directions, but only two lateral ones.
pub fn rover(steering: [f64; 6], mu: f64) -> Scene {
    let radius = 0.1;
    let height = 0.4;
    // Wheel positions from the trunk's origin; the bogies turn about (-0.22, ., ±0.55).
    let wheels = [
        (0.62, -0.575),
        (0.62, 0.575),
        (0.13, -0.62),
        (-0.57, -0.62),
        (0.13, 0.62),
        (-0.57, 0.62),
    ];
    let bogie_x = -0.22;
    let mut rows = Vec::new();
    for (i, &(x, z)) in wheels.iter().enumerate() {
        // Velocity of the wheel's material point on the ground, as three
        // rows over the 15 velocities.
        let r = [x, -height, z];
        let mut point = vec![vec![0.0; ROVER_NV]; 3];
        for k in 0..3 {
            point[k][k] = 1.0;
        }
        // ω × r.
        point[0][4] = r[2];
        point[0][5] = -r[1];
        point[1][3] = -r[2];
        point[1][5] = r[0];
        point[2][3] = r[1];
        point[2][4] = -r[0];
        if i < 2 {
            // Front axle about x through its own middle, 0.1 above the ground.
            point[1][6] = -z;
            point[2][6] = -radius;
        } else {
            let bogie = if z < 0.0 { 7 } else { 8 };
            point[0][bogie] = radius + 0.15;
            point[1][bogie] = x - bogie_x;
        }
        let (sin, cos) = steering[i].sin_cos();
        let rolling = [cos, 0.0, -sin];
        let lateral = [sin, 0.0, cos];
        let along = |d: [f64; 3]| -> Vec<f64> {
            (0..ROVER_NV)
                .map(|j| (0..3).map(|k| d[k] * point[k][j]).sum())
                .collect()
        };
        let mut roll = along(rolling);
        // A positive spin drives forward: the point on the ground moves back.
        roll[9 + i] = -radius;
        rows.push(along([0.0, 1.0, 0.0]));
        rows.push(roll);
        rows.push(along(lateral));
    }
    let mut mass = vec![960.0, 960.0, 960.0, 90.0, 180.0, 150.0, 25.0, 20.0, 20.0];
    mass.extend([0.15; 6]);
    Scene {
        dimension: Dimension::Three,
        rows,
        inverse_mass: mass.iter().map(|m| 1.0 / m).collect(),
        mu: vec![mu; 6],
    }
}

/// A rigid table: `legs` feet evenly on a circle of radius 1 m, mass 6 kg; `W` of rank 6.
pub fn table(legs: usize, mu: f64) -> Scene {
    let mut rows = Vec::new();
    for leg in 0..legs {
        let angle = std::f64::consts::TAU * leg as f64 / legs as f64;
        let r = [angle.cos(), -0.8, angle.sin()];
        rows.push(vec![0.0, 1.0, 0.0, -r[2], 0.0, r[0]]);
        rows.push(vec![1.0, 0.0, 0.0, 0.0, r[2], -r[1]]);
        rows.push(vec![0.0, 0.0, 1.0, r[1], -r[0], 0.0]);
    }
    Scene {
        dimension: Dimension::Three,
        rows,
        inverse_mass: vec![1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 0.5, 0.8, 0.5],
        mu: vec![mu; legs],
    }
}

/// A pile of cubes of side 1 m, four corner contacts at each interface, masses from the ground up.
pub fn pile(masses: &[f64], mu: f64) -> Scene {
    let nv = 6 * masses.len();
    let mut rows = Vec::new();
    for level in 0..masses.len() {
        for (x, z) in [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)] {
            let mut block = vec![vec![0.0; nv]; 3];
            let mut add = |body: usize, r: [f64; 3], sign: f64| {
                let o = 6 * body;
                let jacobian = [
                    [0.0, 1.0, 0.0, -r[2], 0.0, r[0]],
                    [1.0, 0.0, 0.0, 0.0, r[2], -r[1]],
                    [0.0, 0.0, 1.0, r[1], -r[0], 0.0],
                ];
                for (row, values) in block.iter_mut().zip(jacobian) {
                    for (k, value) in values.iter().enumerate() {
                        row[o + k] += sign * value;
                    }
                }
            };
            add(level, [x, -0.5, z], 1.0);
            if level > 0 {
                add(level - 1, [x, 0.5, z], -1.0);
            }
            rows.extend(block);
        }
    }
    let inverse_mass = masses
        .iter()
        .flat_map(|m| [1.0 / m, 1.0 / m, 1.0 / m, 6.0 / m, 6.0 / m, 6.0 / m])
        .collect();
    Scene {
        dimension: Dimension::Three,
        mu: vec![mu; 4 * masses.len()],
        rows,
        inverse_mass,
    }
}

/// Free velocity of bodies at rest after a step of gravity: `v = −g h`
/// along y for every sixth velocity from the second.
pub fn falling(n_bodies: usize, gh: f64) -> Vec<f64> {
    (0..6 * n_bodies)
        .map(|k| if k % 6 == 1 { -gh } else { 0.0 })
        .collect()
}
