//! A thin disc that rolls about its resting centre, Euler's disc without losses.
//!
//! With the angle α between disc and ground the centre rests at height `R sin α`, and the disc
//! precesses at `Ω² = 4 g / (R sin α)`: the moment `m g R cos α` of the reaction is `Ω` times the
//! horizontal angular momentum `¼ m R² Ω sin α cos α`. The disc turns at `Ω sin α` about the radius
//! to its lowest point, which is at rest, and needs no friction. Along its instantaneous motion the
//! rim approaches the ground with `4 g cos² α`: more than twice gravity below 45 degrees.

use rover_core::integrator::{StepOptions, StepReport};
use rover_core::multibody::Configuration;
use rover_core::nalgebra::{UnitQuaternion, Vector3};

use crate::rover::scenes::VARIANTS;
use crate::shared::{flat, moving};
use crate::spheres::sphere_scenes::{WHEEL_RADIUS, lone_wheel};

const DURATION: f64 = 2.0;

/// Errors after [`DURATION`], relative to the disc's size, angle and energy.
struct Errors {
    energy: f64,
    centre: f64,
    tilt: f64,
    phase: f64,
    /// Its energies are relative too.
    report: StepReport,
}

fn precess(degrees: f64, g: f64, n: u32, change: impl Fn(&mut StepOptions)) -> Errors {
    let tilt = degrees.to_radians();
    let (sin, cos) = tilt.sin_cos();
    let rate = (4.0 * g / (WHEEL_RADIUS * sin)).sqrt();
    let mut options = StepOptions {
        gravity: Vector3::new(0.0, -g, 0.0),
        time_step: DURATION / f64::from(n),
        friction_coefficient: 1.0,
        ..StepOptions::default()
    };
    change(&mut options);
    let mut start = Configuration::zero(&lone_wheel());
    start.position = Vector3::new(0.0, WHEEL_RADIUS * sin, 0.0);
    // The axle is (0, cos α, sin α).
    let lean = tilt - std::f64::consts::FRAC_PI_2;
    start.attitude = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), lean);
    let turn = Vector3::new(0.0, sin, -cos) * (rate * sin);
    let v = vec![0.0, 0.0, 0.0, turn.x, turn.y, turn.z];
    let mut disc = moving(lone_wheel(), flat(), options, start.clone(), v);
    let before = disc.energy();
    let mut report = disc.step(n as usize).unwrap();
    for energy in [
        &mut report.energy_dissipated,
        &mut report.energy_lost,
        &mut report.energy_removed,
        &mut report.energy_lifted,
    ] {
        *energy /= before.kinetic;
    }
    let end = disc.q();
    let axle = end.attitude * Vector3::z();
    let ahead = axle.x.atan2(axle.z) - rate * DURATION;
    Errors {
        energy: (disc.energy().total() - before.total()) / before.kinetic,
        centre: (end.position - start.position).norm() / WHEEL_RADIUS,
        tilt: axle.y.acos() - tilt,
        phase: ahead.sin().atan2(ahead.cos()),
        report,
    }
}

/// Whether the report explains the change of the energy.
fn balances(errors: &Errors) -> bool {
    let report = &errors.report;
    let taken = report.energy_dissipated + report.energy_lost + report.energy_removed;
    (errors.energy + taken - report.energy_lifted).abs() < 1e-9
}

#[test]
fn a_disc_in_steady_precession_keeps_its_energy_where_its_rim_presses_harder_than_gravity() {
    // A contact counted as persistent only up to the speed 2 g h: at 45 degrees the disc lost 12%
    // of its energy in 2 s, at 30 degrees 39%, and the report said nothing.
    for variant in VARIANTS {
        for (degrees, g) in [(30.0, 9.81), (45.0, 9.81), (50.0, 9.81), (30.0, 1.62)] {
            let with = |n| precess(degrees, g, n, |options| options.variant = variant);
            let (coarse, fine) = (with(1000), with(2000));
            let name = format!("{variant:?}, {degrees} degrees, {g} m/s²");
            assert!(fine.energy.abs() < 1.5e-3, "{name}: {:e}", fine.energy);
            assert!(fine.centre < 6e-4, "{name}: {:e}", fine.centre);
            assert!(fine.tilt.abs() < 2e-4, "{name}: {:e}", fine.tilt);
            assert!(fine.phase.abs() < 6e-3, "{name}: {:e}", fine.phase);
            let order = (coarse.energy / fine.energy).log2();
            assert!((1.8..2.2).contains(&order), "{name}: order {order}");
            assert!(balances(&coarse) && balances(&fine), "{name}");
        }
    }
}

#[test]
fn energy_that_a_step_loses_in_persistent_contact_is_reported() {
    // With θ above ½ the scheme is of first order and dissipates.
    for (degrees, n) in [(30.0, 2000), (45.0, 1000)] {
        let disc = precess(degrees, 9.81, n, |options| options.theta = 0.6);
        assert!(disc.energy < -0.3, "{degrees}: {}", disc.energy);
        assert!(balances(&disc), "{degrees}");
        let lost = disc.report.energy_lost;
        assert!(lost > 0.1, "{degrees}: {lost}");
    }
}
