#![allow(missing_docs, clippy::print_stdout, clippy::unwrap_used, clippy::pedantic)]
#[path = "/work/wt-contacts/tests/physics/exploring_scenes.rs"]
#[allow(missing_docs)]
mod exploring_scenes;
use exploring_scenes::{Ground, STEPS_A_COMMAND, drives};
use rover_core::integrator::{StepOptions, moreau_jean::MoreauJean};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let ground = Ground::of(&args[1]).unwrap();
    let torque: f64 = args[2].parse().unwrap();
    let n: usize = args[3].parse().unwrap();
    let general = args.get(4).is_some();
    let d = drives(ground, torque, &StepOptions::default());
    let mut hist = [0usize; 12];
    let (mut total, mut steps, mut piv) = (0, 0, 0);
    for d in d.into_iter().take(n) {
        let mut d = d;
        for c in 0..d.n_commands() {
            d.give(c);
            for _ in 0..STEPS_A_COMMAND {
                let r = if general { d.simulation.step_with(&MoreauJean, 1).unwrap() } else { d.simulation.step(1).unwrap() };
                hist[r.iterations.min(11)] += 1; total += r.iterations; steps += 1; piv += r.pivots;
                if !general && std::env::var("V").is_ok() { println!("STEP {} iters {} res {:e} lifted {:e}", steps, r.iterations, r.residual, r.energy_lifted); }
            }
        }
    }
    println!("{} general {} mean {} pivots {} {:?}", args[1], general, total as f64 / steps as f64, piv as f64/steps as f64, hist);
}
