//! Closed loops: linkages against their closed forms, and against the same machine as a tree.

use rover_core::contact::loops::{closed, redundant_rows, widest_gap};
use rover_core::integrator::Variant;
use rover_core::multibody::error::{ModelError, ModelFault};
use rover_core::multibody::{
    Configuration, JointKind, LoopDescription, LoopKind, Model, ModelDescription, SolidDescription,
};
use rover_core::simulation::RoverSimulation;

use super::machines::{energy, joint, machine, simulation, solid};
use crate::shared::{VARIANTS, apart, closure, largest, limits, near, near_in, stepping};

fn with_loops(solids: Vec<SolidDescription>, loops: Vec<LoopDescription>) -> ModelDescription {
    ModelDescription {
        loops,
        ..machine(solids)
    }
}

fn built(solids: Vec<SolidDescription>, loops: Vec<LoopDescription>) -> Model {
    Model::from_description(with_loops(solids, loops)).unwrap()
}

/// Lengths of crank, coupler, rocker and base, m.
const BARS: [f64; 4] = [0.3, 0.9, 0.7, 1.0];

/// Where coupler and rocker meet at a crank angle: the upper intersection of two circles.
fn meeting_point(crank: f64) -> [f64; 2] {
    let [a, b, c, d] = BARS;
    let (x, y) = (a * crank.cos(), a * crank.sin());
    let (dx, dy) = (d - x, -y);
    let s = dx.hypot(dy);
    let along = (s * s + b * b - c * c) / (2.0 * s);
    let across = (b * b - along * along).sqrt();
    [
        x + (along * dx - across * dy) / s,
        y + (along * dy + across * dx) / s,
    ]
}

/// Angles of coupler, relative to the crank, and rocker from their places at a crank angle of 0.
fn four_bar_angles(crank: f64) -> [f64; 2] {
    let [a, _, _, d] = BARS;
    let angles = |crank: f64| {
        let [x, y] = meeting_point(crank);
        let coupler = (y - a * crank.sin()).atan2(x - a * crank.cos()) - crank;
        [coupler, y.atan2(x - d)]
    };
    let ([c, r], [c_0, r_0]) = (angles(crank), angles(0.0));
    [c - c_0, r - r_0]
}

/// Crank and coupler on the world, and a rocker beside them.
fn four_bar_parts() -> (Vec<SolidDescription>, LoopDescription) {
    let [a, _, _, d] = BARS;
    let [x, y] = meeting_point(0.0);
    let mut crank = solid("crank", None, JointKind::Revolute);
    crank.centre_of_mass = Some([0.5 * a, 0.0, 0.0]);
    let mut coupler = solid("coupler", Some("crank"), JointKind::Revolute);
    coupler.position = Some([a, 0.0, 0.0]);
    coupler.centre_of_mass = Some([0.5 * (x - a), 0.5 * y, 0.0]);
    coupler.mass = 2.0;
    let mut rocker = solid("rocker", None, JointKind::Revolute);
    rocker.position = Some([d, 0.0, 0.0]);
    rocker.centre_of_mass = Some([0.5 * (x - d), 0.5 * y, 0.0]);
    rocker.mass = 1.5;
    let mut pin = closure("pin", LoopKind::Connect, "coupler", Some("rocker"));
    pin.position = Some([x - a, y, 0.0]);
    (vec![crank, coupler, rocker], pin)
}

fn four_bar() -> Model {
    let (solids, pin) = four_bar_parts();
    built(solids, vec![pin])
}

/// Sets a single joint and closes the loops about it.
fn set_crank(run: &mut RoverSimulation, crank: f64) {
    let [coupler, rocker] = four_bar_angles(crank);
    let mut q = Configuration::zero(run.model());
    q.joints = vec![crank, coupler, rocker];
    let v = vec![0.0; run.model().nv()];
    run.set_state(q, v);
}

/// Freudenstein's equation along a driven motion of many turns.
#[test]
fn the_angles_of_a_four_bar_are_those_of_its_circles() {
    for variant in VARIANTS {
        let mut run = simulation(four_bar(), stepping(variant, 5e-3));
        set_crank(&mut run, 0.0);
        run.set_joint_torques(&[8.0, 0.0, 0.0]).unwrap();
        for _ in 0..400 {
            let report = run.step(1).unwrap();
            assert!(report.is_converged() && report.loop_gap < 1e-12);
            let crank = joint(&run, "crank");
            let expected = four_bar_angles(crank);
            let turn = std::f64::consts::TAU;
            for (name, expected) in ["coupler", "rocker"].into_iter().zip(expected) {
                let off = (joint(&run, name) - expected).rem_euclid(turn);
                let off = off.min(turn - off);
                assert!(off < 1e-11, "{variant:?} {name} at {crank}: {off}");
            }
            // The pin's velocity, seen from both bodies.
            let model = run.model();
            let (n, nv) = (model.n_loop_rows(), model.nv());
            let (mut gaps, mut rows) = (vec![0.0; n], vec![0.0; n * nv]);
            model.write_loops(&run.kinematics(), &run.q().joints, &mut gaps, &mut rows);
            for row in rows.chunks_exact(nv) {
                let rate: f64 = row.iter().zip(run.v()).map(|(a, v)| a * v).sum();
                assert!(rate.abs() < 1e-12, "{variant:?}: {rate}");
            }
        }
        assert!(joint(&run, "crank").abs() > 10.0, "{variant:?}: many turns");
    }
}

/// An hour at 5 ms is 720 000 steps; the test takes a sixth of it.
#[test]
fn a_free_four_bar_keeps_its_energy_and_stays_closed() {
    for variant in VARIANTS {
        let mut run = simulation(four_bar(), stepping(variant, 5e-3));
        set_crank(&mut run, 0.4);
        let before = energy(&run);
        let n = if variant == Variant::Newton {
            20_000
        } else {
            120_000
        };
        let report = run.step(n).unwrap();
        assert!(report.is_converged() && report.loop_gap < 1e-12);
        assert!(report.fallbacks <= n / 1000);
        let (lost, kinetic) = (before - energy(&run), 7.0);
        assert!(lost.abs() < 1e-4 * kinetic, "{variant:?}: {lost} J");
    }
}

#[test]
fn the_scheme_is_of_second_order_with_loops() {
    for variant in VARIANTS {
        let end = |steps: u32| {
            let mut run = simulation(four_bar(), stepping(variant, 0.4 / f64::from(steps)));
            set_crank(&mut run, 0.4);
            run.step(steps as usize).unwrap();
            joint(&run, "crank")
        };
        let exact = end(4000);
        let errors = [50, 100].map(|steps| (end(steps) - exact).abs());
        assert!(
            errors[0] > 3.0 * errors[1] && errors[1] < 1e-3,
            "{variant:?} {errors:?}"
        );
    }
}

/// With a rod of a milligram, `(I + m x'²) θ̈ = τ − m x' x'' θ̇²` and the pin pushes the slider by
/// `(m ẍ, m ẍ tan β)` along the rod.
#[test]
fn a_slider_crank_has_its_accelerations_and_forces() {
    let (r, l, m, theta, rate, torque) = (0.2_f64, 0.6_f64, 1.0, 0.7_f64, 3.0_f64, 1.5);
    let crank = solid("crank", None, JointKind::Revolute);
    let mut rod = solid("rod", Some("crank"), JointKind::Revolute);
    rod.position = Some([r, 0.0, 0.0]);
    rod.mass = 1e-6;
    let mut slider = solid("slider", None, JointKind::Prismatic);
    slider.position = Some([r + l, 0.0, 0.0]);
    slider.axis = Some([1.0, 0.0, 0.0]);
    slider.mass = m;
    let pin = closure("pin", LoopKind::Connect, "slider", Some("rod"));
    let (s, c) = theta.sin_cos();
    let w = (l * l - r * r * s * s).sqrt();
    let x = r * c + w;
    let slope = -r * s - r * r * s * c / w;
    let bend = -r * c - r * r * ((c * c - s * s) / w + r * r * s * s * c * c / w.powi(3));
    let beta = (-r * s / l).asin();
    let beta_rate = -r * c * rate / (l * beta.cos());
    let inertia = 0.5 * 0.1 * 0.1 + m * slope * slope;
    let acceleration = (torque - m * slope * bend * rate * rate) / inertia;
    let push = m * (bend * rate * rate + slope * acceleration);
    for variant in VARIANTS {
        let h = 1e-6;
        let model = built(
            vec![crank.clone(), rod.clone(), slider.clone()],
            vec![pin.clone()],
        );
        let mut run = simulation(model, stepping(variant, h));
        let mut q = Configuration::zero(run.model());
        q.joints = vec![theta, beta - theta, x - (r + l)];
        run.set_state(q, vec![rate, beta_rate - rate, slope * rate]);
        run.set_joint_torques(&[torque, 0.0, 0.0]).unwrap();
        run.step(1).unwrap();
        let found = (run.v()[0] - rate) / h;
        near(found, acceleration, 1e-4 * acceleration.abs());
        let forces = run.loop_forces();
        for (found, expected) in forces.iter().zip([push, push * beta.tan(), 0.0]) {
            near(*found, expected, 1e-4 * push.abs());
        }
    }
}

/// A joint that two solids share and a weld across it are one rigid body; five of the weld's rows
/// say what the joint says already.
#[test]
fn welded_solids_move_as_one() {
    let upper = || {
        let mut upper = solid("upper", None, JointKind::Revolute);
        upper.centre_of_mass = Some([0.0, -0.4, 0.0]);
        upper
    };
    let mut lower = solid("lower", Some("upper"), JointKind::Revolute);
    lower.position = Some([0.0, -0.8, 0.0]);
    lower.centre_of_mass = Some([0.3, -0.3, 0.0]);
    let weld = closure("weld", LoopKind::Weld, "lower", Some("upper"));
    for variant in VARIANTS {
        let model = built(vec![upper(), lower.clone()], vec![weld.clone()]);
        assert_eq!(redundant_rows(&model, &Configuration::zero(&model)), [5]);
        let mut welded = simulation(model, stepping(variant, 2e-3));
        let mut rigid = lower.clone();
        rigid.locked = Some(0.0);
        let mut one = simulation(built(vec![upper(), rigid], vec![]), stepping(variant, 2e-3));
        for run in [&mut welded, &mut one] {
            let mut q = Configuration::zero(run.model());
            q.joints[0] = 1.0;
            let nv = run.model().nv();
            run.set_state(q, vec![0.0; nv]);
            run.step(1000).unwrap();
        }
        let off = joint(&welded, "upper") - joint(&one, "upper");
        assert!(off.abs() < 1e-9, "{variant:?}: {off}");
        assert!(joint(&welded, "lower").abs() < 1e-12);
    }
}

/// `q_b = P(q_a)`: all work goes into `½ (I_a + I_b P'²) q̇_a²`.
#[test]
fn a_polynomial_couples_two_flywheels() {
    let wheels = || {
        ["first", "second"]
            .map(|name| solid(name, None, JointKind::Revolute))
            .to_vec()
    };
    let mut gear = closure("gear", LoopKind::Joint, "second", Some("first"));
    gear.polynomial = Some(vec![0.0, 0.5, 0.3, -0.04, 0.002]);
    for variant in VARIANTS {
        let mut run = simulation(built(wheels(), vec![gear.clone()]), stepping(variant, 1e-3));
        run.set_joint_torques(&[0.02, 0.0]).unwrap();
        run.step(1500).unwrap();
        let q = joint(&run, "first");
        let value = q * (0.5 + q * (0.3 + q * (-0.04 + q * 0.002)));
        let slope = 0.5 + q * (0.6 + q * (-0.12 + q * 0.008));
        assert!((joint(&run, "second") - value).abs() < 1e-12 && q > 1.0);
        assert!((run.v()[1] - slope * run.v()[0]).abs() < 1e-12);
        let inertia = 0.005 * (1.0 + slope * slope);
        let expected = (2.0 * 0.02 * q / inertia).sqrt();
        near_in(&variant, run.v()[0], expected, 1e-4 * expected);
    }
}

/// A joint at a constant bears what a weight asks of it.
#[test]
fn a_joint_that_is_held_bears_its_load() {
    let mut arm = solid("arm", None, JointKind::Revolute);
    arm.centre_of_mass = Some([0.5, 0.0, 0.0]);
    let lock = closure("lock", LoopKind::Joint, "arm", None);
    let mut run = simulation(
        built(vec![arm], vec![lock]),
        stepping(Variant::Linearised, 5e-3),
    );
    run.step(100).unwrap();
    assert!(joint(&run, "arm").abs() < 1e-13);
    assert!((run.loop_forces()[0] - 9.81 * 0.5).abs() < 1e-9);
}

/// A free body whose corner is connected to the world swings as on a spherical joint.
#[test]
fn a_body_tied_to_the_world_is_a_pendulum() {
    let bob = |joint| {
        let mut bob = solid("bob", None, joint);
        bob.inertia = Some([0.02, 0.03, 0.04, 0.0, 0.0, 0.0]);
        bob.centre_of_mass = Some([0.1, -0.6, 0.2]);
        bob
    };
    let mut tie = closure("tie", LoopKind::Connect, "bob", None);
    assert_eq!(
        Model::from_description(with_loops(vec![bob(JointKind::Free)], vec![tie.clone()]))
            .unwrap_err()
            .to_string(),
        "loops[0].other_position: is missing"
    );
    tie.other_position = Some([0.0; 3]);
    for variant in VARIANTS {
        let model = built(vec![bob(JointKind::Free)], vec![tie.clone()]);
        let mut tied = simulation(model, stepping(variant, 1e-3));
        let model = built(vec![bob(JointKind::Spherical)], vec![]);
        let mut hung = simulation(model, stepping(variant, 1e-3));
        let begin = energy(&tied);
        tied.step(1500).unwrap();
        hung.step(1500).unwrap();
        assert!(tied.q().position.norm() < 1e-12);
        assert!((energy(&tied) - begin).abs() < 1e-9);
        let centres = [&tied, &hung].map(RoverSimulation::centre_of_mass);
        let off = (centres[0] - centres[1]).norm();
        assert!(off < 2e-4, "{variant:?}: {off}");
    }
}

/// The same pin twice: the second follows from the first, and changes nothing.
#[test]
fn a_redundant_loop_is_found_and_changes_nothing() {
    let (solids, pin) = four_bar_parts();
    let again = LoopDescription {
        name: "again".into(),
        ..pin.clone()
    };
    let twice = built(solids.clone(), vec![pin, again]);
    assert_eq!(redundant_rows(&twice, &Configuration::zero(&twice)), [1, 3]);
    for variant in VARIANTS {
        let mut runs = [four_bar(), twice.clone()].map(|m| simulation(m, stepping(variant, 5e-3)));
        for run in &mut runs {
            set_crank(run, 0.4);
            run.step(200).unwrap();
        }
        let [once, twice] = runs.map(|run| joint(&run, "crank"));
        assert!((once - twice).abs() < 1e-9, "{variant:?}: {once} {twice}");
    }
}

/// A crank that is welded to the world leaves no motion: the linkage is a frame.
#[test]
fn a_linkage_without_freedom_rests() {
    let (solids, pin) = four_bar_parts();
    let weld = closure("weld", LoopKind::Weld, "crank", None);
    for variant in VARIANTS {
        let model = built(solids.clone(), vec![pin.clone(), weld.clone()]);
        let mut run = simulation(model, stepping(variant, 5e-3));
        run.step(400).unwrap();
        assert!(largest(&run.q().joints) < 1e-12, "{variant:?}");
        assert!(largest(run.v()) < 1e-12, "{variant:?}");
    }
}

/// A stop closes against the machine as its loops move it: the crank stops dead, and the rocker
/// with it.
#[test]
fn a_stop_holds_the_whole_linkage() {
    let (mut solids, pin) = four_bar_parts();
    let rocker = four_bar_angles(0.25)[1];
    assert!(rocker < 0.0);
    solids[2].limits = Some(limits(rocker, 2.0));
    for variant in VARIANTS {
        let model = built(solids.clone(), vec![pin.clone()]);
        let mut run = simulation(model, stepping(variant, 5e-3));
        run.set_joint_torques(&[20.0, 0.0, 0.0]).unwrap();
        run.step(400).unwrap();
        assert!(largest(run.v()) < 1e-9, "{variant:?} {:?}", run.v());
        let expected = [0.25, four_bar_angles(0.25)[0], rocker];
        assert!(apart(&run.q().joints, &expected) < 1e-6);
    }
}

#[test]
fn an_open_configuration_is_closed_or_refused() {
    let model = four_bar();
    let mut q = Configuration::zero(&model);
    q.joints = vec![0.3, 0.0, 0.0];
    let gap = widest_gap(&model, &q).unwrap();
    assert!(gap.value > 0.1 && gap.unit == "m");
    let mut v = vec![1.0, 2.0, -3.0];
    let near = closed(&model, &q, &mut v).unwrap();
    assert!(widest_gap(&model, &near).unwrap().value < 1e-12);
    let [coupler, rocker] = four_bar_angles(near.joints[0]);
    assert!((near.joints[1] - coupler).abs() < 1e-11 && (near.joints[2] - rocker).abs() < 1e-11);
    // The base is longer than all bars together.
    let (mut solids, mut pin) = four_bar_parts();
    let far = solids[2].position.unwrap();
    solids[2].position = Some([far[0] + 5.0, 0.0, 0.0]);
    pin.other_position = Some([0.0, 0.7, 0.0]);
    let refused = Model::from_description(with_loops(solids, vec![pin])).unwrap_err();
    let text = refused.to_string();
    let ModelError::Invalid { fault, .. } = &refused else {
        panic!("{refused}");
    };
    assert!(matches!(fault, ModelFault::LoopOpen { gap, unit: "m", .. } if *gap > 4.0));
    assert!(
        text.starts_with(
            "loops[0]: the loop \"pin\" does not close at the zero of all joints, the gap is 5.12"
        ),
        "{text}"
    );
}

#[test]
fn what_no_loop_can_be_is_refused_by_its_field() {
    let refused = |change: &dyn Fn(&mut LoopDescription)| {
        let (solids, mut pin) = four_bar_parts();
        change(&mut pin);
        Model::from_description(with_loops(solids, vec![pin]))
            .unwrap_err()
            .to_string()
    };
    for (text, expected) in [
        (
            refused(&|pin| pin.solid = "nobody".into()),
            "loops[0].solid: there is no solid or joint named \"nobody\"",
        ),
        (
            refused(&|pin| pin.other = Some("coupler".into())),
            "loops[0]: both ends of the loop \"pin\" are on one rigid body",
        ),
        (
            refused(&|pin| pin.polynomial = Some(vec![1.0])),
            "loops[0].polynomial: a loop of kind \"connect\" has no polynomial",
        ),
        (
            refused(&|pin| pin.other_rotation = Some([0.0; 3])),
            "loops[0].other_rotation: a loop of kind \"connect\" has no other_rotation",
        ),
        (
            refused(&|pin| pin.position = Some([f64::NAN, 0.0, 0.0])),
            "loops[0].position: must be finite, is NaN",
        ),
        (
            refused(&|pin| {
                pin.kind = LoopKind::Joint;
                pin.position = None;
                pin.polynomial = Some(vec![0.0; 6]);
            }),
            "loops[0].polynomial: must be one to five coefficients, is 6",
        ),
    ] {
        assert_eq!(text, expected);
    }
    let (solids, pin) = four_bar_parts();
    let twice = Model::from_description(with_loops(solids, vec![pin.clone(), pin]));
    assert_eq!(
        twice.unwrap_err().to_string(),
        "loops[1].name: the name \"pin\" is used twice"
    );
}
