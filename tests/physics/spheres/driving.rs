//! Long drives over rocks.

use nalgebra::Vector3;
use rover_core::geometry::SphereField;
use rover_core::integrator::Variant;
use rover_core::multibody::Model;

use super::sphere_scenes::{deepest, placed, rocks};
use crate::shared::stepping;

#[allow(clippy::print_stderr)] // figures that are reported beside what is asserted
fn report(line: &str) {
    eprintln!("{line}");
}

#[test]
fn penetration_stays_below_a_millimetre_at_one_millisecond() {
    for seed in [1, 2, 3] {
        let field = SphereField::rocks(&rocks(seed)).unwrap();
        let options = stepping(Variant::default(), 0.001);
        let mut rover = placed(Model::rover(), field, options, Vector3::new(-4.0, 0.6, 0.0));
        rover.step(800).unwrap();
        let (mut worst, mut unsolved, mut fastest, mut iterations) = (0.0_f64, 0, 0.0_f64, 0);
        let steps = 4000;
        for _ in 0..steps {
            let v = rover.v();
            let speed = v[0].hypot(v[1]).hypot(v[2]);
            fastest = fastest.max(speed);
            // A cruise control: as much torque as keeps it below 1 m/s.
            rover.set_wheel_torques(&[60.0 * (0.9 - speed); 6]).unwrap();
            let taken = rover.step(1).unwrap();
            unsolved += usize::from(!taken.is_converged());
            iterations += taken.iterations;
            worst = worst.min(deepest(&rover));
        }
        report(&format!(
            "seed {seed}: deepest {worst:.2e} m, {unsolved} of {steps} steps not converged, {:.2} iterations a step, fastest {fastest:.2} m/s, at {}",
            f64::from(u32::try_from(iterations).unwrap()) / f64::from(steps),
            rover.q().position.transpose()
        ));
        assert!(worst > -1e-3, "seed {seed}: {worst} m");
    }
}
