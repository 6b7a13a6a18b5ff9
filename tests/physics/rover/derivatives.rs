//! Steps on firm ground with their derivatives.

use std::sync::Arc;

use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::Model;
use rover_core::scalar::Instructions;
use rover_core::simulation::{Differentiator, RoverSimulation, StepParameter, Trajectory};

#[test]
fn derivatives_have_the_same_bits_with_any_instructions() {
    let model = Arc::new(Model::rover());
    let ground = Arc::new(Plane::ground());
    let sim = RoverSimulation::new(model, ground, StepOptions::default()).unwrap();
    let mut state = vec![0.0; 42];
    (state[1], state[21], state[25]) = (0.35, 0.5, 0.2);
    let commands: Vec<f64> = (0..36).map(|k| 0.3 * f64::from(k).sin()).collect();
    let parameters = [StepParameter::Friction, StepParameter::Mass(0)];
    let take = |instructions| {
        let mut differentiator = Differentiator::with(&sim, instructions).unwrap();
        let go_on = &mut || true;
        let found = differentiator.trajectory(&state, (3, &commands), &parameters, go_on);
        let Trajectory { states, a, b, c } = found.unwrap();
        let numbers = [states, a, b, c].concat();
        numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    };
    let alone = take(Instructions::Baseline);
    assert!(alone.len() > 3 * 42 * 42);
    assert_eq!(alone, take(Instructions::of_this_machine()));
}
