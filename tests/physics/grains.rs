//! Grains in the plane and in space: closed forms for both, heaps, energy
//! and momentum balance, a machine among them.

use std::sync::Arc;

use rover_core::nalgebra::{SVector, Vector3};
use rover_core::planar::PlanarBall;
use rover_core::problem::{BodyPairs, FrictionContactProblem};
use rover_core::simulation::{GrainSimulation, grain_options};
use rover_core::solver::{Method, Swept};
use rover_core::spatial::space::{axis, body_velocities};
use rover_core::system::grains::{
    COORDINATES, GrainContact, GrainScene, Grains, Packing, SleepOptions, Wall,
};

use super::grain_scenes::{G, MASS, RADIUS, alike, awake, between, exact, rough, solve_to};
use super::shared::apart;

/// Tolerance of all steps but those of larger beds.
const TOLERANCE: f64 = 1e-9;

/// Grains that are alike on a floor at y = 0, with their centres here.
fn on_a_floor<const D: usize>(centres: &[SVector<f64, D>], mu: f64) -> GrainSimulation<D>
where
    BodyPairs<D>: Swept<D>,
{
    on_a_wall(Wall::floor(0.0), centres, mu)
}

fn on_a_wall<const D: usize>(
    wall: Wall<D>,
    centres: &[SVector<f64, D>],
    mu: f64,
) -> GrainSimulation<D>
where
    BodyPairs<D>: Swept<D>,
{
    let scene = between(vec![wall], alike(centres.len()), rough(mu));
    let options = exact(&scene, TOLERANCE);
    awake(scene, options, &coordinates(centres))
}

fn coordinates<const D: usize>(centres: &[SVector<f64, D>]) -> Vec<f64> {
    let padded = centres
        .iter()
        .flat_map(|centre| centre.iter().chain(&[0.0]).take(COORDINATES));
    padded.copied().collect()
}

/// Gives a bed other velocities.
fn set_v<const D: usize>(heap: &mut GrainSimulation<D>, change: impl FnOnce(&mut [f64]))
where
    BodyPairs<D>: Swept<D>,
{
    let (q, mut v) = (heap.q().clone(), heap.v().to_vec());
    change(&mut v);
    heap.set_state(&q, &v).expect("a state");
}

fn centre<const D: usize>(heap: &GrainSimulation<D>, i: usize) -> SVector<f64, D>
where
    BodyPairs<D>: Swept<D>,
{
    SVector::from_fn(|k, _| heap.q()[COORDINATES * i + k])
}

/// Impulse of a contact of the last step on its first body, N s.
fn impulse<const D: usize>(contact: &GrainContact<D>, local: [f64; D]) -> SVector<f64, D> {
    let parts = contact.frame().into_iter().zip(local);
    parts.map(|(direction, p)| direction * p).sum()
}

/// Impulse of the last step's contacts with walls on the grains, N s.
fn impulse_of_walls(heap: &GrainSimulation<3>) -> Vector3<f64> {
    let all = heap.contacts().iter();
    let with_walls = all.filter(|a| !a.contact.is_with_grain());
    with_walls.map(|a| impulse(&a.contact, a.impulse)).sum()
}

/// κ, moment of inertia over m r²: a sliding body that starts to roll keeps 1/(1 + κ) of its speed.
fn kappa<const D: usize>() -> f64 {
    if D == 2 { 0.5 } else { 0.4 }
}

fn rolls_after_sliding<const D: usize>(expected: f64)
where
    BodyPairs<D>: Swept<D>,
{
    let start: SVector<f64, D> = axis(1) * 0.1;
    let mut heap = on_a_floor(&[start], 0.3);
    // Slantwise in space, so that both tangents work.
    let ahead =
        (axis::<D>(0) * 3.0 + axis::<D>(D - 1) * if D == 3 { 4.0 } else { 0.0 }).normalize();
    set_v(&mut heap, |v| v[..D].copy_from_slice(ahead.as_slice()));
    heap.step(200).unwrap();
    let off = (SVector::<f64, D>::from_column_slice(&heap.v()[..D]) - ahead * expected).norm();
    assert!(off < 1e-9, "{off} m/s in {D} dimensions");
    // v = r ω.
    let spin: f64 = heap.v()[D..].iter().map(|w| w * w).sum::<f64>().sqrt();
    assert!((0.1 * spin - expected).abs() < 1e-8, "{spin} rad/s");
    // It slides until κ v₀/((1 + κ) μ g), and slows down by μ g; then it
    // rolls. The implicit step is late by less than a step.
    let until = kappa::<D>() / (1.0 + kappa::<D>()) / (0.3 * G);
    let way = until - 0.5 * 0.3 * G * until * until + expected * (0.2 - until);
    let gone = (centre(&heap, 0) - start).norm();
    assert!((gone - way).abs() < 3e-4, "{gone} m, not {way}");
}

#[test]
fn a_sliding_disk_comes_to_roll_at_two_thirds_and_a_ball_at_five_sevenths() {
    rolls_after_sliding::<2>(2.0 / 3.0);
    rolls_after_sliding::<3>(5.0 / 7.0);
}

fn goes_down_a_slope<const D: usize>(mu: f64, slope: f64)
where
    BodyPairs<D>: Swept<D>,
{
    let alpha = slope.atan();
    let normal = axis::<D>(0) * alpha.sin() + axis::<D>(1) * alpha.cos();
    let wall = Wall::new(SVector::zeros(), normal).expect("a slope");
    let mut heap = on_a_wall(wall, &[normal * 0.1], mu);
    heap.step(500).unwrap();
    // Rolls with g sin α/(1 + κ) where tan α ≤ (1 + 1/κ) μ, slides with g
    // (sin α − μ cos α) where not.
    let kappa = kappa::<D>();
    let share = if slope <= (1.0 + 1.0 / kappa) * mu {
        alpha.sin() / (1.0 + kappa)
    } else {
        alpha.sin() - mu * alpha.cos()
    };
    let speed = SVector::<f64, D>::from_column_slice(&heap.v()[..D]).norm();
    let expected = 0.5 * G * share;
    assert!((speed - expected).abs() < 1e-6 * expected, "{D}: {speed}");
}

#[test]
fn on_a_slope_a_disk_slides_above_three_times_the_friction_and_a_ball_above_three_and_a_half() {
    // 0.98 and 1.02 of the limit.
    for (of_disk, of_ball) in [(2.94, 3.43), (3.06, 3.57)] {
        goes_down_a_slope::<2>(0.2, 0.2 * of_disk);
        goes_down_a_slope::<3>(0.2, 0.2 * of_ball);
    }
}

/// D grains around the y axis with `room` times their diameter between their
/// centres, and one on top of them: sin φ of the lines to it.
fn small_pyramid<const D: usize>(room: f64) -> (Vec<SVector<f64, D>>, f64) {
    let side = 0.2 * room;
    let out = if D == 2 {
        0.5 * side
    } else {
        side / 3_f64.sqrt()
    };
    let mut centres: Vec<SVector<f64, D>> = (0..D)
        .map(|k| {
            let angle = std::f64::consts::TAU * k as f64 / D as f64;
            let away = axis::<D>(0) * angle.cos()
                + axis::<D>(D - 1) * if D == 3 { angle.sin() } else { 0.0 };
            away * out + axis::<D>(1) * 0.1
        })
        .collect();
    let sine = out / 0.2;
    centres.push(axis::<D>(1) * (0.1 + 0.2 * (1.0 - sine * sine).sqrt()));
    (centres, sine)
}

/// Each of the D below carries W/D: moments about its centre ask for equal friction above and
/// below, so with the line of contact at φ from the vertical `N = W/D`, `T = N tan(φ/2)`, and the
/// floor bears `W + W/D`. It stands for μ ≥ tan(φ/2), and else slips apart.
fn rests_on_others<const D: usize>()
where
    BodyPairs<D>: Swept<D>,
{
    let (centres, sine) = small_pyramid::<D>(1.1);
    let needed = (0.5 * sine.asin()).tan();
    let mut stands = on_a_floor(&centres, 1.05 * needed);
    assert!(stands.step(100).unwrap().is_converged());
    let weight = MASS * G;
    let h = stands.options().time_step;
    let mut seen = [0, 0];
    for active in stands.contacts() {
        let force = SVector::<f64, D>::from(active.impulse) / h;
        let (normal, across) = (force[0], force.rows(1, D - 1).norm());
        let expected = if active.contact.is_with_grain() {
            seen[0] += 1;
            weight / D as f64
        } else {
            seen[1] += 1;
            weight + weight / D as f64
        };
        let friction = weight / D as f64 * needed;
        assert!((normal - expected).abs() < 1e-5 * weight, "{D}: {normal} N");
        assert!((across - friction).abs() < 1e-5 * weight, "{D}: {across} N");
    }
    assert_eq!(seen, [D, D]);
    assert!((centre(&stands, D) - centres[D]).norm() < 1e-7);
    let mut slips = on_a_floor(&centres, 0.95 * needed);
    slips.step(100).unwrap();
    assert!(centre(&slips, D)[1] < centres[D][1] - 1e-4, "{D}: it sinks");
}

#[test]
fn a_disk_rests_on_two_and_a_ball_on_three_while_friction_bears_it() {
    rests_on_others::<2>();
    rests_on_others::<3>();
}

#[test]
fn a_pyramid_of_balls_stands_on_glued_ones_which_carry_its_weight() {
    // Six glued, three, one: a tetrahedron of side 0.4 m.
    let (side, up) = (0.2, 0.2 * (2.0_f64 / 3.0).sqrt());
    let mut centres = Vec::new();
    for layer in 0..3_u32 {
        let n = 3 - layer;
        // Each layer stands over the middles of the triangles below.
        let shift = f64::from(layer) * side / 2.0;
        let back = f64::from(layer) * side / (2.0 * 3_f64.sqrt());
        for row in 0..n {
            for k in 0..n - row {
                let x = shift + side * (f64::from(k) + 0.5 * f64::from(row));
                let z = back + side * 0.75_f64.sqrt() * f64::from(row);
                centres.push(Vector3::new(x, 0.1 + up * f64::from(layer), z));
            }
        }
    }
    let glued = (0..10).map(|i| i < 6).collect();
    let grains = alike::<3>(10).with_kinematic(glued).expect("marks");
    let scene = between(vec![], grains, rough(0.5));
    let options = exact(&scene, TOLERANCE);
    let mut heap = awake(scene, options, &coordinates(&centres));
    assert!(heap.step(200).unwrap().is_converged());
    let on_glued = heap.contacts().iter();
    let on_glued = on_glued.filter(|a| a.contact.key.a < 6 && a.contact.key.b >= 6);
    let pressed: Vector3<f64> = on_glued.map(|a| impulse(&a.contact, a.impulse)).sum();
    let carried = -pressed / heap.options().time_step;
    let weight = 4.0 * 2.0 * G;
    let off = (carried - Vector3::y() * weight).norm();
    assert!(off < 1e-6 * weight, "{carried:?} N");
    for (i, centre) in centres.iter().enumerate() {
        let moved = (self::centre(&heap, i) - centre).norm();
        assert!(moved < 1e-7, "{i} by {moved} m");
    }
}

/// Balls of different sizes in a box, and their places.
fn balls_in_a_box(count: usize) -> (GrainScene<3>, Vec<f64>) {
    let packing = Packing {
        count,
        radius_min: 0.012,
        radius_max: 0.0165,
        mass: 0.03,
        corner: [0.0; 3],
        sides: [0.17, f64::INFINITY, 0.17],
        seed: 5,
    };
    let (grains, q) = packing.build().expect("a packing");
    let mut walls = vec![Wall::floor(0.0), Wall::left(0.0), Wall::right(0.17)];
    walls.push(Wall::new(Vector3::zeros(), Vector3::z()).expect("a wall"));
    let front = Vector3::new(0.0, 0.0, 0.17);
    walls.push(Wall::new(front, -Vector3::z()).expect("a wall"));
    (between(walls, grains, rough(0.5)), q)
}

/// These balls, at rest.
fn bed(count: usize) -> GrainSimulation<3> {
    let (scene, q) = balls_in_a_box(count);
    let options = grain_options(&scene.grains);
    awake(scene, options, &q)
}

/// Balls that fall in a box, long enough for several slabs and several threads.
fn falling() -> GrainSimulation<3> {
    let (scene, q) = balls_in_a_box(1000);
    let mut options = grain_options(&scene.grains);
    options.time_step = 2e-3;
    solve_to(&mut options, 1e-3, 1e-2, 2000);
    let mut heap = awake(scene, options, &q);
    for _ in 0..300 {
        if heap.parts().pairs().round.len() >= 1200 {
            break;
        }
        heap.step(1).unwrap();
    }
    heap.step(5).unwrap();
    heap
}

#[test]
fn any_number_of_threads_gives_balls_the_same_bits() {
    let bits = |heap: &GrainSimulation<3>| -> Vec<u64> {
        let numbers = heap.q().iter().chain(heap.v());
        numbers.map(|x| x.to_bits()).collect()
    };
    let alone = falling();
    let pairs = alone.parts().pairs();
    assert!(pairs.slabs.iter().any(|slab| *slab >= 2) && pairs.round.len() > 1000);
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let together = pool.build().expect("threads").install(falling);
        assert!(bits(&together) == bits(&alone), "{threads} threads");
    }
}

#[test]
fn contacts_that_rest_between_sweeps_obey_the_law_within_the_tolerance() {
    let mut heap = falling();
    for _ in 0..20 {
        let before = heap.energy().total();
        assert!(heap.step(1).unwrap().is_converged());
        let pairs = heap.parts().pairs();
        let p: Vec<f64> = heap.contacts().iter().flat_map(|a| a.impulse).collect();
        let mut y = vec![0.0; pairs.n_coordinates];
        pairs.add_impulses(&p, &mut y);
        let mut change = vec![0.0; p.len()];
        pairs.local(&y, &mut change);
        // The operator block by block and the pairs are two ways to the same velocities.
        let q = vec![0.0; p.len()];
        let mu = vec![0.5; p.len() / 3];
        let problem =
            FrictionContactProblem::from_assembled_sparse(heap.parts().operator(), &q, &mu);
        let mut u = vec![0.0; p.len()];
        problem.operator().multiply_add(&p, &q, &mut u);
        let largest = u.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        assert!(apart(&u, &change) < 1e-10 * largest);
        for p in p.chunks_exact(3) {
            assert!(p[1].hypot(p[2]) <= 0.5 * p[0] * (1.0 + 1e-14));
        }
        assert!(heap.energy().total() <= before + 1e-12 * before.abs());
    }
    let (deepest, smallest) = (heap.penetration(), heap.description().grains.smallest());
    assert!(deepest < 0.01 * smallest, "{deepest} m");
}

#[test]
fn balls_fall_in_a_box_and_rest_in_it_and_their_energy_never_grows() {
    let mut heap = bed(100);
    let mut energy = heap.energy().total();
    let scale = energy;
    let mass: f64 = heap.description().grains.mass().iter().sum();
    let smallest = heap.description().grains.smallest();
    let weight = heap.options().gravity * (mass * heap.options().time_step);
    let (mut momentum, _) = heap.momentum();
    let mut converged = 0;
    for k in 0..900 {
        converged += usize::from(heap.step(1).unwrap().is_converged());
        let now = heap.energy().total();
        assert!(now <= energy + 1e-13 * scale, "step {k}: {}", now - energy);
        energy = now;
        // M Δv = h M g plus the impulses of the walls: nothing else acts.
        let (after, _) = heap.momentum();
        let off = (after - momentum - weight - impulse_of_walls(&heap)).norm();
        assert!(off < 1e-12, "step {k}: {off} N s");
        momentum = after;
        let depth = heap.penetration() / smallest;
        assert!(depth < 0.01, "step {k}: {depth}");
    }
    assert!(converged > 890, "{converged} of 900 steps");
    // Without rolling friction some grains still roll: 2 cm/s in total.
    let kinetic = heap.energy().kinetic;
    assert!(kinetic < 0.5 * mass * 0.02 * 0.02, "{kinetic} J");
    let force = impulse_of_walls(&heap) / heap.options().time_step;
    assert!((force.y - mass * G).abs() < 0.02 * mass * G, "{force:?} N");
    let highest = (0..100).fold(0.0_f64, |most, i| most.max(centre(&heap, i).y));
    assert!(highest < 0.14, "they settled: {highest} m");
}

#[test]
fn balls_that_collide_in_free_space_keep_their_momentum() {
    let (mut scene, q) = balls_in_a_box(60);
    scene.walls.clear();
    let mut options = grain_options(&scene.grains);
    options.gravity = Vector3::zeros();
    let mut heap = awake(scene, options, &q);
    let mut x = 0.37_f64;
    set_v(&mut heap, |v| {
        for v in v {
            x = 3.99 * x * (1.0 - x);
            *v = 2.0 * x - 1.0;
        }
    });
    let before = heap.momentum();
    let mut contacts = 0;
    for _ in 0..100 {
        contacts += heap.step(1).unwrap().n_contacts;
    }
    assert!(contacts > 500, "they did meet: {contacts}");
    let after = heap.momentum();
    assert!((after.0 - before.0).norm() < 1e-12, "{before:?} {after:?}");
    // The impulses act at one point of two balls that touch up to the gap that a contact may close.
    assert!((after.1 - before.1).norm() < 1e-2 * before.1.norm());
}

#[test]
fn sweeps_and_a_factorisation_give_balls_the_same_velocities() {
    let [swept, factored] = [Method::GaussSeidel, Method::ProximalPoint].map(|method| {
        let (scene, q) = balls_in_a_box(40);
        let mut options = grain_options(&scene.grains);
        solve_to(&mut options, 1e-10, 1e-9, 100_000);
        // Into the middle of the bed.
        let mut heap = awake(scene.clone(), options.clone(), &q);
        heap.step(80).unwrap();
        let (q, v) = (heap.q(), heap.v());
        options.solver.method = method;
        let mut heap = awake(scene, options, q);
        set_v(&mut heap, |own| own.copy_from_slice(v));
        let report = heap.step(1).unwrap();
        assert!(
            report.is_converged() && report.n_contacts > 40,
            "{report:?}"
        );
        heap.v().to_vec()
    });
    let off = apart(&swept, &factored);
    assert!(off < 1e-5, "{off}");
}

#[test]
fn balls_that_rest_fall_asleep_and_wake_when_one_is_struck() {
    let (centres, _) = small_pyramid::<3>(1.1);
    let heap = on_a_floor(&centres, 0.5);
    let (scene, options) = (heap.description().clone(), heap.options().clone());
    let sleep = Some(SleepOptions::default());
    let mut heap = GrainSimulation::new(scene, options, sleep, heap.q().clone()).expect("a bed");
    heap.step(100).unwrap();
    assert!(heap.asleep().iter().all(|sleeps| *sleeps));
    assert_eq!(
        heap.step(1).unwrap().n_contacts,
        0,
        "nothing is left to solve"
    );
    // An impact on one of the three keeps all awake that are near.
    set_v(&mut heap, |v| v[0] = 0.5);
    heap.step(1).unwrap();
    assert!(heap.asleep().iter().all(|sleeps| !sleeps));
    let report = heap.step(1).unwrap();
    assert!(report.n_contacts >= 3, "{report:?}");
}

/// The impact of one body on two others on the floor, in the plane z = 0, is the same whether the
/// one is a grain or a machine.
fn machine_moves_as_a_grain<const D: usize>()
where
    BodyPairs<D>: Swept<D>,
{
    let (mut flat, _) = small_pyramid::<2>(1.1);
    flat[2].y += 0.05;
    let centres: Vec<SVector<f64, D>> = flat
        .iter()
        .map(|x| SVector::from_fn(|k, _| if k < 2 { x[k] } else { 0.0 }))
        .collect();
    // The velocity of the one at `at`, whose last entry is its turn.
    let struck = |mut heap: GrainSimulation<D>, at: usize| {
        let turn = heap.v().len() - 1;
        set_v(&mut heap, |v| (v[at], v[turn]) = (0.3, 2.0));
        assert!(heap.step(300).unwrap().is_converged());
        [0, 1, D, at, at + 1, turn].map(|k| heap.v()[k])
    };
    let at = 2 * body_velocities(D);
    let grain = struck(on_a_floor(&centres, 0.4), at);
    let ball = PlanarBall::new(MASS, RADIUS, kappa::<D>() * MASS * RADIUS * RADIUS).unwrap();
    let mut scene = between(vec![Wall::floor(0.0)], alike(2), rough(0.4));
    scene.machine = Some(Arc::new(ball.into()));
    let options = exact(&scene, TOLERANCE);
    let mut q = coordinates(&centres[..2]);
    q.extend([flat[2].x, flat[2].y, 0.0]);
    let machine = struck(awake(scene, options, &q), at);
    let off = apart(&grain, &machine);
    assert!(grain.iter().any(|v| v.abs() > 0.05), "it moves");
    assert!(off < 1e-4, "{D}: {off}");
}

#[test]
fn a_machine_that_is_a_disk_or_a_ball_moves_as_one() {
    machine_moves_as_a_grain::<2>();
    machine_moves_as_a_grain::<3>();
}

/// Detection looks as far as the fastest ball goes. A light ball that a heavy one strikes leaves
/// twice as fast, and met the third one only after the step, inside it.
#[test]
fn a_ball_that_is_thrown_within_a_step_does_not_end_inside_another() {
    let speed = 20.0;
    for share in [1.2, 1.5, 1.8] {
        let grains = Grains::<3>::new(vec![RADIUS; 3], vec![100.0 * MASS, MASS, MASS]).unwrap();
        let scene = between(vec![Wall::floor(0.0)], grains, rough(0.0));
        let mut options = exact(&scene, TOLERANCE);
        options.restitution = 1.0;
        let way = share * speed * options.time_step;
        let centres = [0.0, 0.2, 0.4 + way].map(|x| Vector3::new(x, 1.0, 0.0));
        let mut heap = awake(scene, options, &coordinates(&centres));
        set_v(&mut heap, |v| v[0] = speed);
        let report = heap.step(1).unwrap();
        let overlap = heap.penetration();
        assert!(overlap < 1e-3 * RADIUS, "{share}: {overlap} {report:?}");
        assert!(report.retaken > 0, "{share}");
    }
}

#[test]
fn packings_in_space_do_not_overlap_and_stay_in_their_box() {
    let heap = bed(300);
    assert!(heap.penetration() <= 0.0);
    for (i, r) in heap.description().grains.radius().iter().enumerate() {
        let x = centre(&heap, i);
        assert!(x.x >= *r && x.x + r <= 0.17 && x.z >= *r && x.z + r <= 0.17 && x.y >= *r);
    }
    let narrow = Packing::<3> {
        count: 1,
        radius_min: 0.1,
        radius_max: 0.1,
        mass: 1.0,
        corner: [0.0; 3],
        sides: [1.0, 1.0, 0.15],
        seed: 0,
    };
    let refused = narrow.build().expect_err("no room");
    assert_eq!(refused.field(), "depth");
    assert!(refused.to_string().contains("ball"), "{refused}");
}
