//! `resources/scene.json`: what the unit simulates, as `rover_gym.exports.fmu` writes it.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use rover_core::geometry::{HeightField, Plane, SphereField, Terrain, TriangleMesh, Union};
use rover_core::integrator::{Stabilisation, StepOptions, Variant};
use rover_core::law::materials::{MaterialPair, Materials};
use rover_core::nalgebra::Vector3;
use rover_core::simulation::sealed::{checksum, unseal};
use rover_core::simulation::{AnySnapshot, CommandError, RoverScene, Snapshot};
use rover_core::solver::{Method, SolverOptions};
use serde::Deserialize;

use crate::refusal::Refusal;

/// The version of the format that is read.
const FORMAT: u32 = 3;

/// What follows the scene's text in the file: the checksum of the text.
const CHECKSUM: &str = "\nCRC-32 ";

/// What a variable of the unit is.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum VariableKind {
    Time,
    Friction,
    Restitution,
    Gravity,
    TimeStep,
    Model,
    WheelTorque,
    Steering,
    Q,
    V,
    Attitude,
    WheelGap,
    WheelForce,
    MotorTorque,
    TrunkForce,
    Inertial,
    KineticEnergy,
    PotentialEnergy,
    Contacts,
    SolverResidual,
    SolverIterations,
}

/// A variable: its name, what it is, and which entry of it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variable {
    pub reference: u32,
    pub name: String,
    pub channel: VariableKind,
    pub index: usize,
    /// 1 or -1: of the variable, where that of the channel is positive.
    pub sign: f64,
}

/// A ground.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Ground {
    Plane {
        normal: [f64; 3],
        offset: f64,
    },
    SphereField {
        centres: Vec<[f64; 3]>,
        radii: Vec<f64>,
        plane: Option<([f64; 3], f64)>,
        material: String,
    },
    HeightField {
        /// Row by row; null where there is no data.
        heights: Vec<Option<f32>>,
        shape: [usize; 2],
        spacing: [f64; 2],
        origin: [f64; 2],
        material: String,
    },
    TriangleMesh {
        vertices: Vec<[f64; 3]>,
        triangles: Vec<[usize; 3]>,
        material: String,
    },
    Union {
        parts: Vec<Ground>,
    },
}

/// The keyword arguments of `rover_gym.Simulation`, as its `settings` returns them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Settings {
    gravity: [f64; 3],
    friction: f64,
    restitution: f64,
    #[serde(default)]
    materials: Vec<(String, String, f64, f64)>,
    time_step: f64,
    variant: String,
    theta: f64,
    forecast: f64,
    solver: String,
    tolerance: f64,
    acceptable: f64,
    max_iterations: usize,
    /// None grows with the problem.
    #[serde(default)]
    budget: Option<u64>,
    stabilisation: String,
    warm_start: bool,
}

/// The file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    token: String,
    /// TOML.
    model: String,
    terrain: Ground,
    settings: Settings,
    /// Bytes of `Snapshot.to_bytes`.
    snapshot: Vec<u8>,
    variables: Vec<Variable>,
}

/// What the unit simulates.
pub struct SceneFile {
    pub token: String,
    /// TOML.
    pub model: String,
    pub terrain: Arc<dyn Terrain>,
    pub options: StepOptions,
    /// Where every run begins.
    pub start: Snapshot<RoverScene>,
    pub variables: HashMap<u32, Variable>,
}

impl SceneFile {
    /// Reads the file of a unit's folder of resources.
    pub fn read(resources: &Path) -> Result<Self, Refusal> {
        let path = resources.join("scene.json");
        let refuse = |message: String| Refusal::Scene {
            path: path.display().to_string(),
            message,
        };
        let text = std::fs::read_to_string(&path).map_err(|e| refuse(e.to_string()))?;
        let (text, sum) = (text.rsplit_once(CHECKSUM))
            .ok_or_else(|| refuse("ends before its checksum".to_owned()))?;
        if sum != checksum(text.as_bytes()).to_string() {
            return Err(refuse("is damaged (the checksum does not fit)".to_owned()));
        }
        let file: File = serde_json::from_str(text).map_err(|e| refuse(e.to_string()))?;
        if file.format != FORMAT {
            let found = file.format;
            return Err(refuse(format!("format: must be {FORMAT}, is {found}")));
        }
        let snapshot = unseal(&file.snapshot).map_err(|e| refuse(format!("snapshot: {e}")))?;
        let start = match postcard::from_bytes(snapshot) {
            Ok(AnySnapshot::Rover(start)) => start,
            Ok(_) => return Err(refuse("snapshot: must be a rover's".to_owned())),
            Err(e) => return Err(refuse(format!("snapshot: {e}"))),
        };
        Ok(Self {
            token: file.token,
            model: file.model,
            terrain: file.terrain.build().map_err(&refuse)?,
            options: file.settings.options().map_err(&refuse)?,
            start,
            variables: (file.variables.into_iter())
                .map(|variable| (variable.reference, variable))
                .collect(),
        })
    }
}

impl SceneFile {
    /// The refusal of a command, which names the variable in the place of the command's entry.
    pub fn refusal(&self, channel: VariableKind, error: CommandError) -> Refusal {
        let CommandError::BeyondLimit {
            index,
            value,
            limit,
            ..
        } = error
        else {
            return error.into();
        };
        let mut variables = self.variables.values();
        match variables.find(|one| one.channel == channel && one.index == index) {
            Some(variable) => Refusal::OutOfRange {
                name: variable.name.clone(),
                range: format!("within ±{limit} rad"),
                value: variable.sign * value,
            },
            None => error.into(),
        }
    }
}

impl Ground {
    fn build(self) -> Result<Arc<dyn Terrain>, String> {
        let text = |e: rover_core::geometry::TerrainError| format!("terrain: {e}");
        Ok(match self {
            Self::Plane { normal, offset } => Arc::new(Plane::new(normal, offset).map_err(text)?),
            Self::SphereField {
                centres,
                radii,
                plane,
                material,
            } => {
                let plane = plane.map(|(normal, offset)| Plane::new(normal, offset));
                let plane = plane.transpose().map_err(text)?;
                let field = SphereField::new(&centres, &radii, plane).map_err(text)?;
                Arc::new(field.with_material(&material))
            }
            Self::HeightField {
                heights,
                shape,
                spacing,
                origin,
                material,
            } => {
                let heights = heights.into_iter().map(|y| y.unwrap_or(f32::NAN)).collect();
                let field = HeightField::new(heights, shape, spacing, origin).map_err(text)?;
                Arc::new(field.with_material(&material))
            }
            Self::TriangleMesh {
                vertices,
                triangles,
                material,
            } => {
                let mesh = TriangleMesh::new(&vertices, &triangles).map_err(text)?;
                Arc::new(mesh.with_material(&material))
            }
            Self::Union { parts } => {
                let parts: Result<_, _> = parts.into_iter().map(Self::build).collect();
                Arc::new(Union::new(parts?).map_err(text)?)
            }
        })
    }
}

impl Settings {
    fn options(self) -> Result<StepOptions, String> {
        let unknown = |field: &str, word: &str| format!("settings.{field}: unknown, is {word:?}");
        let variant = match self.variant.as_str() {
            "linearised" => Variant::Linearised,
            "newton" => Variant::Newton,
            other => return Err(unknown("variant", other)),
        };
        let stabilisation = match self.stabilisation.as_str() {
            "projection" => Stabilisation::Projection,
            "none" => Stabilisation::None,
            other => return Err(unknown("stabilisation", other)),
        };
        let method = Method::from_name(&self.solver);
        let pair = |(a, b, friction_coefficient, restitution)| MaterialPair {
            materials: [a, b],
            friction_coefficient,
            restitution,
        };
        let options = StepOptions {
            gravity: Vector3::from(self.gravity),
            friction_coefficient: self.friction,
            restitution: self.restitution,
            materials: Materials::new(self.materials.into_iter().map(pair).collect()),
            time_step: self.time_step,
            theta: self.theta,
            forecast: self.forecast,
            variant,
            stabilisation,
            warm_start: self.warm_start,
            // As the border to Python fills them.
            solver: SolverOptions {
                method: method.ok_or_else(|| unknown("solver", &self.solver))?,
                tolerance: self.tolerance,
                acceptable: self.acceptable,
                velocity_tolerance: self.tolerance.max(1e-9),
                max_newton_steps: self.max_iterations,
                max_sweeps: self.max_iterations,
                budget: self.budget,
                ..SolverOptions::default()
            },
            ..StepOptions::default()
        };
        options.check().map_err(|e| format!("settings.{e}"))?;
        Ok(options)
    }
}
