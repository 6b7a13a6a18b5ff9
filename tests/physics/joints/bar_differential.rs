//! A rocker-bogie whose differential is a bar with two rods, beside one whose rockers are coupled.

use rover_core::geometry::{Plane, SphereField};
use rover_core::integrator::Variant;
use rover_core::multibody::{Model, ModelDescription};
use rover_core::simulation::RoverSimulation;
use std::sync::Arc;

use super::machines::{joint, standing};
use crate::rover_kinds::with_a_bar;
use crate::shared::{VARIANTS, moving, stepping};

fn on_stones(description: ModelDescription, variant: Variant) -> RoverSimulation {
    let model = Model::from_description(description).unwrap();
    let q = standing(&model);
    let centres = [[0.6, -0.12, -0.2], [1.1, -0.13, 0.2], [1.6, -0.1, -0.15]];
    let stones = SphereField::new(&centres, &[0.16; 3], Some(Plane::ground())).unwrap();
    let v = vec![0.0; model.nv()];
    let mut run = moving(model, Arc::new(stones), stepping(variant, 5e-3), q, v);
    let torques = vec![0.9; run.model().wheels().len()];
    run.set_wheel_torques(&torques).unwrap();
    run
}

/// Both climb the stones in the same way; the bar and its rods weigh 3 g.
#[test]
fn a_bar_differential_drives_as_coupled_rockers() {
    for variant in VARIANTS {
        let mut bar = on_stones(with_a_bar(), variant);
        let mut coupled = on_stones(ModelDescription::named("open-rover").unwrap(), variant);
        let mut steepest = 0.0_f64;
        let mut farthest = 0.0_f64;
        for _ in 0..400 {
            let report = bar.step(1).unwrap();
            assert!(
                report.is_converged() && report.loop_gap < 1e-12,
                "{variant:?} {report:?}"
            );
            coupled.step(1).unwrap();
            let [left, right] = ["left_rocker", "right_rocker"].map(|name| joint(&bar, name));
            assert!((left + right).abs() < 1e-11, "{variant:?}: {left} {right}");
            steepest = steepest.max(left.abs());
            farthest = farthest.max((left - joint(&coupled, "left_rocker")).abs());
        }
        let way = (bar.q().position - coupled.q().position).norm();
        assert!(steepest > 0.03, "{variant:?}: {steepest}");
        assert!(farthest < 1e-5, "{variant:?}: {farthest}");
        assert!(way < 1e-5, "{variant:?}: {way}");
    }
}
