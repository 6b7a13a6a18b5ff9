//! Steps in sand with their derivatives.

use rover_core::scalar::Instructions;
use rover_core::simulation::{Differentiator, StepParameter, Trajectory};

use super::sand_scenes::{bekker_sand, dry_sand, placed, wide};

#[test]
fn derivatives_in_sand_have_the_same_bits_with_any_instructions() {
    for soil in [dry_sand(), bekker_sand()] {
        let model = wide("open-rover", 0.08, 1.0);
        let mut sim = placed(&model, soil, 0.05, 0.005);
        sim.set_wheel_torques(&[0.6; 6]).unwrap();
        sim.step(60).unwrap();
        let ground = sim.terrain().soft().unwrap().soil.clone();
        let named = |name| StepParameter::named(&model, Some(&ground), name).unwrap();
        let parameters = [named("soil:internal_friction"), named("soil:memory")];
        let commands = [[0.6; 6], [0.0; 6]].concat().repeat(3);
        let take = |instructions| {
            let mut differentiator = Differentiator::with(&sim, instructions).unwrap();
            let state = differentiator.state_of(&sim);
            assert_eq!(state.len(), 2 * model.nv() + 7 * model.wheels().len());
            let go_on = &mut || true;
            let found = differentiator.trajectory(&state, (3, &commands), &parameters, go_on);
            let Trajectory { states, a, b, c } = found.unwrap();
            assert!(c.iter().any(|x| *x != 0.0));
            let numbers = [states, a, b, c].concat();
            numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        let alone = take(Instructions::Baseline);
        assert_eq!(alone, take(Instructions::of_this_machine()));
    }
}
