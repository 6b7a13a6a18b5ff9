//! The two-wheel rover against closed forms and finite differences.

use std::sync::Arc;

use nalgebra::{SMatrix, SVector, Vector2};
use rover_core::geometry::Support;
use rover_core::integrator::StepOptions;
use rover_core::planar::{
    ContactRule, Line, PlanarGround, PlanarTree, PlanarWheel, Polyline, Sine, TwoWheelRover,
};
use rover_core::simulation::PlanarSimulation;

use super::scenes::{
    G, VARIANTS, at_rest, count, force, incline, level, mass_matrix, options, options_of, placed,
    speed,
};
use crate::shared::near;

type Q = SVector<f64, 5>;

/// The original's scale: body 130 kg, wheels 60 kg of 20 cm, half length 40 cm.
fn report_rover() -> TwoWheelRover {
    rover(0.4, 0.0)
}

/// Axles at ±half length and `drop` below the body's mass centre.
fn rover(half: f64, drop: f64) -> TwoWheelRover {
    let wheel = |x: f64| PlanarWheel {
        mass: 60.0,
        radius: 0.2,
        inertia: 1.2,
        axle: Vector2::new(x, -drop),
    };
    TwoWheelRover::new(130.0, 130.0 * 0.64 / 12.0, wheel(-half), wheel(half)).unwrap()
}

/// Nothing about it is symmetric.
fn lopsided() -> TwoWheelRover {
    let a = PlanarWheel {
        mass: 20.0,
        radius: 0.15,
        inertia: 0.3,
        axle: Vector2::new(-0.5, -0.1),
    };
    let b = PlanarWheel {
        mass: 45.0,
        radius: 0.25,
        inertia: 1.1,
        axle: Vector2::new(0.35, -0.2),
    };
    TwoWheelRover::new(80.0, 6.0, a, b).unwrap()
}

/// Standing on a slope (rise positive forward) with both wheels of `r` touching.
fn on_slope(rover: &TwoWheelRover, angle: f64) -> [f64; 5] {
    let [a, b] = rover.wheels();
    assert!((a.radius - b.radius).abs() < 1e-12);
    // Axles at height r over the slope along its normal; the body's centre `−axle.y` above them.
    let up = Vector2::new(-angle.sin(), angle.cos()) * (a.radius - a.axle.y);
    [up.x, up.y, angle, 0.0, 0.0]
}

fn states() -> impl Iterator<Item = (Q, Q)> {
    (0..20).map(|i| {
        let wave = |k: f64| (1.3 * f64::from(i) + 2.1 * k).sin();
        (
            Q::from_fn(|k, _| 2.0 * wave(k as f64)),
            Q::from_fn(|k, _| 3.0 * wave(k as f64 + 7.0)),
        )
    })
}

/// Centre of a wheel.
fn centre(tree: &PlanarTree, wheel: usize, q: &Q) -> Vector2<f64> {
    tree.disc(wheel, &tree.poses(q.as_slice())).centre
}

/// M and F of [`TwoWheelRover`]'s page.
fn closed_forms(
    rover: &TwoWheelRover,
    (q, v): (&Q, &Q),
    g: &Vector2<f64>,
    [tau_a, tau_b]: [f64; 2],
) -> (SMatrix<f64, 5, 5>, Q) {
    let [a, b] = rover.wheels();
    let turned = |x: Vector2<f64>| nalgebra::Rotation2::new(q[2]) * x;
    // `Σ m_i r_i`.
    let s = turned(a.axle) * a.mass + turned(b.axle) * b.mass;
    let around = a.mass * a.axle.norm_squared() + b.mass * b.axle.norm_squared();
    let m = rover.total_mass();
    let mut M = SMatrix::from_diagonal(&Q::from([
        m,
        m,
        rover.inertia() + around,
        a.inertia,
        b.inertia,
    ]));
    (M[(0, 2)], M[(2, 0)]) = (-s.y, -s.y);
    (M[(1, 2)], M[(2, 1)]) = (s.x, s.x);
    let linear = g * m + s * (v[2] * v[2]);
    let turning = s.perp(g) + tau_a + tau_b;
    (M, Q::from([linear.x, linear.y, turning, -tau_a, -tau_b]))
}

#[test]
fn the_tree_has_the_closed_forms() {
    let (g, torques) = (Vector2::new(0.7, -G), [3.0, -5.0]);
    for rover in [report_rover(), lopsided()] {
        let tree = PlanarTree::from(rover);
        for (q, v) in states() {
            let (M, F) = closed_forms(&rover, (&q, &v), &g, torques);
            let difference = (mass_matrix(&tree, &q) - M).norm();
            assert!(difference < 1e-13 * M.norm(), "{difference}");
            let difference = (force(&tree, &q, &v, &g, &torques) - F).norm();
            assert!(difference < 1e-13 * F.norm(), "{difference}");
        }
    }
}

#[test]
fn the_normal_row_is_the_gaps_gradient_and_the_tangential_one_the_rims_velocity() {
    let sine = Sine::new(0.3, 3.0, 0.2, 0.0).unwrap();
    let rover = lopsided();
    let tree = PlanarTree::from(rover);
    for (mut q, v) in states() {
        q[1] = 0.9 + 0.05 * q[1];
        q[2] *= 0.1;
        let o = StepOptions {
            forecast: 1.0,
            ..options(0.0, 0.5, 0.0, 1e-9)
        };
        let gaps = |q: &Q| {
            let q: [f64; 5] = (*q).into();
            at_rest(sine, rover, o.clone(), q).gaps()
        };
        let step = 1e-6;
        let (before, after) = (gaps(&(q - v * step)), gaps(&(q + v * step)));
        for i in 0..2 {
            let poses = tree.poses(q.as_slice());
            let disc = tree.disc(i, &poses);
            let mut facing = Vec::new();
            sine.facing(&disc.centre, 5.0, &mut facing);
            let foot = facing
                .iter()
                .min_by(|a, b| a.distance.total_cmp(&b.distance))
                .unwrap();
            let (point, t) = (
                disc.centre - foot.n * disc.radius,
                Vector2::new(foot.n.y, -foot.n.x),
            );
            let mut rows = Vec::new();
            tree.push_rows(i, &poses, &point, &[foot.n, t], &mut rows);
            let [normal, tangential] = [0, 5].map(|k| Q::from_column_slice(&rows[k..k + 5]));
            let rate = (after[i] - before[i]) / (2.0 * step);
            near(normal.dot(&v), rate, 1e-6);
            // The rim's material point: the centre's velocity and the wheel's own turn.
            let place = |s: f64| centre(&tree, i, &(q + v * s));
            let velocity = (place(step) - place(-step)) / (2.0 * step);
            let found = tree.point_velocity(i, &poses, &disc.centre, v.as_slice());
            assert!((found - velocity).norm() < 1e-6);
            let rim = velocity.dot(&t) + disc.radius * v[3 + i];
            assert!((tangential.dot(&v) - rim).abs() < 1e-6);
        }
    }
}

/// Mean normal forces of the last step of 5 ms, N.
fn loads(simulation: &PlanarSimulation) -> Vec<f64> {
    let contacts = simulation.contacts().iter();
    contacts.map(|c| c.impulse[0] / 5e-3).collect()
}

#[test]
fn loads_on_the_flat_are_those_of_statics() {
    let wheel = |x: f64| PlanarWheel {
        mass: 60.0,
        radius: 0.2,
        inertia: 1.2,
        axle: Vector2::new(x, -0.1),
    };
    let rover = TwoWheelRover::new(130.0, 7.0, wheel(-0.5), wheel(0.3)).unwrap();
    let q = [0.0, 0.3, 0.0, 0.0, 0.0];
    let mut simulation = at_rest(level(), rover, options(G, 0.7, 0.0, 5e-3), q);
    simulation.step(100).unwrap();
    assert!(speed(simulation.v()) < 1e-12);
    let loads = loads(&simulation);
    // Body's weight split by 0.3 : 0.5, each wheel its own.
    let expected = [
        60.0 * G + 130.0 * G * 0.3 / 0.8,
        60.0 * G + 130.0 * G * 0.5 / 0.8,
    ];
    for (load, expected) in loads.iter().zip(expected) {
        assert!((load - expected).abs() < 1e-9 * expected, "{loads:?}");
    }
}

/// Torque (N m, each wheel) that holds the rover on a slope: 2 τ = r m g sin α.
fn holding(rover: &TwoWheelRover, angle: f64) -> f64 {
    0.5 * rover.wheels()[0].radius * rover.total_mass() * G * angle.sin()
}

#[test]
fn on_a_slope_torques_hold_it_and_the_loads_are_those_of_moments() {
    let (angle, drop) = (0.3_f64, 0.15);
    let rover = rover(0.4, drop);
    let tau = holding(&rover, angle);
    let q = on_slope(&rover, angle);
    let mut simulation = at_rest(incline(angle), rover, options(G, 0.7, 0.0, 5e-3), q);
    simulation.set_inputs(&[tau, tau]).unwrap();
    simulation.step(400).unwrap();
    assert!(speed(simulation.v()) < 1e-9, "{:?}", simulation.v());
    let loads = loads(&simulation);
    // Moments about the contact points: the mass centre at height z over
    // the slope shifts m g sin α z / (2 l) to the back.
    let z = 0.2 + 130.0 * drop / 250.0;
    let (m, l) = (rover.total_mass(), 0.4);
    let shift = m * G * angle.sin() * z / (2.0 * l);
    let half = 0.5 * m * G * angle.cos();
    near(loads[0], half + shift, 1e-8 * half);
    near(loads[1], half - shift, 1e-8 * half);
}

#[test]
fn it_tips_over_where_the_mass_centre_passes_the_lower_contact() {
    // tan α = l/z, held by the back wheel's motor alone: at the limit it carries everything.
    let drop = 0.5;
    let rover = rover(0.4, drop);
    let z = 0.2 + 130.0 * drop / 250.0;
    let limit = (0.4_f64 / z).atan();
    for (share, tips) in [(0.998, false), (1.002, true)] {
        let angle = share * limit;
        let tau = holding(&rover, angle);
        let q = on_slope(&rover, angle);
        let mut simulation = at_rest(incline(angle), rover, options(G, 5.0, 0.0, 2e-3), q);
        simulation.set_inputs(&[2.0 * tau, 0.0]).unwrap();
        simulation.step(1500).unwrap();
        let lifted = simulation.gaps()[1];
        assert_eq!(lifted > 0.01, tips, "{share}: {lifted}");
    }
}

#[test]
fn the_steepest_slope_it_climbs_is_the_friction_angle() {
    // Both wheels driven at their friction limit hold m g sin α = μ m g cos α; on a steeper slope
    // the rover slides back at any torque.
    let mu = 0.5;
    let rover = report_rover();
    for (share, climbs) in [(0.97, true), (1.03, false)] {
        let angle = share * f64::atan(mu);
        let mut best = f64::NEG_INFINITY;
        for k in 1..=60 {
            // Rear-loaded on a slope: torques in proportion to the loads, by moments.
            let tau = holding(&rover, angle) * (0.7 + 0.02 * f64::from(k));
            let shift = angle.tan() * 0.2 / 0.4;
            let torques = [tau * (1.0 + shift), tau * (1.0 - shift)];
            let q = on_slope(&rover, angle);
            let mut simulation = at_rest(incline(angle), rover, options(G, mu, 0.0, 5e-3), q);
            simulation.set_inputs(&torques).unwrap();
            simulation.step(200).unwrap();
            best = best.max(simulation.v()[0]);
        }
        assert_eq!(best > 0.0, climbs, "{share}: {best} m/s");
    }
}

#[test]
fn driving_on_the_flat_accelerates_at_the_closed_form() {
    // (m + 2 J/r²) a = 2 τ/r while the wheels roll.
    let rover = report_rover();
    for variant in VARIANTS {
        let q = [0.0, 0.2, 0.0, 0.0, 0.0];
        let mut simulation = at_rest(level(), rover, options_of(variant, G, 0.9, 0.0, 5e-3), q);
        simulation.set_inputs(&[50.0, 50.0]).unwrap();
        assert!(simulation.step(400).unwrap().is_converged());
        let a = 2.0 * 50.0 / 0.2 / (rover.total_mass() + 2.0 * 1.2 / 0.04);
        near(simulation.v()[0], 2.0 * a, 1e-10);
        // Load transfer: the torques' reaction on the body, and the body's
        // inertia at the height of the axles: none beyond it.
        let loads = loads(&simulation);
        let shift = 2.0 * 50.0 / 0.8;
        near(loads[0] - loads[1], 2.0 * shift, 1e-6);
    }
}

#[test]
fn free_flight_is_a_parabola_and_keeps_its_energy() {
    let far = Line::new(0.0, -1000.0).unwrap();
    // With equal wheels beside the mass centre M is constant and a step exact.
    let start = ([0.1, 2.0, 0.3, 0.0, 1.0], [1.0, 4.0, 2.0, -3.0, 0.5]);
    for variant in VARIANTS {
        let options = options_of(variant, G, 0.5, 0.0, 5e-3);
        let mut simulation = placed(far, report_rover(), options, start.0, start.1);
        let before = simulation.energy().total();
        simulation.step(400).unwrap();
        let after = simulation.energy().total();
        assert!((after - before).abs() < 1e-9 * before, "{}", after - before);
        let y = 2.0 + 4.0 * 2.0 - 0.5 * G * 4.0;
        near(simulation.q()[1], y, 1e-9);
    }
    // Lopsided, its mass centre flies a parabola, and the audit keeps the energy.
    for variant in VARIANTS {
        for h in [8e-3, 1e-3] {
            let options = options_of(variant, G, 0.5, 0.0, h);
            let mut simulation = placed(far, lopsided(), options, start.0, start.1);
            let before = simulation.energy().total();
            simulation.step(count(2.0, h)).unwrap();
            let drift = (simulation.energy().total() - before).abs() / before;
            assert!(drift < 1e-12, "{variant:?}, {h}: {drift}");
        }
    }
}

#[test]
fn it_drives_over_waves_and_up_a_step() {
    let waves = Sine::new(0.08, 1.5, 0.0, 0.0).unwrap();
    let step = Polyline::step(1.2, 0.05).unwrap();
    for (ground, torque, way) in [
        (Arc::new(waves) as Arc<dyn PlanarGround>, 45.0, 3.0),
        (Arc::new(step), 90.0, 3.0),
    ] {
        let (rule, options) = (ContactRule::Nearest, options(G, 0.9, 0.0, 2e-3));
        let mut simulation = PlanarSimulation::new(report_rover(), ground, rule, options).unwrap();
        simulation
            .set_state(&[0.0, 0.35, 0.0, 0.0, 0.0], &[0.0; 5])
            .unwrap();
        simulation.step(500).unwrap();
        simulation.set_inputs(&[torque, torque]).unwrap();
        let mut deepest = 0.0_f64;
        for _ in 0..10_000 {
            assert!(simulation.step(1).unwrap().is_converged());
            deepest = simulation.gaps().iter().fold(deepest, |m, g| m.min(*g));
            if simulation.q()[0] > way {
                break;
            }
        }
        assert!(simulation.q()[0] > way, "{:?}", simulation.q());
        assert!(
            simulation.q()[2].abs() < 1.0,
            "upright: {}",
            simulation.q()[2]
        );
        assert!(deepest > -2e-3, "{deepest}");
    }
}
