//! Disks: conservation, energy, penetration, sleep, the sweeps against a dense solver.

use std::ops::RangeInclusive;
use std::sync::Arc;

use rover_core::integrator::{Stabilisation, StepOptions};
use rover_core::nalgebra::{Vector2, Vector3};
use rover_core::planar::{Line, PlanarWheel, TwoWheelRover};
use rover_core::simulation::{DiskSimulation, grain_options};
use rover_core::solver::Method;
use rover_core::system::grains::{GrainFriction, GrainScene, Grains, Packing, SleepOptions, Wall};

use crate::grain_scenes::{awake, between, rough, solve_to};
use crate::shared::near;

fn box_of(width: f64) -> Vec<Wall<2>> {
    vec![Wall::floor(0.0), Wall::left(0.0), Wall::right(width)]
}

fn packing(count: usize, columns: usize, seed: u64) -> Packing<2> {
    Packing {
        count,
        sides: [0.0335 * columns as f64, f64::INFINITY],
        radius_min: 0.013,
        seed,
        ..Packing::default()
    }
}

/// Disks in a box, not yet settled.
fn simulation(
    packing: &Packing<2>,
    change: impl FnOnce(&mut StepOptions, &mut GrainScene<2>),
) -> DiskSimulation {
    let (disks, q) = packing.build().expect("a packing");
    let mut options = grain_options(&disks);
    let walls = box_of(packing.sides[0]);
    let mut scene = between(walls, disks, GrainFriction::default());
    change(&mut options, &mut scene);
    awake(scene, options, &q)
}

/// Velocities drawn from a recurrence, in [−speed, speed].
fn shake(sim: &mut DiskSimulation, speed: f64) {
    let mut x = 0.37_f64;
    let n = 3 * sim.description().grains.len();
    let v: Vec<f64> = (0..n)
        .map(|k| {
            x = 3.99 * x * (1.0 - x);
            let arm = if k % 3 == 2 { 30.0 } else { 1.0 };
            arm * speed * (2.0 * x - 1.0)
        })
        .collect();
    let q = sim.q().clone();
    sim.set_state(&q, &v).expect("a state");
}

#[test]
fn collisions_in_free_space_keep_momentum_to_rounding() {
    let mut sim = simulation(&packing(120, 11, 1), |options, scene| {
        options.gravity = Vector3::zeros();
        options.restitution = 0.4;
        scene.walls.clear();
    });
    shake(&mut sim, 1.0);
    let (linear, moment) = sim.momentum();
    let mut contacts = 0;
    for _ in 0..200 {
        contacts += sim.step(1).expect("finite").n_contacts;
    }
    assert!(contacts > 1000, "they did meet: {contacts}");
    let (after, turned) = sim.momentum();
    // 84 kg at 1 m/s: rounding of a few thousand sums of order 1.
    for k in 0..2 {
        assert!((after[k] - linear[k]).abs() < 1e-11, "{linear} {after}");
    }
    // The impulses act at one point of two circles that touch up to the gap that a contact may
    // close: the moment is kept but for that.
    assert!((turned.z - moment.z).abs() < 1e-3 * 84.0 * 0.3);
}

#[test]
fn energy_never_grows_without_restitution() {
    energy_never_grows(200, &[195..=200, 0..=166, 133..=200, 195..=200]);
}

/// Ignored because the last hundred steps take six times as long as the others: `make test-all`
/// runs it, and the test above, which runs always, has the same bed.
#[test]
#[ignore = "tests/physics/planar/disks.rs::energy_never_grows_without_restitution"]
fn energy_never_grows_without_restitution_until_the_bed_lies() {
    energy_never_grows(300, &[295..=300, 0..=250, 200..=300, 295..=300]);
}

/// `expected`: how many of the steps converge, case by case.
fn energy_never_grows(n_steps: usize, expected: &[RangeInclusive<usize>; 4]) {
    // The default options; sweeps cut short; solved well and without
    // projection; solved coarsely, mostly by the proximal point.
    for case in 0..4 {
        let mut sim = simulation(&packing(120, 10, 2), |options, _| match case {
            0 => {}
            1 => {
                options.solver.method = Method::GaussSeidel;
                options.solver.max_sweeps = 7;
            }
            3 => solve_to(options, 1e-2, 1e-1, 2),
            _ => {
                solve_to(options, 1e-9, 1e-8, 20_000);
                options.stabilisation = Stabilisation::None;
            }
        });
        shake(&mut sim, 0.5);
        let mut energy = sim.energy().total();
        let scale = energy;
        let mut converged = 0;
        for step in 0..n_steps {
            converged += usize::from(sim.step(1).expect("finite").is_converged());
            let now = sim.energy().total();
            let gain = now - energy;
            assert!(gain <= 1e-13 * scale, "case {case}, step {step}: {gain}");
            energy = now;
        }
        assert!(energy < 0.95 * scale);
        // Solved well, some steps want more sweeps than are allowed; cut short, most do.
        assert!(
            expected[case].contains(&converged),
            "{converged} in case {case}"
        );
    }
}

#[test]
fn disks_that_are_shaken_and_fall_stay_out_of_one_another() {
    let mut sim = simulation(&packing(150, 12, 2), |_, _| {});
    shake(&mut sim, 0.5);
    for step in 0..300 {
        sim.step(1).expect("finite");
        let share = sim.penetration() / sim.description().grains.smallest();
        assert!(share < 0.01, "step {step}: {share}");
    }
}

#[test]
fn energy_never_grows_with_restitution_without_friction() {
    for e in [0.5, 0.9] {
        let mut sim = simulation(&packing(60, 10, 3), |options, scene| {
            options.restitution = e;
            options.solver.tolerance = 1e-8;
            options.solver.max_sweeps = 20_000;
            options.gravity = Vector3::zeros();
            scene
                .walls
                .push(Wall::new(Vector2::new(0.0, 0.6), -Vector2::y()).expect("a wall"));
            scene.friction = rough(0.0);
        });
        shake(&mut sim, 1.0);
        let mut energy = sim.energy().kinetic;
        let scale = energy;
        for step in 0..300 {
            sim.step(1).expect("finite");
            let now = sim.energy().kinetic;
            let gain = now - energy;
            assert!(gain <= 1e-7 * scale, "e {e}, step {step}: {gain}");
            energy = now;
        }
        assert!(energy < 0.99 * scale, "they did meet");
    }
}

#[test]
fn a_disk_falls_and_rests_within_a_rounding_of_the_floor() {
    let disks = Grains::new(vec![0.02], vec![0.5]).expect("a disk");
    let options = grain_options(&disks);
    let mut scene = between(vec![], disks, GrainFriction::default());
    scene.ground = Some(Arc::new(Line::new(0.0, 0.1).expect("a line")));
    let q = vec![0.0, 0.5, 0.0];
    let mut sim = awake(scene, options, &q);
    // 0.38 m of free fall take √(2 · 0.38/9.81) = 0.2783 s; an implicit step is late by h/2.
    sim.step(276).expect("finite");
    assert!(sim.v()[1] < -2.7, "still falls");
    sim.step(6).expect("finite");
    assert!(sim.v()[1].abs() < 1e-12);
    assert!((sim.q()[1] - 0.12).abs() < 1e-12, "{}", sim.q()[1]);
}

#[test]
fn the_floor_carries_the_weight() {
    let mut sim = simulation(&packing(200, 12, 4), |_, _| {});
    sim.step(800).expect("finite");
    let weight: f64 = 9.81 * sim.description().grains.mass().iter().sum::<f64>();
    let force: f64 = sim
        .contacts()
        .iter()
        .filter(|c| !c.contact.is_with_grain())
        .map(|c| (c.contact.n * c.impulse[0] + c.contact.t() * c.impulse[1]).y * 1e3)
        .sum();
    assert!((force - weight).abs() < 2e-3 * weight, "{force} {weight}");
}

#[test]
fn sweeps_and_the_dense_newton_give_the_same_velocities() {
    let packing = packing(40, 8, 5);
    let mut speeds = Vec::new();
    for method in [Method::Auto, Method::ProximalPoint] {
        let mut sim = simulation(&packing, |options, _| {
            options.solver.method = method;
            solve_to(options, 1e-10, 1e-9, 100_000);
        });
        shake(&mut sim, 0.3);
        let report = sim.step(3).expect("finite");
        assert!(report.is_converged(), "{method:?} {report:?}");
        speeds.push(sim.v().to_vec());
    }
    let worst = distances(&speeds[0], &speeds[1])
        .into_iter()
        .fold(0.0, f64::max);
    assert!(worst < 1e-6, "{worst} m/s");
}

/// Differences of the places or speeds of disks.
fn distances(a: &[f64], b: &[f64]) -> Vec<f64> {
    let pairs = a.chunks(3).zip(b.chunks(3));
    pairs
        .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
        .collect()
}

/// A bed, and one disk that falls on its left end: with or without sleep.
fn dropped(sleep: Option<SleepOptions>) -> (DiskSimulation, usize) {
    let packing = packing(240, 60, 6);
    let mut bed = simulation(&packing, |options, _| options.solver.tolerance = 1e-6);
    bed.step(700).expect("finite");
    let (mut radius, mut mass) = (
        bed.description().grains.radius().to_vec(),
        bed.description().grains.mass().to_vec(),
    );
    radius.push(0.03);
    mass.push(3.0);
    let mut q = bed.q().clone();
    q.extend([0.2, 0.6, 0.0]);
    let scene = GrainScene {
        grains: Grains::new(radius, mass).expect("disks"),
        ..(**bed.description()).clone()
    };
    let options = bed.options().clone();
    let mut sim = DiskSimulation::new(Arc::new(scene), options, sleep, q).expect("a bed");
    let mut most = 0;
    for _ in 0..60 {
        sim.step(10).expect("finite");
        most = most.max(sim.asleep().iter().filter(|a| **a).count());
    }
    (sim, most)
}

#[test]
fn sleep_leaves_the_motion_as_it_is_and_wakes_what_is_struck() {
    let (roused, none) = dropped(None);
    let (slept, most) = dropped(Some(SleepOptions::default()));
    assert!(none == 0 && most > 120, "{most} of 241 slept");
    let apart = distances(roused.q(), slept.q());
    let worst = apart.iter().copied().fold(0.0, f64::max);
    let mean = apart.iter().sum::<f64>() / apart.len() as f64;
    // After an impact that moves disks by several radii the mean difference is a hundredth of a
    // radius. The place of a single disk is chaotic: it changes by 0.4 mm if the point of impact
    // shifts by 1 nm.
    assert!(mean < 0.00015 && worst < 0.005, "{mean} m, {worst} m");
}

/// The same bed at rest, perhaps with sleep.
fn asleep(bed: &DiskSimulation, sleep: Option<SleepOptions>) -> DiskSimulation {
    let (scene, options) = (bed.description().clone(), bed.options().clone());
    DiskSimulation::new(scene, options, sleep, bed.q().clone()).expect("a bed")
}

#[test]
fn sleeping_costs_less() {
    let packing = packing(240, 60, 6);
    let mut sim = simulation(&packing, |_, _| {});
    sim.step(1200).expect("finite");
    let mut sleeping = asleep(&sim, Some(SleepOptions::default()));
    sleeping.step(400).expect("finite");
    // A rolling disk keeps rolling: there is no rolling friction.
    let slept = sleeping.asleep().iter().filter(|a| **a).count();
    assert!(slept > 120, "{slept} sleep");
    let contacts = sleeping.step(1).expect("finite").n_contacts;
    assert!(
        contacts < 250,
        "{contacts} of more than 400 contacts are left"
    );
    let before = sleeping.q().clone();
    sleeping.wake();
    assert!(sleeping.asleep().iter().all(|a| !a));
    sleeping.step(5).expect("finite");
    let moved = distances(&before, sleeping.q());
    let most = moved.iter().filter(|way| **way > 2e-5).count();
    assert!(
        most < 5,
        "they wake with the load that they had, {most} moved"
    );
}

#[test]
fn what_is_left_after_a_removal_keeps_its_load_and_old_snapshots_do_not_fit() {
    for sleep in [None, Some(SleepOptions::default())] {
        let packing = packing(120, 30, 8);
        let mut bed = simulation(&packing, |_, _| {});
        bed.step(900).expect("finite");
        let mut sim = asleep(&bed, sleep);
        sim.step(300).expect("finite");
        let snapshot = sim.snapshot();
        // The highest disk bears no load, so those below only lose its weight.
        let heights = sim.q().chunks_exact(3).map(|disk| disk[1]);
        let highest = heights.fold(f64::MIN, f64::max);
        let marked: Vec<bool> = sim
            .q()
            .chunks_exact(3)
            .map(|disk| disk[1] >= highest)
            .collect();
        let lowest = (0..120).filter(|i| sim.q()[3 * i + 1] < 0.02);
        let lowest: Vec<[f64; 2]> = lowest
            .map(|i| [sim.q()[3 * i], sim.q()[3 * i + 1]])
            .collect();
        sim.remove(&marked).expect("others are left");
        assert_eq!(sim.description().grains.len(), 119);
        assert!(sim.restore(&snapshot).is_err(), "of other disks");
        sim.step(20).expect("finite");
        for before in lowest {
            let rows = sim.q().chunks_exact(3);
            let nearest = rows.map(|q| (q[0] - before[0]).hypot(q[1] - before[1]));
            assert!(nearest.fold(f64::MAX, f64::min) < 1e-4, "it stays");
        }
        assert!(sim.remove(&[true; 119]).is_err(), "one must be left");
        assert_eq!(sim.description().grains.len(), 119);
    }
}

fn rover() -> TwoWheelRover {
    let wheel = |x: f64| PlanarWheel {
        mass: 60.0,
        radius: 0.2,
        inertia: 1.2,
        axle: Vector2::new(x, 0.0),
    };
    TwoWheelRover::new(130.0, 130.0 * 0.64 / 12.0, wheel(-0.4), wheel(0.4)).expect("a rover")
}

#[test]
fn the_rover_drives_over_the_original_bed() {
    let (disks, q) = Packing::default().build().expect("a packing");
    let options = grain_options(&disks);
    let walls = box_of(Packing::default().sides[0]);
    let scene = between(walls, disks, GrainFriction::default());
    let mut bed = awake(scene, options.clone(), &q);
    bed.step(300).expect("finite");
    let mut q = bed.q().clone();
    q.extend([0.7, 0.31, 0.0, 0.0, 0.0]);
    let scene = GrainScene {
        machine: Some(Arc::new(rover().into())),
        ..(**bed.description()).clone()
    };
    let mut sim = awake(scene, options, &q);
    sim.step(300).expect("finite");
    // The bed still yields now and then, hence the mean over 0.2 s.
    let mut weight = 0.0;
    for _ in 0..200 {
        sim.step(1).expect("finite");
        weight += sim.impulse_on_wheels()[1] / 0.2;
    }
    near(weight, 250.0 * 9.81, 0.1 * 250.0 * 9.81);
    sim.set_inputs(&[50.0, 50.0]).expect("torques");
    let n = 3 * sim.description().grains.len();
    let from = sim.q()[n];
    let snapshot = sim.snapshot();
    sim.step(500).expect("finite");
    assert!(sim.q()[n] > from + 0.02, "{} m forward", sim.q()[n] - from);
    assert!(sim.penetration() < 0.01 * 0.016);
    let end = sim.q().clone();
    sim.restore(&snapshot).expect("its own");
    sim.step(500).expect("finite");
    assert_eq!(*sim.q(), end, "a snapshot continues bit for bit");
}
