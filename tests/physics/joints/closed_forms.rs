//! Motions with a closed form, one per joint type.

use nalgebra::{Rotation3, Vector3};
use rover_core::integrator::Variant;
use rover_core::multibody::{Configuration, Hold, JointKind, Kinematics};

use super::machines::{energy, model, simulation, solid};
use crate::shared::{VARIANTS, near, spring, stepping};

/// Period of a pendulum of length l that swings by ±a:
/// `4 √(l/g) K(sin(a/2))`, K by the arithmetic–geometric mean.
fn period(over_g: f64, a: f64) -> f64 {
    let (mut x, mut y) = (1.0, (0.5 * a).cos());
    for _ in 0..8 {
        (x, y) = (0.5 * (x + y), (x * y).sqrt());
    }
    4.0 * over_g.sqrt() * std::f64::consts::FRAC_PI_2 / x
}

/// `T = 4 √(I/(m g l)) K(sin(a/2))`.
#[test]
fn a_pendulum_on_the_world_has_its_period() {
    let mut bob = solid("bob", None, JointKind::Revolute);
    bob.centre_of_mass = Some([0.0, -0.8, 0.0]);
    bob.position = Some([3.0, 2.0, 1.0]);
    bob.armature = Some(0.1);
    let inertia = 1.0 * 0.8 * 0.8 + 0.5 * 0.1 * 0.1 + 0.1;
    let expected = period(inertia / (9.81 * 0.8), 1.2);
    let mut pendulum = simulation(model(vec![bob]), stepping(Variant::Linearised, 1e-3));
    let mut start = Configuration::zero(pendulum.model());
    start.joints[0] = 1.2;
    pendulum.set_state(start, vec![0.0]);
    let before = energy(&pendulum);
    let (mut last, mut crossings) = (1.2, Vec::new());
    while crossings.len() < 3 {
        pendulum.step(1).unwrap();
        let angle = pendulum.q().joints[0];
        if last * angle < 0.0 {
            let share = last / (last - angle);
            crossings.push(pendulum.time() - 1e-3 * (1.0 - share));
        }
        last = angle;
    }
    let measured = crossings[2] - crossings[0];
    near(measured, expected, 1e-5 * expected);
    assert!((energy(&pendulum) - before).abs() < 1e-6 * before.abs());
}

/// `m ẍ + c ẋ + k (x − x₀) = −m g` along a slope; with armature the mass is larger.
#[test]
fn a_slide_with_a_spring_and_a_damper_is_an_oscillator() {
    let mut block = solid("block", None, JointKind::Prismatic);
    block.axis = Some([0.0, 1.0, 0.0]);
    block.spring = Some(spring(200.0, 0.3));
    block.damping = Some(2.0);
    block.armature = Some(1.0);
    let model = model(vec![block]);
    let (m, w2) = (2.0, 100.0);
    let rest = 0.3 - 9.81 / 200.0;
    let decay: f64 = 0.5 * 2.0 / m;
    let w = (w2 - decay * decay).sqrt();
    let mut errors = Vec::new();
    for steps in [500_u32, 1000] {
        let h = 1.0 / f64::from(steps);
        let mut run = simulation(model.clone(), stepping(Variant::Linearised, h));
        run.step(steps as usize).unwrap();
        // From rest at 0.
        let x = rest - rest * (-decay).exp() * (w.cos() + decay / w * w.sin());
        errors.push((run.q().joints[0] - x).abs());
    }
    assert!(errors[1] < 2e-4, "{errors:?}");
    assert!(errors[1] < 0.6 * errors[0], "{errors:?}");
}

/// The energy, including that of the spring, does not grow for any stiffness and step size.
#[test]
fn no_spring_and_no_step_give_energy() {
    for stiffness in [1e2, 1e6, 1e12] {
        for variant in VARIANTS {
            let mut upper = solid("upper", None, JointKind::Revolute);
            upper.centre_of_mass = Some([0.0, -0.5, 0.0]);
            upper.spring = Some(spring(stiffness, 0.5));
            let mut lower = solid("lower", Some("upper"), JointKind::Prismatic);
            lower.axis = Some([0.0, 1.0, 0.0]);
            lower.position = Some([0.0, -1.0, 0.0]);
            lower.spring = Some(spring(stiffness, 0.0));
            let mut run = simulation(model(vec![upper, lower]), stepping(variant, 0.02));
            let mut most = energy(&run);
            let scale = most.abs().max(10.0);
            for _ in 0..300 {
                run.step(1).unwrap();
                let now = energy(&run);
                assert!(
                    now < most + 1e-6 * scale,
                    "{stiffness} {variant:?}: {now} {most}"
                );
                most = most.min(now).max(now);
            }
        }
    }
}

/// A heavy symmetric top precesses steadily at the rate Ω with `(I₃ ω₃ − I₁ Ω cos θ) Ω = m g l`.
#[test]
fn a_top_on_a_spherical_joint_precesses() {
    for variant in VARIANTS {
        let mut top = solid("top", None, JointKind::Spherical);
        top.position = Some([0.0, 1.0, 0.0]);
        top.inertia = Some([0.02, 0.03, 0.02, 0.0, 0.0, 0.0]);
        top.centre_of_mass = Some([0.0, 0.3, 0.0]);
        let model = model(vec![top]);
        let (I1, I3, mgl) = (0.02 + 0.09, 0.03, 9.81 * 0.3);
        let (theta, precession): (f64, f64) = (0.6, 2.0);
        // Spin ω₃ about the axis of symmetry, from the formula.
        let spin = (mgl / precession + I1 * precession * theta.cos()) / I3;
        let h = 1e-4;
        let mut run = simulation(model, stepping(variant, h));
        let mut start = Configuration::zero(run.model());
        let lean = Rotation3::from_axis_angle(&Vector3::x_axis(), theta);
        start.rotations[0] = lean.into();
        let axis = lean * Vector3::y();
        // ω = Ω y + (ω₃ − Ω cos θ) e₃
        let omega = Vector3::y() * precession + axis * (spin - precession * theta.cos());
        run.set_state(start, omega.as_slice().to_vec());
        let before = energy(&run);
        run.step(5000).unwrap();
        let turned = Rotation3::from_axis_angle(&Vector3::y_axis(), precession * 0.5);
        let now = run.q().rotations[0] * Vector3::y();
        let miss = (now - turned * axis).norm();
        assert!(miss < 1e-5, "{variant:?}: {miss}");
        assert!((energy(&run) - before).abs() < 1e-6 * before.abs());
    }
}

/// Accelerations of a double pendulum from its Lagrangian; both links are point masses.
#[test]
fn a_double_pendulum_falls_as_its_lagrangian_says() {
    let mut upper = solid("upper", None, JointKind::Revolute);
    upper.centre_of_mass = Some([0.0, -0.7, 0.0]);
    upper.inertia = Some([1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0]);
    let mut lower = upper.clone();
    lower.name = "lower".into();
    lower.parent = Some("upper".into());
    lower.position = Some([0.0, -0.7, 0.0]);
    lower.centre_of_mass = Some([0.0, -0.4, 0.0]);
    lower.mass = 2.0;
    let (m1, m2, l1, l2, g) = (1.0, 2.0, 0.7, 0.4, 9.81);
    let (a, b, wa, wb): (f64, f64, f64, f64) = (0.8, -0.5, 1.5, -2.0);
    // Angles a and b from the vertical: M(a − b) (ä, b̈) = forces.
    let d = a - b;
    let M = nalgebra::Matrix2::new(
        (m1 + m2) * l1 * l1,
        m2 * l1 * l2 * d.cos(),
        m2 * l1 * l2 * d.cos(),
        m2 * l2 * l2,
    );
    let force = nalgebra::Vector2::new(
        -m2 * l1 * l2 * wb * wb * d.sin() - (m1 + m2) * g * l1 * a.sin(),
        m2 * l1 * l2 * wa * wa * d.sin() - m2 * g * l2 * b.sin(),
    );
    let expected = M.try_inverse().unwrap() * force;
    let h = 1e-6;
    let mut run = simulation(model(vec![upper, lower]), stepping(Variant::Linearised, h));
    let mut start = Configuration::zero(run.model());
    start.joints.copy_from_slice(&[a, b - a]);
    run.set_state(start, vec![wa, wb - wa]);
    run.step(1).unwrap();
    let v = run.v();
    let found = [(v[0] - wa) / h, (v[0] + v[1] - wb) / h];
    near(found[0], expected.x, 1e-3);
    near(found[1], expected.y, 1e-3);
}

/// Held joints of a machine on a fixed base reach their set-points; the rotation of the joint
/// origin rotates the axis.
#[test]
fn an_arm_on_a_turned_base_is_held() {
    let mut base = solid("base", None, JointKind::Fixed);
    base.position = Some([0.0, 1.0, 0.0]);
    base.rotation = Some([0.0, std::f64::consts::FRAC_PI_2, 0.0]);
    let mut arm = solid("arm", Some("base"), JointKind::Prismatic);
    arm.axis = Some([1.0, 0.0, 0.0]);
    arm.hold = Some(Hold {
        stiffness: 1e4,
        damping: 300.0,
    });
    let mut run = simulation(model(vec![base, arm]), stepping(Variant::Linearised, 0.01));
    run.hold(&["arm".into()], Some(&[0.4]), None, None).unwrap();
    run.step(500).unwrap();
    let kinematics: Kinematics = run.kinematics();
    let place = kinematics.origin(1) + kinematics.r(1);
    // The x axis of the base is the world's −z.
    assert!(
        (place - Vector3::new(0.0, 1.0, -0.4)).norm() < 1e-6,
        "{place}"
    );
}
