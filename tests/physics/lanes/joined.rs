//! Several machines in one model take their steps in lanes, as the general step does.

use std::sync::Arc;

use rover_core::contact::placement::resting_pose;
use rover_core::geometry::{Plane, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::integrator::moreau_jean::MoreauJean;
use rover_core::multibody::description::{JointKind, LoopDescription, LoopKind, Shape};
use rover_core::multibody::{Model, ModelDescription, coordinates};
use rover_core::scalar::Instructions;
use rover_core::simulation::RoverSimulation;

use super::lane_batch::{command, drive_all, rocks};
use super::surfaces::hills;
use crate::shared::{Numbers, apart, closure, flat, moving, quantile, step_beside_the_general_one};

/// A machine of a scene: its description, its place and heading on the ground, how high it starts
/// over the plane, m, its speed along x, m/s, and the mean torque of its wheels, N m.
struct Part {
    description: ModelDescription,
    at: [f64; 3],
    lift: f64,
    speed: f64,
    torque: f64,
}

/// Machines on a ground.
struct Scene {
    name: &'static str,
    parts: Vec<Part>,
    loops: Vec<LoopDescription>,
    ground: Arc<dyn Terrain>,
    /// Largest torque that is drawn beside the mean one, N m.
    noise: f64,
}

fn part(description: ModelDescription, x: f64, z: f64) -> Part {
    Part {
        description,
        at: [x, z, 0.0],
        lift: 0.0,
        speed: 0.0,
        torque: 0.0,
    }
}

fn named(name: &str) -> ModelDescription {
    ModelDescription::named(name).unwrap()
}

/// A free solid of one shape that collides.
fn block(mass: f64, shape: &Shape) -> ModelDescription {
    let mut own = ModelDescription::rover();
    own.solids.truncate(1);
    own.wheels.clear();
    own.tags.clear();
    own.solids[0].mass = mass;
    own.solids[0].shape = Some(shape.clone());
    own.solids[0].inertia = None;
    own.solids[0].centre_of_mass = None;
    own.solids[0].collides = true;
    own
}

fn connect(name: &str, solid: &str, x: f64, other: &str, at: [f64; 3]) -> LoopDescription {
    LoopDescription {
        position: Some([x, 0.0, 0.0]),
        other_position: Some(at),
        ..closure(name, LoopKind::Connect, solid, Some(other))
    }
}

impl Scene {
    fn new(name: &'static str, parts: Vec<Part>) -> Self {
        Self {
            name,
            parts,
            loops: Vec::new(),
            ground: flat(),
            noise: 5.0,
        }
    }

    /// Its machines at rest on their ground, or where it is rough, above it.
    fn begin(&self) -> RoverSimulation {
        let names = ["a", "b", "c"];
        let parts = names.iter().zip(&self.parts);
        let parts = parts.map(|(name, part)| ((*name).to_owned(), part.description.clone()));
        let joined = ModelDescription::joined(self.name, parts.collect(), self.loops.clone());
        let model = Arc::new(Model::from_description(joined).unwrap());
        let (mut q, mut v) = (Vec::new(), Vec::new());
        for part in &self.parts {
            let own = Model::from_description(part.description.clone()).unwrap();
            let [x, z, heading] = part.at;
            let mut place = if own.wheels().is_empty() {
                let mut place = vec![0.0; own.nv()];
                (place[0], place[2]) = (x, z);
                place
            } else {
                resting_pose(&own, &Plane::ground(), [x, z], heading).unwrap()
            };
            place[1] += part.lift;
            q.extend(place);
            let first = v.len();
            v.resize(first + own.nv(), 0.0);
            v[first] = part.speed;
        }
        let q = coordinates::from_public(&model, &q).unwrap();
        let q = rover_core::contact::loops::closed(&model, &q, &mut v).unwrap();
        let ground = Arc::clone(&self.ground);
        moving(model, ground, StepOptions::default(), q, v)
    }

    fn torques(&self, numbers: &mut Numbers) -> Vec<f64> {
        let wheels = self.parts.iter().flat_map(|part| {
            let n = part.description.wheels.len();
            std::iter::repeat_n(part.torque, n)
        });
        wheels
            .map(|mean| mean + self.noise * numbers.next())
            .collect()
    }
}

fn scenes() -> Vec<Scene> {
    let bar = Shape::Box {
        size: [0.5, 0.03, 0.03],
    };
    let mut bar = block(1.0, &bar);
    bar.solids[0].collides = false;
    let skid = || named("skid-steered");
    let driven = |part: Part, speed: f64, torque: f64| Part {
        speed,
        torque,
        ..part
    };
    let lifted = |part: Part, lift: f64| Part { lift, ..part };
    let rover = ModelDescription::rover;
    let mut tow = Scene::new(
        "tow with a bar",
        vec![
            driven(part(skid(), 0.0, 0.0), 0.0, 6.0),
            part(named("open-rover"), -1.6, 0.0),
            lifted(part(bar.clone(), -0.9, 0.0), 0.3),
        ],
    );
    tow.loops = vec![
        connect("front", "c/trunk", 0.25, "a/trunk", [-0.55, 0.0, 0.0]),
        connect("rear", "c/trunk", -0.25, "b/trunk", [0.5, -0.06, 0.0]),
    ];
    let deck = Shape::Box {
        size: [3.0, 0.2, 2.0],
    };
    let mut on_hills = Scene::new(
        "meet on hills",
        vec![
            driven(lifted(part(rover(), -1.3, 0.1), 0.15), 0.8, 8.0),
            driven(lifted(part(rover(), 1.3, -0.2), 0.15), -0.8, -8.0),
        ],
    );
    on_hills.ground = hills(0.25, 3);
    let mut on_rocks = Scene::new(
        "among rocks",
        vec![
            lifted(part(skid(), -1.5, 0.0), 0.15),
            lifted(part(named("open-rover"), 0.5, 0.4), 0.15),
            lifted(part(rover(), 3.0, -0.4), 0.15),
        ],
    );
    on_rocks.ground = rocks(&mut Numbers(5));
    let mut wide = skid();
    for wheel in &mut wide.wheels {
        wheel.width = Some(0.08);
        wheel.stiffness = Some(2e6);
        wheel.damping = Some(1e4);
    }
    let unseen = lifted(part(bar, 0.0, 2.0), 3.0);
    vec![
        // A machine once got the pattern of the one that was asked first, and panicked.
        Scene::new(
            "of different shapes",
            vec![
                unseen,
                part(wide.clone(), 0.0, 0.0),
                part(rover(), 0.0, 4.0),
            ],
        ),
        Scene::new(
            "apart",
            vec![part(rover(), 0.0, 0.0), part(named("open-rover"), 0.0, 4.0)],
        ),
        Scene::new(
            "head-on",
            vec![
                driven(part(skid(), -1.0, 0.0), 1.5, 4.0),
                driven(part(skid(), 1.0, 0.1), -1.5, -4.0),
            ],
        ),
        Scene::new(
            "push on rigid discs",
            vec![
                driven(part(rover(), -2.05, 0.05), 0.5, 8.0),
                part(rover(), 0.0, 0.0),
            ],
        ),
        Scene::new(
            "push",
            vec![
                driven(part(wide, -1.0, 0.05), 0.5, 8.0),
                part(skid(), 0.6, 0.0),
            ],
        ),
        tow,
        Scene::new(
            "on a deck",
            vec![
                lifted(part(block(500.0, &deck), 0.0, 0.0), 0.1),
                lifted(part(skid(), 0.0, 0.0), 0.2),
            ],
        ),
        on_hills,
        on_rocks,
    ]
}

/// How the steps of a scene went.
#[derive(Default)]
struct Met {
    differences: Vec<f64>,
    fallbacks: usize,
    pairs: usize,
    unsolved: usize,
}

fn compare(scene: &Scene, steps: usize) -> Met {
    let mut numbers = Numbers(7);
    let mut own = scene.begin();
    let mut met = Met::default();
    for step in 0..steps {
        if step % 10 == 0 {
            own.set_wheel_torques(&scene.torques(&mut numbers)).unwrap();
        }
        let mut general = own.clone();
        general.step_with(&MoreauJean, 1).unwrap();
        let report = own.step(1).unwrap();
        let difference = apart(own.v(), general.v());
        met.fallbacks += report.fallbacks;
        met.unsolved += usize::from(!report.is_converged());
        assert!(
            report.energy_gain < 1e-9,
            "{}: {}",
            scene.name,
            report.energy_gain
        );
        let pairs = own.contacts().iter();
        met.pairs += usize::from(pairs.clone().any(|own| own.contact.other.is_some()));
        met.differences.push(difference);
        if difference < 1e-9 {
            let places = |sim: &RoverSimulation| {
                let mut all: Vec<_> = (sim.contacts().iter())
                    .map(|own| {
                        (
                            (own.contact.key.part, own.contact.key.feature),
                            own.position,
                        )
                    })
                    .collect();
                all.sort_by_key(|own| own.0);
                all
            };
            for (a, b) in places(&own).iter().zip(&places(&general)) {
                assert_eq!(a.0, b.0, "{} {step}", scene.name);
                assert!(
                    apart(&a.1, &b.1) < 1e-9,
                    "{} {step} {a:?} {b:?}",
                    scene.name
                );
            }
        }
    }
    met
}

/// A block strikes an arm on a hinge of the world, far above the ground, and they go on together.
#[test]
fn a_block_that_strikes_a_hinged_arm_obeys_the_law_of_the_general_step() {
    let cuboid = |size| Shape::Box { size };
    let mut arm = block(5.0, &cuboid([2.0, 0.2, 0.4]));
    let root = &mut arm.solids[0];
    (root.joint, root.axis) = (Some(JointKind::Revolute), Some([0.0, 0.0, 1.0]));
    root.position = Some([0.0, 50.0, 0.0]);
    let parts = vec![
        ("arm".to_owned(), arm),
        ("block".to_owned(), block(2.0, &cuboid([0.3; 3]))),
    ];
    let joined = ModelDescription::joined("hinge", parts, Vec::new());
    let model = Arc::new(Model::from_description(joined).unwrap());
    let q = [0.1, 0.5, 50.45, 0.05, 0.2, 0.1, 0.3];
    let q = coordinates::from_public(&model, &q).unwrap();
    for restitution in [0.0, 0.5] {
        let options = StepOptions {
            restitution,
            ..StepOptions::default()
        };
        let v = vec![0.3, 1.0, -1.0, 0.2, 1.0, -2.0, 0.5];
        let mut own = moving(Arc::clone(&model), flat(), options, q.clone(), v);
        let (mut touches, mut general_steps, mut differences) = (0, 0, Vec::new());
        for _ in 0..200 {
            let (report, difference) = step_beside_the_general_one(&mut own);
            general_steps += report.fallbacks;
            touches += usize::from(!own.contacts().is_empty());
            differences.push(difference);
        }
        assert!(
            touches > 2 && general_steps < 40,
            "{touches} {general_steps}"
        );
        let typical = quantile(differences, 95);
        assert!(typical < 1e-9, "{typical:e}");
    }
}

#[test]
fn several_machines_obey_the_law_of_the_general_step() {
    for scene in scenes() {
        let steps = 300;
        let met = compare(&scene, steps);
        let name = scene.name;
        let touching = met.pairs;
        let alone = [
            "of different shapes",
            "apart",
            "tow with a bar",
            "among rocks",
        ];
        let should_touch = !alone.contains(&name);
        assert_eq!(touching > 50, should_touch, "{name}: {touching}");
        assert!(met.fallbacks * 50 <= steps, "{name}: {}", met.fallbacks);
        // A few friction problems have several answers.
        let typical = quantile(met.differences, 95);
        assert!(typical < 1e-9, "{name}: {typical:e}");
    }
}

#[test]
fn several_machines_in_lanes_move_as_they_would_alone() {
    for scene in scenes() {
        for instructions in Instructions::all_of_this_machine() {
            let mut numbers = Numbers(3);
            let start = scene.begin();
            let rovers = (0..9).map(|k| {
                let mut own = start.clone();
                command(&mut own, scene.noise, &mut numbers);
                // So that some touch while others do not.
                own.step(12 * k).unwrap();
                own
            });
            let rovers = rovers.collect();
            drive_all(instructions, rovers, (8, scene.noise), &mut Numbers(4));
        }
    }
}
