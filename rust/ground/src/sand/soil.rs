//! A soil: its law of stress, its memory, and how it bears a second pass.

use super::bekker::Bekker;
use super::piece::{Piece, Stress, WheelConditions};
use super::resistive_force::{Flow, Interface, traction};
use super::wheel::Skin;
use friction_contact::quantity::{QuantityError, between, not_negative, positive};
use friction_contact::scalar::Lane;

/// A soil.
#[derive(Clone, Debug, PartialEq)]
pub struct Soil {
    /// The law of stress on a piece of a wheel.
    pub law: StressLaw,
    /// K, length over which sand forgets the motion of a wheel, m.
    pub memory: f64,
    /// How many times as stiff as at the first pass sand in a rut is, up to the stress that it has
    /// borne.
    pub reload: f64,
}

/// A law of stress.
#[derive(Clone, Debug, PartialEq)]
pub enum StressLaw {
    /// Three-dimensional resistive force theory ([`super::resistive_force`]).
    Resistive(Resistive),
    /// Bekker's, Wong's and Reece's, with Janosi's and Hanamoto's shear ([`super::bekker`]).
    Bekker(Bekker),
}

/// Sand in resistive force theory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resistive {
    /// ρ, kg/m³.
    pub density: f64,
    /// μ, tangent of the angle of repose.
    pub internal_friction: f64,
    /// Factor on ξ; 1 by the theory.
    pub stiffness_factor: f64,
    /// The bare rim of a wheel.
    pub tread: Interface,
    /// Side walls of a wheel.
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

impl Soil {
    /// Stress on pieces; its derivatives if they are wanted.
    #[inline(always)]
    #[must_use]
    pub fn stress<T: Lane>(
        &self,
        piece: &Piece<T>,
        setting: &WheelConditions,
        wants_slopes: bool,
    ) -> Stress<T> {
        match &self.law {
            StressLaw::Resistive(sand) => {
                let surface = match piece.skin {
                    Skin::Rim => sand.tread.mixed(&sand.grousers, setting.held),
                    Skin::Wall => sand.wall,
                };
                let properties = (&surface, &sand.flow);
                let (n, x, g) = (piece.normal, piece.x, piece.down);
                let found = traction(n, x, g, properties, wants_slopes);
                let xi = n.x.like(sand.stiffness(setting.gravity));
                let pressure = xi * piece.depth;
                Stress {
                    value: found.alpha * pressure,
                    by_x: found.slope.map(|column| column * pressure),
                    by_depth: found.alpha * xi,
                    ..Stress::none(n.x.token())
                }
            }
            StressLaw::Bekker(soil) => soil.stress(piece, setting, wants_slopes),
        }
    }

    /// Whether side walls bear nothing.
    pub(super) fn spares_walls(&self) -> bool {
        matches!(self.law, StressLaw::Bekker(_))
    }

    /// Numbers of the soil with their names, to be read or changed.
    #[must_use]
    pub fn numbers_mut(&mut self) -> Vec<(&'static str, &mut f64)> {
        let mut all: Vec<(&'static str, &mut f64)> = match &mut self.law {
            StressLaw::Resistive(sand) => vec![
                ("density", &mut sand.density),
                ("internal_friction", &mut sand.internal_friction),
                ("stiffness_factor", &mut sand.stiffness_factor),
                ("tread_friction", &mut sand.tread.friction),
                ("tread_follow", &mut sand.tread.follow),
                ("wall_friction", &mut sand.wall.friction),
                ("wall_follow", &mut sand.wall.follow),
                ("grouser_friction", &mut sand.grousers.friction),
                ("grouser_follow", &mut sand.grousers.follow),
                ("dilatancy", &mut sand.flow.dilatancy),
                ("grip", &mut sand.flow.grip),
                ("grip_width", &mut sand.flow.width),
                ("fluidity", &mut sand.flow.fluidity),
                ("mobilisation", &mut sand.flow.mobilisation),
            ],
            StressLaw::Bekker(soil) => vec![
                ("cohesive_modulus", &mut soil.cohesive_modulus),
                ("frictional_modulus", &mut soil.frictional_modulus),
                ("exponent", &mut soil.exponent),
                ("cohesion", &mut soil.cohesion),
                ("internal_friction", &mut soil.internal_friction),
                ("shear_modulus", &mut soil.shear_modulus),
                ("stress_angle", &mut soil.stress_angle),
                ("stress_angle_slip", &mut soil.stress_angle_slip),
                ("slip_sinkage", &mut soil.slip_sinkage),
            ],
        };
        all.push(("memory", &mut self.memory));
        all.push(("reload", &mut self.reload));
        all
    }

    /// Checks every number.
    ///
    /// # Errors
    /// A number out of its range, by the name of its field.
    pub fn check(&self) -> Result<(), QuantityError> {
        between("memory", self.memory, [1e-4, 1.0], "from 0.0001 to 1 m")?;
        between("reload", self.reload, [1.0, 1e3], "from 1 to 1000")?;
        match &self.law {
            StressLaw::Resistive(sand) => sand.check(),
            StressLaw::Bekker(soil) => soil.check(),
        }
    }
}

impl Resistive {
    fn check(&self) -> Result<(), QuantityError> {
        let (density, tan) = (self.density, self.internal_friction);
        between("density", density, [1.0, 1e4], "from 1 to 10 000 kg/m³")?;
        between("internal_friction", tan, [0.05, 2.0], "from 0.05 to 2")?;
        positive("stiffness_factor", self.stiffness_factor)?;
        for (name, surface) in [
            ("tread", &self.tread),
            ("wall", &self.wall),
            ("grouser", &self.grousers),
        ] {
            not_negative(&format!("{name}_friction"), surface.friction)?;
            let follow = format!("{name}_follow");
            between(&follow, surface.follow, [0.01, 1e3], "from 0.01 to 1000")?;
        }
        let flow = &self.flow;
        not_negative("dilatancy", flow.dilatancy)?;
        for (field, value, low, range) in [
            ("grip", flow.grip, 0.0, "from 0 to 1"),
            ("grip_width", flow.width, 1e-3, "from 0.001 to 1"),
            ("fluidity", flow.fluidity, 0.0, "from 0 to 1"),
            ("mobilisation", flow.mobilisation, 1e-3, "from 0.001 to 1"),
        ] {
            between(field, value, [low, 1.0], range)?;
        }
        Ok(())
    }
}
