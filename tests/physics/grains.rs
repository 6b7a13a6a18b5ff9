//! Grains in the plane and in space: closed forms for both, heaps, energy
//! and momentum balance, a machine among them.

use std::sync::Arc;

use rover_core::integrator::{
    Dynamics, Integrator, MechanicalSystem, NoProbe, Stabilisation, StateMut, StepOptions,
    StepReport, StepScratch, WarmStart,
};
use rover_core::nalgebra::{SVector, Vector3};
use rover_core::planar::PlanarBall;
use rover_core::problem::FrictionContactProblem;
use rover_core::solver::SolverOptions;
use rover_core::spatial::space::{axis, body_velocities};
use rover_core::system::grains::{
    COORDINATES, GrainContact, GrainFriction, GrainKey, GrainParts, GrainScene, GrainSystem,
    Grains, Packing, Sleep, SleepOptions, StepTaken, Wall,
};

const G: f64 = 9.81;

/// Grains through time.
struct Heap<const D: usize> {
    scene: GrainScene<D>,
    options: StepOptions,
    q: Vec<f64>,
    v: Vec<f64>,
    time: f64,
    steps: usize,
    warm_start: WarmStart<GrainKey>,
    parts: GrainParts<D>,
    scratch: StepScratch<Vec<f64>, GrainContact<D>>,
    sleep: Sleep,
    sleep_options: Option<SleepOptions>,
}

/// μ of all contacts.
fn rough(mu: f64) -> GrainFriction {
    GrainFriction {
        grains: mu,
        walls: mu,
        wheels: mu,
        ..GrainFriction::default()
    }
}

fn options() -> StepOptions {
    StepOptions {
        theta: 1.0,
        forecast: 1.0,
        time_step: 1e-3,
        stabilisation: Stabilisation::None,
        solver: SolverOptions {
            tolerance: 1e-9,
            velocity_tolerance: 1e-9,
            max_sweeps: 20_000,
            ..SolverOptions::default()
        },
        ..StepOptions::default()
    }
}

/// Grains of 0.1 m and 2 kg on a floor at y = 0, with their centres here.
fn on_a_floor<const D: usize>(centres: &[SVector<f64, D>], mu: f64) -> Heap<D>
where
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    on_a_wall(Wall::floor(0.0), centres, mu)
}

fn on_a_wall<const D: usize>(wall: Wall<D>, centres: &[SVector<f64, D>], mu: f64) -> Heap<D>
where
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    let n = centres.len();
    let scene = GrainScene {
        grains: Grains::new(vec![0.1; n], vec![2.0; n]).expect("grains"),
        walls: vec![wall],
        ground: None,
        machine: None,
        friction: rough(mu),
    };
    Heap::new(scene, options(), coordinates(centres))
}

fn coordinates<const D: usize>(centres: &[SVector<f64, D>]) -> Vec<f64> {
    let mut q = Vec::new();
    for centre in centres {
        q.extend(centre.iter().chain(&[0.0]).take(COORDINATES));
    }
    q
}

impl<const D: usize> Heap<D>
where
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    fn new(scene: GrainScene<D>, options: StepOptions, q: Vec<f64>) -> Self {
        scene.check().expect("a scene");
        scene.check_configuration(&q).expect("a configuration");
        let nv = scene.nv();
        Self {
            scratch: StepScratch::new(&q, 3 * scene.grains.len()),
            v: vec![0.0; nv],
            q,
            time: 0.0,
            steps: 0,
            warm_start: WarmStart::default(),
            parts: GrainParts::default(),
            sleep: Sleep::new(scene.grains.kinematic()),
            sleep_options: None,
            scene,
            options,
        }
    }

    fn step(&mut self, n: usize) -> StepReport {
        let mut total = StepReport::default();
        for _ in 0..n {
            let mut system = GrainSystem {
                scene: &self.scene,
                asleep: self.sleep.asleep(),
                moments: &Vec::new(),
                inputs: &[],
                pull: SVector::zeros(),
                parts: &mut self.parts,
            };
            let state = StateMut {
                configuration: &mut self.q,
                v: &mut self.v,
                time: &mut self.time,
            };
            let (options, scratch) = (&self.options, &mut self.scratch);
            let warm_start = &mut self.warm_start;
            let variant = options.variant;
            let report = variant.step(
                &mut system,
                options,
                state,
                warm_start,
                scratch,
                &mut NoProbe,
            );
            total.merge(&report.expect("a finite step"));
            self.steps += 1;
            if let Some(options) = &self.sleep_options {
                let taken = StepTaken {
                    scene: &self.scene,
                    weight_impulse: self.options.gravity.norm() * self.options.time_step,
                    q: &self.q,
                    v: &mut self.v,
                    contacts: self.scratch.contacts(),
                    impulses: self.scratch.impulses(),
                    count: self.steps,
                    movers: &[],
                };
                self.sleep.update(options, taken, &mut self.warm_start);
            }
        }
        total
    }

    fn centre(&self, i: usize) -> SVector<f64, D> {
        SVector::from_fn(|k, _| self.q[COORDINATES * i + k])
    }

    fn velocity(&self, i: usize) -> SVector<f64, D> {
        SVector::from_fn(|k, _| self.v[body_velocities(D) * i + k])
    }

    fn energy(&self) -> f64 {
        let energy = self.scene.energy(&self.q, &self.v, &self.options.gravity);
        energy.total()
    }

    /// Force on the first body of each contact of the last step, N: normal,
    /// and size of the tangential one.
    fn forces(&self) -> impl Iterator<Item = (&GrainContact<D>, f64, f64)> {
        let h = self.options.time_step;
        let contacts = self.scratch.contacts().iter();
        contacts
            .zip(self.scratch.impulses().chunks_exact(D))
            .map(move |(contact, p)| {
                let across: f64 = p[1..].iter().map(|p| p * p).sum::<f64>().sqrt();
                (contact, p[0] / h, across / h)
            })
    }

    /// Impulse of the last step's contacts with walls on the grains, N s.
    fn impulse_of_walls(&self) -> SVector<f64, D> {
        let contacts = self.scratch.contacts().iter();
        let local = self.scratch.impulses().chunks_exact(D);
        let mut sum = SVector::zeros();
        for (contact, p) in contacts.zip(local).filter(|(c, _)| !c.is_with_grain()) {
            for (direction, p) in contact.frame().iter().zip(p) {
                sum += direction * *p;
            }
        }
        sum
    }
}

/// κ, moment of inertia over m r²: a sliding body that starts to roll keeps 1/(1 + κ) of its speed.
fn kappa<const D: usize>() -> f64 {
    if D == 2 { 0.5 } else { 0.4 }
}

fn rolls_after_sliding<const D: usize>(expected: f64)
where
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    let start: SVector<f64, D> = axis(1) * 0.1;
    let mut heap = on_a_floor(&[start], 0.3);
    // Slantwise in space, so that both tangents work.
    let ahead =
        (axis::<D>(0) * 3.0 + axis::<D>(D - 1) * if D == 3 { 4.0 } else { 0.0 }).normalize();
    for k in 0..D {
        heap.v[k] = ahead[k];
    }
    heap.step(200);
    let off = (heap.velocity(0) - ahead * expected).norm();
    assert!(off < 1e-9, "{off} m/s in {D} dimensions");
    // v = r ω.
    let spin: f64 = heap.v[D..].iter().map(|w| w * w).sum::<f64>().sqrt();
    assert!((0.1 * spin - expected).abs() < 1e-8, "{spin} rad/s");
    // It slides until κ v₀/((1 + κ) μ g), and slows down by μ g; then it
    // rolls. The implicit step is late by less than a step.
    let until = kappa::<D>() / (1.0 + kappa::<D>()) / (0.3 * G);
    let way = until - 0.5 * 0.3 * G * until * until + expected * (0.2 - until);
    let gone = (heap.centre(0) - start).norm();
    assert!((gone - way).abs() < 3e-4, "{gone} m, not {way}");
}

#[test]
fn a_sliding_disk_comes_to_roll_at_two_thirds_and_a_ball_at_five_sevenths() {
    rolls_after_sliding::<2>(2.0 / 3.0);
    rolls_after_sliding::<3>(5.0 / 7.0);
}

fn goes_down_a_slope<const D: usize>(mu: f64, slope: f64)
where
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    let alpha = slope.atan();
    let normal = axis::<D>(0) * alpha.sin() + axis::<D>(1) * alpha.cos();
    let wall = Wall::new(SVector::zeros(), normal).expect("a slope");
    let mut heap = on_a_wall(wall, &[normal * 0.1], mu);
    heap.step(500);
    // Rolls with g sin α/(1 + κ) where tan α ≤ (1 + 1/κ) μ, slides with g
    // (sin α − μ cos α) where not.
    let kappa = kappa::<D>();
    let share = if slope <= (1.0 + 1.0 / kappa) * mu {
        alpha.sin() / (1.0 + kappa)
    } else {
        alpha.sin() - mu * alpha.cos()
    };
    let speed = heap.velocity(0).norm();
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
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    let (centres, sine) = small_pyramid::<D>(1.1);
    let needed = (0.5 * sine.asin()).tan();
    let mut stands = on_a_floor(&centres, 1.05 * needed);
    let report = stands.step(100);
    assert!(report.is_converged());
    let weight = 2.0 * G;
    let mut seen = [0, 0];
    for (contact, normal, across) in stands.forces() {
        let expected = if contact.is_with_grain() {
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
    assert!((stands.centre(D) - centres[D]).norm() < 1e-7);
    let mut slips = on_a_floor(&centres, 0.95 * needed);
    slips.step(100);
    assert!(slips.centre(D).y() < centres[D].y() - 1e-4, "{D}: it sinks");
}

/// The height of a vector in any dimension.
trait Height {
    fn y(&self) -> f64;
}

impl<const D: usize> Height for SVector<f64, D> {
    fn y(&self) -> f64 {
        self[1]
    }
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
    let mut heap = on_a_floor(&centres, 0.5);
    heap.scene.walls.clear();
    let glued = (0..10).map(|i| i < 6).collect();
    heap.scene.grains = heap
        .scene
        .grains
        .clone()
        .with_kinematic(glued)
        .expect("marks");
    heap.sleep = Sleep::new(heap.scene.grains.kinematic());
    let report = heap.step(200);
    assert!(report.is_converged());
    let h = heap.options.time_step;
    let mut carried = Vector3::zeros();
    let local = heap.scratch.impulses().chunks_exact(3);
    for (contact, p) in heap.scratch.contacts().iter().zip(local) {
        if contact.key.a < 6 && contact.key.b >= 6 {
            for (direction, p) in contact.frame().iter().zip(p) {
                carried -= direction * (p / h);
            }
        }
    }
    let weight = 4.0 * 2.0 * G;
    let off = (carried - Vector3::y() * weight).norm();
    assert!(off < 1e-6 * weight, "{carried:?} N");
    for (i, centre) in centres.iter().enumerate() {
        let moved = (heap.centre(i) - centre).norm();
        assert!(moved < 1e-7, "{i} by {moved} m");
    }
}

/// Balls of different sizes in a box.
fn bed(count: usize) -> Heap<3> {
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
    let scene = GrainScene {
        grains,
        walls,
        ground: None,
        machine: None,
        friction: rough(0.5),
    };
    let mut options = options();
    options.solver.tolerance = 1e-4;
    options.solver.velocity_tolerance = 1e-3;
    options.solver.max_sweeps = 2000;
    Heap::new(scene, options, q)
}

/// Balls that fall in a box, long enough for several slabs and several threads.
fn falling() -> Heap<3> {
    let mut heap = bed(1000);
    heap.options.time_step = 2e-3;
    heap.options.solver.tolerance = 1e-3;
    heap.options.solver.velocity_tolerance = 1e-2;
    while heap.parts.pairs().round.len() < 1200 && heap.steps < 300 {
        heap.step(1);
    }
    heap.step(5);
    heap
}

#[test]
fn any_number_of_threads_gives_balls_the_same_bits() {
    let bits = |heap: &Heap<3>| -> Vec<u64> {
        let numbers = heap.q.iter().chain(&heap.v);
        numbers.map(|x| x.to_bits()).collect()
    };
    let alone = falling();
    assert!(alone.parts.pairs().slabs.iter().any(|slab| *slab >= 2));
    assert!(alone.parts.pairs().round.len() > 1000);
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
        let before = heap.energy();
        let report = heap.step(1);
        assert!(report.is_converged());
        let (pairs, p) = (heap.parts.pairs(), heap.scratch.impulses());
        let mut y = vec![0.0; pairs.n_coordinates];
        pairs.add_impulses(p, &mut y);
        let mut change = vec![0.0; p.len()];
        pairs.local(&y, &mut change);
        // The operator block by block and the pairs are two ways to the same velocities.
        let q = vec![0.0; p.len()];
        let mu = vec![0.5; p.len() / 3];
        let problem = FrictionContactProblem::from_assembled_sparse(heap.parts.operator(), &q, &mu);
        let mut u = vec![0.0; p.len()];
        problem.operator().multiply_add(p, &q, &mut u);
        let largest = u.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
        for (u, change) in u.iter().zip(&change) {
            assert!((u - change).abs() < 1e-10 * largest);
        }
        for p in p.chunks_exact(3) {
            assert!(p[1].hypot(p[2]) <= 0.5 * p[0] * (1.0 + 1e-14));
        }
        assert!(heap.energy() <= before + 1e-12 * before.abs());
    }
    let deepest = heap.scene.penetration(&heap.q, heap.time);
    assert!(deepest < 0.01 * heap.scene.grains.smallest(), "{deepest} m");
}

#[test]
fn balls_fall_in_a_box_and_rest_in_it_and_their_energy_never_grows() {
    let mut heap = bed(100);
    let mut energy = heap.energy();
    let scale = energy;
    let mass: f64 = heap.scene.grains.mass().iter().sum();
    let smallest = heap.scene.grains.smallest();
    let (mut momentum, _) = heap.scene.momentum(&heap.q, &heap.v);
    let mut converged = 0;
    for step in 0..900 {
        converged += usize::from(heap.step(1).is_converged());
        let now = heap.energy();
        assert!(
            now <= energy + 1e-13 * scale,
            "step {step}: {}",
            now - energy
        );
        energy = now;
        // M Δv = h M g plus the impulses of the walls: nothing else acts.
        let (after, _) = heap.scene.momentum(&heap.q, &heap.v);
        let weight = heap.options.gravity * (mass * heap.options.time_step);
        let off = (after - momentum - weight - heap.impulse_of_walls()).norm();
        assert!(off < 1e-12, "step {step}: {off} N s");
        momentum = after;
        let depth = heap.scene.penetration(&heap.q, heap.time) / smallest;
        assert!(depth < 0.01, "step {step}: {depth}");
    }
    assert!(converged > 890, "{converged} of 900 steps");
    // Without rolling friction some grains still roll: 2 cm/s in total.
    let kinetic = heap
        .scene
        .energy(&heap.q, &heap.v, &heap.options.gravity)
        .kinetic;
    assert!(kinetic < 0.5 * mass * 0.02 * 0.02, "{kinetic} J");
    let force = heap.impulse_of_walls() / heap.options.time_step;
    assert!((force.y - mass * G).abs() < 0.02 * mass * G, "{force:?} N");
    let highest = (0..100).fold(0.0_f64, |most, i| most.max(heap.centre(i).y));
    assert!(highest < 0.14, "they settled: {highest} m");
}

#[test]
fn balls_that_collide_in_free_space_keep_their_momentum() {
    let mut heap = bed(60);
    heap.scene.walls.clear();
    heap.options.gravity = Vector3::zeros();
    let mut x = 0.37_f64;
    for v in &mut heap.v {
        x = 3.99 * x * (1.0 - x);
        *v = 2.0 * x - 1.0;
    }
    let before = heap.scene.momentum(&heap.q, &heap.v);
    let mut contacts = 0;
    for _ in 0..100 {
        contacts += heap.step(1).n_contacts;
    }
    assert!(contacts > 500, "they did meet: {contacts}");
    let after = heap.scene.momentum(&heap.q, &heap.v);
    assert!((after.0 - before.0).norm() < 1e-12, "{before:?} {after:?}");
    // The impulses act at one point of two balls that touch up to the gap that a contact may close.
    assert!((after.1 - before.1).norm() < 1e-2 * before.1.norm());
}

#[test]
fn sweeps_and_a_factorisation_give_balls_the_same_velocities() {
    use rover_core::solver::Method;
    let [swept, factored] = [Method::GaussSeidel, Method::ProximalPoint].map(|method| {
        let mut heap = bed(40);
        heap.options.solver.tolerance = 1e-10;
        heap.options.solver.velocity_tolerance = 1e-9;
        heap.options.solver.max_sweeps = 100_000;
        // Into the middle of the bed.
        heap.step(80);
        heap.options.solver.method = method;
        let report = heap.step(1);
        assert!(
            report.is_converged() && report.n_contacts > 40,
            "{report:?}"
        );
        heap.v
    });
    let off = swept.iter().zip(&factored);
    let off = off.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    assert!(off < 1e-5, "{off}");
}

#[test]
fn balls_that_rest_fall_asleep_and_wake_when_one_is_struck() {
    let (centres, _) = small_pyramid::<3>(1.1);
    let mut heap = on_a_floor(&centres, 0.5);
    heap.sleep_options = Some(SleepOptions::default());
    heap.step(100);
    assert!(heap.sleep.asleep().iter().all(|sleeps| *sleeps));
    assert_eq!(heap.step(1).n_contacts, 0, "nothing is left to solve");
    // An impact on one of the three wakes all that are near.
    heap.sleep.wake_all(&[false; 4], &mut heap.warm_start);
    heap.v[0] = 0.5;
    heap.step(1);
    assert!(heap.sleep.asleep().iter().all(|sleeps| !sleeps));
    let report = heap.step(1);
    assert!(report.n_contacts >= 3, "{report:?}");
}

/// The impact of one body on two others on the floor, in the plane z = 0, is the same whether the
/// one is a grain or a machine.
fn machine_moves_as_a_grain<const D: usize>()
where
    for<'a> GrainSystem<'a, D>:
        MechanicalSystem<Machine: Dynamics<Configuration = Vec<f64>>, Contact = GrainContact<D>>,
{
    let (mut flat, _) = small_pyramid::<2>(1.1);
    flat[2].y += 0.05;
    let centres: Vec<SVector<f64, D>> = flat
        .iter()
        .map(|x| SVector::from_fn(|k, _| if k < 2 { x[k] } else { 0.0 }))
        .collect();
    // The velocity of the one at `at`, whose last entry is its turn.
    let struck = |mut heap: Heap<D>, at: usize| {
        heap.v[at] = 0.3;
        *heap.v.last_mut().unwrap() = 2.0;
        assert!(heap.step(300).is_converged());
        let turn = heap.v.len() - 1;
        [0, 1, D, at, at + 1, turn].map(|k| heap.v[k])
    };
    let at = 2 * body_velocities(D);
    let grain = struck(on_a_floor(&centres, 0.4), at);
    let mut scene = on_a_floor(&centres[..2], 0.4).scene;
    let ball = PlanarBall::new(2.0, 0.1, kappa::<D>() * 2.0 * 0.01).unwrap();
    scene.machine = Some(Arc::new(ball.into()));
    let mut q = coordinates(&centres[..2]);
    q.extend([flat[2].x, flat[2].y, 0.0]);
    let machine = struck(Heap::new(scene, options(), q), at);
    let off = grain.iter().zip(&machine);
    let off = off.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
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
        let way = share * speed * options().time_step;
        let places = [0.0, 0.2, 0.4 + way];
        let centres = places.map(|x| Vector3::new(x, 1.0, 0.0));
        let mut heap = on_a_floor::<3>(&centres, 0.0);
        heap.scene.grains = Grains::new(vec![0.1; 3], vec![200.0, 2.0, 2.0]).unwrap();
        heap.options.restitution = 1.0;
        heap.v[0] = speed;
        let report = heap.step(1);
        let overlap = heap.scene.penetration(&heap.q, heap.time);
        assert!(
            overlap < 1e-3 * 0.1,
            "{share}: {overlap} {report:?} {:?}",
            heap.v
        );
        assert!(report.retaken > 0, "{share}");
    }
}

#[test]
fn packings_in_space_do_not_overlap_and_stay_in_their_box() {
    let heap = bed(300);
    assert!(heap.scene.penetration(&heap.q, heap.time) <= 0.0);
    let radius = heap.scene.grains.radius();
    for (i, r) in radius.iter().enumerate() {
        let x = heap.centre(i);
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
