//! Free spheres in space: energy, momentum, penetration, symmetry, and a
//! single sphere's closed forms.

#![allow(clippy::unwrap_used)] // a test stops where a scene is impossible

use std::sync::Arc;

use rover_comparison::free_spheres::SphereKind;
use rover_comparison::scenes::{G, options};
use rover_comparison::slab::Slab;
use rover_comparison::sphere_scenes::{KIND, Push, SphereRun, SphereScene, Treatment, run};
use rover_comparison::sphere_simulation::SphereSimulation;
use rover_core::integrator::{Stabilisation, StepOptions};
use rover_core::nalgebra::Vector3;
use rover_core::simulation::GrainSimulation;
use rover_core::system::grains::{GrainFriction, GrainScene, Grains, Wall};

/// What a scene shows in so many seconds; no CPU time is measured.
fn shown(scene: SphereScene, step: f64, treatment: Treatment, seconds: f64) -> SphereRun {
    run(scene, step, treatment, seconds, || 0.0).unwrap()
}

fn weightless(friction: f64, restitution: f64, time_step: f64) -> StepOptions {
    StepOptions {
        gravity: Vector3::zeros(),
        ..options(friction, restitution, time_step)
    }
}

#[test]
fn bouncing_keeps_its_energy_at_any_step() {
    for step in [0.02, 0.01, 0.003, 0.001] {
        let shown = shown(SphereScene::Bouncing, step, Treatment::VelocityLevel, 4.0);
        assert!((shown.energy - 24034.5).abs() < 1e-8);
        assert!(shown.n_contacts == 49, "the balls did strike");
        assert!(shown.energy_change < 1e-13, "{shown:?}");
    }
}

#[test]
fn elastic_impacts_of_the_block_keep_its_energy() {
    for step in [0.01, 0.005] {
        let shown = shown(
            SphereScene::ElasticBlock,
            step,
            Treatment::VelocityLevel,
            1.0,
        );
        assert!(shown.n_contacts > 100, "many at once: {shown:?}");
        assert!(shown.energy_change < 1e-12, "{shown:?}");
    }
}

#[test]
fn projection_keeps_the_block_apart() {
    let projected = shown(SphereScene::Block, 1e-3, Treatment::Projection, 0.6);
    assert!(projected.n_contacts > 200 && projected.converged > 0.99);
    assert!(projected.penetration < 1e-5, "{projected:?}");
    assert!(projected.deepest < 5e-3, "{projected:?}");
    // The velocity law alone lets penetration stay.
    let left = shown(SphereScene::Block, 1e-3, Treatment::VelocityLevel, 0.6);
    assert!(left.penetration > projected.penetration, "{left:?}");
    assert!(left.penetration < 1e-4, "{left:?}");
}

#[test]
fn projected_to_convergence_nothing_penetrates_at_the_end_of_any_step() {
    // 216 contacts with the ground and among neighbours, each less than
    // 1e-10 m deep: a sum below 1e-17 m².
    let largest = |treatment: Treatment| {
        let mut simulation = SphereScene::Block.start(1e-2, treatment).unwrap();
        let mut largest = 0.0_f64;
        for _ in 0..60 {
            assert!(simulation.step(1).unwrap().is_converged());
            largest = largest.max(simulation.penetration().sum_of_squares);
        }
        largest
    };
    let found = largest(Treatment::Convergence);
    assert!(found < 1e-17, "{found:e} m²");
    assert!(
        largest(Treatment::Projection) > 1e-6,
        "the scene tells them apart"
    );
}

#[test]
fn balls_roll_on_a_pushed_box_with_two_sevenths_of_its_acceleration() {
    for push in [Push::X, Push::Z, Push::Diagonal] {
        let scene = SphereScene::Rolling(push);
        let [slab, ball] = scene.accelerations().unwrap().map(|a| a.norm());
        assert!((slab - 0.7385).abs() < 5e-5 && (ball - 0.2110).abs() < 5e-5);
        for step in [0.01, 0.002] {
            let shown = shown(scene, step, Treatment::Projection, 4.0);
            assert!(shown.velocity_error.unwrap() < 1e-20, "{push:?}: {shown:?}");
            assert!(shown.penetration < 1e-20, "{push:?}: {shown:?}");
        }
    }
}

fn brick() -> Slab {
    Slab {
        mass: 3.0,
        half: Vector3::new(0.1, 0.2, 0.4),
        friction: 0.5,
        push: Vector3::zeros(),
    }
}

#[test]
fn a_tumbling_box_keeps_its_momenta_to_second_order() {
    let drift = |step: f64| {
        let start = Vector3::new(0.0, 5.0, 0.0);
        let options = weightless(0.5, 0.0, step);
        let mut simulation =
            SphereSimulation::with_slab(KIND, Vec::new(), (brick(), start), options).unwrap();
        simulation.start_with(|v| v.copy_from_slice(&[1.0, 0.2, -0.3, 2.0, 3.0, -1.0]));
        let (linear, angular) = (simulation.momentum(), simulation.angular_momentum());
        while simulation.time() < 1.0 - 0.5 * step {
            simulation.step(1).unwrap();
        }
        assert!((simulation.momentum() - linear).norm() < 1e-12);
        (simulation.angular_momentum() - angular).norm()
    };
    let (coarse, fine) = (drift(2e-3), drift(1e-3));
    assert!(coarse < 1e-4, "{coarse}");
    let order = (coarse / fine).log2();
    assert!((order - 2.0).abs() < 0.3, "order {order}");
}

#[test]
fn a_box_dropped_askew_comes_to_rest_on_a_face() {
    let slab = (brick(), Vector3::new(0.0, 0.6, 0.0));
    let options = options(0.5, 0.0, 1e-3);
    let mut simulation = SphereSimulation::with_slab(KIND, Vec::new(), slab, options).unwrap();
    simulation.start_with(|v| v[3..6].copy_from_slice(&[0.5, 0.1, 1.0]));
    simulation.step(4000).unwrap();
    let height = simulation.centres()[0].y;
    // A resting contact within the fall of one step, g h²/2 = 4.9e-6 m, is left where it is.
    let face = [0.1, 0.2, 0.4].map(|half: f64| (height - half).abs());
    assert!(face.iter().any(|off| *off < 5e-6), "height {height}");
    assert!(simulation.v().iter().all(|v| v.abs() < 1e-9));
    assert!(simulation.penetration().deepest < 1e-7);
}

#[test]
fn impacts_in_flight_keep_the_momentum() {
    // A weightless crowd that implodes, with friction, above the plane.
    for (friction, restitution) in [(0.0, 1.0), (0.6, 0.0), (0.6, 0.5)] {
        let mut centres = SphereScene::ElasticBlock.centres();
        centres.retain(|x| x.x.abs() < 0.4 && x.z.abs() < 0.4 && x.y < 1.8);
        for x in &mut centres {
            x.y += 5.0;
        }
        let middle = Vector3::new(0.0, 6.4, 0.0);
        let options = weightless(friction, restitution, 2e-3);
        let mut simulation = SphereSimulation::new(KIND, centres.clone(), options).unwrap();
        simulation.start_with(|v| {
            for (v, x) in v.chunks_exact_mut(6).zip(&centres) {
                let inwards = (middle - x) * 2.0 + Vector3::new(0.1, -0.2, 0.3).cross(x);
                v[..3].copy_from_slice(inwards.as_slice());
                v[3..].copy_from_slice(&[1.0, -2.0, 0.5]);
            }
        });
        let start = (simulation.momentum(), simulation.angular_momentum());
        let before = simulation.energy();
        let mut struck = 0;
        for _ in 0..150 {
            struck += simulation.step(1).unwrap().n_contacts;
        }
        assert!(struck > 100, "{struck} contacts");
        let change = (simulation.momentum() - start.0).norm();
        assert!(change < 1e-10, "linear: {change}");
        // Directions are taken at the predicted end of the step and arms as
        // the radius: angular momentum is kept to O(h).
        let spin = (simulation.angular_momentum() - start.1).norm();
        assert!(
            spin < 0.02 * start.1.norm(),
            "angular: {spin} of {}",
            start.1.norm()
        );
        assert!(simulation.energy() <= before * (1.0 + 1e-12));
    }
}

#[test]
fn a_symmetric_heap_stays_symmetric() {
    // A sphere falls on four in a square: a quarter turn about y changes nothing.
    let side = 0.11;
    let mut centres: Vec<_> = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        .map(|(x, z)| Vector3::new(side * x, 0.1, side * z))
        .to_vec();
    centres.push(Vector3::new(0.0, 0.5, 0.0));
    let mut simulation = SphereSimulation::new(KIND, centres, options(0.0, 0.0, 2e-3)).unwrap();
    simulation.step(400).unwrap();
    let x = simulation.centres();
    assert!(x[0].x > side + 0.01, "pushed apart");
    assert!(x[4].x.abs() < 1e-9 && x[4].z.abs() < 1e-9);
    for k in 1..4 {
        let before = x[k - 1];
        let turned = Vector3::new(-before.z, before.y, before.x);
        assert!((x[k] - turned).norm() < 1e-9, "{k}: {} {turned}", x[k]);
    }
    let W = simulation.operator().to_dense();
    let n = 3 * simulation.contacts().len();
    for r in 0..n {
        for s in 0..r {
            assert!((W[r * n + s] - W[s * n + r]).abs() < 1e-14);
        }
    }
}

#[test]
fn a_sliding_sphere_comes_to_roll_at_five_sevenths() {
    let kind = SphereKind {
        mass: 3.0,
        radius: 0.2,
    };
    let start = vec![Vector3::new(0.0, 0.2, 0.0)];
    let mut simulation = SphereSimulation::new(kind, start, options(0.3, 0.0, 1e-3)).unwrap();
    simulation.start_with(|v| v[0] = 1.0);
    simulation.step(200).unwrap();
    assert!((simulation.v()[0] - 5.0 / 7.0).abs() < 1e-9);
    assert!(
        (simulation.v()[5] + 5.0 / 7.0 / 0.2).abs() < 1e-8,
        "rolls forward"
    );
    // Until it rolls it slips for 2 v/(7 mu g) over 12 v²/(49 mu g).
    let slips = 2.0 / (7.0 * 0.3 * G);
    let expected = 12.0 / (49.0 * 0.3 * G) + 5.0 / 7.0 * (0.2 - slips);
    assert!((simulation.centres()[0].x - expected).abs() < 2e-4);
    assert!((simulation.centres()[0].y - 0.2).abs() < 1e-12);
}

/// The core's grains have a different contact law, `0 ≤ u_N + gap⁺/h ⊥ p_N ≥ 0` with θ = 1, and a
/// different contact search: both converge to the same motion as the step shrinks.
#[test]
fn grains_in_space_and_free_spheres_come_to_the_same_motion() {
    let kind = SphereKind {
        mass: 2.0,
        radius: 0.1,
    };
    // One falls on three that lie on the ground, off their centre, and pushes them apart.
    let centres = vec![
        Vector3::new(0.0, 0.1, 0.0),
        Vector3::new(0.22, 0.1, 0.0),
        Vector3::new(0.11, 0.1, 0.19),
        Vector3::new(0.12, 0.4, 0.07),
    ];
    let apart = |step: f64, n: usize| {
        let settings = options(0.3, 0.0, step);
        let mut spheres = SphereSimulation::new(kind, centres.clone(), settings).unwrap();
        spheres.step(n).unwrap();
        let grains = Grains::<3>::new(vec![kind.radius; 4], vec![kind.mass; 4]).unwrap();
        let settings = StepOptions {
            theta: 1.0,
            forecast: 1.0,
            stabilisation: Stabilisation::None,
            ..options(0.3, 0.0, step)
        };
        let scene = GrainScene {
            grains,
            walls: vec![Wall::floor(0.0)],
            ground: None,
            machine: None,
            friction: GrainFriction {
                grains: 0.3,
                walls: 0.3,
                wheels: 0.3,
                ..GrainFriction::default()
            },
        };
        let q = centres.iter().flatten().copied().collect();
        let mut balls = GrainSimulation::<3>::new(Arc::new(scene), settings, None, q).unwrap();
        balls.step(n).unwrap();
        let moved = (spheres.centres()[1] - centres[1]).norm();
        assert!(moved > 0.01, "pushed away: {moved} m");
        let rows = balls.q().chunks_exact(3).zip(spheres.centres());
        rows.map(|(q, x)| (Vector3::from_column_slice(q) - x).norm())
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (apart(1e-3, 400), apart(2.5e-4, 1600));
    assert!(fine < 5e-4 && fine < 0.5 * coarse, "{coarse} m, {fine} m");
}
