//! Measures every scheme and prints a table; with a path, writes the curves there as JSON.
//!
//! Run: `cargo run --release -p rover-comparison --bin orders -- runs/orders.json`
//! (or `make orders`, which draws them too).

#![allow(clippy::print_stdout)] // it prints a table

use std::error::Error;

use rover_comparison::SCHEMES;
use rover_comparison::measure::{SchemeMeasurement, accumulation, measure};

fn number(x: Option<f64>) -> String {
    x.map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"))
}

fn power(x: Option<f64>) -> String {
    x.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}"))
}

fn print_row(m: &SchemeMeasurement) {
    print!("{:<40}", m.name);
    for order in m.orders {
        print!("{:>9}", number(order));
    }
    let e = m.energy;
    for x in [e.elastic, e.growth, e.rest, e.rolling, m.creep] {
        print!("{:>10}", power(x));
    }
    let is_converged = m.is_converged.map_or("-", |x| if x { "yes" } else { "no" });
    println!(
        "{:>9}{:>7}{is_converged:>6}",
        number(m.cost),
        number(m.iterations)
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{:<40}{:>9}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>10}{:>10}{:>10}{:>10}{:>9}{:>7}{:>6}",
        "order in",
        "flight",
        "rolling",
        "sliding",
        "driving",
        "impacts",
        "gap",
        "elastic",
        "growth",
        "rest",
        "valley",
        "creep",
        "us/step",
        "iter",
        "conv"
    );
    let mut all = Vec::new();
    for scheme in &SCHEMES {
        let measured = measure(scheme)?;
        print_row(&measured);
        all.push(measured);
    }
    let accumulates = accumulation(0.5, 2.0)?;
    println!("event-driven, ball from 1 m with e = 0.5: stops at {accumulates:?} s of 1.354571 s");
    if let Some(path) = std::env::args().nth(1) {
        let document = serde_json::json!({
            "schemes": all,
            "accumulation": accumulates,
            "duration": rover_comparison::measure::DURATION,
        });
        if let Some(folder) = std::path::Path::new(&path).parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(&path, serde_json::to_string_pretty(&document)?)?;
    }
    Ok(())
}
