//! Loose boxes dropped in a heap, 2 ms a step:
//! `cargo run --release --example heap_steps -- [boxes along a side] [steps] [seed]`.
//!
//! Prints every unsolved step, then their number and the time of all steps.
#![allow(clippy::print_stdout, clippy::unwrap_used)] // its purpose

#[path = "../../../tests/physics/contacts/heap_scenes.rs"]
#[allow(missing_docs)]
mod heap_scenes;

use std::time::Instant;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, usual: u64| {
        let given = arguments.get(k);
        given.map_or(usual, |text| text.parse().expect("a number"))
    };
    let (side, steps, seed) = (number(0, 3), number(1, 200), number(2, 1));
    let mut simulation = heap_scenes::heap_of_boxes(usize::try_from(side).expect("few"), seed);
    let begin = Instant::now();
    let (mut unsolved, mut most) = (0, 0);
    for step in 0..steps {
        let report = simulation.step(1).expect("a sound state");
        most = most.max(report.n_contacts);
        if !report.is_converged() {
            unsolved += 1;
            println!(
                "step {step}: {} contacts, residual {:.1e}, {} iterations{}",
                report.n_contacts,
                report.residual,
                report.iterations,
                if report.budget_exhausted {
                    ", budget spent"
                } else {
                    ""
                },
            );
        }
    }
    println!(
        "{unsolved} of {steps} steps unsolved; at most {most} contacts; {:.1} s",
        begin.elapsed().as_secs_f64()
    );
}
