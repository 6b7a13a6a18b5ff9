//! Bodies whose own rotation changes only their appearance.

use std::collections::{HashMap, HashSet};

use nalgebra::Vector3;

use super::Body;
use super::parts::Wheel;
use crate::multibody::joint::{JointAxis, JointModel};

/// Finds the bodies whose own rotation changes only their appearance.
pub(super) fn mark_spinners(
    bodies: &mut [Body],
    wheels: &[Wheel],
    carriers: impl Iterator<Item = usize>,
) {
    let carriers: HashSet<usize> = (bodies.iter().filter_map(|b| b.parent))
        .chain(carriers)
        .collect();
    let mut wheels_of: HashMap<usize, Vec<&Wheel>> = HashMap::new();
    for wheel in wheels {
        wheels_of.entry(wheel.body).or_default().push(wheel);
    }
    for b in 0..bodies.len() {
        let body = &bodies[b];
        let turns = body.joint.turning().is_some();
        let Some(axis) = body.joint.axis().filter(|_| turns) else {
            continue;
        };
        let direction = axis.direction();
        let along = |x: &Vector3<f64>| x.cross(&direction).norm() < 1e-12;
        let I = body.principal_inertia;
        let across = match axis {
            JointAxis::X => [I.y, I.z],
            JointAxis::Y => [I.x, I.z],
            JointAxis::Z => [I.x, I.y],
            JointAxis::General(_) => [f64::NAN; 2],
        };
        let is_symmetric =
            body.principal_axes.is_none() && (across[0] - across[1]).abs() <= 1e-14 * I.sum();
        let is_leaf = !carriers.contains(&b);
        let wheels_spin =
            (wheels_of.get(&b).into_iter().flatten()).all(|w| along(&w.centre) && along(&w.axle));
        let is_spinner = is_leaf && is_symmetric && wheels_spin && along(&body.centre_of_mass);
        bodies[b].is_spinner = is_spinner;
    }
}
