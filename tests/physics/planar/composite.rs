//! Two machines as one system.

use std::sync::Arc;

use nalgebra::{SVector, Vector2, Vector3};
use rover_core::contact::Activation;
use rover_core::integrator::{
    Integrator, MechanicalSystem, NoProbe, Scratch, StateMut, StepOptions, UnilateralContact,
    WarmStart,
};
use rover_core::planar::{
    Ball, ContactRule, Ground, Line, PlanarMachine, PlanarWheel, Sine, TwoWheelRover,
};
use rover_core::problem::Operator;
use rover_core::simulation::PlanarSimulation;
use rover_core::system::{
    Apart, Composite, CompositeParts, Coupling, PlanarContact, PlanarScratch, PlanarSystem,
};

use super::scenes::{G, VARIANTS, level, options};

type Pair<const N: usize, const P: usize> = (SVector<f64, N>, SVector<f64, P>);
type Both<'s, 'a> = (&'s PlanarSystem<'a, 3, Ball>, &'s PlanarSystem<'a, 3, Ball>);

/// A machine on a ground under constant torques.
struct Driven<const NV: usize, M> {
    machine: M,
    ground: Arc<dyn Ground>,
    inputs: Vec<f64>,
    parts: PlanarScratch<NV>,
}

impl<const NV: usize, M: PlanarMachine<NV>> Driven<NV, M> {
    fn new(machine: M, ground: impl Ground + 'static, inputs: &[f64]) -> Self {
        Self {
            machine,
            ground: Arc::new(ground),
            inputs: inputs.to_vec(),
            parts: PlanarScratch::default(),
        }
    }

    fn system(&mut self) -> PlanarSystem<'_, NV, M> {
        PlanarSystem {
            machine: &self.machine,
            ground: &*self.ground,
            rule: ContactRule::Nearest,
            inputs: &self.inputs,
            parts: &mut self.parts,
        }
    }

    /// Coordinates and rates after n steps alone.
    fn alone(
        &self,
        q: &SVector<f64, NV>,
        v: &[f64],
        options: &StepOptions,
        n: usize,
    ) -> (SVector<f64, NV>, Vec<f64>)
    where
        M: Clone,
    {
        let (machine, ground) = (self.machine.clone(), self.ground.clone());
        let mut simulation =
            PlanarSimulation::new(machine, ground, ContactRule::Nearest, options.clone()).unwrap();
        simulation.set_state(q.as_slice(), v).unwrap();
        simulation.set_inputs(&self.inputs).unwrap();
        simulation.step(n).unwrap();
        (*simulation.q(), simulation.v().to_vec())
    }
}

/// Moves two machines as one system; asks after each step that its solve converged.
fn together<'a, const N: usize, const P: usize, A, B, K>(
    (first, second): (&'a mut Driven<N, A>, &'a mut Driven<P, B>),
    coupling: K,
    (q, v): (&mut Pair<N, P>, &mut [f64]),
    options: &StepOptions,
    n: usize,
) where
    A: PlanarMachine<N>,
    B: PlanarMachine<P>,
    K: Coupling<PlanarSystem<'a, N, A>, PlanarSystem<'a, P, B>>,
{
    let mut parts = CompositeParts::default();
    let mut system = Composite {
        first: first.system(),
        second: second.system(),
        coupling,
        parts: &mut parts,
    };
    let (mut warm_start, mut scratch) = (WarmStart::default(), Scratch::new(&*q, N + P, 8, 2));
    let mut time = 0.0;
    for _ in 0..n {
        let state = StateMut {
            configuration: &mut *q,
            v: &mut *v,
            time: &mut time,
        };
        let report = options.variant.step(
            &mut system,
            options,
            state,
            &mut warm_start,
            &mut scratch,
            &mut NoProbe,
        );
        assert!(report.unwrap().is_converged());
    }
}

fn disc() -> Ball {
    Ball::new(2.0, 0.3, 0.09).unwrap()
}

#[test]
fn two_balls_apart_move_as_each_alone() {
    for variant in VARIANTS {
        let options = StepOptions {
            variant,
            ..options(G, 0.5, 0.6, 2e-3)
        };
        // One rolls down a slope, the other slides on level ground.
        let mut first = Driven::new(disc(), Line::new(-0.2, 0.0).unwrap(), &[0.3]);
        let mut second = Driven::new(Ball::new(5.0, 0.2, 0.1).unwrap(), level(), &[0.0]);
        let normal = Vector2::new(0.2, 1.0).normalize();
        let (q_a, v_a) = ((normal * 0.3).push(0.0), [0.0; 3]);
        let (q_b, v_b) = (Vector3::new(1.0, 0.2, 0.0), [3.0, 0.0, 2.0]);
        let expected = (
            first.alone(&q_a, &v_a, &options, 500),
            second.alone(&q_b, &v_b, &options, 500),
        );
        let (mut q, mut v) = ((q_a, q_b), [v_a, v_b].concat());
        let both = (&mut first, &mut second);
        together(both, Apart, (&mut q, &mut v), &options, 500);
        assert!((q.0 - expected.0.0).amax() < 1e-12);
        assert!((q.1 - expected.1.0).amax() < 1e-12);
        let alone = [expected.0.1, expected.1.1].concat();
        assert!(
            v.iter()
                .zip(alone)
                .all(|(v, alone)| (v - alone).abs() < 1e-11)
        );
    }
}

#[test]
fn machines_of_two_kinds_move_as_each_alone() {
    let options = options(G, 0.6, 0.0, 5e-3);
    let wheel = |x: f64| PlanarWheel {
        mass: 5.0,
        radius: 0.2,
        inertia: 0.1,
        axle: Vector2::new(x, -0.1),
    };
    let rover = TwoWheelRover::new(40.0, 4.0, wheel(-0.4), wheel(0.4)).unwrap();
    let mut first = Driven::new(rover, Sine::new(0.1, 1.5, 0.0, 0.0).unwrap(), &[8.0, 8.0]);
    let mut second = Driven::new(disc(), level(), &[0.2]);
    let mut q_a = SVector::<f64, 5>::zeros();
    q_a.y = 0.5;
    let (q_b, rest) = (Vector3::new(3.0, 0.3, 0.0), [0.0; 5]);
    let alone = first.alone(&q_a, &rest, &options, 300);
    let ball = second.alone(&q_b, &rest[..3], &options, 300);
    let (mut q, mut v) = ((q_a, q_b), vec![0.0; 8]);
    let both = (&mut first, &mut second);
    together(both, Apart, (&mut q, &mut v), &options, 300);
    assert!(q.0.x > 0.3, "drives: {}", q.0.x);
    // Both systems share the record of persistent impulses: when one lands, the other is of order 1
    // for a step.
    assert!((q.0 - alone.0).amax() < 1e-3, "{} {}", q.0, alone.0);
    assert!((q.1 - ball.0).amax() < 1e-3, "{} {}", q.1, ball.0);
}

/// Two balls that collide.
struct Meeting {
    radii: [f64; 2],
    /// Where they are, in the middle and at the end of the step.
    middle: Pair<3, 3>,
    end: Pair<3, 3>,
    /// Rows of Hᵀ and of Zᵀ of their contact (2 × 3), of each ball.
    H: [[f64; 6]; 2],
    Z: [[f64; 6]; 2],
}

/// Their contact.
#[derive(Clone)]
struct Touch {
    n: Vector2<f64>,
    gap: f64,
}

impl UnilateralContact for Touch {
    type Key = ();

    fn key(&self) {}

    fn gap(&self) -> f64 {
        self.gap
    }
}

/// `out += Hᵀ v` of one ball.
fn add_rows(rows: &[f64; 6], v: &[f64], out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(rows.chunks_exact(3)) {
        *out += row.iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
    }
}

/// `out += H p` of one ball.
fn add_columns(rows: &[f64; 6], p: &[f64], out: &mut [f64]) {
    for (p, row) in p.iter().zip(rows.chunks_exact(3)) {
        for (out, entry) in out.iter_mut().zip(row) {
            *out += entry * p;
        }
    }
}

impl Meeting {
    fn new(radii: [f64; 2]) -> Self {
        Self {
            radii,
            middle: Pair::default(),
            end: Pair::default(),
            H: [[0.0; 6]; 2],
            Z: [[0.0; 6]; 2],
        }
    }

    fn touch(&self, (a, b): &Pair<3, 3>) -> Touch {
        let between = a.xy() - b.xy();
        let distance = between.norm();
        Touch {
            n: between / distance,
            gap: distance - self.radii[0] - self.radii[1],
        }
    }
}

impl<'a> Coupling<PlanarSystem<'a, 3, Ball>, PlanarSystem<'a, 3, Ball>> for Meeting {
    type Contact = Touch;

    fn place_middle(&mut self, q: (&Vector3<f64>, &Vector3<f64>)) {
        self.middle = (*q.0, *q.1);
    }

    fn place_end(&mut self, q: (&Vector3<f64>, &Vector3<f64>)) {
        self.end = (*q.0, *q.1);
    }

    fn detect(
        &mut self,
        _systems: Both<'_, 'a>,
        (v_a, v_b): (&[f64], &[f64]),
        activation: Activation,
        out: &mut Vec<Touch>,
    ) {
        let touch = self.touch(&self.middle);
        let u = Vector2::new(v_a[0] - v_b[0], v_a[1] - v_b[1]);
        if activation.admits(touch.gap, || touch.n.dot(&u)) {
            out.push(touch);
        }
    }

    fn relocate(&mut self, _systems: Both<'_, 'a>, contacts: &mut [Touch]) {
        for contact in contacts {
            *contact = self.touch(&self.end);
        }
    }

    fn assemble(
        &mut self,
        (first, second): (&mut PlanarSystem<'a, 3, Ball>, &PlanarSystem<'a, 3, Ball>),
        _of_second: &[PlanarContact],
        contacts: &[Touch],
        v: (&[f64], &[f64]),
        u: &mut [f64],
    ) {
        let [Touch { n, .. }] = contacts else {
            return;
        };
        let [a, b] = self.radii;
        self.H = [
            [n.x, n.y, 0.0, n.y, -n.x, a],
            [-n.x, -n.y, 0.0, -n.y, n.x, b],
        ];
        self.Z = self.H;
        for row in self.Z[0].chunks_exact_mut(3) {
            first.half_solve(row);
        }
        for row in self.Z[1].chunks_exact_mut(3) {
            second.half_solve(row);
        }
        u.fill(0.0);
        add_rows(&self.H[0], v.0, u);
        add_rows(&self.H[1], v.1, u);
    }

    fn local(&self, _systems: Both<'_, 'a>, y: (&[f64], &[f64]), out: &mut [f64]) {
        out.fill(0.0);
        add_rows(&self.Z[0], y.0, out);
        add_rows(&self.Z[1], y.1, out);
    }

    fn add_local_of_velocity(
        &self,
        _systems: Both<'_, 'a>,
        _contacts: &[Touch],
        v: (&[f64], &[f64]),
        out: &mut [f64],
    ) {
        add_rows(&self.H[0], v.0, out);
        add_rows(&self.H[1], v.1, out);
    }

    fn add_impulses(&self, _systems: Both<'_, 'a>, p: &[f64], y: (&mut [f64], &mut [f64])) {
        add_columns(&self.Z[0], p, y.0);
        add_columns(&self.Z[1], p, y.1);
    }

    fn add_generalized_impulse(
        &self,
        _systems: Both<'_, 'a>,
        _contacts: &[Touch],
        p: &[f64],
        out: (&mut [f64], &mut [f64]),
    ) {
        add_columns(&self.H[0], p, out.0);
        add_columns(&self.H[1], p, out.1);
    }
}

/// Two balls in flight without gravity that meet with an offset; their velocities afterwards.
fn collision(offset: f64, friction: f64, restitution: f64) -> (Pair<3, 3>, Vec<f64>) {
    let options = options(0.0, friction, restitution, 1e-3);
    let mut first = Driven::new(disc(), level(), &[0.0]);
    let mut second = Driven::new(disc(), level(), &[0.0]);
    let mut q = (
        Vector3::new(0.0, 5.0, 0.0),
        Vector3::new(0.7, 5.0 + offset, 0.0),
    );
    let mut v = vec![2.0, 0.0, 1.0, -1.0, 0.0, 0.0];
    let coupling = Meeting::new([0.3; 2]);
    let both = (&mut first, &mut second);
    together(both, coupling, (&mut q, &mut v), &options, 200);
    (q, v)
}

#[test]
fn equal_balls_that_meet_head_on_exchange_their_velocities() {
    let (q, v) = collision(0.0, 0.0, 1.0);
    let expected = [-1.0, 0.0, 1.0, 2.0, 0.0, 0.0];
    for (v, expected) in v.iter().zip(expected) {
        assert!((v - expected).abs() < 1e-12, "{v} {expected}");
    }
    assert!(q.1.x - q.0.x > 0.6, "apart again");
}

#[test]
fn a_rough_blow_keeps_the_momenta_and_loses_energy() {
    let (_, v) = collision(0.25, 0.8, 0.3);
    assert!((v[0] + v[3] - 1.0).abs() < 1e-12, "along x");
    assert!((v[1] + v[4]).abs() < 1e-12, "along y");
    assert!(v[5].abs() > 0.1, "friction turns the other");
    // 2 kg each, 0.09 kg m² about the centre.
    let kinetic = |v: &[f64]| v[0] * v[0] + v[1] * v[1] + 0.045 * v[2] * v[2];
    assert!(kinetic(&v[..3]) + kinetic(&v[3..]) < 5.045);
    // Equal radii feel equal moments of the same sense: the change of spin is shared alike.
    assert!((v[2] - 1.0 - v[5]).abs() < 1e-12, "{} {}", v[2], v[5]);
}

#[test]
fn the_operator_between_is_the_sum_of_both_mobilities() {
    let options = options(0.0, 0.5, 0.0, 1e-3);
    let mut first = Driven::new(disc(), level(), &[0.0]);
    let mut second = Driven::new(Ball::new(5.0, 0.2, 0.1).unwrap(), level(), &[0.0]);
    let coupling = Meeting::new([0.3, 0.2]);
    let mut parts = CompositeParts::default();
    let mut system = Composite {
        first: first.system(),
        second: second.system(),
        coupling,
        parts: &mut parts,
    };
    // The first also rests on the ground.
    let q = (Vector3::new(0.0, 0.3, 0.0), Vector3::new(0.3, 0.7, 0.0));
    system.place_middle(&q);
    system.place_end(&q);
    let (v, mut contacts) = (vec![0.0; 6], Vec::new());
    system.detect(&v, Activation::default(), &mut contacts);
    assert_eq!(contacts.len(), 2);
    system.update_mass_matrix(&options);
    assert!(system.factorise(&options));
    let mut u = [0.0; 4];
    system.assemble(&contacts, &v, &mut u);
    let mu = [0.5; 2];
    let problem = system.problem(&u, &mu);
    let Operator::Dense(W) = problem.operator() else {
        panic!("a dense operator");
    };
    // 1/m + 1/m, and r²/J beside it along the tangent; the ground's contact
    // and theirs share the first ball.
    let n = Vector2::new(-0.6, -0.8);
    let spin = [0.3 * 0.3 / 0.09, 0.2 * 0.2 / 0.1];
    let expected = [
        [0.5, 0.0, 0.5 * n.y, -0.5 * n.x],
        [0.0, 0.5 + spin[0], 0.5 * n.x, 0.5 * n.y + spin[0]],
        [0.5 * n.y, 0.5 * n.x, 0.7, 0.0],
        [
            -0.5 * n.x,
            0.5 * n.y + spin[0],
            0.0,
            0.7 + spin[0] + spin[1],
        ],
    ];
    for (i, row) in expected.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let found = W[4 * i + j];
            assert!((found - entry).abs() < 1e-12, "{i} {j}: {found} {entry}");
        }
    }
}
