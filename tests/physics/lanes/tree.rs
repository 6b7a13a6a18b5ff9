//! Poses, mass matrix, factor, bias and energy: those of a sum over rigid bodies, and every lane
//! with the bits of the same source run as `f64`.

use nalgebra::{DVector, Matrix3, Rotation3, Vector3};
use proptest::prelude::*;

use rover_core::multibody::bias::{BiasScratch, bias};
use rover_core::multibody::description::{CouplingDescription, JointKind, SolidDescription};
use rover_core::multibody::energy::{EnergyScratch, energy};
use rover_core::multibody::{
    Configuration, Factor, Inertias, LaneConfiguration, MassMatrix, Model, ModelDescription, Poses,
};
use rover_core::scalar::{Lane, LaneMask, Single, Vec3};

use super::{OverLanes, on_every_register, rigid_bodies, spread};

/// Time over which the configurations of a test move.
const H: f64 = 0.3;

/// A rover in a state, under its own gravity.
struct Rover {
    model: Model,
    q: Configuration,
    v: Vec<f64>,
    gravity: [f64; 3],
}

/// What the sources of the tree compute.
#[derive(Default)]
struct Found {
    parts: Vec<Part>,
}

/// The numbers of one quantity.
struct Part {
    name: &'static str,
    numbers: Vec<f64>,
    /// What their errors are compared with.
    size: f64,
}

impl Found {
    fn add(&mut self, name: &'static str, numbers: impl IntoIterator<Item = f64>) {
        self.add_sum(name, numbers, 1.0);
    }

    /// Adds a sum over terms of this size, which may cancel.
    fn add_sum(
        &mut self,
        name: &'static str,
        numbers: impl IntoIterator<Item = f64>,
        of_terms: f64,
    ) {
        let numbers: Vec<f64> = numbers.into_iter().collect();
        let largest = numbers.iter().fold(of_terms, |size, x| size.max(x.abs()));
        self.parts.push(Part {
            name,
            numbers,
            size: largest.max(1.0),
        });
    }
}

/// The sources on as many machines as lanes.
fn found<T: Lane>(token: T::Token, rovers: &[Rover]) -> Vec<Found> {
    let machine = rovers[0].model.mechanism().clone();
    let mut inertias = Inertias::<T>::new(token, &machine);
    let mut start = LaneConfiguration::new(token, &machine);
    for (lane, rover) in rovers.iter().enumerate() {
        assert!(*rover.model.mechanism() == machine);
        inertias.set_lane(lane, rover.model.inertias());
        start.set_lane(lane, &rover.q);
    }
    let v: Vec<T> = spread(token, rovers, |rover| rover.v.clone());
    let gravity: Vec<T> = spread(token, rovers, |rover| rover.gravity.to_vec());
    let gravity = Vec3::new(gravity[0], gravity[1], gravity[2]);

    let mut place = start.clone();
    T::vectorize(token, || {
        place.set_moved(&machine, &start, &v, H);
        place.normalise();
    });
    assert!(place.is_finite().all());
    let mut poses = Poses::new(token, &machine);
    poses.update(&machine, &inertias, &place);
    let mut M = MassMatrix::new(token, &machine);
    M.update(&machine, &inertias, &poses);
    let dense: Vec<_> = (0..T::LANES).map(|k| M.to_dense(&machine, k)).collect();
    let mut product = v.clone();
    M.times(&machine, &v, &mut product);
    let mut factor = Factor::new(token, &machine);
    assert!(M.factorise(&machine, &mut factor).all());
    let mut columns: Vec<[T; 3]> = v.iter().map(|&v| [v, v, v]).collect();
    factor.half_solve_columns(&machine, 0..v.len(), &mut columns);
    assert!(M.factorise_in_place(&machine, &mut factor).all());
    let mut half = v.clone();
    T::vectorize(token, || factor.half_solve(&machine, &mut half));
    let mut solved = half.clone();
    T::vectorize(token, || factor.half_solve_back(&machine, &mut solved));
    let last = machine.n_bodies() - 1;
    let path = machine.path(last);
    let mut along: Vec<[T; 3]> = path.iter().map(|&k| [v[k], v[0], v[k]]).collect();
    T::vectorize(token, || {
        factor.half_solve_path(&machine, last, &mut along);
    });
    let mut load = v.clone();
    let mut scratch = BiasScratch::new(token, &machine);
    bias(
        &machine,
        &inertias,
        &poses,
        &v,
        gravity,
        &mut scratch,
        &mut load,
    );
    let mut scratch = EnergyScratch::new(token, &machine);
    let (energy, momentum) = energy(&machine, &inertias, &place, &v, gravity, &mut scratch);

    let of_lane = |(lane, rover): (usize, &Rover)| {
        let mut found = Found::default();
        let mut q = rover.q.clone();
        place.to_lane(lane, &mut q);
        found.add("configuration", numbers(&q));
        for (b, pose) in poses.bodies.iter().enumerate() {
            let columns = [pose.R.x, pose.R.y, pose.R.z];
            let attitude = columns.iter().flat_map(|column| column.get(lane));
            found.add("attitude", attitude);
            found.add("places", [pose.r, pose.c].iter().flat_map(|x| x.get(lane)));
            for mover in machine.movers(b) {
                let motion = &poses.motions[mover.motion];
                found.add("turning", motion.axis.get(lane));
                found.add("moving", motion.velocity_at(pose.c).get(lane));
            }
        }
        found.add("mass matrix", dense[lane].iter().copied());
        found.add("product", product.iter().map(|x| x.get(lane)));
        found.add("half-solution", half.iter().map(|x| x.get(lane)));
        found.add("solution", solved.iter().map(|x| x.get(lane)));
        found.add("columns", columns.iter().flatten().map(|x| x.get(lane)));
        found.add("path", along.iter().flatten().map(|x| x.get(lane)));
        found.add("bias", load.iter().map(|x| x.get(lane)));
        found.add("kinetic energy", [energy.kinetic.get(lane)]);
        found.add("potential energy", [energy.potential.get(lane)]);
        found.add("momentum", momentum.get(lane));
        found
    };
    rovers.iter().enumerate().map(of_lane).collect()
}

fn numbers(q: &Configuration) -> Vec<f64> {
    let free = q.position.iter().chain(q.attitude.coords.iter());
    let balls = q.rotations.iter().flat_map(|q| q.coords.iter());
    let others = (q.others.iter()).flat_map(|q| q.position.iter().chain(q.attitude.coords.iter()));
    let numbers = free.chain(&q.joints).chain(balls).chain(others);
    numbers.copied().collect()
}

/// The same quantities by sums over rigid bodies.
fn expected(rover: &Rover) -> Found {
    let Rover { model, v, .. } = rover;
    let gravity = Vector3::from(rover.gravity);
    let mut q = rover.q.clone();
    q.set_moved(model, &rover.q, v, H);
    q.normalise();
    let bodies = rigid_bodies::moving(model, &q, v);
    let units = rigid_bodies::units(model, &q);
    let M = rigid_bodies::mass_matrix(model, &units);
    let energy = rigid_bodies::energy(model, &bodies, v, &gravity);
    let v_column = DVector::from_column_slice(v);
    let half = rigid_bodies::half_solve(&M, v);

    let mut found = Found::default();
    found.add("configuration", numbers(&q));
    for (b, own) in bodies.iter().enumerate() {
        let tree = &model.trees()[model.bodies()[b].tree];
        let origin = if tree.is_free {
            bodies[tree.bodies.start].r
        } else {
            Vector3::zeros()
        };
        found.add("attitude", own.R.iter().copied());
        let places = [own.r - origin, own.c - origin];
        found.add("places", places.iter().flatten().copied());
        for k in model.movers(b).iter().map(|mover| mover.velocity) {
            found.add("turning", units[k][b].omega.iter().copied());
            found.add("moving", units[k][b].c_dot.iter().copied());
        }
    }
    found.add("mass matrix", M.iter().copied());
    found.add("product", (&M * &v_column).iter().copied());
    found.add("half-solution", half.iter().copied());
    let solved = M.clone().cholesky().unwrap().solve(&v_column);
    found.add("solution", solved.iter().copied());
    found.add("columns", half.iter().flat_map(|x| [*x; 3]));
    let path = model.path(model.bodies().len() - 1);
    let column = |of: &dyn Fn(usize) -> f64| {
        let mut y = vec![0.0; model.nv()];
        for &k in path {
            y[k] = of(k);
        }
        rigid_bodies::half_solve(&M, &y)
    };
    let (own, first) = (column(&|k| v[k]), column(&|_| v[0]));
    found.add(
        "path",
        path.iter().flat_map(|&k| [own[k], first[k], own[k]]),
    );
    let bias = rigid_bodies::bias(model, &q, v, &gravity, &units);
    found.add("bias", bias.iter().copied());
    found.add("kinetic energy", [energy.kinetic]);
    let (potential, of_terms) = energy.potential;
    found.add_sum("potential energy", [potential], of_terms);
    let (momentum, of_terms) = energy.momentum;
    found.add_sum("momentum", momentum.iter().copied(), of_terms);
    found
}

/// The condition number of M enters what is solved with it, and differences the expected bias.
fn tolerance(name: &str) -> f64 {
    match name {
        "solution" | "half-solution" | "columns" | "path" => 1e-11,
        "bias" => 1e-7,
        _ => 1e-13,
    }
}

/// Rovers in lanes, beside the same rovers alone.
struct SameBits<'a> {
    rovers: &'a [Rover],
    alone: &'a [Found],
}

impl OverLanes for SameBits<'_> {
    fn run<T: Lane>(&mut self, token: T::Token) {
        same_bits::<T>(token, self.rovers, self.alone);
    }
}

fn same_bits<T: Lane>(token: T::Token, rovers: &[Rover], alone: &[Found]) {
    // Also with the rovers in other lanes.
    for shift in [0, 3] {
        for start in (0..rovers.len()).step_by(T::LANES) {
            let mut order: Vec<usize> = (start..start + T::LANES).collect();
            order.rotate_left(shift % T::LANES);
            let block: Vec<Rover> = order.iter().map(|&i| rovers[i].copy()).collect();
            for (found, &i) in found::<T>(token, &block).iter().zip(&order) {
                for (found, alone) in found.parts.iter().zip(&alone[i].parts) {
                    for (x, y) in found.numbers.iter().zip(&alone.numbers) {
                        assert_eq!(x.to_bits(), y.to_bits(), "{}: {x} {y}", found.name);
                    }
                }
            }
        }
    }
}

impl Rover {
    fn copy(&self) -> Self {
        Self {
            model: self.model.clone(),
            q: self.q.clone(),
            v: self.v.clone(),
            gravity: self.gravity,
        }
    }
}

/// Eight machines alone and in lanes, against sums over rigid bodies.
fn check(rovers: &[Rover]) {
    let mut alone = Vec::new();
    for rover in rovers {
        let found = found::<f64>(Single::best(), std::slice::from_ref(rover)).remove(0);
        let expected = expected(rover);
        assert_eq!(found.parts.len(), expected.parts.len());
        for (found, expected) in found.parts.iter().zip(&expected.parts) {
            let (name, n) = (found.name, found.numbers.len());
            assert_eq!((name, n), (expected.name, expected.numbers.len()));
            for (x, y) in found.numbers.iter().zip(&expected.numbers) {
                let error = (x - y).abs() / expected.size;
                assert!(error < tolerance(name), "{name}: {error:e}");
            }
        }
        alone.push(found);
    }
    on_every_register(&mut SameBits {
        rovers,
        alone: &alone,
    });
}

/// A number between −1 and 1 that depends on the seed and k.
fn random(seed: u64, k: usize) -> f64 {
    let mut x = seed ^ (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 29)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 32)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Eight rovers of a description with masses of their own, in random states.
fn rovers(description: &ModelDescription, seed: u64, speed: f64) -> Vec<Rover> {
    let rover = |lane: usize| {
        let number = |k: usize| random(seed, 1000 * lane + k);
        let mut own = description.clone();
        for (i, solid) in own.solids.iter_mut().enumerate() {
            let factor = 1.0 + 0.3 * number(i);
            solid.mass *= factor;
            for entry in solid.inertia.iter_mut().flatten() {
                *entry *= factor;
            }
        }
        let model = Model::from_description(own).unwrap();
        let mut q = Configuration::zero(&model);
        let turns: Vec<f64> = (0..model.nv()).map(|k| 3.0 * number(100 + k)).collect();
        q.advance(&model, &turns, 1.0);
        Rover {
            q,
            v: (0..model.nv()).map(|k| speed * number(200 + k)).collect(),
            gravity: [number(300), -9.81, number(301)],
            model,
        }
    };
    (0..8).map(rover).collect()
}

/// A random tree on a root with this joint: fixed rotations, axes along and across the frame, mass
/// centres off the axes and principal axes of their own, some of them symmetric bodies; joints of
/// every kind,
/// rotors, and joints that follow another one beside or below it.
fn tree(seed: u64, n: usize, root: JointKind) -> ModelDescription {
    let mut description = ModelDescription::rover();
    let template = description.solids[1].clone();
    description.wheels.clear();
    description.tags.clear();
    description.solids.clear();
    let mut parents: Vec<usize> = Vec::new();
    for i in 0..n {
        let number = |k: usize| random(seed, 10_000 + 100 * i + k);
        let choice = |k: usize, n: usize| ((number(k) + 1.0) * 0.5 * n as f64) as usize % n;
        let three = |k: usize| [number(k), number(k + 1), number(k + 2)];
        let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let [a, b, c] = three(0).map(|x| 0.1 + x.abs());
        let moments = match choice(3, 5) {
            0 => [a, a, b],
            1 => [b, a, a],
            2 => [a, b, a],
            _ => [b + c, a + c, a + b],
        };
        let moments = moments.map(|x| x + 1.0);
        let turn = match choice(4, 2) {
            0 => Matrix3::identity(),
            _ => *Rotation3::new(Vector3::from(three(5))).matrix(),
        };
        let I = turn * Matrix3::from_diagonal(&moments.into()) * turn.transpose();
        let kind = match choice(25, 5) {
            _ if i == 0 => root,
            0 | 1 => JointKind::Revolute,
            2 => JointKind::Prismatic,
            _ => JointKind::Spherical,
        };
        let mut parent = choice(8, i.max(1));
        // One of two follows another joint if it can: a sibling, or one between the base and it.
        let is_own = |j: &usize| {
            let solid: &SolidDescription = &description.solids[*j];
            let kinds = [Some(JointKind::Revolute), Some(JointKind::Prismatic)];
            kinds.contains(&solid.joint) && solid.coupled.is_none()
        };
        let leaders: Vec<usize> = (1..i).filter(is_own).collect();
        let can_follow = matches!(kind, JointKind::Revolute | JointKind::Prismatic);
        let coupled = (can_follow && !leaders.is_empty() && choice(26, 2) == 0).then(|| {
            let leader = leaders[choice(27, leaders.len())];
            let is_below = |mut j: usize| {
                while j > leader {
                    j = parents[j];
                }
                j == leader
            };
            let below: Vec<usize> = (leader..i).filter(|&j| is_below(j)).collect();
            parent = match choice(28, 2) {
                0 => parents[leader],
                _ => below[choice(29, below.len())],
            };
            CouplingDescription {
                joint: format!("solid {leader}"),
                ratio: 2.0 * number(30),
                offset: number(31),
            }
        });
        parents.push(parent);
        let has_axis = can_follow;
        let is_rotor = has_axis && choice(32, 3) == 0;
        description.solids.push(SolidDescription {
            name: format!("solid {i}"),
            parent: (i > 0).then(|| format!("solid {parent}")),
            joint: Some(kind),
            coupled,
            armature: is_rotor.then(|| 0.1 + number(33).abs()),
            position: (kind != JointKind::Free).then(|| three(10)),
            rotation: (kind != JointKind::Free && choice(13, 2) == 0).then(|| three(14)),
            axis: has_axis.then(|| match choice(17, 4) {
                3 => three(18),
                k => unit[k],
            }),
            mass: 1.0 + a,
            centre_of_mass: (choice(21, 2) == 0).then(|| three(22)),
            inertia: Some([
                I[(0, 0)],
                I[(1, 1)],
                I[(2, 2)],
                I[(0, 1)],
                I[(0, 2)],
                I[(1, 2)],
            ]),
            shape: None,
            shapes: Vec::new(),
            collides: false,
            hold: None,
            ..template.clone()
        });
    }
    description
}

/// Joints of the roots of a forest.
const ROOTS: [JointKind; 5] = [
    JointKind::Free,
    JointKind::Fixed,
    JointKind::Revolute,
    JointKind::Prismatic,
    JointKind::Spherical,
];

/// Trees of up to n solids, one after the other.
fn forest(seed: u64, n: usize, roots: &[usize]) -> ModelDescription {
    let mut all = ModelDescription::rover();
    all.wheels.clear();
    all.tags.clear();
    all.solids.clear();
    for (t, &root) in roots.iter().enumerate() {
        let own = tree(seed ^ t as u64, 1 + (n + t) % n, ROOTS[root]);
        let named = |name: String| format!("tree {t} {name}");
        all.solids.extend(own.solids.into_iter().map(|mut solid| {
            solid.name = named(solid.name);
            solid.parent = solid.parent.map(named);
            if let Some(coupled) = &mut solid.coupled {
                coupled.joint = named(coupled.joint.clone());
            }
            solid
        }));
    }
    all
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(40) })]

    #[test]
    fn rovers_agree(seed: u64, speed in prop::sample::select(vec![0.01, 1.0, 20.0])) {
        check(&rovers(&ModelDescription::rover(), seed, speed));
    }

    #[test]
    fn random_trees_agree(seed: u64, n in 1_usize..14, speed in prop::sample::select(vec![0.01, 1.0, 20.0])) {
        check(&rovers(&tree(seed, n, JointKind::Free), seed, speed));
    }

    #[test]
    fn several_trees_on_any_root_agree(
        seed: u64,
        roots in prop::collection::vec(0..ROOTS.len(), 1..5),
        n in 1_usize..6,
    ) {
        check(&rovers(&forest(seed, n, &roots), seed, 3.0));
    }
}

#[test]
fn models_of_the_gallery_agree() {
    for (seed, name) in ModelDescription::names().into_iter().enumerate() {
        let description = ModelDescription::named(name).unwrap();
        check(&rovers(&description, seed as u64, 1.0));
    }
}
