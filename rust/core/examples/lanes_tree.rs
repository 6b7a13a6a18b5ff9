//! Phases of the tree dynamics over lanes, for counting instructions and for times per rover.
//!
//! `lanes_tree PHASE WIDTH REPETITIONS` runs one phase on the built-in rover; the difference of two
//! runs counted by callgrind, divided by the difference of their repetitions and by the width, is
//! the cost per rover. `lanes_tree` alone prints times per rover.
#![allow(clippy::print_stdout, clippy::inline_always)]

use std::hint::black_box;
use std::time::Instant;

use rover_core::contact::slots::machine::SharedMachine;
use rover_core::multibody::bias::{BiasScratch, bias};
use rover_core::multibody::energy::{EnergyScratch, energy};
use rover_core::multibody::inertias::Inertias;
use rover_core::multibody::lane_configuration::LaneConfiguration;
use rover_core::multibody::poses::Poses;
use rover_core::multibody::{Configuration, Model};
use rover_core::multibody::{Factor, MassMatrix};
#[cfg(target_arch = "x86_64")]
use rover_core::scalar::{Eights, Fours};
use rover_core::scalar::{Instructions, Lane, Single, Vec3};

const PHASES: [&str; 7] = [
    "move",
    "poses",
    "mass matrix",
    "factor",
    "bias",
    "solves",
    "energy",
];

struct Block<T: Lane> {
    token: T::Token,
    machine: SharedMachine,
    inertias: Inertias<T>,
    start: LaneConfiguration<T>,
    place: LaneConfiguration<T>,
    v: Vec<T>,
    gravity: Vec3<T>,
    poses: Poses<T>,
    M: MassMatrix<T>,
    factor: Factor<T>,
    bias_scratch: BiasScratch<T>,
    load: Vec<T>,
    energy_scratch: EnergyScratch<T>,
}

impl<T: Lane> Block<T> {
    fn new(token: T::Token, model: &Model) -> Self {
        let machine = SharedMachine::of(model);
        let mut block = Self {
            token,
            inertias: Inertias::new(token, &machine),
            start: LaneConfiguration::new(token, &machine),
            place: LaneConfiguration::new(token, &machine),
            v: vec![T::splat(token, 0.0); machine.nv()],
            gravity: Vec3::splat(token, [0.0, -9.81, 0.0]),
            poses: Poses::new(token, &machine),
            M: MassMatrix::new(token, &machine),
            factor: Factor::new(token, &machine),
            bias_scratch: BiasScratch::new(token, &machine),
            load: vec![T::splat(token, 0.0); machine.nv()],
            energy_scratch: EnergyScratch::new(token, &machine),
            machine,
        };
        for lane in 0..T::LANES {
            let number = |k: usize| (1.7 * (k + 30 * lane) as f64).sin();
            let mut q = Configuration::zero(model);
            let turns: Vec<f64> = (0..model.nv()).map(number).collect();
            q.advance(model, &turns, 0.3);
            block.inertias.set_lane(lane, model.inertias());
            block.start.set_lane(lane, &q);
            for k in 0..model.nv() {
                block.v[k].set(lane, number(k + 7));
            }
        }
        for phase in PHASES {
            block.run(phase);
        }
        block
    }

    fn run(&mut self, phase: &str) {
        let Self {
            machine, inertias, ..
        } = self;
        match phase {
            "move" => T::vectorize(
                self.token,
                #[inline(always)]
                || {
                    self.place.set_moved(machine, &self.start, &self.v, 0.0025);
                },
            ),
            "poses" => self.poses.update(machine, inertias, &self.place),
            "mass matrix" => self.M.update(machine, inertias, &self.poses),
            "factor" => {
                black_box(self.M.factorise_in_place(machine, &mut self.factor));
            }
            "bias" => bias(
                machine,
                inertias,
                &self.poses,
                &self.v,
                self.gravity,
                &mut self.bias_scratch,
                &mut self.load,
            ),
            "solves" => T::vectorize(
                self.token,
                #[inline(always)]
                || {
                    self.factor.half_solve(machine, &mut self.load);
                    self.factor.half_solve_back(machine, &mut self.load);
                },
            ),
            "energy" => {
                black_box(energy(
                    machine,
                    inertias,
                    &self.place,
                    &self.v,
                    self.gravity,
                    &mut self.energy_scratch,
                ));
            }
            _ => panic!("phases: {PHASES:?}"),
        }
        black_box(self);
    }

    fn repeat(&mut self, phase: &str, n: usize) {
        for _ in 0..n {
            self.run(phase);
        }
    }

    /// Repeats a phase between two lines of output, by which a tracer finds it.
    fn announce(&mut self, phase: &str, n: usize) {
        println!("{phase}, {n} times");
        self.repeat(phase, n);
        println!("done");
    }

    /// Time of a phase per rover, ns: the best of several runs.
    fn time(&mut self, phase: &str) -> f64 {
        let n = 2000;
        let run = |_| {
            let start = Instant::now();
            self.repeat(phase, n);
            start.elapsed().as_secs_f64() * 1e9 / (n * T::LANES) as f64
        };
        (0..20).map(run).fold(f64::MAX, f64::min)
    }
}

fn main() {
    let model = Model::rover();
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let [phase, width, n] = &args[..] {
        let n = n.parse().expect("repetitions");
        match (&width[..], Instructions::of_this_machine()) {
            ("1", _) => Block::<f64>::new(Single::best(), &model).announce(phase, n),
            #[cfg(target_arch = "x86_64")]
            ("4", Instructions::Avx2(token)) => {
                Block::<Fours>::new(token, &model).announce(phase, n);
            }
            #[cfg(target_arch = "x86_64")]
            ("8", Instructions::Avx512(token)) => {
                Block::<Eights>::new(token, &model).announce(phase, n);
            }
            _ => panic!("no {width} lanes on this machine"),
        }
        return;
    }
    let mut single = Block::<f64>::new(Single::best(), &model);
    println!("ns per rover   alone   lanes");
    macro_rules! table {
        ($vector:ident, $token:expr) => {{
            let mut block = Block::<$vector>::new($token, &model);
            for phase in PHASES {
                let (alone, lanes) = (single.time(phase), block.time(phase));
                println!("{phase:12} {alone:7.1} {lanes:7.1}");
            }
        }};
    }
    match Instructions::of_this_machine() {
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(token) => table!(Eights, token),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(token) => table!(Fours, token),
        Instructions::Baseline => {
            for phase in PHASES {
                println!("{phase:12} {:7.1}", single.time(phase));
            }
        }
    }
}
