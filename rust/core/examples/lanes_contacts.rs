//! Phases of the contacts over lanes, for counting instructions and for times per rover.
//!
//! `lanes_contacts PHASE GROUND WIDTH REPETITIONS` replays recorded drives with random torques and
//! runs the phases up to the one named; the difference of two runs counted by callgrind, divided by
//! the repetitions and by the width, is the cost of a phase per rover. `lanes_contacts` alone
//! prints times per rover.
#![allow(clippy::print_stdout, clippy::inline_always)]

#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use exploring_scenes::{Ground, STEPS_A_COMMAND, drives};
use rover_core::contact::Activation;
use rover_core::contact::slots::contacts::{ContactSlots, DetectionInput};
use rover_core::contact::slots::ground::BlockGround as LaneGround;
use rover_core::contact::slots::machine::SharedMachine;
use rover_core::contact::slots::rows::ContactMatrices;
use rover_core::geometry::Terrain;
use rover_core::integrator::StepOptions;
use rover_core::multibody::inertias::Inertias;
use rover_core::multibody::lane_configuration::LaneConfiguration;
use rover_core::multibody::poses::Poses;
use rover_core::multibody::{Configuration, Model};
use rover_core::multibody::{Factor, MassMatrix};
#[cfg(target_arch = "x86_64")]
use rover_core::scalar::{Eights, Fours};
use rover_core::scalar::{Instructions, Lane, LaneMask, Single, Vec3};
use rover_core::solver::batch::problem::ContactProblem;

const PHASES: [&str; 4] = ["replay", "detect", "assemble", "problems"];
const STEPS: usize = 400;
const H: f64 = 0.005;

/// States of a drive, one every step of 5 ms.
struct Record {
    terrain: Arc<dyn Terrain>,
    states: Vec<(Configuration, Vec<f64>)>,
}

/// The drives of `tests/comparison/exploring.json` with up to 60 N m, as many as asked for; more
/// than there are begin later in the same drives.
fn records(ground: Ground, n: usize) -> (Arc<Model>, Vec<Record>) {
    let drives = drives(ground, 60.0, &StepOptions::default());
    let model = Arc::clone(drives[0].simulation.model());
    let record = |k: usize| {
        let mut drive = drives[k % drives.len()].clone();
        let mut states = Vec::with_capacity(STEPS);
        let mut command = 10 * (k / drives.len());
        while states.len() < STEPS {
            drive.give(command % drive.n_commands());
            command += 1;
            for _ in 0..STEPS_A_COMMAND {
                drive.simulation.step(1).expect("a common step");
                let simulation = &drive.simulation;
                states.push((simulation.q().clone(), simulation.v().to_vec()));
            }
        }
        Record {
            terrain: Arc::clone(drive.simulation.terrain()),
            states,
        }
    };
    (model, (0..n).map(record).collect())
}

struct Block<T: Lane> {
    token: T::Token,
    machine: SharedMachine,
    ground: LaneGround<T>,
    /// Poses at the midpoint and at the end, and velocity, of every step.
    states: Vec<(Poses<T>, Poses<T>, Vec<T>)>,
    factor: Factor<T>,
    models: Vec<Option<Arc<Model>>>,
    contacts: ContactSlots<T>,
    rows: ContactMatrices<T>,
    q: Vec<[T; 3]>,
    problems: Vec<ContactProblem>,
    fallbacks: u32,
}

impl<T: Lane> Block<T> {
    fn new(token: T::Token, model: &Model, records: &[Record]) -> Self {
        let machine = SharedMachine::of(model);
        let mut inertias = Inertias::new(token, &machine);
        let mut ground = LaneGround::new(token, machine.wheels.len(), machine.boxes.len());
        for lane in 0..T::LANES {
            inertias.set_lane(lane, model.inertias());
            ground.set_lane(lane, &records[lane].terrain);
        }
        let mut states = Vec::with_capacity(STEPS);
        for k in 0..STEPS {
            let mut place = LaneConfiguration::new(token, &machine);
            let mut v = vec![T::splat(token, 0.0); machine.nv()];
            for lane in 0..T::LANES {
                let (q, of_lane) = &records[lane].states[k];
                place.set_lane(lane, q);
                for (v, x) in v.iter_mut().zip(of_lane) {
                    v.set(lane, *x);
                }
            }
            let at = |h: f64| {
                let mut moved = place.clone();
                T::vectorize(
                    token,
                    #[inline(always)]
                    || moved.set_moved(&machine, &place, &v, h),
                );
                let mut poses = Poses::new(token, &machine);
                poses.update(&machine, &inertias, &moved);
                poses
            };
            states.push((at(0.5 * H), at(H), v));
        }
        let mut M = MassMatrix::new(token, &machine);
        M.update(&machine, &inertias, &states[0].0);
        let mut factor = Factor::new(token, &machine);
        assert!(M.factorise(&machine, &mut factor).all());
        let contacts = ContactSlots::new(token, &machine);
        Self {
            token,
            rows: ContactMatrices::new(token, &machine, contacts.n_slots()),
            q: vec![[T::splat(token, 0.0); 3]; contacts.n_slots()],
            machine,
            models: vec![Some(Arc::new(model.clone())); T::LANES],
            ground,
            states,
            factor,
            contacts,
            problems: vec![ContactProblem::default(); T::LANES],
            fallbacks: 0,
        }
    }

    /// The phases up to the one given, at one of the recorded steps.
    fn run(&mut self, k: usize, last: usize) {
        let (middle, end, v) = black_box(&self.states[k % STEPS]);
        if last >= 1 {
            let gravity = Vec3::splat(self.token, [0.0, -9.81, 0.0]);
            let activation = Activation::of_step(gravity, H, 0.5, 0.5 * H);
            let input = DetectionInput {
                machine: &self.machine,
                models: &self.models,
                going: (1 << T::LANES) - 1,
                middle,
                end,
                v,
                needs_pieces: false,
                activation: &activation,
            };
            let fallbacks = self.contacts.detect(&mut self.ground, &input);
            self.fallbacks += fallbacks.bits().count_ones();
        }
        if last >= 2 {
            self.rows
                .assemble((&self.machine, &self.factor), end, &self.contacts, v, None);
        }
        if last >= 3 {
            let mu = vec![T::splat(self.token, 0.7); self.contacts.n_slots()];
            self.rows
                .to_problems(&self.contacts, (&self.q, &mu), &mut self.problems, None);
        }
        black_box(&mut self.problems);
    }

    fn repeat(&mut self, last: usize, n: usize) {
        for k in 0..n {
            self.run(k, last);
        }
    }

    /// Time up to a phase per rover, ns: the best of several runs over a few steps, whose poses
    /// stay in the cache.
    fn time(&mut self, last: usize) -> f64 {
        let (few, times) = (4, 100);
        let run = |first: usize| {
            let start = Instant::now();
            for k in 0..few * times {
                self.run(first + k % few, last);
            }
            start.elapsed().as_secs_f64() * 1e9 / (few * times * T::LANES) as f64
        };
        (0..STEPS).step_by(10).map(run).fold(f64::MAX, f64::min)
    }

    fn times(&mut self) {
        let mut before = 0.0;
        for (last, phase) in PHASES.iter().enumerate() {
            let time = self.time(last);
            println!("  {phase:12} {:7.1}", time - before);
            before = time;
        }
        self.fallbacks = 0;
        let (mut slots, mut contacts) = (0, 0);
        for k in 0..STEPS {
            self.run(k, 1);
            slots += self.contacts.used().len();
            contacts += (0..T::LANES)
                .map(|lane| self.contacts.list(lane).n)
                .sum::<usize>();
        }
        println!(
            "  contacts {:.2}, slots {:.2} a step; {} of {} steps fall back",
            contacts as f64 / (STEPS * T::LANES) as f64,
            slots as f64 / STEPS as f64,
            self.fallbacks,
            STEPS * T::LANES
        );
    }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if let [phase, ground, width, n] = &args[..] {
        let n = n.parse().expect("repetitions");
        let last = PHASES.iter().position(|p| p == phase).expect("a phase");
        let width = width.parse().expect("a width");
        let ground = Ground::of(ground).expect("a ground");
        let (model, records) = records(ground, width);
        match (width, Instructions::of_this_machine()) {
            (1, _) => Block::<f64>::new(Single::best(), &model, &records).repeat(last, n),
            #[cfg(target_arch = "x86_64")]
            (4, Instructions::Avx2(token)) => {
                Block::<Fours>::new(token, &model, &records).repeat(last, n);
            }
            #[cfg(target_arch = "x86_64")]
            (8, Instructions::Avx512(token)) => {
                Block::<Eights>::new(token, &model, &records).repeat(last, n);
            }
            _ => panic!("no {width} lanes on this machine"),
        }
        return;
    }
    for ground in Ground::ALL {
        let (model, records) = records(ground, 8);
        println!("{}, ns per rover: alone", ground.name());
        Block::<f64>::new(Single::best(), &model, &records).times();
        match Instructions::of_this_machine() {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512(token) => {
                println!("{}, ns per rover: eight lanes", ground.name());
                Block::<Eights>::new(token, &model, &records).times();
            }
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2(token) => {
                println!("{}, ns per rover: four lanes", ground.name());
                Block::<Fours>::new(token, &model, &records).times();
            }
            Instructions::Baseline => {}
        }
    }
}
