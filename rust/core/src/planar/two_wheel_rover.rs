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

use nalgebra::Vector2;

use super::error::PlanarError;
use super::tree::{DiscWheel, PlanarBody, PlanarTree, fingerprint};
use crate::quantity::{INERTIAS, LENGTHS, MASSES, PLACES, within};

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
}

impl From<TwoWheelRover> for PlanarTree {
    fn from(rover: TwoWheelRover) -> Self {
        let TwoWheelRover {
            mass,
            inertia,
            wheels,
        } = rover;
        let body = PlanarBody {
            is_spinner: false,
            ..PlanarBody::centred(Vector2::zeros(), mass, inertia)
        };
        let part = |w: PlanarWheel| PlanarBody::centred(w.axle, w.mass, w.inertia);
        let [a, b] = wheels;
        let of_wheel = |w: &PlanarWheel| [w.mass, w.radius, w.inertia, w.axle.x, w.axle.y];
        let numbers = wheels.iter().flat_map(of_wheel);
        Self::new(
            vec![body, part(a), part(b)],
            vec![
                DiscWheel::driven(1, a.radius),
                DiscWheel::driven(2, b.radius),
            ],
            fingerprint("two wheels", [mass, inertia].into_iter().chain(numbers)),
        )
    }
}
