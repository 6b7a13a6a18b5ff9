//! Rolling and drilling friction of grains: closed forms of one ball and of one disk, momentum and
//! energy of two, and heaps that stand steeper.

use std::sync::Arc;

use rover_core::geometry::Drum;
use rover_core::law::rolling::RollingFriction;
use rover_core::nalgebra::{SVector, Vector3};
use rover_core::problem::BodyPairs;
use rover_core::simulation::{GrainSimulation, grain_options};
use rover_core::solver::Swept;
use rover_core::spatial::space::body_velocities;
use rover_core::system::grains::{Cohesion, GrainFriction, GrainScene, Packing, Wall};

use super::grain_scenes::{G, RADIUS, alike, awake, between, exact, rough};
use super::shared::{apart, bits, largest, near};

fn scene<const D: usize>(n: usize, rolling: f64, drilling: f64) -> GrainScene<D> {
    let rolling = RollingFriction { rolling, drilling };
    let friction = GrainFriction {
        rolling,
        ..rough(0.9)
    };
    between(vec![Wall::floor(0.0)], alike(n), friction)
}

/// Tolerance of the steps.
const TOLERANCE: f64 = 1e-10;

/// A bed in a state, every step of which is solved well.
fn moving<const D: usize>(
    scene: GrainScene<D>,
    gravity: Vector3<f64>,
    q: &[f64],
    v: &[f64],
) -> GrainSimulation<D>
where
    BodyPairs<D>: Swept<D>,
{
    let mut options = exact(&scene, TOLERANCE);
    options.gravity = gravity;
    let mut run = awake(scene, options, q);
    run.set_state(q, v).expect("a state");
    run
}

const DOWN: Vector3<f64> = Vector3::new(0.0, -G, 0.0);

/// One grain on the floor with gravity tilted by `angle` towards +x, at the speed `speed` along x,
/// and rolling without slip.
fn one<const D: usize>(rolling: f64, angle: f64, speed: f64) -> GrainSimulation<D>
where
    BodyPairs<D>: Swept<D>,
{
    let gravity = G * Vector3::new(angle.sin(), -angle.cos(), 0.0);
    let mut v = vec![0.0; body_velocities(D)];
    v[0] = speed;
    v[body_velocities(D) - 1] = -speed / RADIUS;
    moving(scene(1, rolling, 0.0), gravity, &[0.0, RADIUS, 0.0], &v)
}

/// Moment of inertia over m r².
fn inertia<const D: usize>() -> f64 {
    if D == 2 { 0.5 } else { 0.4 }
}

/// A grain that rolls without slip has the inertia m + J/r², and the moment μ_r r m g about its
/// contact brakes it: `a = −μ_r g/(1 + J/(m r²))`, 5/7 μ_r g for a ball and 2/3 μ_r g for a disk.
fn comes_to_rest<const D: usize>()
where
    BodyPairs<D>: Swept<D>,
{
    let (rolling, speed) = (0.05, 0.3);
    let braking = rolling * G / (1.0 + inertia::<D>());
    let mut run = one::<D>(rolling, 0.0, speed);
    let h = run.options().time_step;
    let n = 500;
    assert!(run.step(n).expect("finite").is_converged());
    let expected = speed - braking * h * n as f64;
    near(run.v()[0], expected, 1e-9);
    let spin = run.v()[body_velocities(D) - 1];
    assert!((spin + expected / RADIUS).abs() < 1e-8, "without slip");
    run.step(1000).expect("finite");
    assert!(largest(run.v()) < 1e-12, "{:?}", run.v());
}

#[test]
fn a_rolling_ball_and_a_rolling_disk_come_to_rest() {
    comes_to_rest::<3>();
    comes_to_rest::<2>();
}

/// On a slope the moment holds up to `tan α = μ_r`; beyond, the grain rolls down with
/// `a = g (sin α − μ_r cos α)/(1 + J/(m r²))`.
fn rests_or_rolls<const D: usize>()
where
    BodyPairs<D>: Swept<D>,
{
    let rolling: f64 = 0.2;
    for angle in [rolling.atan() - 1e-6, rolling.atan() + 1e-2] {
        let mut run = one::<D>(rolling, angle, 0.0);
        let n = 300;
        assert!(run.step(n).expect("finite").is_converged());
        let time = run.options().time_step * n as f64;
        let pull = (angle.sin() - rolling * angle.cos()).max(0.0);
        let expected = G * pull / (1.0 + inertia::<D>()) * time;
        near(run.v()[0], expected, 1e-8);
    }
}

#[test]
fn a_ball_and_a_disk_rest_on_a_slope_up_to_the_angle_of_rolling_friction() {
    rests_or_rolls::<3>();
    rests_or_rolls::<2>();
}

/// A floor without Coulomb friction transmits no moment either.
#[test]
fn a_ball_rolls_on_over_a_smooth_floor() {
    let mut scene = scene::<3>(1, 0.3, 0.3);
    scene.friction.walls = 0.0;
    let v = [0.2, 0.0, 0.0, 0.0, 1.0, -2.0];
    let mut run = moving(scene, DOWN, &[0.0, RADIUS, 0.0], &v);
    run.step(100).expect("finite");
    assert!(apart(run.v(), &v) < 1e-9, "{:?}", run.v());
}

/// A ball that spins about the vertical: `dω/dt = −μ_d r m g/J = −5/2 μ_d g/r`.
#[test]
fn a_spinning_ball_stops() {
    let drilling = 0.02;
    let (scene, spin) = (scene::<3>(1, 0.0, drilling), 3.0);
    let v = [0.0, 0.0, 0.0, 0.0, spin, 0.0];
    let mut run = moving(scene, DOWN, &[0.0, RADIUS, 0.0], &v);
    let n = 400;
    run.step(n).expect("finite");
    let time = run.options().time_step * n as f64;
    let expected = spin - 2.5 * drilling * G / RADIUS * time;
    near(run.v()[4], expected, 1e-8);
    run.step(400).expect("finite");
    assert!(largest(run.v()) < 1e-12, "{:?}", run.v());
}

/// Two balls that attract each other by F in free space, one of them spinning about the line of
/// the centres and about an axis across it. With ℓ = r/2 the drilling spins approach each other by
/// `2 μ_d ℓ F/J` a second. Momentum is kept to the last digits and energy falls.
#[test]
fn two_balls_share_their_spin_and_keep_the_momentum() {
    let (drilling, force) = (0.1, 4.0);
    let mut scene = scene::<3>(2, 0.05, drilling);
    let attraction = Cohesion::new(force, None, RADIUS).expect("a cohesion");
    scene.grains = scene.grains.with_cohesion(attraction);
    scene.walls.clear();
    let inertia = scene.grains.inertia(0);
    let q = [0.0, 0.0, 0.0, 2.0 * RADIUS, 0.0, 0.0];
    let mut v = vec![0.0; 12];
    v[3] = 2.0;
    let mut run = moving(scene, Vector3::zeros(), &q, &v);
    let before = run.momentum();
    let n = 100;
    run.step(n).expect("finite");
    let time = run.options().time_step * n as f64;
    let rate = drilling * 0.5 * RADIUS * force / inertia;
    near(run.v()[3], 2.0 - rate * time, 1e-8);
    near(run.v()[9], rate * time, 1e-8);
    // Now one that rolls on the other, too.
    v[5] = 5.0;
    run.set_state(&q, &v).expect("a state");
    let rolling = run.momentum();
    let mut energy = run.energy().kinetic;
    for _ in 0..300 {
        run.step(1).expect("finite");
        let now = run.energy().kinetic;
        assert!(now <= energy * (1.0 + 1e-12), "{now} J after {energy} J");
        energy = now;
    }
    let after = run.momentum();
    assert!((after.0 - before.0).norm() < 1e-12);
    assert!(
        (after.1 - rolling.1).norm() < 1e-7 * rolling.1.norm(),
        "{after:?}"
    );
}

/// With a bound that no moment reaches a ball sticks to a turning drum like a part of it. Were the
/// drum's own rotation left out, the ball would slide along without turning.
#[test]
fn a_ball_held_by_a_turning_drum_turns_with_it() {
    let mut scene = scene::<3>(1, 50.0, 50.0);
    let rate = 0.4;
    scene.walls.clear();
    scene.friction.walls = 50.0;
    let drum = Drum::new(Vector3::zeros(), 1.0, 2.0, rate).expect("a drum");
    scene.ground = Some(Arc::new(drum));
    let mut run = moving(scene, DOWN, &[0.0, RADIUS - 1.0, 0.0], &[0.0; 6]);
    run.step(50).expect("finite");
    near(run.v()[5], rate, 1e-6);
    near(run.v()[0], rate * (1.0 - RADIUS), 1e-3);
}

/// A heap of balls on a floor of glued ones.
fn heap(rolling: f64, threads: usize) -> GrainSimulation<3> {
    let packing = Packing::<3> {
        count: 160,
        radius_min: 0.009,
        radius_max: 0.011,
        mass: 0.01,
        corner: [-0.04, 0.0, -0.04],
        sides: [0.08, f64::INFINITY, 0.08],
        seed: 3,
    };
    let (grains, q) = packing.build().expect("a packing");
    let scene = GrainScene {
        grains,
        ..scene::<3>(1, rolling, 0.5 * rolling)
    };
    let mut options = grain_options(&scene.grains);
    options.time_step = 2e-3;
    options.solver.threads = threads;
    awake(scene, options, &q)
}

/// Mean height of the balls, m.
fn height(run: &GrainSimulation<3>) -> f64 {
    let rows = run.q().as_chunks::<3>().0;
    rows.iter().map(|q| q[1]).sum::<f64>() / rows.len() as f64
}

#[test]
fn a_column_that_collapses_stands_higher_with_rolling_friction() {
    let heights = [0.0, 0.3].map(|rolling| {
        let mut run = heap(rolling, 1);
        let start = run.energy().total();
        let report = run.step(500).expect("finite");
        assert!(report.is_converged(), "{report:?}");
        assert!(run.energy().total() < start, "dissipates");
        height(&run)
    });
    assert!(heights[1] > 1.3 * heights[0], "{heights:?} m");
}

/// Every moment of a heap is within its bound, and at the bound where its contact rolls.
#[test]
fn the_moments_of_a_heap_are_remembered_within_their_bounds() {
    let mut run = heap(0.2, 1);
    run.step(150).expect("finite");
    let snapshot = run.snapshot();
    let moments = &snapshot.memory.moments;
    assert_eq!(moments.len(), run.contacts().len());
    let mut at_the_bound = 0;
    for (active, (key, s)) in run.contacts().iter().zip(moments) {
        assert_eq!(active.contact.key, *key);
        let (n, s) = (active.contact.n, SVector::<f64, 3>::from(*s));
        let along = n.dot(&s);
        let across = (s - n * along).norm();
        let p_N = active.impulse[0];
        assert!(across <= 0.2 * p_N * (1.0 + 1e-9) + 1e-15);
        assert!(along.abs() <= 0.1 * p_N * (1.0 + 1e-9) + 1e-15);
        at_the_bound += usize::from(p_N > 0.0 && across > 0.2 * p_N * (1.0 - 1e-9));
    }
    assert!(at_the_bound > 20, "{at_the_bound} of {}", moments.len());
}

/// A snapshot goes on bit for bit, and so does the same bed on two threads.
#[test]
fn snapshots_and_threads_keep_every_bit() {
    let mut run = heap(0.2, 1);
    let mut other = heap(0.2, 2);
    run.step(60).expect("finite");
    other.step(60).expect("finite");
    let bits = |run: &GrainSimulation<3>| [bits(run.q()), bits(run.v())];
    assert_eq!(bits(&run), bits(&other), "threads");
    let snapshot = run.snapshot();
    run.step(30).expect("finite");
    let mut restored = heap(0.2, 1);
    restored.restore(&snapshot).expect("the same bed");
    restored.step(30).expect("finite");
    assert_eq!(bits(&run), bits(&restored), "snapshot");
}

#[test]
fn coefficients_are_checked_by_name() {
    for (rolling, drilling, field) in [
        (-0.1, 0.0, "rolling_friction"),
        (0.0, f64::NAN, "drilling_friction"),
    ] {
        let scene = scene::<3>(1, rolling, drilling);
        let refused = scene.check().expect_err("refused");
        assert_eq!(refused.field(), field);
    }
}
