//! A plane given as a height field is a plane.

use std::sync::Arc;

use rover_core::geometry::{Plane, Terrain, Union};
use rover_core::simulation::RoverSimulation;

use super::surface_scenes::{map, rover_on};
use crate::rover::scenes::on_slope;
use crate::shared::{apart, flat, in_public};
use crate::spheres::sphere_scenes::{WHEEL_MASS, WHEEL_RADIUS, lone_wheel, placed};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Model, coordinates};
use rover_core::nalgebra::Vector3;

/// Drives on and turns for two seconds.
fn drive(simulation: &mut RoverSimulation) -> Vec<f64> {
    simulation
        .set_steering(&[-0.2, -0.2, 0.0, 0.1, 0.0, 0.1])
        .unwrap();
    simulation.set_wheel_torques(&[12.0; 6]).unwrap();
    let mut path = Vec::new();
    for _ in 0..20 {
        assert!(simulation.step(20).unwrap().is_converged());
        path.extend(simulation.q().position.iter());
        path.extend(simulation.q().attitude.coords.iter());
    }
    path
}

#[test]
fn a_flat_map_of_any_spacing_moves_the_rover_as_the_plane_does() {
    let expected = drive(&mut rover_on(flat(), 0.36));
    let away = apart(&expected[..1], &expected[expected.len() - 7..][..1]);
    assert!(away > 0.3, "it drives: {away}");
    for (spacing, cells) in [(0.03, 400), (0.25, 48), (1.0, 12), (5.0, 4)] {
        let level = Arc::new(map(cells, spacing, |_, _| 0.0));
        let path = drive(&mut rover_on(level, 0.36));
        let error = apart(&path, &expected);
        assert!(error < 1e-9, "{spacing}: {error}");
    }
}

#[test]
fn a_tilted_map_moves_the_rover_as_the_tilted_plane_does() {
    for (spacing, cells) in [(0.03, 400), (0.25, 48), (1.0, 12)] {
        // A rise of each cell that single precision holds.
        let rise = (0.1_f64 * spacing * 1024.0).round() / 1024.0;
        let slope = rise / spacing;
        let degrees = slope.atan().to_degrees();
        let mut on_plane = on_slope(degrees, StepOptions::default());
        let q = coordinates::to_public(on_plane.model(), on_plane.q());
        let expected = drive(&mut on_plane);
        let field = map(cells, spacing, |x, _| (x / spacing).round() * rise);
        let path = drive(&mut in_public(Model::rover(), Arc::new(field), &q));
        let error = apart(&path, &expected);
        assert!(error < 1e-9, "{spacing}: {error}");
    }
}

#[test]
fn a_union_with_a_plane_below_changes_nothing() {
    let level: Arc<dyn Terrain> = Arc::new(map(48, 0.25, |_, _| 0.0));
    let below: Arc<dyn Terrain> = Arc::new(Plane::new([0.0, 1.0, 0.0], 1.0).unwrap());
    let both = Union::new(vec![Arc::clone(&level), below]).unwrap();
    let expected = drive(&mut rover_on(level, 0.36));
    let path = drive(&mut rover_on(Arc::new(both), 0.36));
    assert!(apart(&path, &expected) < 1e-9);
}

#[test]
fn a_wheel_feels_nothing_of_a_thousand_inner_edges() {
    // Along the cells, across them and along their diagonal.
    for heading in [0.0, 0.3, std::f64::consts::FRAC_PI_4] {
        let field = map(2400, 0.004, |_, _| 0.0);
        let start = Vector3::new(-3.0, WHEEL_RADIUS, 0.0);
        let mut wheel = placed(lone_wheel(), field, StepOptions::default(), start);
        let mut configuration = wheel.q().clone();
        let turn =
            rover_core::nalgebra::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -heading);
        configuration.attitude = turn;
        let speed = 2.0;
        let (x, z) = (heading.cos(), heading.sin());
        let axis = turn * Vector3::z() * (-speed / WHEEL_RADIUS);
        let v = vec![speed * x, 0.0, speed * z, axis.x, axis.y, axis.z];
        wheel.set_state(configuration, v);
        let load = WHEEL_MASS * 9.81 * wheel.options().time_step;
        let mut edges = 0.0;
        for _ in 0..500 {
            assert!(wheel.step(1).unwrap().is_converged());
            assert_eq!(wheel.contacts().len(), 1);
            let [n, t, b] = wheel.contacts()[0].impulse;
            assert!((n - load).abs() < 1e-9 * load, "{n} for {load}");
            assert!(t.abs() < 1e-9 * load && b.abs() < 1e-9 * load, "{t} {b}");
            edges += speed * wheel.options().time_step / 0.004;
        }
        assert!(edges > 1000.0);
    }
}
