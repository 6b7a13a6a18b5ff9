//! A rover among balls: momentum, weights, and fixed balls beside the same spheres as a terrain.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use rover_core::contact::Activation;
use rover_core::geometry::{Plane, SphereField, Terrain};
use rover_core::integrator::{Dynamics, MechanicalSystem, Stabilisation, StepOptions, StepReport};
use rover_core::law::rolling::RollingFriction;
use rover_core::multibody::{Model, ModelDescription};
use rover_core::nalgebra::{UnitQuaternion, Vector3};
use rover_core::simulation::{
    GrainSimulation, RoverInGrains, RoverSimulation, Scene as _, TogetherError, grain_options,
};
use rover_core::solver::SolverOptions;
use rover_core::system::grains::{COORDINATES, GrainFriction, Grains, Packing, SleepOptions, Wall};
use rover_core::system::{CompositeContact, CompositeScratch, TreeAmongGrains};

use super::grain_scenes::{awake, between};
use super::rover_kinds::{dry, mecanum, with_a_bar};
use crate::shared::{apart, flat, resting};

/// μ of the rover's parts on grains.
const ON_GRAINS: f64 = 0.7;

/// θ = γ = 1, solved to `tolerance`.
fn options(gravity: f64, time_step: f64, tolerance: f64) -> StepOptions {
    StepOptions {
        theta: 1.0,
        forecast: 1.0,
        time_step,
        gravity: Vector3::new(0.0, -gravity, 0.0),
        stabilisation: Stabilisation::None,
        friction_coefficient: 0.6,
        solver: SolverOptions {
            tolerance,
            velocity_tolerance: tolerance,
            max_sweeps: 20_000,
            ..SolverOptions::default()
        },
        ..StepOptions::default()
    }
}

/// The report's rover at a place (m) on a terrain.
fn rover(terrain: Arc<dyn Terrain>, place: [f64; 3], options: &StepOptions) -> RoverSimulation {
    machine(ModelDescription::rover(), terrain, place, options)
}

/// A machine at a place (m) on a terrain.
fn machine(
    description: ModelDescription,
    terrain: Arc<dyn Terrain>,
    place: [f64; 3],
    options: &StepOptions,
) -> RoverSimulation {
    let model = Model::from_description(description).unwrap();
    resting(model, terrain, options.clone(), |q| {
        q.position = place.into();
    })
}

/// The report's rover with a thing that the step has to know of, and its name.
fn machines() -> Vec<(&'static str, ModelDescription)> {
    let mut soft = ModelDescription::rover();
    for wheel in &mut soft.wheels {
        (wheel.stiffness, wheel.damping) = (Some(2e5), Some(2e4));
    }
    vec![
        ("nothing", ModelDescription::rover()),
        ("loops", with_a_bar()),
        ("dry joints", dry(ModelDescription::rover(), 2.0, 5.0)),
        ("rollers", mecanum()),
        ("soft wheels", soft),
    ]
}

fn nowhere() -> Arc<dyn Terrain> {
    Arc::new(Plane::new([0.0, 1.0, 0.0], 100.0).unwrap())
}

/// A rover and balls.
struct Scene {
    rover: RoverSimulation,
    bed: GrainSimulation<3>,
    link: RoverInGrains,
}

impl Scene {
    fn new(rover: RoverSimulation, bed: GrainSimulation<3>) -> Self {
        let link = RoverInGrains::new(&rover, &bed, ON_GRAINS).unwrap();
        Self { rover, bed, link }
    }

    fn step(&mut self, n: usize) -> StepReport {
        let Self { rover, bed, link } = self;
        link.step(rover, bed, n, &mut || true).unwrap()
    }

    fn kinetic(&self) -> f64 {
        self.rover.energy().kinetic + self.bed.energy().kinetic
    }

    /// Linear momentum, and angular momentum about the origin.
    fn momentum(&self) -> [Vector3<f64>; 2] {
        let (linear, moment) = self.bed.momentum();
        let own = self.rover.momentum();
        [linear + own.linear, moment + own.angular]
    }
}

/// Balls without walls.
fn balls(
    centres: &[[f64; 3]],
    radius: f64,
    mass: f64,
    kinematic: bool,
    options: &StepOptions,
) -> GrainSimulation<3> {
    let friction = GrainFriction::default();
    balls_with(friction, centres, radius, mass, kinematic, options)
}

fn balls_with(
    friction: GrainFriction,
    centres: &[[f64; 3]],
    radius: f64,
    mass: f64,
    kinematic: bool,
    options: &StepOptions,
) -> GrainSimulation<3> {
    let n = centres.len();
    let grains = Grains::new(vec![radius; n], vec![mass; n]).unwrap();
    let grains = grains.with_kinematic(vec![kinematic; n]).unwrap();
    let scene = between(Vec::new(), grains, friction);
    let q = centres.concat();
    awake(scene, options.clone(), &q)
}

#[test]
fn a_hail_of_balls_keeps_the_momenta_and_gains_no_energy() {
    hail(GrainFriction::default());
    // Moments between balls, beside the contacts of the rover.
    hail(GrainFriction {
        rolling: RollingFriction {
            rolling: 0.3,
            drilling: 0.1,
        },
        ..GrainFriction::default()
    });
}

fn hail(friction: GrainFriction) {
    let options = options(0.0, 1e-3, 1e-10);
    let rover = rover(nowhere(), [0.0, 0.0, 0.0], &options);
    let mut centres = Vec::new();
    for i in 0..4 {
        for j in 0..4 {
            for k in 0..3 {
                let (i, j, k) = (f64::from(i), f64::from(j), f64::from(k));
                centres.push([1.6 + 0.25 * k + 0.01 * j, 0.22 * i - 0.4, 0.31 * j - 0.5]);
            }
        }
    }
    let n = centres.len();
    let mut bed = balls_with(friction, &centres, 0.1, 6.0, false, &options);
    let mut v = vec![0.0; 6 * n];
    for (i, v) in v.chunks_exact_mut(6).enumerate() {
        v.copy_from_slice(&[-3.0, 0.1, 0.0, 0.0, 0.0, (i % 3) as f64 - 1.0]);
    }
    let q = bed.q().clone();
    bed.set_state(&q, &v).unwrap();
    let mut scene = Scene::new(rover, bed);
    let [linear, angular] = scene.momentum();
    let (mut energy, mut touched) = (scene.kinetic(), 0);
    let first = energy;
    for _ in 0..400 {
        let report = scene.step(1);
        assert!(report.is_converged(), "{report:?}");
        let now = scene.kinetic();
        // The steering's springs give back what they took.
        assert!(now <= energy * (1.0 + 1e-4), "{now} {energy}");
        energy = now;
        touched += scene.rover.contacts().len();
    }
    assert!(touched > 20, "{touched}");
    assert!(energy < 0.9 * first);
    let [later, turned] = scene.momentum();
    // The rover's joints turn explicitly: its momenta are right to the order of the step.
    assert!(
        (later - linear).norm() < 1e-5 * linear.norm(),
        "{later} {linear}"
    );
    assert!(
        (turned - angular).norm() < 2e-2 * linear.norm(),
        "{turned} {angular}"
    );
    assert!(scene.bed.penetration() < 1e-3);
}

/// A settled bed in a box of 2.6 m by 1.8 m.
fn bed(options: &StepOptions, sleep: Option<SleepOptions>) -> GrainSimulation<3> {
    let packing = Packing::<3> {
        count: 700,
        radius_min: 0.04,
        radius_max: 0.05,
        mass: 1.0,
        corner: [-1.3, 0.0, -0.9],
        sides: [2.6, f64::INFINITY, 1.8],
        seed: 3,
    };
    let (grains, q) = packing.build().unwrap();
    let wall = |p: [f64; 3], n: [f64; 3]| Wall::new(Vector3::from(p), Vector3::from(n)).unwrap();
    let walls = vec![
        wall([0.0; 3], [0.0, 1.0, 0.0]),
        wall([-1.3, 0.0, 0.0], [1.0, 0.0, 0.0]),
        wall([1.3, 0.0, 0.0], [-1.0, 0.0, 0.0]),
        wall([0.0, 0.0, -0.9], [0.0, 0.0, 1.0]),
        wall([0.0, 0.0, 0.9], [0.0, 0.0, -1.0]),
    ];
    let scene = between(walls, grains, GrainFriction::default());
    let mut bed = GrainSimulation::new(Arc::new(scene), options.clone(), sleep, q).unwrap();
    bed.step(200).unwrap();
    bed
}

#[test]
fn a_rover_on_a_bed_is_borne_by_it() {
    let options = options(9.81, 2e-3, 1e-3);
    let mut bed = bed(&options, Some(SleepOptions::default()));
    let top = bed.q().chunks_exact(COORDINATES).map(|q| q[1] + 0.05);
    let top = top.fold(0.0, f64::max);
    let rover = rover(nowhere(), [0.0, top + 0.36, 0.0], &options);
    bed.wake();
    let mut scene = Scene::new(rover, bed);
    scene.step(500);
    let weight = 9.81 * scene.rover.model().mass();
    let before = scene.rover.momentum().linear.y;
    let mut impulse = 0.0;
    for _ in 0..50 {
        scene.step(1);
        let up = scene.rover.contacts().iter().map(|c| {
            let [n, t, b] = c.contact.frame.rows();
            (n * c.impulse[0] + t * c.impulse[1] + b * c.impulse[2]).y
        });
        impulse += up.sum::<f64>();
    }
    let borne = weight * 50.0 * options.time_step;
    let change = scene.rover.momentum().linear.y - before;
    let missing = impulse - borne - change;
    assert!(missing.abs() < 1e-3 * borne, "{impulse} {borne} {change}");
    assert!((impulse / borne - 1.0).abs() < 0.2, "{impulse} {borne}");
    let depth = scene.bed.penetration();
    assert!(depth < 0.01 * 0.04, "{depth}");
    let down = scene.rover.q().position.y;
    assert!(down > 0.1 && down < top + 0.36, "{down}");
}

#[test]
fn fixed_balls_carry_a_machine_like_the_spheres_of_a_terrain() {
    let options = StepOptions {
        friction_coefficient: ON_GRAINS,
        ..options(9.81, 1e-3, 1e-7)
    };
    let centres: Vec<[f64; 3]> = (0..480)
        .map(|i| {
            let (i, j) = (f64::from(i / 20), f64::from(i % 20));
            [0.15 * i - 1.0, 0.01 * ((i + j) % 3.0), 0.15 * j - 1.42]
        })
        .collect();
    let radii = vec![0.13; centres.len()];
    let field: Arc<dyn Terrain> = Arc::new(SphereField::new(&centres, &radii, None).unwrap());
    for (name, own) in machines() {
        let placed = |terrain: &Arc<dyn Terrain>| {
            let mut own = machine(own.clone(), terrain.clone(), [0.0; 3], &options);
            let mut q = own.q().clone();
            q.attitude = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.5);
            let (model, kinematics) = (own.model(), own.kinematics());
            let bottoms = model.wheels().iter().map(|wheel| {
                let centre = kinematics.point(wheel.body, &wheel.centre);
                kinematics.origin(wheel.body).y + centre.y - wheel.radius
            });
            q.position.y = 0.16 - bottoms.fold(f64::INFINITY, f64::min);
            let nv = model.nv();
            let wheels = model.wheels().iter();
            let torques: Vec<f64> = wheels.map(|w| 0.6 * model.mass() * w.radius).collect();
            own.set_state(q, vec![0.0; nv]);
            own.set_wheel_torques(&torques).unwrap();
            own
        };
        let mut alone = placed(&field);
        let bed = balls(&centres, 0.13, 1.0, true, &options);
        let mut scene = Scene::new(placed(&nowhere()), bed);
        let start = alone.q().position;
        alone.step(600).unwrap();
        let report = scene.step(600);
        assert!(report.is_converged(), "{name}: {report:?}");
        let (one, other) = (alone.q().position, scene.rover.q().position);
        assert!((one - start).norm() > 0.05, "{name} drives: {one}");
        assert!((one - other).norm() < 0.01, "{name}: {one} {other}");
        let gaps = scene.link.wheel_gaps(&scene.rover, &scene.bed);
        let deepest = gaps.into_iter().fold(0.0, f64::min);
        let yields = alone.model().has_compliance();
        assert_eq!(deepest < -2e-5, yields, "{name}: {deepest}");
        // The story: the drives of a rover among grains did no work, so that its energy was free.
        let (one, other) = (alone.last_call().work, scene.rover.last_call().work);
        assert!(one > 0.1 * alone.model().mass(), "{name}: {one} J");
        assert!((one - other).abs() < 0.05 * one, "{name}: {one} {other} J");
    }
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let options = options(9.81, 1e-3, 1e-6);
    let bed = |options| balls(&[[0.0, -0.3, 0.0]], 0.05, 1.0, false, options);
    let mut own = rover(nowhere(), [0.0, 1.0, 0.0], &options);
    let slow = grain_options(&bed(&options).description().grains);
    let other = StepOptions {
        time_step: 2e-3,
        ..slow
    };
    let refused = RoverInGrains::new(&own, &bed(&other), 0.5).unwrap_err();
    assert!(matches!(
        refused,
        TogetherError::Differs {
            field: "time_step",
            ..
        }
    ));
    assert!(RoverInGrains::new(&own, &bed(&options), -0.5).is_err());
    own.set_state(
        rover(nowhere(), [0.0, -0.3, 0.0], &options).q().clone(),
        vec![0.0; 21],
    );
    let refused = RoverInGrains::new(&own, &bed(&options), 0.5).unwrap_err();
    assert!(
        matches!(refused, TogetherError::Overlap { grain: 0, .. }),
        "{refused}"
    );
}

/// The step applies Z and Zᵀ contact by contact; W is assembled from the pairs of bodies.
#[test]
fn the_assembled_operator_is_that_of_the_impulses() {
    for own in [ModelDescription::rover(), with_a_bar()] {
        for touch_it in [true, false] {
            is_that_of_the_impulses(&own, touch_it);
        }
    }
}

fn is_that_of_the_impulses(own: &ModelDescription, touch_it: bool) {
    let options = options(9.81, 1e-3, 1e-9);
    let placed = |y: f64| machine(own.clone(), flat(), [0.0, y, 0.0], &options);
    // Its wheels rest on the ground, and one of them by a ball, which another one lies on.
    let centre = |rover: &RoverSimulation| {
        let (model, kinematics) = (rover.model(), rover.kinematics());
        let wheel = &model.wheels()[0];
        kinematics.origin(wheel.body) + kinematics.point(wheel.body, &wheel.centre)
    };
    let low = placed(0.0);
    let radius = low.model().wheels()[0].radius;
    let rover = placed(radius - centre(&low).y - 1e-6);
    let wheel = centre(&rover);
    let away = if touch_it { 0.0 } else { 10.0 };
    let side = wheel.x.signum() * (radius + 0.1 + away);
    let place = [wheel.x + side, wheel.y, wheel.z];
    let above = [place[0], place[1] + 0.2, place[2]];
    let bed = balls(&[place, above], 0.1, 4.0, false, &options);
    let mut parts = CompositeScratch::default();
    let (mut bed_parts, mut rover_parts) = (bed.scene().parts(), rover.scene().parts());
    let (mut bed_memory, mut rover_memory) = (bed.scene().memory(), rover.scene().memory());
    let (of_bed, of_rover) = (bed.command(), rover.command());
    let mut system = TreeAmongGrains {
        bed: (bed.scene()).system(&options, of_bed, &mut bed_memory, &mut bed_parts),
        tree: (rover.scene()).system(&options, of_rover, &mut rover_memory, &mut rover_parts),
        friction: ON_GRAINS,
        parts: &mut parts,
    };
    let q = (bed.q().clone(), rover.scene().moved(rover.q()));
    system.place_middle(&q);
    system.place_end(&q);
    let (v, mut contacts) = (vec![0.0; system.nv()], Vec::new());
    let activation = Activation {
        lead: options.time_step,
        ..Activation::default()
    };
    system.detect(&v, activation, &mut contacts);
    system.relocate(&mut contacts);
    system.update_mass_matrix(&options, true, true);
    assert!(system.factorise(&options));
    let n = 3 * contacts.len();
    system.assemble(&contacts, &v, &mut vec![0.0; n]);
    let count = |is: fn(&CompositeContact) -> bool| contacts.iter().filter(|c| is(c)).count();
    assert!(count(|c| matches!(c, CompositeContact::Grains(_))) > 0);
    assert!(count(|c| matches!(c, CompositeContact::Tree(_))) > 0);
    assert_eq!(
        count(|c| matches!(c, CompositeContact::Touch(_))) > 0,
        touch_it
    );
    let p: Vec<f64> = (0..n).map(|i| (1.7 * i as f64).sin()).collect();
    let (mut y, mut expected) = (vec![0.0; system.nv()], vec![0.0; n]);
    system.add_impulses(&p, &mut y);
    system.local(&y, &mut expected);
    let yields = |i: usize| [0.02, 0.05, 0.01].map(|w| w * (1 + i % 3) as f64);
    system.soften((0..contacts.len()).map(|i| {
        let is_of_grains = matches!(contacts[i], CompositeContact::Grains(_));
        if is_of_grains { [0.0; 3] } else { yields(i) }
    }));
    for (i, contact) in contacts.iter().enumerate() {
        if !matches!(contact, CompositeContact::Grains(_)) {
            for (k, w) in yields(i).into_iter().enumerate() {
                expected[3 * i + k] += w * p[3 * i + k];
            }
        }
    }
    let (zero, mu, mut found) = (vec![0.0; n], vec![0.5; contacts.len()], vec![0.0; n]);
    let problem = system.problem(&zero, &mu);
    problem.operator().multiply_add(&p, &zero, &mut found);
    let off = apart(&expected, &found);
    assert!(off < 1e-12, "{off:e}");
}
