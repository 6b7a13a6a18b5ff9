//! Models, options, starts and comparisons that the tests share.
#![allow(clippy::unwrap_used)]

use std::fmt::Debug;
use std::sync::Arc;

use rover_core::geometry::{Plane, SphereField, Terrain};
use rover_core::integrator::moreau_jean::MoreauJean;
use rover_core::integrator::{StepOptions, StepReport, Variant};
use rover_core::multibody::{
    Configuration, CouplingDescription, JointLimits, LoopDescription, LoopKind, Model,
    ModelDescription, Spring, coordinates,
};
use rover_core::nalgebra::Vector3;
use rover_core::simulation::RoverSimulation;

pub use super::rover::scenes::VARIANTS;

/// A description in TOML, checked and built.
pub fn model(text: &str) -> Model {
    Model::from_description(ModelDescription::from_toml(text).unwrap()).unwrap()
}

/// One free solid named "body", with a mass, kg, and further fields of its description.
pub fn described(mass: f64, rest: &str) -> ModelDescription {
    let text = format!("name = 'machine'\n[[solids]]\nname = 'body'\nmass = {mass}\n{rest}\n");
    ModelDescription::from_toml(&text).unwrap()
}

/// The model of [`described`].
pub fn body(mass: f64, rest: &str) -> Model {
    Model::from_description(described(mass, rest)).unwrap()
}

/// The hull of a prism along y with six sides as wide as its radius, m, and half its height, m.
pub fn prism(radius: f64, half: f64) -> String {
    let corners: Vec<String> = (0..6)
        .flat_map(|k| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_3 * f64::from(k)).sin_cos();
            [-half, half].map(|y| format!("[{}, {y}, {}]", radius * cos, radius * sin))
        })
        .collect();
    format!("kind = 'hull', points = [{}]", corners.join(", "))
}

/// Default options with a variant and a time step, s.
pub fn stepping(variant: Variant, time_step: f64) -> StepOptions {
    StepOptions {
        variant,
        time_step,
        ..StepOptions::default()
    }
}

/// Level ground at height 0.
pub fn flat() -> Arc<dyn Terrain> {
    Arc::new(Plane::ground())
}

/// Ground out of reach.
pub fn nothing() -> Arc<dyn Terrain> {
    Arc::new(SphereField::new(&[[0.0, -1e5, 0.0]], &[1.0], None).unwrap())
}

/// A machine in a configuration, with a velocity.
pub fn moving(
    model: impl Into<Arc<Model>>,
    ground: Arc<dyn Terrain>,
    options: StepOptions,
    q: Configuration,
    v: Vec<f64>,
) -> RoverSimulation {
    let mut simulation = RoverSimulation::new(model.into(), ground, options).unwrap();
    simulation.set_state(q, v);
    simulation
}

/// A machine at rest; `place` changes the zero of all coordinates to its configuration.
pub fn resting(
    model: impl Into<Arc<Model>>,
    ground: Arc<dyn Terrain>,
    options: StepOptions,
    place: impl FnOnce(&mut Configuration),
) -> RoverSimulation {
    let model = model.into();
    let mut q = Configuration::zero(&model);
    place(&mut q);
    let v = vec![0.0; model.nv()];
    moving(model, ground, options, q, v)
}

/// A machine at rest in public coordinates, with the default options.
pub fn in_public(
    model: impl Into<Arc<Model>>,
    ground: Arc<dyn Terrain>,
    q: &[f64],
) -> RoverSimulation {
    let model = model.into();
    let (q, v) = (
        coordinates::from_public(&model, q).unwrap(),
        vec![0.0; model.nv()],
    );
    moving(model, ground, StepOptions::default(), q, v)
}

/// Names of all joints of a rover but its base.
pub fn joints(rover: &RoverSimulation) -> Vec<String> {
    let bodies = rover.model().bodies();
    bodies[1..].iter().map(|body| body.name.clone()).collect()
}

/// Stops of a joint, rad or m.
pub fn limits(lower: f64, upper: f64) -> JointLimits {
    JointLimits { lower, upper }
}

/// Coupling of a joint to another one.
pub fn follows(joint: &str, ratio: f64, offset: f64) -> CouplingDescription {
    CouplingDescription {
        joint: joint.into(),
        ratio,
        offset,
    }
}

/// Spring of a joint, N m/rad or N/m, and its rest, rad or m.
pub fn spring(stiffness: f64, rest: f64) -> Spring {
    Spring { stiffness, rest }
}

/// A loop of two solids or joints, closed at the zero of all joints.
pub fn closure(name: &str, kind: LoopKind, solid: &str, other: Option<&str>) -> LoopDescription {
    LoopDescription {
        name: name.into(),
        kind,
        solid: solid.into(),
        other: other.map(Into::into),
        position: None,
        other_position: None,
        other_rotation: None,
        polynomial: None,
    }
}

/// Repeatable numbers in [−1, 1).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 * 2.0_f64.powi(-52) - 1.0
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next())
    }
}

/// Panics unless a number is nearer to the expected one than the tolerance.
#[track_caller]
pub fn near(found: f64, expected: f64, tolerance: f64) {
    near_in(&(), found, expected, tolerance);
}

/// Panics, and says in which scene, unless a number is nearer to the expected one than the
/// tolerance.
#[track_caller]
pub fn near_in(scene: &dyn Debug, found: f64, expected: f64, tolerance: f64) {
    let off = (found - expected).abs();
    assert!(
        off < tolerance,
        "{scene:?}: {found} is {off:e} from {expected}, more than {tolerance:e}"
    );
}

/// Largest difference of two lists of numbers; not a number if one of them has such.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    greatest(a.iter().zip(b).map(|(a, b)| (a - b).abs()))
}

/// Largest magnitude of a list of numbers; not a number if the list has such.
pub fn largest(numbers: &[f64]) -> f64 {
    greatest(numbers.iter().map(|x| x.abs()))
}

fn greatest(sizes: impl Iterator<Item = f64>) -> f64 {
    let larger = |most: f64, x: f64| if x.is_nan() || x > most { x } else { most };
    sizes.fold(0.0, larger)
}

/// The number below which this share of a list lies, per cent.
pub fn quantile(mut numbers: Vec<f64>, per_cent: usize) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() * per_cent / 100]
}

/// Bits of numbers, which compare also signs of zero.
pub fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// Takes a step that must converge and may create no more energy than `allowed`, J, beyond what the
/// projection lifts.
#[track_caller]
pub fn step_without_gain(simulation: &mut RoverSimulation, allowed: f64) -> StepReport {
    let before = simulation.energy();
    let report = simulation.step(1).unwrap();
    assert!(report.is_converged(), "{report:?}");
    let after = simulation.energy();
    let gain = after.kinetic + after.potential - before.kinetic - before.potential;
    let time = simulation.time();
    assert!(
        gain < allowed + report.energy_lifted,
        "{gain} J at {time} s"
    );
    report
}

/// Takes a step, and the general step of a copy: the report, and the largest difference of the
/// velocities.
pub fn step_beside_the_general_one(own: &mut RoverSimulation) -> (StepReport, f64) {
    let mut general = own.clone();
    general.step_with(&MoreauJean, 1).unwrap();
    let report = own.step(1).unwrap();
    (report, apart(own.v(), general.v()))
}
