//! Drives of joints other than wheels'.

use rover_core::integrator::Variant;
use rover_core::multibody::{DriveDescription, JointKind, Motor, SolidDescription};

use super::machines::{model, simulation, solid};
use crate::shared::{VARIANTS, stepping};

/// About y, so that gravity exerts no torque.
const INERTIA: f64 = 0.25 * 0.1 * 0.1;

fn turret(motor: Option<Motor>) -> SolidDescription {
    let mut turret = solid("turret", None, JointKind::Revolute);
    turret.axis = Some([0.0, 1.0, 0.0]);
    turret.drive = Some(DriveDescription {
        torque_limit: 0.01,
        motor,
    });
    turret
}

const MOTOR: Motor = Motor {
    stall_torque: 0.008,
    no_load_speed: 5.0,
    regenerating: true,
};

/// `I ω = h τ` with the commanded torque or the limit; a joint without a drive has no limit.
#[test]
fn a_torque_saturates_at_the_drives_limit() {
    for (asked, given) in [(0.004, 0.004), (1.0, 0.01), (-1.0, -0.01)] {
        let mut free = solid("free", Some("turret"), JointKind::Revolute);
        free.axis = Some([0.0, 1.0, 0.0]);
        let mut run = simulation(
            model(vec![turret(None), free]),
            stepping(Variant::Linearised, 1e-3),
        );
        // The other joint has no drive and no limit; its torque acts back on the turret.
        run.set_joint_torques(&[asked, 0.5]).unwrap();
        run.step(10).unwrap();
        let v = run.v();
        let expected = 0.01 * (given - 0.5) / INERTIA;
        assert!((v[0] - expected).abs() < 1e-9, "{v:?} {expected}");
        let last = run.last_call();
        let work = given * v[0] * 0.5 * 0.01;
        assert!((last.work - work.abs()).abs() < 1e-9, "{last:?} {work}");
    }
}

/// `I ω̇ = τ₀ (1 − ω/ω₀)` on the motor's line, from rest: `ω = ω₀ (1 − exp(−τ₀ t / (I ω₀)))`.
#[test]
fn a_joint_runs_up_along_its_motors_line() {
    for variant in VARIANTS {
        let h = 1e-4;
        let mut run = simulation(model(vec![turret(Some(MOTOR))]), stepping(variant, h));
        run.set_joint_torques(&[0.01]).unwrap();
        for n in [1, 2] {
            run.step(1000).unwrap();
            let t = 0.1 * f64::from(n);
            let rate = MOTOR.stall_torque / (INERTIA * MOTOR.no_load_speed);
            let expected = MOTOR.no_load_speed * (1.0 - (-rate * t).exp());
            let found = run.v()[0];
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        let snapshot = run.snapshot();
        run.restore(&snapshot).unwrap();
    }
}
