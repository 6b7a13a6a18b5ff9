//! The two-wheel rover of the report's section 3.1 with the coordinates (x, y, θ, θ_A, θ_B).
//!
//! (x, y) is the body's mass centre, θ its angle, θ_A and θ_B the *absolute*
//! angles of the back wheel A and the front wheel B. The axle of wheel i sits at
//! a_i in the body's axes, at `r_i = R(θ) a_i = (X_i, Y_i)` from the mass
//! centre, so its velocity is `(ẋ − Y_i θ̇, ẏ + X_i θ̇)` and
//!
//! ```text
//! K = ½ (m + m_A + m_B)(ẋ² + ẏ²) + ½ (J + Σ m_i |a_i|²) θ̇²
//!     + θ̇ Σ m_i (X_i ẏ − Y_i ẋ) + ½ Σ J_i θ̇_i²
//!
//!     | m_tot    0      −Σ m_i Y_i       0    0  |      | m_tot g_x + θ̇² Σ m_i X_i              |
//!     |   0    m_tot     Σ m_i X_i       0    0  |      | m_tot g_y + θ̇² Σ m_i Y_i              |
//! M = |  sym    sym   J + Σ m_i |a_i|²   0    0  |  F = | Σ m_i (X_i g_y − Y_i g_x) + τ_A + τ_B |
//!     |   0      0           0          J_A   0  |      | −τ_A                                  |
//!     |   0      0           0           0   J_B |      | −τ_B                                  |
//! ```
//!
//! with the torques τ_i of the motors between body and wheels, positive when they drive forward.
//! The report's (3.37)–(3.41) leave the wheels' masses out of the first two rows of M and θ̈ out of
//! the third, and (3.29) leaves out g. A wheel's contact at the rim point `E = c_i − r_i n` has the
//! columns `(n, r_i × n, 0…)` and `(t, r_i × t, r)` with r in the wheel's own row: the body's turn
//! moves the axle and never the rim.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::error::PlanarError;
use super::machine::{Disc, PlanarMachine, fingerprint};
use crate::quantity::{INERTIAS, LENGTHS, MASSES, PLACES, within};
use crate::scalar::elementary::sin_cos;

/// A wheel and where its axle sits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarWheel {
    /// kg.
    pub mass: f64,
    /// m.
    pub radius: f64,
    /// About the axle, kg m².
    pub inertia: f64,
    /// Axle relative to the body's mass centre, body axes, m.
    pub axle: Vector2<f64>,
}

/// Body and two wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoWheelRover {
    mass: f64,
    inertia: f64,
    wheels: [PlanarWheel; 2],
}

impl TwoWheelRover {
    /// `mass` in kg, `inertia` about the body's own mass centre in kg m²;
    /// back wheel A and front wheel B.
    ///
    /// # Errors
    /// A number that is not finite or not positive, wheels that overlap.
    pub fn new(
        mass: f64,
        inertia: f64,
        wheel_a: PlanarWheel,
        wheel_b: PlanarWheel,
    ) -> Result<Self, PlanarError> {
        within(|| "mass".to_owned(), mass, MASSES)?;
        for (name, wheel) in [("a", &wheel_a), ("b", &wheel_b)] {
            within(|| format!("wheel_mass_{name}"), wheel.mass, MASSES)?;
            within(|| format!("radius_{name}"), wheel.radius, LENGTHS)?;
            within(|| format!("wheel_inertia_{name}"), wheel.inertia, INERTIAS)?;
            for (k, value) in wheel.axle.iter().enumerate() {
                within(|| format!("axle_{name}[{k}]"), *value, PLACES)?;
            }
        }
        within(|| "inertia".to_owned(), inertia, INERTIAS)?;
        let apart = (wheel_b.axle - wheel_a.axle).norm();
        let needed = wheel_a.radius + wheel_b.radius;
        if apart <= needed {
            return Err(PlanarError::WheelsOverlap {
                value: apart,
                needed,
            });
        }
        Ok(Self {
            mass,
            inertia,
            wheels: [wheel_a, wheel_b],
        })
    }

    /// Mass of the body, kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Inertia of the body, kg m².
    #[must_use]
    pub fn inertia(&self) -> f64 {
        self.inertia
    }

    /// Back wheel A, front wheel B.
    #[must_use]
    pub fn wheels(&self) -> &[PlanarWheel; 2] {
        &self.wheels
    }

    /// Mass of all, kg.
    #[must_use]
    pub fn total_mass(&self) -> f64 {
        self.mass + self.wheels[0].mass + self.wheels[1].mass
    }

    /// `r_A`, `r_B`: the axles relative to the body's mass centre, world axes, m.
    fn arms_of(&self, q: &SVector<f64, 5>) -> [Vector2<f64>; 2] {
        let (sin, cos) = sin_cos(q[2]);
        let R = Matrix2::new(cos, -sin, sin, cos);
        [R * self.wheels[0].axle, R * self.wheels[1].axle]
    }

    /// `Σ m_i r_i`, kg m.
    fn moment(&self, q: &SVector<f64, 5>) -> Vector2<f64> {
        let [a, b] = self.arms_of(q);
        a * self.wheels[0].mass + b * self.wheels[1].mass
    }

    /// Mass centre of all, world, m.
    #[must_use]
    pub fn centre_of_mass(&self, q: &SVector<f64, 5>) -> Vector2<f64> {
        q.xy() + self.moment(q) / self.total_mass()
    }
}

impl PlanarMachine<5> for TwoWheelRover {
    fn mass_matrix(&self, q: &SVector<f64, 5>) -> SMatrix<f64, 5, 5> {
        let s = self.moment(q);
        let around: f64 = self
            .wheels
            .iter()
            .map(|w| w.mass * w.axle.norm_squared())
            .sum();
        let mut M = SMatrix::<f64, 5, 5>::zeros();
        M[(0, 0)] = self.total_mass();
        M[(1, 1)] = self.total_mass();
        M[(2, 2)] = self.inertia + around;
        M[(3, 3)] = self.wheels[0].inertia;
        M[(4, 4)] = self.wheels[1].inertia;
        (M[(0, 2)], M[(2, 0)]) = (-s.y, -s.y);
        (M[(1, 2)], M[(2, 1)]) = (s.x, s.x);
        M
    }

    fn force(
        &self,
        q: &SVector<f64, 5>,
        v: &SVector<f64, 5>,
        gravity: &Vector2<f64>,
        torques: &[f64],
    ) -> SVector<f64, 5> {
        let s = self.moment(q);
        let linear = gravity * self.total_mass() + s * (v[2] * v[2]);
        SVector::from([
            linear.x,
            linear.y,
            s.perp(gravity) + torques[0] + torques[1],
            -torques[0],
            -torques[1],
        ])
    }

    fn potential(&self, q: &SVector<f64, 5>, gravity: &Vector2<f64>) -> f64 {
        -self.total_mass() * gravity.dot(&self.centre_of_mass(q))
    }

    fn n_inputs(&self) -> usize {
        2
    }

    fn turning(&self, v: &SVector<f64, 5>) -> f64 {
        v[2].abs()
    }

    fn n_discs(&self) -> usize {
        2
    }

    fn disc(&self, i: usize, q: &SVector<f64, 5>) -> Disc {
        Disc {
            centre: q.xy() + self.arms_of(q)[i],
            radius: self.wheels[i].radius,
        }
    }

    fn point_jacobian(
        &self,
        i: usize,
        q: &SVector<f64, 5>,
        point: &Vector2<f64>,
    ) -> SMatrix<f64, 2, 5> {
        let arm = self.arms_of(q)[i];
        let rim = point - (q.xy() + arm);
        let mut J = SMatrix::<f64, 2, 5>::zeros();
        J[(0, 0)] = 1.0;
        J[(1, 1)] = 1.0;
        (J[(0, 2)], J[(1, 2)]) = (-arm.y, arm.x);
        (J[(0, 3 + i)], J[(1, 3 + i)]) = (-rim.y, rim.x);
        J
    }

    fn arms(&self) -> SVector<f64, 5> {
        let [a, b] = &self.wheels;
        let arm = a.axle.norm().max(b.axle.norm());
        SVector::from([1.0, 1.0, arm, a.radius, b.radius])
    }

    fn fingerprint(&self) -> u64 {
        let of_wheel = |w: &PlanarWheel| [w.mass, w.radius, w.inertia, w.axle.x, w.axle.y];
        let wheels = self.wheels.iter().flat_map(of_wheel);
        fingerprint(
            "two wheels",
            [self.mass, self.inertia].into_iter().chain(wheels),
        )
    }
}
