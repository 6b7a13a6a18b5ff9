//! Machines with every kind of joint and force take their steps in lanes, as the general step does.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use rover_core::contact::Part;
use rover_core::geometry::Terrain;
use rover_core::integrator::moreau_jean::MoreauJean;
use rover_core::integrator::{Phase, Probe, StepOptions, StepReport, Variant};
use rover_core::law::materials::{MaterialPair, Materials};
use rover_core::multibody::description::{JointKind, SolidDescription};
use rover_core::multibody::{Configuration, Kinematics, Model, ModelDescription, Motor};
use rover_core::solver::Method;

use crate::shared::{
    Numbers, apart, flat, follows, limits, moving, quantile, resting, spring,
    step_beside_the_general_one, stepping,
};

/// The built-in rover with springs, dampers, rotors, stops and motors, a mast that slides, a ball
/// joint, and joints that follow another one beside and below it.
pub fn equipped() -> ModelDescription {
    let mut rover = ModelDescription::rover();
    let template = rover.solids[1].clone();
    let solid = |name: &str, parent: &str, joint, position| SolidDescription {
        name: name.into(),
        parent: Some(parent.into()),
        joint: Some(joint),
        position: Some(position),
        axis: None,
        mass: 20.0,
        hold: None,
        ..template.clone()
    };
    for body in &mut rover.solids {
        if body.name == "front_axle" {
            body.spring = Some(spring(900.0, 0.02));
            body.damping = Some(40.0);
            body.armature = Some(3.0);
            body.limits = Some(limits(-0.06, 0.06));
        } else if body.name.ends_with("bogie") {
            body.damping = Some(5.0);
        } else if body.name.starts_with("wheel") {
            body.armature = Some(0.05);
        }
    }
    for wheel in &mut rover.wheels {
        wheel.motor = Some(Motor {
            stall_torque: 120.0,
            no_load_speed: 5.0,
            regenerating: wheel.name.starts_with('F'),
        });
    }
    rover.solids.extend([
        SolidDescription {
            axis: Some([0.1, 1.0, 0.0]),
            spring: Some(spring(6e3, 0.0)),
            damping: Some(60.0),
            limits: Some(limits(-0.035, 0.02)),
            ..solid("mast", "trunk", JointKind::Prismatic, [0.3, 0.3, 0.0])
        },
        SolidDescription {
            centre_of_mass: Some([0.02, -0.2, 0.0]),
            ..solid("bob", "mast", JointKind::Spherical, [0.0, 0.5, 0.1])
        },
        SolidDescription {
            axis: Some([0.0, 0.0, 1.0]),
            coupled: Some(follows("mast", 4.0, 0.1)),
            ..solid("flag", "mast", JointKind::Revolute, [0.0, 0.1, 0.0])
        },
        SolidDescription {
            axis: Some([1.0, 0.0, 0.2]),
            coupled: Some(follows("front_axle", -0.7, 0.1)),
            ..solid("balance", "trunk", JointKind::Revolute, [-0.4, 0.2, 0.0])
        },
    ]);
    rover
}

/// How a step went.
#[derive(Default)]
struct Parts {
    kinematics: usize,
    mass_matrices: usize,
}

impl Probe for Parts {
    fn end(&mut self, phase: Phase) {
        self.kinematics += usize::from(phase == Phase::Kinematics);
        self.mass_matrices += usize::from(phase == Phase::MassMatrix);
    }
}

/// What was met on a drive.
#[derive(Default)]
struct Met {
    steps: usize,
    general: usize,
    retaken: usize,
    stops: usize,
    /// Steps whose rebounds the energy audit slowed.
    corrected: usize,
    differences: Vec<f64>,
}

/// Height of the lowest point of the wheels at the zero of all coordinates, m.
fn lowest_of_wheels(model: &Model) -> f64 {
    let kinematics = Kinematics::of(model, &Configuration::zero(model));
    let wheels = model.wheels().iter();
    let lowest = wheels.map(|wheel| kinematics.point(wheel.body, &wheel.centre).y - wheel.radius);
    lowest.fold(f64::INFINITY, f64::min)
}

/// Drives a machine that is let go `height` above the plane, m, and pushed about by forces of up to
/// `push` times its weight. It begins to turn, and its wheels to spin, with up to `spin` rad/s
/// about every axis. Commands are of ten steps.
fn drive(
    model: &Arc<Model>,
    options: StepOptions,
    [height, push, spin]: [f64; 3],
    n_commands: usize,
) -> Met {
    let mut numbers = Numbers(5);
    let mass: f64 = model.bodies().iter().map(|body| body.mass).sum();
    let weight = mass * options.gravity.norm();
    let mut start = Configuration::zero(model);
    if model.is_free() {
        start.position.y = height - lowest_of_wheels(model);
    }
    let mut v = vec![0.0; model.nv()];
    let wheels = model.wheels().iter().filter_map(|wheel| wheel.joint);
    let wheels = wheels.map(|joint| model.mechanism().joints[joint].velocity);
    let turns = if model.is_free() { 3..6 } else { 0..0 };
    for k in turns.chain(wheels) {
        v[k] = spin * numbers.next();
    }
    let mut rover = moving(Arc::clone(model), flat(), options, start, v);
    let mut met = Met::default();
    for _ in 0..n_commands {
        let wheels = model.wheels().iter();
        let torques: Vec<f64> = (wheels.clone())
            .map(|wheel| 0.6 * wheel.torque_limit * numbers.next())
            .collect();
        let steering: Vec<f64> = wheels
            .map(|wheel| 0.7 * wheel.steering_limit * numbers.next())
            .collect();
        rover.set_commands(&torques, &steering).unwrap();
        if push > 0.0 {
            for solid in [model.frames().first(), model.frames().last()] {
                let force = [0.0; 3].map(|_: f64| push * weight * numbers.next());
                let (solid, moment) = (&solid.unwrap().name, force.map(|x| 0.2 * x));
                rover
                    .apply_wrench(solid, force, moment, [0.1, 0.2, 0.0])
                    .unwrap();
            }
        }
        for _ in 0..10 {
            let mut general = rover.clone();
            general.step_with(&MoreauJean, 1).unwrap();
            let mut parts = Parts::default();
            let report = rover.step_probed(1, &mut parts).unwrap();
            let is_general = report.fallbacks > 0;
            assert_eq!(is_general, parts.kinematics > 1);
            met.steps += 1;
            met.general += usize::from(is_general);
            met.retaken += usize::from(!is_general && report.retaken > 0);
            if !is_general {
                assert_eq!(parts.mass_matrices, 1 + report.retaken);
            }
            let is_stop = |key: rover_core::contact::ContactKey| {
                matches!(key.opposite, rover_core::contact::Opposite::Stop)
            };
            let stops = rover.contacts().iter().filter(|a| is_stop(a.contact.key));
            for stop in stops {
                met.stops += usize::from(!is_general);
                assert!(stop.impulse[0] >= 0.0 && stop.impulse[1..] == [0.0; 2]);
                assert_eq!(stop.velocity[1..], [0.0; 2]);
            }
            let difference = apart(rover.v(), general.v());
            met.differences.push(difference);
            let (own, other) = (report, general.last_report());
            if difference < 1e-9 {
                assert_eq!(own.retaken > 0, other.retaken > 0);
                assert_eq!(rover.contacts().len(), general.contacts().len());
            }
            if difference < 1e-11 && !is_general {
                let energies = |report: &StepReport| {
                    [
                        report.energy_supplied,
                        report.energy_dissipated,
                        report.energy_removed,
                        report.energy_lifted,
                        report.energy_released,
                        report.residual,
                    ]
                };
                let (own_parts, others) = (energies(&own), energies(other));
                assert!(apart(&own_parts, &others) < 1e-6, "{own:?} {other:?}");
                met.corrected += usize::from(own.residual > 1e-6);
            }
        }
    }
    met
}

#[test]
fn every_joint_and_force_obeys_the_law_of_the_general_step() {
    let models = ["mars-rover", "open-rover", "four-steered", "skid-steered"];
    let mut models: Vec<ModelDescription> = models
        .map(|name| ModelDescription::named(name).unwrap())
        .to_vec();
    models.push(equipped());
    for description in models {
        let name = description.name.clone();
        let model = Arc::new(Model::from_description(description).unwrap());
        for h in [0.005, 0.02] {
            let options = stepping(Variant::default(), h);
            let met = drive(&model, options, [0.03, 0.0, 0.0], 60);
            let general = met.general * 6;
            assert!(
                general < met.steps,
                "{name}: {} of {}",
                met.general,
                met.steps
            );
            // A few friction problems have several answers.
            let typical = quantile(met.differences, 95);
            assert!(typical < 1e-9, "{name} {h}: {typical:e}");
            if name == "rover" {
                assert!(
                    met.retaken > 5 && met.stops > 100,
                    "{} {}",
                    met.retaken,
                    met.stops
                );
            }
        }
    }
}

/// Rovers that bounce, by one number or by pairs of materials, on rigid and on yielding wheels;
/// that forces push about; whose solves start from nothing, or have another method; and that turn
/// too fast for explicit gyroscopic terms.
#[test]
fn rebounds_wrenches_methods_and_fast_turns_obey_the_law_of_the_general_step() {
    rebounds_and_the_rest_obey(&["mars-rover", "equipped"], 20);
}

/// Ignored because it takes 20 s: `make test-all` runs it, and the test above, which runs always,
/// has two of its machines and a third of most drives.
#[test]
#[ignore = "tests/physics/lanes/machines.rs::rebounds_wrenches_methods_and_fast_turns_obey_the_law_of_the_general_step"]
fn rebounds_wrenches_methods_and_fast_turns_obey_the_law_for_long() {
    rebounds_and_the_rest_obey(&["mars-rover", "open-rover", "equipped"], 60);
}

fn rebounds_and_the_rest_obey(names: &[&str], n_commands: usize) {
    let pair = MaterialPair {
        materials: ["wheel".into(), "ground".into()],
        friction_coefficient: 0.5,
        restitution: 0.6,
    };
    let usual = StepOptions::default;
    let bouncing = |restitution| StepOptions {
        restitution,
        ..usual()
    };
    let materials = StepOptions {
        materials: Materials::new(vec![pair]),
        ..usual()
    };
    let cold = StepOptions {
        warm_start: false,
        ..usual()
    };
    let by = |method| {
        let mut options = usual();
        options.solver.method = method;
        options
    };
    let cases = [
        (by(Method::Newton), [0.03, 0.0, 0.0]),
        (by(Method::ProximalPoint), [0.03, 0.0, 0.0]),
        (bouncing(0.3), [0.5, 0.0, 0.0]),
        (bouncing(0.9), [0.5, 0.0, 0.0]),
        (materials, [0.3, 0.0, 0.0]),
        (usual(), [0.03, 0.4, 0.0]),
        (cold, [0.03, 0.0, 0.0]),
        (usual(), [0.5, 0.0, 70.0]),
    ];
    let mut corrected = 0;
    for &name in names {
        let description = match name {
            "equipped" => equipped(),
            _ => ModelDescription::named(name).unwrap(),
        };
        let model = Arc::new(Model::from_description(description).unwrap());
        for (options, start) in &cases {
            // What falls far bounces for long, and what turns fast takes parts of steps at first.
            let n_commands = if start[0] > 0.1 { 60 } else { n_commands };
            let met = drive(&model, options.clone(), *start, n_commands);
            let Met { steps, general, .. } = met;
            corrected += met.corrected;
            // A ball joint that turns by half a radian in a step takes several, and one method
            // alone does not solve every problem.
            let is_hard = start[2] > 0.0 || options.solver.method != Method::Auto;
            let most = if is_hard { steps / 2 } else { steps / 6 };
            assert!(general < most, "{name} {options:?}: {general}");
            let typical = quantile(met.differences, 90);
            assert!(typical < 1e-9, "{name} {options:?}: {typical:e}");
        }
    }
    assert!(corrected > 0);
}

/// A machine whose trunk hangs on a joint of the world, its wheels just above the plane.
pub fn on_a_stand(
    mut own: ModelDescription,
    kind: JointKind,
    axis: Option<[f64; 3]>,
) -> ModelDescription {
    let root = &mut own.solids[0];
    (root.joint, root.axis, root.position) = (Some(kind), axis, Some([0.0; 3]));
    let model = Model::from_description(own.clone()).unwrap();
    let lowest = lowest_of_wheels(&model);
    own.solids[0].position = Some([0.0, 1e-3 - lowest, 0.0]);
    own
}

/// Machines whose trunk hangs on a joint of the world, on a slide, or does not move at all, with
/// their wheels on the ground.
#[test]
fn machines_on_stands_obey_the_law_of_the_general_step() {
    let kinds = [
        (JointKind::Prismatic, Some([0.0, 1.0, 0.0])),
        (JointKind::Revolute, Some([0.0, 0.0, 1.0])),
        (JointKind::Spherical, None),
        (JointKind::Fixed, None),
    ];
    for (kind, axis) in kinds {
        let description = on_a_stand(equipped(), kind, axis);
        let model = Arc::new(Model::from_description(description).unwrap());
        let met = drive(&model, StepOptions::default(), [0.0, 0.1, 0.0], 60);
        let Met { steps, general, .. } = met;
        assert!(
            general * 6 < steps && met.stops > 100,
            "{kind:?}: {general}"
        );
        let typical = quantile(met.differences, 90);
        // On a slide wheels push against each other sideways, by what W's rounding says.
        let is_slide = kind == JointKind::Prismatic;
        assert!(
            typical < if is_slide { 1e-6 } else { 1e-9 },
            "{kind:?}: {typical:e}"
        );
    }
}

/// The built-in rover on its back, on its side or pushed against the ground, whose boxes touch the
/// ground, also with friction by pair of materials, and with bodies that can touch each other.
#[test]
fn bodies_on_the_ground_obey_the_law_of_the_general_step() {
    let mut touching = ModelDescription::rover();
    touching.self_contact = true;
    let materials = Materials::new(vec![MaterialPair {
        materials: ["body".into(), "ground".into()],
        friction_coefficient: 0.3,
        restitution: 0.0,
    }]);
    let grounds: [Arc<dyn Terrain>; 3] = [
        flat(),
        super::surfaces::hills(0.25, 3),
        super::surfaces::hills_with_rocks(4),
    ];
    let mut numbers = Numbers(9);
    let (mut steps, mut fallbacks, mut boxes, mut pairs) = (0, 0, 0, 0);
    let mut differences = Vec::new();
    for (k, ground) in grounds.iter().cycle().take(9).enumerate() {
        let own = if k % 2 == 0 {
            ModelDescription::rover()
        } else {
            touching.clone()
        };
        let model = Arc::new(Model::from_description(own).unwrap());
        let options = StepOptions {
            materials: if k > 5 {
                materials.clone()
            } else {
                Materials::default()
            },
            ..StepOptions::default()
        };
        let mut start = Configuration::zero(&model);
        start.position.y = 0.6;
        let turn = [3.1, 1.5, 2.8][k / 3];
        start.attitude = UnitQuaternion::from_scaled_axis(Vector3::x() * turn);
        let v = (0..model.nv()).map(|_| 0.5 * numbers.next()).collect();
        let mut rover = moving(model, Arc::clone(ground), options, start, v);
        for step in 0..200 {
            if step % 20 == 0 {
                let torques: Vec<f64> = (0..6).map(|_| 60.0 * numbers.next()).collect();
                rover.set_commands(&torques, &[0.0; 6]).unwrap();
            }
            let (report, difference) = step_beside_the_general_one(&mut rover);
            steps += 1;
            fallbacks += report.fallbacks;
            let kinds = rover.contacts().iter().map(|a| a.contact);
            boxes += kinds
                .clone()
                .filter(|c| matches!(c.part, Part::Box(_)))
                .count();
            pairs += kinds.filter(|c| c.other.is_some()).count();
            differences.push(difference);
        }
    }
    assert!(fallbacks * 10 < steps, "{fallbacks} of {steps}");
    assert!(
        boxes > 1000 && pairs > 100,
        "{boxes} contacts of boxes, {pairs} of pairs"
    );
    // A few friction problems have several answers.
    let typical = quantile(differences, 90);
    assert!(typical < 1e-9, "{typical:e}");
}

/// Forty arms with stops, all of them bent against an end: more contacts than a problem of the
/// usual effort has. A few at their stops are solved with it.
#[test]
fn a_machine_may_have_any_number_of_stops() {
    let mut description = ModelDescription::rover();
    let template = description.solids[1].clone();
    description.solids.extend((0..40).map(|i| SolidDescription {
        name: format!("arm {i}"),
        mass: 0.1,
        limits: Some(limits(-1.0, 1.0)),
        ..template.clone()
    }));
    let model = Arc::new(Model::from_description(description).unwrap());
    for (n_bent, has_fallbacks) in [(5, false), (40, true)] {
        let mut start = Configuration::zero(&model);
        start.position.y = 5.0;
        let mut v = vec![0.0; model.nv()];
        for i in 0..n_bent {
            let joint = model.joint_index(&format!("arm {i}")).unwrap();
            start.joints[joint] = 0.999;
            v[model.joint_velocity(joint)] = 1.0;
        }
        let mut rover = moving(Arc::clone(&model), flat(), StepOptions::default(), start, v);
        let report = rover.step(1).unwrap();
        assert_eq!(rover.contacts().len(), n_bent);
        assert!(report.is_converged());
        assert_eq!(report.fallbacks > 0, has_fallbacks, "{n_bent}");
        assert!(rover.q().joints.iter().all(|q| *q < 1.0 + 1e-9));
    }
}

/// The order of what is remembered does not show. A contact that is forgotten begins anew, and ends
/// at the same load.
#[test]
fn impulses_are_remembered_by_contact() {
    let mut rover = resting(Model::rover(), flat(), StepOptions::default(), |_| ());
    rover.set_wheel_torques(&[5.0; 6]).unwrap();
    rover.step(200).unwrap();
    let known = rover.snapshot();
    assert_eq!(known.warm_start.impulses.len(), 6);
    let mut permuted = known.clone();
    permuted.warm_start.impulses.swap(0, 1);
    let mut forgotten = known.clone();
    forgotten.warm_start.impulses.remove(2);
    let ends = [known, permuted, forgotten].map(|snapshot| {
        let mut rover = rover.clone();
        rover.restore(&snapshot).unwrap();
        assert_eq!(rover.step(1).unwrap().fallbacks, 0);
        rover
    });
    assert_eq!(ends[0].state(), ends[1].state());
    for (a, b) in ends[0].contacts().iter().zip(ends[2].contacts()) {
        assert!((a.impulse[0] - b.impulse[0]).abs() < 1e-3 * a.impulse[0]);
    }
}
