//! The ball against closed forms.

use std::f64::consts::{PI, TAU};

use nalgebra::SVector;
use rover_core::integrator::Variant;
use rover_core::planar::{Line, PlanarBall, Polyline, Sine, Spline};
use rover_core::simulation::PlanarSimulation;

use super::scenes::{
    G, VARIANTS, at_rest, count, incline, level, options, options_of, placed, speed,
};
use crate::shared::{near, near_in};

fn disc() -> PlanarBall {
    // A homogeneous disc: J = m r²/2.
    PlanarBall::new(2.0, 0.3, 0.09).unwrap()
}

#[test]
fn a_bouncing_ball_rests_at_the_zeno_time() {
    // √(2 h/g) (1 + e)/(1 − e).
    let (height, e) = (1.0, 0.6);
    let zeno = (2.0 * height / G).sqrt() * (1.0 + e) / (1.0 - e);
    let mut errors = Vec::new();
    for h in [1e-3, 1e-4] {
        let q = [0.0, 0.3 + height, 0.0];
        let mut simulation = at_rest(level(), disc(), options(G, 0.5, e, h), q);
        let mut last_move = 0.0;
        while simulation.time() < 3.0 {
            simulation.step(1).unwrap();
            if simulation.v()[1].abs() > 2.0 * G * h {
                last_move = simulation.time();
            }
        }
        errors.push((last_move - zeno).abs());
        assert!(speed(simulation.v()) < 1e-12, "rests: {:?}", simulation.v());
    }
    assert!(
        errors[0] < 0.02 && errors[1] < 0.003,
        "{errors:?} s of {zeno} s"
    );
}

#[test]
fn bounces_without_loss_keep_the_energy_to_rounding() {
    // θ = ½, e = 1: in the step of an impact the position stays and the velocity is reflected.
    for variant in VARIANTS {
        for slope in [0.0, -0.3] {
            let options = options_of(variant, G, 0.0, 1.0, 1e-3);
            let q = [0.0, 1.5, 0.0];
            let v = [0.4, 0.0, 1.0];
            let mut simulation = placed(Line::new(slope, 0.0).unwrap(), disc(), options, q, v);
            let before = simulation.energy().total();
            simulation.step(20_000).unwrap();
            let after = simulation.energy();
            let scale = after.kinetic + before.abs();
            near_in(&(variant, slope), after.total(), before, 1e-11 * scale);
        }
    }
}

#[test]
fn a_ball_rolls_down_a_line_at_the_closed_form() {
    // a = g sin α/(1 + J/(m r²)), as long as μ ≥ tan α/(1 + m r²/J).
    for (alpha, ratio) in [(0.2_f64, 0.5), (0.5, 0.4), (0.5, 1.0)] {
        let limit = alpha.tan() / (1.0 + 1.0 / ratio);
        let ball = PlanarBall::new(2.0, 0.3, ratio * 2.0 * 0.09).unwrap();
        for (mu, acceleration) in [
            (1.001 * limit, G * alpha.sin() / (1.0 + ratio)),
            (0.9 * limit, G * (alpha.sin() - 0.9 * limit * alpha.cos())),
        ] {
            for variant in VARIANTS {
                let options = options_of(variant, G, mu, 0.0, 5e-3);
                let q = [0.0, 0.3 / alpha.cos(), 0.0];
                let mut simulation = at_rest(incline(-alpha), ball, options, q);
                let report = simulation.step(400).unwrap();
                assert!(report.is_converged());
                let speed = simulation.v()[0].hypot(simulation.v()[1]);
                let expected = 2.0 * acceleration;
                near_in(&(alpha, mu), speed, expected, 1e-10 * expected);
                // The position is that of constant acceleration to
                // rounding: ½ a t² = a h Σ (k − ½) h.
                let way = simulation.q()[0].hypot(simulation.q()[1] - 0.3 / alpha.cos());
                assert!((way - 0.5 * acceleration * 4.0).abs() < 1e-9, "{way}");
                assert!(simulation.gaps()[0].abs() < 1e-9);
            }
        }
    }
}

#[test]
fn a_sliding_ball_rolls_when_and_as_fast_as_the_closed_form_says() {
    // v₀ without spin: rolls at t* = v₀/(μ g (1 + m r²/J)) with v₀/(1 + J/(m r²)).
    let (v0, mu) = (3.0, 0.25);
    for ratio in [0.5, 0.4] {
        let ball = PlanarBall::new(2.0, 0.3, ratio * 2.0 * 0.09).unwrap();
        let rolling = v0 / (1.0 + ratio);
        let time = v0 / (mu * G * (1.0 + 1.0 / ratio));
        for h in [5e-3, 1e-3] {
            let q = [0.0, 0.3, 0.0];
            let v = [v0, 0.0, 0.0];
            let mut simulation = placed(level(), ball, options(G, mu, 0.0, h), q, v);
            let mut began = None;
            while simulation.time() < 2.0 {
                simulation.step(1).unwrap();
                let slip = simulation.v()[0] + 0.3 * simulation.v()[2];
                if slip.abs() < 1e-9 && began.is_none() {
                    began = Some(simulation.time());
                }
            }
            let began = began.unwrap();
            assert!(began >= time - 1e-9 && began <= time + h, "{began} {time}");
            near(simulation.v()[0], rolling, 1e-12);
        }
    }
}

#[test]
fn a_ball_in_a_valley_narrower_than_itself_rests_on_two_points() {
    // y = sin x has radius of curvature 1 at its bottom, the ball 1.5.
    let ball = PlanarBall::new(3.0, 1.5, 3.375).unwrap();
    let sine = Sine::new(1.0, TAU, 0.0, 0.0).unwrap();
    let q = [-0.5 * PI + 0.1, 1.4, 0.0];
    let mut simulation = at_rest(sine, ball, options(9.8, 0.6, 0.0, 5e-3), q);
    simulation.step(4000).unwrap();
    assert!(speed(simulation.v()) < 1e-9, "{:?}", simulation.v());
    assert!(simulation.gaps()[0].abs() < 1e-6, "{:?}", simulation.gaps());
    let contacts = simulation.contacts();
    assert_eq!(contacts.len(), 2, "{contacts:?}");
    // The contact forces carry the weight.
    let mut force = nalgebra::Vector2::zeros();
    for active in contacts {
        force +=
            (active.contact.n * active.impulse[0] + active.contact.t() * active.impulse[1]) / 5e-3;
    }
    assert!(
        (force - nalgebra::Vector2::new(0.0, 3.0 * 9.8)).norm() < 1e-8,
        "{force:?}"
    );
}

/// Deviation (m) of a ball that rolls in a wide valley from a run with very small steps.
fn rolling_in_a_valley(variant: Variant, h: f64) -> [f64; 3] {
    let sine = Sine::new(0.5, 6.0, 0.3, 0.0).unwrap();
    let options = options_of(variant, G, 0.9, 0.0, h);
    // On the curve, at rest: the centre r away along the normal.
    let (x, k) = (0.0_f64, TAU / 6.0);
    let slope = 0.5 * k * (k * x + 0.3).cos();
    let n = nalgebra::Vector2::new(-slope, 1.0).normalize();
    let q = [x + 0.3 * n.x, 0.5 * (k * x + 0.3).sin() + 0.3 * n.y, 0.0];
    let mut simulation = at_rest(sine, disc(), options, q);
    assert!(simulation.step(count(2.0, h)).unwrap().is_converged());
    [
        simulation.q()[0],
        simulation.q()[1],
        simulation.energy().total(),
    ]
}

#[test]
fn rolling_along_a_curve_is_of_second_order() {
    let exact = rolling_in_a_valley(Variant::Newton, 1e-5);
    for variant in VARIANTS {
        let error = |h: f64| {
            let end = rolling_in_a_valley(variant, h);
            (end[0] - exact[0]).hypot(end[1] - exact[1])
        };
        let (coarse, fine) = (error(8e-3), error(1e-3));
        let order = (coarse / fine).log2() / 3.0;
        assert!(
            (1.9..2.1).contains(&order),
            "{variant:?}: {coarse} {fine} {order}"
        );
        assert!(fine < 1e-3, "{variant:?}: {fine}");
    }
}

/// Duration of [`gliding`], s.
const GLIDE: f64 = 0.25;

/// The frictionless ball in the hollow of `Sine(0.3, 6)`: its centre and the direction along the
/// ground when its foot is at x, and how far the centre moves for each metre of the foot.
fn in_the_hollow(x: f64) -> ([f64; 2], [f64; 2], f64) {
    let (a, k, r) = (0.3, TAU / 6.0, 0.3);
    let (slope, bend) = (a * k * (k * x).cos(), -a * k * k * (k * x).sin());
    let size = slope.hypot(1.0);
    let centre = [x - r * slope / size, a * (k * x).sin() + r / size];
    let moved = size - r * bend / (size * size);
    (centre, [1.0 / size, slope / size], moved)
}

/// The centre [`GLIDE`] seconds after it passed over the foot x at a speed, by Runge–Kutta 4 on the
/// conservation of energy, `½ v² + g y = const`.
fn gliding(x: f64, speed: f64, g: f64) -> [f64; 2] {
    let ([_, top], ..) = in_the_hollow(x);
    let rate = |foot: f64| {
        let ([_, y], _, moved) = in_the_hollow(foot);
        (speed * speed + 2.0 * g * (top - y)).sqrt() / moved
    };
    let (mut foot, h) = (x, GLIDE / 2000.0);
    for _ in 0..2000 {
        let k1 = rate(foot);
        let k2 = rate(foot + 0.5 * h * k1);
        let k3 = rate(foot + 0.5 * h * k2);
        let k4 = rate(foot + h * k3);
        foot += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
    in_the_hollow(foot).0
}

#[test]
fn a_fast_ball_in_a_hollow_is_of_second_order_whatever_gravity_is() {
    // A contact counted as persistent only up to the speed 2 g h: order 1 at 8 m/s on Earth, from 3
    // m/s at g = 1.62 and always at g = 0.
    let x = -2.6;
    let speeds = [3.0, 6.0, 8.0].map(|speed| [G, 1.62, 0.0].map(|g| (speed, g)));
    for (speed, g) in speeds.into_iter().flatten() {
        let (centre, along, _) = in_the_hollow(x);
        let exact = gliding(x, speed, g);
        for variant in VARIANTS {
            let errors = |n: u32| {
                let options = options_of(variant, g, 0.0, 0.0, GLIDE / f64::from(n));
                let ground = Sine::new(0.3, 6.0, 0.0, 0.0).unwrap();
                let v = [speed * along[0], speed * along[1], 0.0];
                let mut ball = placed(ground, disc(), options, [centre[0], centre[1], 0.0], v);
                let before = ball.energy();
                let report = ball.step(n as usize).unwrap();
                let change = ball.energy().total() - before.total();
                let taken = report.energy_dissipated + report.energy_lost + report.energy_removed;
                let unexplained = change + taken - report.energy_lifted;
                assert!(unexplained.abs() < 1e-11 * before.kinetic, "{unexplained}");
                let q = ball.q();
                let place = (q[0] - exact[0]).hypot(q[1] - exact[1]);
                [place, change.abs() / before.kinetic]
            };
            let (coarse, fine) = (errors(25), errors(200));
            let orders = [0, 1].map(|k| (coarse[k] / fine[k]).log2() / 3.0);
            let name = format!("{variant:?}, {speed} m/s, {g} m/s²");
            assert!(
                orders.iter().all(|order| (1.9..2.15).contains(order)),
                "{name}: orders {orders:?}, errors {coarse:?} {fine:?}"
            );
        }
    }
}

#[test]
fn a_spline_through_a_line_is_the_line() {
    let alpha = 0.3_f64;
    let x: Vec<f64> = (0..8).map(|i| -1.0 + 0.7 * f64::from(i)).collect();
    let y: Vec<f64> = x.iter().map(|x| -alpha.tan() * x).collect();
    let start = [0.0, 0.3 / alpha.cos() + 0.2, 0.0];
    let run = |mut simulation: PlanarSimulation| {
        simulation.step(1000).unwrap();
        SVector::<f64, 3>::from_column_slice(simulation.q())
    };
    let o = options(G, 0.4, 0.3, 2e-3);
    let line = run(at_rest(incline(-alpha), disc(), o.clone(), start));
    let spline = Spline::new(&x, &y).unwrap();
    let spline = run(at_rest(spline, disc(), o.clone(), start));
    let polyline = Polyline::new(&x, &y).unwrap();
    let polyline = run(at_rest(polyline, disc(), o, start));
    assert!((line - spline).norm() < 1e-8, "{line} {spline}");
    assert!((line - polyline).norm() < 1e-8, "{line} {polyline}");
}

#[test]
fn a_ball_stays_before_a_step_or_rolls_over_it() {
    // Over the edge of height s without loss but for the impact: the part of the speed along the
    // new tangent stays, with e = 0 and sticking.
    let step = 0.05;
    let ball = disc();
    let (r, inertia, m) = (0.3_f64, 0.09, 2.0);
    // (With μ above about 1 the ball may jam between floor and edge as well: such an impact has two
    // solutions.) Angular momentum about the edge is kept: J ω' + m r² ω' = J v/r + m v (r − s).
    let over = |v: f64| {
        let omega = (inertia * v / r + m * v * (r - step)) / (inertia + m * r * r);
        0.5 * (inertia + m * r * r) * omega * omega - m * G * step
    };
    let (mut low, mut high) = (0.0, 5.0);
    for _ in 0..60 {
        let mid = 0.5 * (low + high);
        if over(mid) > 0.0 {
            high = mid;
        } else {
            low = mid;
        }
    }
    for (share, gets_over) in [(0.96, false), (1.04, true)] {
        let v = share * low;
        let q = [-1.0, r, 0.0];
        let v = [v, 0.0, -v / r];
        let options = options(G, 0.8, 0.0, 2e-4);
        let mut simulation = placed(Polyline::step(0.0, step).unwrap(), ball, options, q, v);
        simulation.step(15_000).unwrap();
        assert_eq!(
            simulation.q()[0] > 0.0,
            gets_over,
            "{share}: {:?}",
            simulation.q()
        );
        let deepest = simulation.gaps()[0];
        assert!(deepest > -1e-6, "{deepest}");
    }
}
