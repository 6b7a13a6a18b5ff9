//! Test motions of the schemes: flight, persistent contact on a sine, bounces.

use std::sync::Arc;

use rover_core::integrator::StepOptions;
use rover_core::nalgebra::{SVector, Vector2, Vector3};
use rover_core::planar::{
    ContactRule, Curve, Line, PlanarBall, PlanarError, PlanarGround, PlanarWheel, Sine,
    TwoWheelRover,
};
use rover_core::simulation::PlanarSimulation;

use crate::Scheme;
use crate::error::MeasureError;

/// m/s².
pub const G: f64 = 9.81;

/// Radius of the ball, m.
pub const RADIUS: f64 = 0.3;

/// Mass of the ball, kg.
pub const MASS: f64 = 2.0;

/// What a wheel of the rover carries, kg.
pub const WHEEL_LOAD: f64 = 13.5;

/// Options with gravity straight down.
#[must_use]
pub fn options(friction: f64, restitution: f64, time_step: f64) -> StepOptions {
    StepOptions {
        gravity: Vector3::new(0.0, -G, 0.0),
        friction_coefficient: friction,
        restitution,
        time_step,
        ..StepOptions::default()
    }
}

/// A homogeneous disc.
fn disc() -> Result<PlanarBall, PlanarError> {
    PlanarBall::new(MASS, RADIUS, 0.5 * MASS * RADIUS * RADIUS)
}

/// A two-wheel rover without symmetry.
fn rover() -> Result<TwoWheelRover, PlanarError> {
    let wheel = |mass, radius: f64, x, y| PlanarWheel {
        mass,
        radius,
        inertia: 0.5 * mass * radius * radius,
        axle: Vector2::new(x, y),
    };
    let (back, front) = (wheel(3.0, 0.2, -0.4, -0.15), wheel(4.0, 0.18, 0.45, -0.12));
    TwoWheelRover::new(20.0, 1.5, back, front)
}

/// A ball whose centre starts over level ground at `gap` from touching, at rest.
///
/// # Errors
/// Options out of their range.
pub fn ball_above(
    scheme: &Scheme,
    options: &StepOptions,
    gap: f64,
) -> Result<PlanarSimulation, MeasureError> {
    ball_on(
        scheme,
        options,
        Line::new(0.0, 0.0)?,
        [0.0, RADIUS + gap],
        [0.0; 3],
    )
}

/// A ball on a ground.
///
/// # Errors
/// Options out of their range.
pub fn ball_on(
    scheme: &Scheme,
    options: &StepOptions,
    ground: impl PlanarGround + 'static,
    centre: [f64; 2],
    v: [f64; 3],
) -> Result<PlanarSimulation, MeasureError> {
    let ground = Arc::new(ground);
    let options = scheme.options(options);
    let mut simulation = PlanarSimulation::new(disc()?, ground, ContactRule::Nearest, options)?;
    simulation.set_state(&[centre[0], centre[1], 0.0], &v)?;
    Ok(simulation)
}

/// A ball that touches `y = 0.3 sin(2π x/6)` at x and moves along it with `speed`, without spin.
///
/// # Errors
/// Options out of their range.
pub fn ball_on_sine(
    scheme: &Scheme,
    options: &StepOptions,
    x: f64,
    speed: f64,
) -> Result<PlanarSimulation, MeasureError> {
    let sine = Sine::new(0.3, 6.0, 0.0, 0.0)?;
    let [y, slope, ..] = sine.jet(x);
    let n = Vector2::new(-slope, 1.0).normalize();
    let centre = Vector2::new(x, y) + n * RADIUS;
    let v = [n.y * speed, -n.x * speed, 0.0];
    ball_on(scheme, options, sine, centre.into(), v)
}

/// The ball rolls from rest into a valley: sticking contact.
///
/// # Errors
/// Options out of their range.
pub fn rolling(scheme: &Scheme, h: f64) -> Result<PlanarSimulation, MeasureError> {
    ball_on_sine(scheme, &options(0.9, 0.0, h), -0.3, 0.0)
}

/// The ball slides through the valley: slipping contact.
///
/// # Errors
/// Options out of their range.
pub fn sliding(scheme: &Scheme, h: f64) -> Result<PlanarSimulation, MeasureError> {
    ball_on_sine(scheme, &options(0.05, 0.0, h), -2.8, 3.0)
}

/// The driven rover rolls over a sine from rest: two sticking contacts.
///
/// # Errors
/// Options out of their range.
pub fn driving(scheme: &Scheme, h: f64) -> Result<PlanarSimulation, MeasureError> {
    let ground = Arc::new(Sine::new(0.1, 3.0, 0.4, 0.0)?);
    let options = scheme.options(&options(0.9, 0.0, h));
    let mut simulation = PlanarSimulation::new(rover()?, ground, ContactRule::Nearest, options)?;
    // Newton's iteration on (y, θ) until both wheels touch.
    let mut q = [0.0, 0.5, 0.0, 0.0, 0.0];
    for _ in 0..30 {
        simulation.set_state(&q, &[0.0; 5])?;
        let gaps = simulation.gaps();
        let mut J = [[0.0; 2]; 2];
        for (column, k) in [1, 2].into_iter().enumerate() {
            for sign in [1.0, -1.0] {
                let mut moved = q;
                moved[k] += sign * 1e-6;
                simulation.set_state(&moved, &[0.0; 5])?;
                for (row, gap) in simulation.gaps().iter().enumerate() {
                    J[row][column] += sign * gap / 2e-6;
                }
            }
        }
        let det = J[0][0] * J[1][1] - J[0][1] * J[1][0];
        q[1] -= (J[1][1] * gaps[0] - J[0][1] * gaps[1]) / det;
        q[2] -= (J[0][0] * gaps[1] - J[1][0] * gaps[0]) / det;
    }
    simulation.set_state(&q, &[0.0; 5])?;
    simulation.set_inputs(&[3.0, 3.0])?;
    Ok(simulation)
}

/// Start of the flight: coordinates, rates, torques.
const FLIGHT: ([f64; 5], [f64; 5], [f64; 2]) = (
    [0.0, 100.0, 0.2, 0.0, 0.0],
    [2.0, 1.0, 3.0, 5.0, -4.0],
    [4.0, -1.5],
);

/// The rover turning in the air under its motors' torques.
///
/// # Errors
/// Options out of their range.
pub fn flight(scheme: &Scheme, h: f64) -> Result<PlanarSimulation, MeasureError> {
    let ground = Arc::new(Line::new(0.0, 0.0)?);
    let options = scheme.options(&options(0.9, 0.0, h));
    let mut simulation = PlanarSimulation::new(rover()?, ground, ContactRule::Nearest, options)?;
    simulation.set_state(&FLIGHT.0, &FLIGHT.1)?;
    simulation.set_inputs(&FLIGHT.2)?;
    Ok(simulation)
}

/// Coordinates of the flight after t: the mass centre on its parabola, the body with constant
/// angular acceleration about it.
///
/// `J_c θ̈ = τ_A + τ_B` with the inertia about the mass centre of all,
/// wheels counted as points at their axles; `J_i θ̈_i = −τ_i`.
///
/// # Errors
/// None in fact.
pub fn flight_at(t: f64) -> Result<SVector<f64, 5>, MeasureError> {
    let rover = rover()?;
    let (q, v, torques) = FLIGHT;
    let [a, b] = rover.wheels();
    let m = rover.total_mass();
    let s = (a.axle * a.mass + b.axle * b.mass) / m;
    let inertia = rover.inertia() + a.mass * a.axle.norm_squared() + b.mass * b.axle.norm_squared()
        - m * s.norm_squared();
    let turned = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        Vector2::new(cos * s.x - sin * s.y, sin * s.x + cos * s.y)
    };
    let accelerated = |q: f64, v: f64, a: f64| q + v * t + 0.5 * a * t * t;
    let angle = accelerated(q[2], v[2], (torques[0] + torques[1]) / inertia);
    let arm = turned(q[2]);
    let centre = Vector2::new(q[0], q[1]) + arm;
    let velocity = Vector2::new(v[0] - v[2] * arm.y, v[1] + v[2] * arm.x);
    let end = Vector2::new(
        accelerated(centre.x, velocity.x, 0.0),
        accelerated(centre.y, velocity.y, -G),
    ) - turned(angle);
    Ok(SVector::from([
        end.x,
        end.y,
        angle,
        accelerated(q[3], v[3], -torques[0] / a.inertia),
        accelerated(q[4], v[4], -torques[1] / b.inertia),
    ]))
}

/// Height over the ground (m) and velocity (m/s) at t of a ball dropped
/// from `gap`, before its Zeno time.
#[must_use]
pub fn bouncing_at(gap: f64, e: f64, t: f64) -> (f64, f64) {
    let first = (2.0 * gap / G).sqrt();
    if t < first {
        return (gap - 0.5 * G * t * t, -G * t);
    }
    let (mut begun, mut speed) = (first, e * G * first);
    while t >= begun + 2.0 * speed / G && speed > 1e-12 {
        begun += 2.0 * speed / G;
        speed *= e;
    }
    let since = t - begun;
    (speed * since - 0.5 * G * since * since, speed - G * since)
}
