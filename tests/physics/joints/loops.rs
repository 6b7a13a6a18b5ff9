//! Closed loops: linkages against their closed forms, and against the same machine as a tree.

use rover_core::integrator::Variant;
use rover_core::multibody::error::ModelError;
use rover_core::multibody::{
    Configuration, CouplingDescription, JointKind, LoopDescription, LoopKind, Model,
    ModelDescription, SolidDescription,
};
use rover_core::simulation::RoverSimulation;
use rover_core::system::loops::{closed, redundant_rows, widest_gap};

use super::machines::{energy, machine, options, simulation, solid};

const VARIANTS: [Variant; 2] = [Variant::Linearised, Variant::Newton];

/// A loop of two solids, closed at the zero of all joints.
fn closure(name: &str, kind: LoopKind, solid: &str, other: Option<&str>) -> LoopDescription {
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

fn joint(run: &RoverSimulation, name: &str) -> f64 {
    run.q().joints[run.model().joint_index(name).unwrap()]
}

/// Freudenstein's equation along a driven motion of many turns.
#[test]
fn the_angles_of_a_four_bar_are_those_of_its_circles() {
    for variant in VARIANTS {
        let mut run = simulation(four_bar(), options(5e-3, variant));
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

#[test]
fn a_free_four_bar_keeps_its_energy_and_stays_closed() {
    for variant in VARIANTS {
        let mut run = simulation(four_bar(), options(5e-3, variant));
        set_crank(&mut run, 0.4);
        let before = energy(&run);
        let mut worst = 0.0_f64;
        for k in 0..20 {
            let report = run.step(1000).unwrap();
            println!("{variant:?} {k} {} gap {} retaken {} lost {}", energy(&run) - before, report.loop_gap, report.retaken, report.energy_lost);
            worst = worst.max((energy(&run) - before).abs());
        }
        let kinetic = run.energy().kinetic;
        println!("{variant:?}: {worst} J of {kinetic} {before}");
    }
}

#[test]
fn the_scheme_is_of_second_order_with_loops() {
    for variant in VARIANTS {
        let end = |h: f64| {
            let mut run = simulation(four_bar(), options(h, variant));
            set_crank(&mut run, 0.4);
            run.step((1.0 / h).round() as usize).unwrap();
            joint(&run, "crank")
        };
        let exact = end(1e-4);
        let errors = [8e-3, 4e-3, 2e-3].map(|h| (end(h) - exact).abs());
        println!("{variant:?} {errors:?}");
    }
}
