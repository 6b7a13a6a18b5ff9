//! The lengths of a machine: how far a unit of each velocity moves what it carries.
//!
//! They convert the change of an angle into a displacement, and say how large a machine is. All are
//! upper bounds in any configuration, found once when the model is built; they grow with the
//! machine.

use std::sync::Arc;

use nalgebra::Vector3;

use super::Model;
use crate::multibody::description::JointLimits;
use crate::multibody::joint::{Joint, JointModel};
use crate::multibody::mechanism::Lever;

/// A ball that contains a part of a body, in the body's frame.
struct Ball {
    body: usize,
    centre: Vector3<f64>,
    radius: f64,
    /// Axle and radius, if it is a wheel.
    disc: Option<(Vector3<f64>, f64)>,
}

impl Ball {
    /// Largest distance from an axis through the frame's origin.
    fn distance_from(&self, axis: &Vector3<f64>) -> f64 {
        let radius = match &self.disc {
            Some((axle, radius)) if axle.cross(axis).norm() < ALONG => *radius,
            _ => self.radius,
        };
        across(&self.centre, axis) + radius
    }
}

/// Distance of a point from an axis through the origin.
fn across(point: &Vector3<f64>, axis: &Vector3<f64>) -> f64 {
    (point - axis * point.dot(axis)).norm()
}

/// Sine of the angle up to which a wheel turns about its axle.
const ALONG: f64 = 1e-9;

impl Model {
    /// Balls around the parts of all bodies.
    fn balls(&self) -> Vec<Ball> {
        let ball = |body, centre, radius| Ball {
            body,
            centre,
            radius,
            disc: None,
        };
        let wheels = self.wheels.iter().map(|own| Ball {
            disc: Some((own.axle, own.radius)),
            ..ball(own.body, own.centre, own.bound())
        });
        let boxes = (self.boxes.iter()).map(|own| ball(own.body, own.centre, own.half_size.norm()));
        let spheres = (self.spheres.iter()).map(|own| ball(own.body, own.centre, own.radius));
        let colliders = self.colliders.iter();
        let colliders = colliders.map(|own| ball(own.body, own.centre, own.bound()));
        wheels
            .chain(boxes)
            .chain(spheres)
            .chain(colliders)
            .collect()
    }

    /// Largest distance of anything that each body carries from the body's origin.
    fn reaches(&self, balls: &[Ball]) -> Vec<f64> {
        let mut reaches = vec![0.0_f64; self.bodies.len()];
        for ball in balls {
            let own = &mut reaches[ball.body];
            *own = own.max(ball.centre.norm() + ball.radius);
        }
        for (b, body) in self.bodies.iter().enumerate().rev() {
            if let Some(parent) = body.parent {
                let own = body.position.norm() + self.travel(b) + reaches[b];
                reaches[parent] = reaches[parent].max(own);
            }
        }
        reaches
    }

    /// How far its joint displaces the origin of a body, where a stop says so.
    fn travel(&self, b: usize) -> f64 {
        let own = self.joints.iter().find(|own| own.body == b);
        let limits = own.and_then(|own| own.limits);
        match limits.filter(|_| self.bodies[b].joint.slides()) {
            Some(JointLimits { lower, upper }) => lower.abs().max(upper.abs()),
            None => 0.0,
        }
    }

    /// Largest distance of anything that a body carries from an axis through its origin.
    fn arm(&self, b: usize, axis: &Vector3<f64>, balls: &[Ball], reaches: &[f64]) -> f64 {
        let own = balls.iter().filter(|ball| ball.body == b);
        let own = own.map(|ball| ball.distance_from(axis));
        let carried = self.bodies.iter().enumerate();
        let carried = carried.filter(|(_, other)| other.parent == Some(b));
        let carried =
            carried.map(|(c, other)| across(&other.position, axis) + self.travel(c) + reaches[c]);
        own.chain(carried).fold(0.0, f64::max)
    }

    /// Finds the levers of the mechanism, and the size of each cluster.
    ///
    /// A turning that moves no part has the size of its cluster as its arm, and 1 m where the
    /// cluster has no size: such a machine touches nothing. An arm of 0 would close a stop at any
    /// angle. Masses have no influence, so that machines that differ in them alone have one
    /// mechanism.
    pub(super) fn find_levers(&mut self) {
        let balls = self.balls();
        let reach = self.reaches(&balls);
        let mut levers = Vec::new();
        let mut sizes = vec![0.0_f64; self.mechanism.n_clusters()];
        for (b, body) in self.bodies.iter().enumerate() {
            let cluster = self.mechanism.cluster_of_body(b);
            let mut lever = |first, n, arm| {
                levers.push(Lever {
                    first,
                    n,
                    arm,
                    cluster,
                });
            };
            if body.parent.is_none() {
                sizes[cluster] = sizes[cluster].max(reach[b]);
            }
            match &body.joint {
                Joint::Free(_) => {
                    lever(body.velocity, 3, 1.0);
                    lever(body.velocity + 3, 3, reach[b]);
                }
                Joint::Spherical(_) => lever(body.velocity, 3, reach[b]),
                joint => {
                    // A coupled joint moves with the velocity of another one.
                    let ratio = joint.coupling().map_or(1.0, |own| own.ratio.abs());
                    let arm = match joint.axis().filter(|_| joint.turning().is_some()) {
                        Some(axis) => self.arm(b, &axis.direction(), &balls, &reach),
                        None => 1.0,
                    };
                    if joint.nv() > 0 || joint.coupling().is_some() {
                        lever(body.velocity, 1, ratio * arm);
                    }
                }
            }
        }
        for lever in &mut levers {
            let size = sizes[lever.cluster];
            if lever.arm == 0.0 {
                lever.arm = if size > 0.0 { size } else { 1.0 };
            }
        }
        let mechanism = Arc::make_mut(&mut self.mechanism);
        for own in &mut mechanism.joints {
            let same = levers.iter().filter(|lever| lever.first == own.velocity);
            own.arm = same.map(|lever| lever.arm).fold(0.0, f64::max);
        }
        mechanism.levers = levers;
        mechanism.sizes = sizes;
    }
}
