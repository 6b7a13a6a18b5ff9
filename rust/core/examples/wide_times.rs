#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used, clippy::pedantic)]
#[path = "../../../tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;
use std::time::Instant;
use exploring_scenes::{Ground, STEPS_A_COMMAND, drives};
use rover_core::integrator::{Phase, Probe, StepOptions};
use rover_core::simulation::Batch;
struct Begun(usize);
impl Probe for Begun {
    fn end(&mut self, phase: Phase) { self.0 += usize::from(phase == Phase::Kinematics); }
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let torque: f64 = args[1].parse().unwrap();
    let only = args.get(2);
    for ground in Ground::ALL {
        if only.is_some_and(|o| !ground.name().contains(o.as_str())) { continue; }
        let drives = drives(ground, torque, &StepOptions::default());
        let (mut best, mut steps) = (f64::INFINITY, 0);
        for _ in 0..5 {
            let mut all = drives.clone();
            let t = Instant::now();
            steps = all.iter_mut().map(|d| d.play().unwrap().steps).sum();
            best = best.min(t.elapsed().as_secs_f64());
        }
        let (mut general, mut iters, mut bad, mut n_contacts, mut most) = (0, 0, 0, 0, 0);
        let mut hist = [0usize; 12];
        for d in &drives {
            let mut d = d.clone();
            for c in 0..d.n_commands() {
                d.give(c);
                for _ in 0..STEPS_A_COMMAND {
                    let mut b = Begun(0);
                    let r = d.simulation.step_probed(1, &mut b).unwrap();
                    general += usize::from(b.0 > 1);
                    iters += r.iterations; n_contacts += r.n_contacts; most = most.max(r.iterations);
                    hist[r.iterations.min(11)] += 1;
                    bad += usize::from(!r.is_converged());
                }
            }
        }
        const N: usize = 64;
        let mut batch_best = f64::INFINITY;
        for _ in 0..3 {
            let rovers: Vec<_> = (0..N).map(|i| drives[i % drives.len()].simulation.clone()).collect();
            let mut batch = Batch::new(rovers, Vec::new(), Some(1)).unwrap();
            let mut rows = vec![0.0; N * batch.layout().size()];
            let n = drives[0].n_commands();
            let mut s = 0.0;
            for c in 0..n {
                let (mut tq, mut st) = (Vec::new(), Vec::new());
                for i in 0..N {
                    let (a, b) = drives[i % drives.len()].command((c + 13 * (i / drives.len())) % n);
                    tq.extend(a); st.extend(b);
                }
                let t = Instant::now();
                batch.step(&tq, &st, STEPS_A_COMMAND, None, &mut rows).unwrap();
                s += t.elapsed().as_secs_f64();
            }
            batch_best = batch_best.min(s / (N * n * STEPS_A_COMMAND) as f64);
        }
        println!("{:<22} alone {:6.2} batch {:6.2} us; general {:5.2}% iters {:5.2} most {} contacts {:5.2} notconv {} of {} {:?}", ground.name(), 1e6*best/steps as f64, 1e6*batch_best, 100.0*general as f64/steps as f64, iters as f64/steps as f64, most, n_contacts as f64/steps as f64, bad, steps, hist);
    }
}
