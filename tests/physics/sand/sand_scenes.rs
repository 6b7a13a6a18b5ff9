//! Soils and rovers of the tests of sand.

use std::sync::Arc;

use rover_core::geometry::{Plane, SoftGround, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Configuration, Model, ModelDescription};
use rover_core::nalgebra::Vector3;
use rover_core::sand::{Bekker, Flow, Interface, Resistive, Soil, StressLaw};
use rover_core::simulation::RoverSimulation;

/// Dry sand with the fitted properties of `docs/sand.md`.
pub fn dry_sand() -> Soil {
    let smooth = |friction| Interface {
        friction,
        follow: 7.5,
    };
    Soil {
        law: StressLaw::Resistive(Resistive {
            density: 1330.0,
            internal_friction: 0.554,
            stiffness_factor: 1.0,
            tread: smooth(0.8),
            wall: smooth(0.32),
            grousers: Interface {
                friction: 0.8,
                follow: 100.0,
            },
            flow: Flow {
                dilatancy: 0.02,
                grip: 0.19,
                width: 0.05,
                fluidity: 0.71,
                mobilisation: 0.05,
            },
        }),
        memory: 0.001,
        reload: 8.0,
    }
}

/// The same ground in Bekker's model.
pub fn bekker_sand() -> Soil {
    Soil {
        law: StressLaw::Bekker(Bekker {
            cohesive_modulus: 0.0,
            frictional_modulus: 1.5e6,
            exponent: 1.1,
            cohesion: 200.0,
            internal_friction: 0.55,
            shear_modulus: 0.015,
            stress_angle: 0.0,
            stress_angle_slip: 0.0,
            slip_sinkage: 0.0,
        }),
        ..dry_sand()
    }
}

/// A plane that rises by an angle along x, rad.
pub fn slope(soil: Soil, angle: f64) -> Arc<dyn Terrain> {
    let normal = [-angle.sin(), angle.cos(), 0.0];
    let plane = Plane::new(normal, 0.0).unwrap();
    Arc::new(SoftGround::new(Arc::new(plane), Arc::new(soil), 0.02).unwrap())
}

/// A rover of the gallery with wide wheels, its mass scaled by a factor.
pub fn wide(name: &str, width: f64, factor: f64) -> Arc<Model> {
    let mut description = ModelDescription::named(name).unwrap();
    for solid in &mut description.solids {
        solid.set_mass(factor * solid.mass);
    }
    for wheel in &mut description.wheels {
        wheel.width = Some(width);
        wheel.rounding = Some(0.1 * width);
        wheel.grouser_height = Some(0.05 * wheel.radius);
        wheel.grousers = Some(24);
    }
    Arc::new(Model::from_description(description).unwrap())
}

/// A rover at rest with its wheels on a slope along x, rad.
pub fn placed(model: &Arc<Model>, soil: Soil, angle: f64, h: f64) -> RoverSimulation {
    let options = StepOptions {
        time_step: h,
        ..StepOptions::default()
    };
    let mut sim = RoverSimulation::new(model.clone(), slope(soil, angle), options).unwrap();
    let mut q = Configuration::zero(model);
    q.attitude = turned(angle);
    let lowest = |q: &Configuration| {
        let kinematics = rover_core::multibody::Kinematics::of(model, q);
        let n = Vector3::new(-angle.sin(), angle.cos(), 0.0);
        let heights = model.wheels().iter().map(|wheel| {
            let c = kinematics.origin(wheel.body) + kinematics.point(wheel.body, &wheel.centre);
            n.dot(&c) - wheel.radius
        });
        heights.fold(f64::INFINITY, f64::min)
    };
    let drop = lowest(&q) / angle.cos();
    q.position.y -= drop;
    let nv = model.nv();
    sim.set_state(q, vec![0.0; nv]);
    sim
}

fn turned(angle: f64) -> rover_core::nalgebra::UnitQuaternion<f64> {
    rover_core::nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

/// Sum of the forces of the sand on the wheels, N.
pub fn total_force(sim: &RoverSimulation) -> Vector3<f64> {
    let wheels = sim.sand().unwrap().wheels.iter();
    wheels.map(|wheel| Vector3::from(wheel.force)).sum()
}
