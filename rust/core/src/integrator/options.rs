//! Options of a step, with their defaults and their ranges.

use nalgebra::Vector3;

use super::error::OptionsError;
use crate::law::materials::{Materials, is_name};
use crate::solver::SolverOptions;

/// Which time-stepping scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Variant {
    /// One linearised step: one evaluation of kinematics, mass matrix and bias.
    #[default]
    Linearised,
    /// Newton on the forces at the end of the step, in momentum form.
    Newton,
}

/// Treatment of penetration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Stabilisation {
    /// None: penetration stays as the velocity law leaves it.
    None,
    /// Projection of the position onto gap ≥ 0 if penetration exceeds `penetration_tolerance`.
    #[default]
    Projection,
    /// Among grains only, elsewhere as `None`: a pair that overlaps by more than
    /// `penetration_tolerance` parts by a fifth of the excess in each step. It is part of the
    /// velocity law, and adds at most the pair's normal impulse times that speed to the energy.
    PushOut,
}

/// Step, scheme, laws and tolerances.
#[derive(Clone, Debug, PartialEq)]
pub struct StepOptions {
    /// Gravity, world, m/s². Default (0, −9.81, 0).
    pub gravity: Vector3<f64>,
    /// Coulomb's μ of every contact, but for those of `materials`. Default 0.7.
    pub friction_coefficient: f64,
    /// Newton's e of every contact, but for those of `materials`, in [0, 1]. Default 0.
    pub restitution: f64,
    /// Pairs of materials with a μ and an e of their own, for machines in three dimensions. Default
    /// none.
    pub materials: Materials,
    /// h, s. Default 0.005.
    pub time_step: f64,
    /// θ of the θ-method, in [½, 1]. Default ½: order 2.
    pub theta: f64,
    /// γ of the contact forecast `gap + γ h u_N ≤ 0`, in [0, 1]. Default ½, as in the reference
    /// runs.
    pub forecast: f64,
    /// Scheme. Default linearised.
    pub variant: Variant,
    /// Default projection.
    pub stabilisation: Stabilisation,
    /// Penetration that is tolerated, m. Default `None`: 1e-8 of the size of a machine in three
    /// dimensions, 5e-3 of the smallest grain, and 1e-8 m otherwise.
    pub penetration_tolerance: Option<f64>,
    /// Whether the solver starts from the last step's impulses. Default true.
    pub warm_start: bool,
    /// Options of the contact solver. Default tolerance 1e-12: it costs 5% more than 1e-10 on a
    /// drive, and a parked rover stays at rest. Default acceptable violation 1e-8 m/s.
    pub solver: SolverOptions,
    /// Newton variant: stop when no velocity changes by more than this, relative to 1 m/s and to
    /// the largest velocity. Default 1e-12.
    pub newton_tolerance: f64,
    /// Newton variant: most iterations. Default 20.
    pub newton_max_iterations: usize,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self {
            gravity: Vector3::new(0.0, -9.81, 0.0),
            friction_coefficient: 0.7,
            restitution: 0.0,
            materials: Materials::default(),
            time_step: 0.005,
            theta: 0.5,
            forecast: 0.5,
            variant: Variant::default(),
            stabilisation: Stabilisation::default(),
            penetration_tolerance: None,
            warm_start: true,
            solver: SolverOptions {
                acceptable: 1e-8,
                ..SolverOptions::default()
            },
            newton_tolerance: 1e-12,
            newton_max_iterations: 20,
        }
    }
}

impl StepOptions {
    /// Whether any contact rebounds.
    #[must_use]
    pub fn is_elastic(&self) -> bool {
        self.restitution > 0.0 || self.materials.is_elastic()
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first option out of its range.
    pub fn check(&self) -> Result<(), OptionsError> {
        let demand = |field, value: f64, is_in: bool, range| {
            if value.is_finite() && is_in {
                Ok(())
            } else {
                Err(OptionsError::OutOfRange {
                    field,
                    range,
                    value,
                })
            }
        };
        for value in self.gravity.iter() {
            let is_moderate = value.abs() <= 1e6;
            demand(
                "gravity",
                *value,
                is_moderate,
                "at most 1e6 m/s² either way",
            )?;
        }
        let (mu, e, h) = (self.friction_coefficient, self.restitution, self.time_step);
        demand("friction", mu, mu >= 0.0, "finite and not negative")?;
        demand("restitution", e, (0.0..=1.0).contains(&e), "in [0, 1]")?;
        check_materials(&self.materials)?;
        let is_step = (1e-9..=1e3).contains(&h);
        demand("time_step", h, is_step, "from 1e-9 to 1e3 s")?;
        demand(
            "theta",
            self.theta,
            (0.5..=1.0).contains(&self.theta),
            "in [0.5, 1]",
        )?;
        demand(
            "forecast",
            self.forecast,
            (0.0..=1.0).contains(&self.forecast),
            "in [0, 1]",
        )?;
        let threads = self.solver.threads;
        let is_count = (1..=1024).contains(&threads);
        demand("threads", threads as f64, is_count, "from 1 to 1024")?;
        let depth = self.penetration_tolerance.unwrap_or(0.0);
        demand(
            "penetration_tolerance",
            depth,
            depth >= 0.0,
            "finite and not negative",
        )?;
        let tolerance = self.solver.tolerance;
        demand(
            "tolerance",
            tolerance,
            tolerance > 0.0,
            "finite and positive",
        )?;
        let acceptable = self.solver.acceptable;
        demand(
            "acceptable",
            acceptable,
            acceptable >= 0.0,
            "finite and not negative",
        )?;
        let iterations = self.solver.max_newton_steps.min(self.solver.max_sweeps) as f64;
        demand(
            "max_iterations",
            iterations,
            iterations >= 1.0,
            "at least 1",
        )
    }
}

fn check_materials(materials: &Materials) -> Result<(), OptionsError> {
    let pairs = materials.pairs();
    for (k, pair) in pairs.iter().enumerate() {
        let [first, second] = &pair.materials;
        for name in [first, second] {
            if !is_name(name) {
                return Err(OptionsError::MaterialName { name: name.clone() });
            }
        }
        let names = || pair.materials.clone();
        if pairs[..k].iter().any(|other| other.is_of(first, second)) {
            return Err(OptionsError::MaterialsTwice { materials: names() });
        }
        let (mu, e) = (pair.friction_coefficient, pair.restitution);
        let is_friction = mu.is_finite() && mu >= 0.0;
        for (quantity, value, is_in, range) in [
            ("friction", mu, is_friction, "finite and not negative"),
            ("restitution", e, (0.0..=1.0).contains(&e), "in [0, 1]"),
        ] {
            if !is_in {
                return Err(OptionsError::BetweenMaterials {
                    quantity,
                    materials: names(),
                    range,
                    value,
                });
            }
        }
    }
    Ok(())
}
