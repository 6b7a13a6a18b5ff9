//! Rovers of a batch move as they would alone, to the last bit.

use std::sync::Arc;

use proptest::prelude::*;
use rover_core::geometry::{Plane, SphereField, Terrain};
use rover_core::integrator::{StepError, StepOptions, StepReport};
use rover_core::multibody::description::{JointKind, LoopKind};
use rover_core::multibody::{Configuration, Model, ModelDescription};
use rover_core::scalar::Instructions;
use rover_core::simulation::RoverSimulation;
use rover_core::simulation::lane_batch::{BatchRover, LaneBatch};
use rover_core::solver::Method;

use super::machines::{equipped, on_a_stand};
use crate::rover_kinds::{dry, mecanum, tracked, with_a_bar};
use crate::shared::{Numbers, bits, closure, flat, moving, step_beside_the_general_one};

pub fn rocks(numbers: &mut Numbers) -> Arc<dyn Terrain> {
    let mut centres = Vec::new();
    let mut radii = Vec::new();
    for _ in 0..60 {
        let radius = 0.09 + 0.04 * numbers.next();
        centres.push([
            3.0 * numbers.next(),
            0.3 * radius * numbers.next() - 0.7 * radius,
            2.0 * numbers.next(),
        ]);
        radii.push(radius);
    }
    Arc::new(SphereField::new(&centres, &radii, Some(Plane::ground())).unwrap())
}

/// A rover on its ground: a plane, rocks, a flat map, hills, or hills with rocks.
fn rover(i: usize, model: &Arc<Model>, numbers: &mut Numbers) -> RoverSimulation {
    with_options(StepOptions::default(), i, model, numbers)
}

fn with_options(
    options: StepOptions,
    i: usize,
    model: &Arc<Model>,
    numbers: &mut Numbers,
) -> RoverSimulation {
    let terrain: Arc<dyn Terrain> = match i % 7 {
        6 => super::surfaces::hills(0.02, i as u64),
        1 => super::surfaces::level(0.25),
        3 => super::surfaces::hills(0.15, i as u64),
        4 => super::surfaces::hills_with_rocks(i as u64),
        2 | 5 => rocks(numbers),
        _ => flat(),
    };
    let options = StepOptions {
        friction_coefficient: 0.6 + 0.2 * numbers.next(),
        ..options
    };
    let mut start = Configuration::zero(model);
    start.position.y = 0.45 + 0.1 * numbers.next();
    let v = (0..model.nv()).map(|_| 0.3 * numbers.next()).collect();
    moving(Arc::clone(model), terrain, options, start, v)
}

pub fn command(rover: &mut RoverSimulation, torque: f64, numbers: &mut Numbers) {
    let model = Arc::clone(rover.model());
    let wheels = model.wheels().iter();
    let torques: Vec<f64> = wheels.map(|_| torque * numbers.next()).collect();
    let limits = model.wheels().iter().map(|wheel| wheel.steering_limit);
    let steering: Vec<f64> = limits.map(|limit| limit * numbers.next()).collect();
    rover.set_commands(&torques, &steering).unwrap();
}

pub fn assert_alike(a: &RoverSimulation, b: &RoverSimulation) {
    assert_eq!(bits(a.v()), bits(b.v()));
    let (p, q) = (a.q(), b.q());
    assert_eq!(bits(&p.joints), bits(&q.joints));
    assert_eq!(bits(p.position.as_slice()), bits(q.position.as_slice()));
    let turns = [p, q].map(|q| bits(q.attitude.coords.as_slice()));
    assert_eq!(turns[0], turns[1]);
    assert_eq!(a.contacts(), b.contacts());
    assert_eq!(a.last_call(), b.last_call());
    assert_eq!(a.motor_torques(), b.motor_torques());
    assert_eq!(bits(&a.loop_forces()), bits(&b.loop_forces()));
    assert!(a.snapshot() == b.snapshot());
}

/// The built-in rover on thin discs, tori and cylinders, rigid and yielding; with all kinds of
/// joints and forces, on thin and on wide wheels; a rover with a differential and motors; rovers on
/// mecanum wheels, with dry friction in joints, on tracks, and with closed loops.
fn models() -> Vec<Arc<Model>> {
    let with = |mut own: ModelDescription, width: Option<f64>, rounding: f64, is_soft: bool| {
        for wheel in &mut own.wheels {
            wheel.width = width;
            wheel.rounding = width.map(|_| rounding);
            wheel.stiffness = Some(if is_soft { 2e6 } else { 0.0 });
            wheel.damping = is_soft.then_some(1e4);
            wheel.relaxation_length = wheel.relaxation_length.filter(|_| is_soft);
        }
        Arc::new(Model::from_description(own).unwrap())
    };
    let rover = ModelDescription::rover;
    let open = ModelDescription::named("open-rover").unwrap();
    vec![
        with(rover(), None, 0.0, false),
        with(rover(), None, 0.0, true),
        with(rover(), Some(0.06), 0.03, false),
        with(rover(), Some(0.08), 0.0, false),
        with(rover(), Some(0.08), 0.02, true),
        with(equipped(), None, 0.0, false),
        with(equipped(), Some(0.08), 0.02, true),
        with(open.clone(), None, 0.0, false),
        with(open, Some(0.05), 0.0, true),
        with(mecanum(), None, 0.0, false),
        with(mecanum(), Some(0.08), 0.02, true),
        with(dry(rover(), 2.0, 30.0), None, 0.0, false),
        with(dry(equipped(), 2.0, 30.0), Some(0.06), 0.03, true),
        Arc::new(Model::from_description(tracked(9)).unwrap()),
        with(with_a_bar(), None, 0.0, true),
        with(with_a_bar(), Some(0.05), 0.01, true),
        with(dry(linked(), 2.0, 30.0), None, 0.0, true),
    ]
}

/// The rover with all kinds of joints and forces, with one bogie that follows the other by a
/// loop, and a mast that is tied to the trunk, once more than needed.
fn linked() -> ModelDescription {
    let mut own = equipped();
    let mut bogies = closure("bogies", LoopKind::Joint, "left_bogie", Some("right_bogie"));
    bogies.polynomial = Some(vec![0.0, -0.8, 0.2]);
    own.loops = vec![
        bogies,
        closure("mast", LoopKind::Weld, "mast", Some("trunk")),
        closure("bob", LoopKind::Connect, "bob", Some("trunk")),
    ];
    own
}

/// Drives rovers of a model in a batch and alone, with 8 commands.
fn drive(instructions: Instructions, model: &Arc<Model>, n: usize, torque: f64, seed: u64) {
    let mut numbers = Numbers(seed);
    let rovers = (0..n).map(|i| rover(i, model, &mut numbers)).collect();
    drive_all(instructions, rovers, (8, torque), &mut numbers);
}

/// Takes ten steps of a batch: the error of each rover.
pub fn advance(batch: &mut LaneBatch, rovers: &mut [RoverSimulation]) -> Vec<Option<StepError>> {
    let mut errors: Vec<Option<StepError>> = vec![None; rovers.len()];
    let mut entries: Vec<BatchRover<'_>> = (rovers.iter_mut().zip(&mut errors))
        .map(|(rover, error)| BatchRover { rover, error })
        .collect();
    batch.advance(&mut entries, 10, &mut || true);
    errors
}

/// Drives rovers of one model in a batch and alone, with so many commands of at most that torque.
pub fn drive_all(
    instructions: Instructions,
    mut together: Vec<RoverSimulation>,
    (n_commands, torque): (usize, f64),
    numbers: &mut Numbers,
) {
    let mut alone = together.clone();
    let mut batch = LaneBatch::new(instructions);
    for _ in 0..n_commands {
        for (a, b) in together.iter_mut().zip(&mut alone) {
            let mut same = Numbers(numbers.0);
            command(a, torque, numbers);
            command(b, torque, &mut same);
        }
        let errors = advance(&mut batch, &mut together);
        for ((a, b), error) in together.iter().zip(&mut alone).zip(errors) {
            assert_eq!(b.step(10).is_err(), error.is_some());
            assert_alike(a, b);
        }
    }
}

/// Change of the energy that the entries of a report add up to, with that of moved set-points, J.
fn explained(report: &StepReport) -> f64 {
    let given = report.energy_supplied + report.energy_of_set_points;
    let given = given + report.energy_released + report.energy_lifted;
    given - report.energy_dissipated - report.energy_lost - report.energy_removed
}

/// Springs, held joints and the work of the actuators were in no entry of the report, and the
/// projection released what it had stored in springs.
#[test]
fn the_entries_of_a_report_add_up_to_the_change_of_the_energy() {
    for (model, seed) in models().iter().zip(0..) {
        let mut numbers = Numbers(seed);
        let mut rovers: Vec<_> = (0..7).map(|i| rover(i, model, &mut numbers)).collect();
        let mut batch = LaneBatch::new(Instructions::of_this_machine());
        let mut before: Vec<Option<f64>> = vec![None; rovers.len()];
        let mut lifted = 0.0;
        for _ in 0..6 {
            for own in &mut rovers {
                command(own, 60.0, &mut numbers);
            }
            let errors = advance(&mut batch, &mut rovers);
            for ((own, before), error) in rovers.iter().zip(&mut before).zip(&errors) {
                let (energy, report) = (own.energy(), own.last_report());
                let size = energy.kinetic + energy.potential.abs() + report.energy_supplied.abs();
                if let Some(before) = before.filter(|_| error.is_none()) {
                    let unexplained = energy.total() - before - explained(report);
                    assert!(
                        unexplained.abs() < 1e-9 * size,
                        "{seed}: {unexplained} {report:?}"
                    );
                }
                lifted += report.energy_lifted;
                *before = Some(energy.total());
            }
        }
        assert!(lifted > 0.0, "{seed}");
    }
}

/// On height maps 10 of 5040 restores went another way, first by an ulp: a wheel that is followed
/// along a map and one that is looked up were placed by different formulas. A restored rover has
/// nothing to follow, so restore it at any step; in lanes and, by another solver, in the general
/// step.
#[test]
fn a_rover_restored_on_a_height_map_goes_on_to_the_bit() {
    for (k, own) in models().iter().enumerate().step_by(2) {
        for ground in [3, 4, 6] {
            for method in [Method::Auto, Method::Newton] {
                let mut numbers = Numbers((10 * k + ground) as u64);
                let mut options = StepOptions::default();
                options.solver.method = method;
                let mut own = with_options(options, ground, own, &mut numbers);
                let fresh = own.clone();
                for _ in 0..4 {
                    command(&mut own, 60.0, &mut numbers);
                    own.step(1).unwrap();
                    for _ in 0..6 {
                        let mut other = fresh.clone();
                        other.restore(&own.snapshot()).unwrap();
                        let (torques, steering) = (own.wheel_torques(), own.steering());
                        other.set_commands(torques, &steering).unwrap();
                        own.step(3).unwrap();
                        other.step(3).unwrap();
                        assert_alike(&own, &other);
                    }
                }
            }
        }
    }
}

/// Rovers on cylinders among rocks, whose wheels lift and meet two things at once, so that the
/// places of their contacts come and go.
fn on_cylinders(n: usize, width: f64, numbers: &mut Numbers) -> Vec<RoverSimulation> {
    let mut wide = ModelDescription::rover();
    for wheel in &mut wide.wheels {
        (wheel.width, wheel.contact_radius) = (Some(width), Some(0.2));
    }
    let model = Arc::new(Model::from_description(wide).unwrap());
    (0..n).map(|_| rover(2, &model, numbers)).collect()
}

/// A thread steps rovers of two machines in turn, with the same lanes of its solver.
#[test]
fn rovers_of_one_machine_do_not_feel_those_of_another() {
    let mut numbers = Numbers(3);
    let mut teams = [0.15, 0.10].map(|width| on_cylinders(16, width, &mut numbers));
    let mut batch = LaneBatch::new(Instructions::of_this_machine());
    for _ in 0..6 {
        for team in &mut teams {
            for own in &mut *team {
                command(own, 60.0, &mut numbers);
            }
            let mut alone = team.clone();
            advance(&mut batch, team);
            for (own, alone) in team.iter().zip(&mut alone) {
                alone.step(10).unwrap();
                assert_alike(own, alone);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]
    #[test]
    fn a_rover_moves_as_it_would_alone(
        which: prop::sample::Index, n in 1usize..20, torque in 0.0..200.0, seed: u64,
    ) {
        drive(Instructions::of_this_machine(), which.get(&models()), n, torque, seed);
    }
}

/// Rovers that bounce, of which some are pushed, some turn too fast for explicit gyroscopic terms,
/// and some for one step; on free roots, on stands, and a free one beside one on a stand.
#[test]
fn rovers_that_bounce_turn_and_are_pushed_move_as_they_would_alone() {
    bounce_turn_and_are_pushed(4);
}

/// Ignored because it takes half a minute: `make test-all` runs it, and the test above, which runs
/// always, is its first half.
#[test]
#[ignore = "tests/physics/lanes/lane_batch.rs::rovers_that_bounce_turn_and_are_pushed_move_as_they_would_alone"]
fn rovers_that_bounce_turn_and_are_pushed_for_long_move_as_they_would_alone() {
    bounce_turn_and_are_pushed(8);
}

fn bounce_turn_and_are_pushed(n_commands: usize) {
    let slide = on_a_stand(equipped(), JointKind::Prismatic, Some([0.0, 1.0, 0.0]));
    let parts = vec![
        ("a".to_owned(), slide.clone()),
        ("b".to_owned(), equipped()),
    ];
    let both = ModelDescription::joined("both", parts, Vec::new());
    let on_stands = [
        slide,
        on_a_stand(equipped(), JointKind::Spherical, None),
        on_a_stand(linked(), JointKind::Revolute, Some([0.0, 0.0, 1.0])),
        both,
    ];
    let on_stands = on_stands.map(|own| Arc::new(Model::from_description(own).unwrap()));
    for (model, seed) in models().iter().chain(&on_stands).zip(300..) {
        let mut numbers = Numbers(seed);
        let options = StepOptions {
            restitution: 0.5,
            warm_start: seed % 3 > 0,
            ..StepOptions::default()
        };
        let mut rovers: Vec<RoverSimulation> = (0..9)
            .map(|i| with_options(options.clone(), i, model, &mut numbers))
            .collect();
        for (i, rover) in rovers.iter_mut().enumerate() {
            let (q, mut v) = (rover.q().clone(), rover.v().to_vec());
            for v in &mut v {
                *v *= [1.0, 100.0, 1.0, 400.0][i % 4];
            }
            rover.set_state(q, v);
            for k in 0..i % 3 {
                let frame = (i + 5 * k) % model.frames().len();
                let name = model.frames()[frame].name.clone();
                let force = [0.0; 3].map(|_: f64| 200.0 * numbers.next());
                rover
                    .apply_wrench(&name, force, force.map(|x| 0.1 * x), [0.1, 0.0, 0.2])
                    .unwrap();
            }
        }
        drive_all(
            Instructions::of_this_machine(),
            rovers,
            (n_commands, 30.0),
            &mut numbers,
        );
    }
}

#[test]
fn narrower_lanes_give_the_same_bits() {
    give_the_same_bits(2);
}

/// Ignored because it takes 20 s: `make test-all` runs it, and the test above, which runs always,
/// is its beginning.
#[test]
#[ignore = "tests/physics/lanes/lane_batch.rs::narrower_lanes_give_the_same_bits"]
fn narrower_lanes_give_the_same_bits_for_long() {
    give_the_same_bits(8);
}

fn give_the_same_bits(n_commands: usize) {
    let models = models();
    for instructions in Instructions::all_of_this_machine() {
        for (model, seed) in models.iter().zip(0..) {
            let mut numbers = Numbers(seed);
            let rovers = (0..8).map(|i| rover(i, model, &mut numbers)).collect();
            drive_all(instructions, rovers, (n_commands, 60.0), &mut numbers);
        }
        drive(instructions, &models[7], 9, 60.0, 7);
        // A lane ends its problem while another one begins to use a place that it has vacated.
        drive(instructions, &models[3], 13, 0.0, 2_654_566_666_266_279_419);
    }
}

#[test]
fn the_quick_step_obeys_the_law_of_the_general_one() {
    for model in models() {
        obeys_the_law_of_the_general_step(&model);
    }
}

fn obeys_the_law_of_the_general_step(model: &Arc<Model>) {
    let mut numbers = Numbers(11);
    let (mut worst, mut unsolved) = (Vec::new(), 0);
    for i in 0..6 {
        let mut own = rover(i, model, &mut numbers);
        own.step(100).unwrap();
        for _ in 0..10 {
            command(&mut own, 30.0, &mut numbers);
            for _ in 0..10 {
                let (report, difference) = step_beside_the_general_one(&mut own);
                unsolved += usize::from(!report.is_converged());
                worst.push(difference);
            }
        }
    }
    worst.sort_by(f64::total_cmp);
    let n_other = worst.iter().filter(|x| **x >= 1e-9).count();
    // Of rigid cylinders many problems have several answers, since small tilts of their axles count
    // as none, and the general step tries fewer ways to pivot before its pyramids: 299 steps of the
    // 600 differ.
    let wheel = &model.description().wheels[0];
    let is_hard =
        wheel.stiffness == Some(0.0) && wheel.width.is_some() && wheel.rounding == Some(0.0);
    // So do some of rigid wheels whose joints resist: 12 of 600.
    let is_dry = wheel.stiffness == Some(0.0) && !model.rubbing_joints().is_empty();
    let (most_other, most_unsolved) = match (is_hard, is_dry) {
        (true, _) => (320, 10),
        (_, true) => (16, 0),
        _ => (6, 0),
    };
    assert!(
        n_other <= most_other,
        "{n_other} of {} steps of {}: {:?}",
        worst.len(),
        model.description().name,
        &worst[worst.len() - 30..]
    );
    assert!(unsolved <= most_unsolved, "{unsolved}");
}
