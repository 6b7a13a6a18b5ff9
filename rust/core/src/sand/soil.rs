//! A soil: its law of stress, its memory, and how it bears a second pass.

use nalgebra::{Matrix3, Vector3};

use super::bekker::Bekker;
use super::resistive_force::{Flow, Interface, traction};
use super::wheel::Skin;
use crate::quantity::{QuantityError, finite, positive};

/// A soil.
#[derive(Clone, Debug, PartialEq)]
pub struct Soil {
    /// The law of stress on a piece of a wheel.
    pub law: Law,
    /// K, length over which sand forgets the motion of a wheel, m.
    pub memory: f64,
    /// How many times as stiff as at the first pass sand in a rut is, up to the stress that it has
    /// borne.
    pub reload: f64,
}

/// A law of stress.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Three-dimensional resistive force theory ([`super::resistive_force`]).
    Resistive(Resistive),
    /// Bekker's pressure with Janosi's and Hanamoto's shear ([`super::bekker`]).
    Bekker(Bekker),
}

/// Sand in resistive force theory.
#[derive(Clone, Debug, PartialEq)]
pub struct Resistive {
    /// ρ, kg/m³.
    pub density: f64,
    /// μ, tangent of the angle of repose.
    pub internal_friction: f64,
    /// Factor on ξ; 1 by the theory.
    pub stiffness_factor: f64,
    /// The bare rim of a wheel.
    pub tread: Interface,
    /// Its side walls.
    pub wall: Interface,
    /// A rim with grousers.
    pub grousers: Interface,
    /// How the sand flows.
    pub flow: Flow,
}

impl Resistive {
    /// ξ at a gravity (m/s²), N/m³.
    #[must_use]
    pub fn stiffness(&self, gravity: f64) -> f64 {
        let mu = self.internal_friction;
        let cubic = mu * (89.0 + mu * (894.0 * mu - 386.0));
        self.stiffness_factor * self.density * gravity * cubic
    }
}

/// A piece of a wheel in the sand.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'a> {
    /// Outward unit normal.
    pub normal: &'a Vector3<f64>,
    /// Displacement relative to the sand, in units of its memory.
    pub x: &'a Vector3<f64>,
    /// Into the sand, against the normal of its surface.
    pub down: &'a Vector3<f64>,
    /// Under the surface, m.
    pub depth: f64,
    /// Along the rim from where it enters the sand, m.
    pub arc: f64,
    /// What it is part of.
    pub skin: Skin,
    /// Part of the rim at which grousers hold sand.
    pub held: f64,
    /// Width of the wheel, m.
    pub width: f64,
    /// m/s², along `down`.
    pub gravity: f64,
}

/// Stress of the sand on a piece, N/m², and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stress {
    /// N/m².
    pub value: Vector3<f64>,
    /// By the displacement.
    pub by_x: Matrix3<f64>,
    /// By the depth, N/m³.
    pub by_depth: Vector3<f64>,
}

impl Stress {
    /// None.
    pub const NONE: Self = Self {
        value: Vector3::new(0.0, 0.0, 0.0),
        by_x: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        by_depth: Vector3::new(0.0, 0.0, 0.0),
    };
}

impl Soil {
    /// Stress on a piece.
    #[must_use]
    pub fn stress(&self, piece: &Piece<'_>) -> Stress {
        match &self.law {
            Law::Resistive(sand) => {
                let surface = match piece.skin {
                    Skin::Rim => sand.tread.mixed(&sand.grousers, piece.held),
                    Skin::Wall => sand.wall,
                };
                let found = traction(piece.normal, piece.x, piece.down, &surface, &sand.flow);
                let xi = sand.stiffness(piece.gravity);
                Stress {
                    value: found.alpha * (xi * piece.depth),
                    by_x: found.slope * (xi * piece.depth),
                    by_depth: found.alpha * xi,
                }
            }
            Law::Bekker(soil) => soil.stress(piece),
        }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// A number out of its range, by the name of its field.
    pub fn check(&self) -> Result<(), QuantityError> {
        in_range("memory", self.memory, [1e-4, 1.0], "from 0.0001 to 1 m")?;
        in_range("reload", self.reload, [1.0, 1e3], "from 1 to 1000")?;
        match &self.law {
            Law::Resistive(sand) => sand.check(),
            Law::Bekker(soil) => soil.check(),
        }
    }
}

impl Resistive {
    fn check(&self) -> Result<(), QuantityError> {
        in_range(
            "density",
            self.density,
            [1.0, 1e4],
            "from 1 to 10 000 kg/m³",
        )?;
        let range = "from 0.05 to 2";
        in_range(
            "internal_friction",
            self.internal_friction,
            [0.05, 2.0],
            range,
        )?;
        positive("stiffness_factor", self.stiffness_factor)?;
        for (name, surface) in [
            ("tread", &self.tread),
            ("wall", &self.wall),
            ("grouser", &self.grousers),
        ] {
            not_negative(&format!("{name}_friction"), surface.friction)?;
            in_range(
                &format!("{name}_follow"),
                surface.follow,
                [0.01, 1e3],
                "from 0.01 to 1000",
            )?;
        }
        let flow = &self.flow;
        not_negative("dilatancy", flow.dilatancy)?;
        in_range("grip", flow.grip, [0.0, 1.0], "from 0 to 1")?;
        in_range("grip_width", flow.width, [1e-3, 1.0], "from 0.001 to 1")?;
        in_range("fluidity", flow.fluidity, [0.0, 1.0], "from 0 to 1")?;
        let range = "from 0.001 to 1";
        in_range("mobilisation", flow.mobilisation, [1e-3, 1.0], range)
    }
}

/// Checks a number against a closed range.
pub(crate) fn in_range(
    field: &str,
    value: f64,
    [low, high]: [f64; 2],
    range: &'static str,
) -> Result<(), QuantityError> {
    finite(field, value)?;
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(QuantityError::OutOfRange {
            field: field.to_owned(),
            range,
            value,
        })
    }
}

/// Checks that a number is finite and not negative.
pub(super) fn not_negative(field: &str, value: f64) -> Result<(), QuantityError> {
    if finite(field, value)? < 0.0 {
        return Err(QuantityError::Negative {
            field: field.to_owned(),
            value,
        });
    }
    Ok(())
}
