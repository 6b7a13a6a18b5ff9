//! An arm that folds down onto its own chassis comes to rest there.

use rover_core::contact::Part;

use super::contact_scenes::{at_rest, folding, overlap, tips};
use crate::shared::{VARIANTS, step_without_gain};

#[test]
fn a_folded_arm_rests_on_the_chassis() {
    for variant in VARIANTS {
        for (tip, half_height) in tips() {
            let mut simulation = at_rest(folding(tip), 0.1, &[0.1, 0.2, -0.1], variant);
            let mut deepest = 0.0_f64;
            for _ in 0..600 {
                // Only gravity does work here, and contacts only dissipate.
                step_without_gain(&mut simulation, 1e-6);
                deepest = deepest.min(overlap(&simulation));
            }
            // A step detects a contact half a step after it has closed, and the next removes the
            // penetration.
            assert!(deepest > -1.5e-2, "{tip}: {deepest}");
            assert!(overlap(&simulation) > -1e-7, "{tip}");
            let energy = simulation.energy();
            assert!(energy.kinetic < 1e-4, "{tip} {variant:?}: {energy:?}");
            // The tip lies on the chassis: its centre is its own height over the chassis' top.
            let kinematics = simulation.kinematics();
            let height = kinematics.r(3).dot(&kinematics.R(0).column(1));
            assert!((height - 0.1 - half_height).abs() < 1e-3, "{tip}: {height}");
            let weight: f64 = (simulation.contacts().iter())
                .filter(|a| a.contact.other.is_some())
                .map(|a| a.impulse[0] / 0.005)
                .sum();
            // The tip's weight and half the arm's, except for the part that friction along the
            // sloping arm carries.
            assert!((weight - 9.81 * (3.0 + 1.0)).abs() < 7.0, "{tip}: {weight}");
            let is_wheel = |part| matches!(part, Part::Wheel(_));
            let ground = simulation
                .contacts()
                .iter()
                .filter(|a| a.contact.other.is_none());
            assert!(
                ground.clone().count() >= 3 && ground.clone().all(|a| !is_wheel(a.contact.part))
            );
        }
    }
}
