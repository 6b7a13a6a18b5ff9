//! Builds bodies, frames, wheels and boxes from a description.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::links::{inertias_of, mechanism_of};
use super::machines::machines_of;
use super::parts::{Collider, ColliderForm, CollisionBox, CollisionSphere, Frame, Wheel};
use super::properties::{JointProperties, Passive};
use super::speed_gains::set_speed_gains;
use super::spinners::mark_spinners;
use super::tree::{Paths, Tree};
use super::{Body, Model, fingerprint};
use crate::law::materials::OwnFriction;
use crate::multibody::description::{
    JointKind, MaterialDescription, ModelDescription, Shape, SolidDescription,
};
use crate::multibody::error::{ModelError, ModelFault};
use crate::multibody::joint::fixed::Lock;
use crate::multibody::joint::{
    Coupled, Coupling, Fixed, Free, Joint, JointAxis, JointModel, Prismatic, Revolute, SingleJoint,
    Spherical,
};
use crate::scalar::elementary::sin_cos;
use crate::spatial::{SymmetricMatrix3, exp_rotation};

/// Mass, first moment, and inertia about the body frame's origin, accumulated while solids are
/// merged.
#[derive(Clone, Default)]
struct MassSum {
    mass: f64,
    moment: Vector3<f64>,
    inertia: Matrix3<f64>,
}

/// A model under construction, one solid at a time.
#[derive(Default)]
struct Builder {
    bodies: Vec<Body>,
    mass_sums: Vec<MassSum>,
    frames: Vec<Frame>,
    boxes: Vec<CollisionBox>,
    spheres: Vec<CollisionSphere>,
    colliders: Vec<Collider>,
    joints: Vec<JointProperties>,
    n_trees: usize,
    n_poses: usize,
    n_rotations: usize,
}

impl Model {
    pub(super) fn build(description: ModelDescription) -> Result<Self, ModelError> {
        let index_of: HashMap<&str, usize> = (description.solids.iter().map(|s| s.name.as_str()))
            .zip(0..)
            .collect();
        let (builder, solid_of_body) = Builder::with_all(&description.solids, &index_of)?;
        let Builder {
            mut bodies,
            frames,
            boxes,
            spheres,
            colliders,
            mut joints,
            n_trees,
            n_poses,
            n_rotations,
            ..
        } = builder;
        let paths = Paths::number(&mut bodies).map_err(|b| {
            let i = solid_of_body[b];
            coupled_apart(i, &description.solids[i])
        })?;
        let mut wheels = wheels(&description, &index_of, &frames, &bodies, &joints);
        set_speed_gains(&mut wheels, &description, &bodies, &joints);
        let carriers = (boxes.iter().map(|x| x.body))
            .chain(spheres.iter().map(|x| x.body))
            .chain(colliders.iter().map(|x| x.body));
        let looped = description.loops.iter().flat_map(|closure| {
            let ends = [Some(&closure.solid), closure.other.as_ref()];
            let frame = |name: &String| Some(frames[*index_of.get(name.as_str())?].body);
            ends.into_iter().flatten().filter_map(frame)
        });
        mark_spinners(&mut bodies, &wheels, carriers.chain(looped));
        let mut trees: Vec<Tree> = (0..n_trees).map(|t| tree(t, &bodies, &paths)).collect();
        let machines = machines_of(&description, &solid_of_body, &mut trees, &joints);
        for joint in &mut joints {
            joint.velocity = bodies[joint.body].velocity;
            joint.is_passive = joint.passive.stiffness > 0.0 || joint.passive.damping > 0.0;
        }
        let common = paths.common(&bodies);
        let mechanism = mechanism_of(&bodies, &trees, &joints, &paths, (n_poses, n_rotations));
        let inertias = inertias_of(&mechanism, &bodies, &trees, &joints);
        let limited = (0..joints.len())
            .filter(|&joint| joints[joint].limits.is_some())
            .collect();
        let rubbing = (0..joints.len())
            .filter(|&joint| joints[joint].passive.friction > 0.0)
            .collect();
        let joint_velocities = joints.iter().map(|joint| joint.velocity).collect();
        let armatures = (joints.iter())
            .filter(|joint| joint.passive.armature > 0.0)
            .map(|joint| (joint.velocity, joint.passive.armature))
            .collect();
        let has_slides = bodies.iter().any(|body| body.joint.slides());
        let model = Self {
            mass: bodies.iter().map(|b| b.mass).sum(),
            fingerprint: fingerprint(description.to_json().unwrap_or_default().bytes()),
            own_frictions: own_frictions(&description),
            has_slides,
            armatures,
            limited,
            rubbing,
            joint_velocities,
            trees,
            mechanism: Arc::new(mechanism),
            inertias,
            joints,
            description,
            bodies,
            frames,
            wheels,
            boxes,
            spheres,
            colliders,
            common,
            body_of_velocity: paths.body_of_velocity,
            loops: Vec::new(),
            machines,
        };
        model.completed()
    }

    /// With what follows from bodies and joints: loops, which trees they tie together, and levers.
    fn completed(mut self) -> Result<Self, ModelError> {
        self.build_loops()?;
        let tied = self.loops.iter().map(|closure| {
            let trees = closure.trees(&self.mechanism).collect();
            (trees, closure.holds_the_world())
        });
        let tied: Vec<(Vec<usize>, bool)> = tied.collect();
        Arc::make_mut(&mut self.mechanism).tie(&tied);
        self.find_levers();
        Ok(self)
    }
}

impl Builder {
    /// Carries all solids; the second is the first solid of each body.
    fn with_all(
        solids: &[SolidDescription],
        index_of: &HashMap<&str, usize>,
    ) -> Result<(Self, Vec<usize>), ModelError> {
        let mut builder = Self {
            n_poses: 1, // the first is the first body's, whether it is free or not
            ..Self::default()
        };
        let mut solid_of_body = Vec::new();
        for (i, solid) in solids.iter().enumerate() {
            let parent = (solid.parent.as_deref()).and_then(|p| index_of.get(p).copied());
            let frame = builder.frame_of(i, solid, parent)?;
            solid_of_body.resize(builder.bodies.len(), i);
            builder.carry(solid, frame)?;
        }
        builder.settle_masses();
        Ok((builder, solid_of_body))
    }

    /// The frame of a solid: that of a new body, or one fixed to an existing body.
    fn frame_of(
        &mut self,
        i: usize,
        solid: &SolidDescription,
        parent: Option<usize>,
    ) -> Result<Frame, ModelError> {
        let kind = solid.joint_kind();
        let axis = solid
            .axis
            .and_then(|a| JointAxis::from_direction(&a.into()));
        let axis = axis.unwrap_or(JointAxis::X);
        let given = Vector3::from(solid.position.unwrap_or_default());
        let turn =
            (solid.rotation).map(|turn| *exp_rotation(&turn.into()).to_rotation_matrix().matrix());
        let place = parent.map(|p| {
            let carrier = &self.frames[p];
            let position = carrier.position + carrier.rotation * given;
            let rotation = turn.map_or(carrier.rotation, |turn| carrier.rotation * turn);
            (carrier.body, position, rotation)
        });
        let lock = match (kind, solid.locked) {
            (JointKind::Fixed, _) => Some(Lock::AtZero),
            (JointKind::Revolute, Some(angle)) => Some(Lock::Turned(axis, angle)),
            (JointKind::Prismatic, Some(way)) => Some(Lock::Displaced(axis, way)),
            _ => None,
        };
        if let (Some((body, position, rotation)), Some(lock)) = (place, lock) {
            let (displacement, rotation) = lock.place(&rotation);
            return Ok(Frame {
                name: solid.name.clone(),
                body,
                position: position + displacement,
                rotation,
            });
        }
        let mut position = place.map_or(given, |(_, position, _)| position);
        let mut rotation = place.map_or_else(|| turn.unwrap_or_else(Matrix3::identity), |p| p.2);
        let joint = match lock {
            // The lock of a root is its position in the world.
            Some(lock) => {
                let displacement;
                (displacement, rotation) = lock.place(&rotation);
                position += displacement;
                Joint::Fixed(Fixed)
            }
            None => self.joint_of(i, solid, axis)?,
        };
        if place.is_none() {
            self.n_trees += 1;
        }
        self.bodies.push(Body {
            name: solid.name.clone(),
            parent: place.map(|(body, ..)| body),
            tree: self.n_trees - 1,
            position,
            rotation: (rotation != Matrix3::identity()).then_some(rotation),
            n_motions: joint.n_motions(),
            is_coupled: joint.coupling().is_some(),
            joint,
            velocity: 0,
            motion: 0,
            mass: 0.0,
            centre_of_mass: Vector3::zeros(),
            principal_inertia: Vector3::zeros(),
            principal_axes: None,
            is_spinner: false,
        });
        self.mass_sums.push(MassSum::default());
        Ok(Frame {
            name: solid.name.clone(),
            body: self.bodies.len() - 1,
            position: Vector3::zeros(),
            rotation: Matrix3::identity(),
        })
    }

    /// The joint of a new body.
    fn joint_of(
        &mut self,
        i: usize,
        solid: &SolidDescription,
        axis: JointAxis,
    ) -> Result<Joint, ModelError> {
        match solid.joint_kind() {
            JointKind::Fixed => Ok(Joint::Fixed(Fixed)),
            JointKind::Free => {
                let pose = if self.bodies.is_empty() {
                    0
                } else {
                    self.n_poses
                };
                self.n_poses = self.n_poses.max(pose + 1);
                Ok(Joint::Free(Free { pose }))
            }
            JointKind::Spherical => {
                self.n_rotations += 1;
                let rotation = self.n_rotations - 1;
                Ok(Joint::Spherical(Spherical { rotation }))
            }
            JointKind::Revolute => {
                let (coordinate, coupling) = self.coordinate_of(i, solid)?;
                let own = Revolute { axis, coordinate };
                Ok(coupling.map_or(Joint::Revolute(own), |coupling| {
                    let moves = SingleJoint::Revolute(own);
                    Joint::Coupled(Coupled { moves, coupling })
                }))
            }
            JointKind::Prismatic => {
                let (coordinate, coupling) = self.coordinate_of(i, solid)?;
                let own = Prismatic { axis, coordinate };
                Ok(coupling.map_or(Joint::Prismatic(own), |coupling| {
                    let moves = SingleJoint::Prismatic(own);
                    Joint::Coupled(Coupled { moves, coupling })
                }))
            }
        }
    }

    /// Index of a joint's coordinate, or of the one that it follows, and how it follows.
    fn coordinate_of(
        &mut self,
        i: usize,
        solid: &SolidDescription,
    ) -> Result<(usize, Option<Coupling>), ModelError> {
        let Some(coupled) = &solid.coupled else {
            self.joints
                .push(JointProperties::of(self.bodies.len(), solid));
            return Ok((self.joints.len() - 1, None));
        };
        let mut joints = self.joints.iter();
        let joint = joints.position(|joint| self.bodies[joint.body].name == coupled.joint);
        let joint = joint.ok_or_else(|| coupled_apart(i, solid))?;
        let coupling = Coupling {
            ratio: coupled.ratio,
            offset: coupled.offset,
            combined: None,
        };
        // Springs, dampers and rotors of a coupled joint act on the joint that it follows.
        let passive = Passive::of(solid).seen_through(&coupling);
        self.joints[joint].passive = self.joints[joint].passive.with(&passive);
        Ok((joint, Some(coupling)))
    }

    /// Adds the mass and shapes of a solid to the body that carries its frame.
    fn carry(&mut self, solid: &SolidDescription, frame: Frame) -> Result<(), ModelError> {
        let own = solid.mass_properties()?;
        let centre = frame.position + frame.rotation * own.centre;
        let about_centre = frame.rotation * own.inertia * frame.rotation.transpose();
        let sum = &mut self.mass_sums[frame.body];
        sum.mass += solid.mass;
        sum.moment += centre * solid.mass;
        sum.inertia += about_centre + SymmetricMatrix3::point_mass(solid.mass, &centre).to_matrix();
        if let (true, Some(shape)) = (solid.collides, &solid.shape) {
            let material = named(solid.material.as_ref(), "body");
            self.touch_with(shape, material, &frame, centre, frame.rotation);
        }
        for placed in solid.shapes.iter().filter(|placed| placed.collides) {
            let centre = frame.position + frame.rotation * placed.centre();
            let turn = placed.turn();
            let rotation = turn.map_or(frame.rotation, |turn| frame.rotation * turn);
            let material = named(placed.material.as_ref(), "body");
            self.touch_with(&placed.shape, material, &frame, centre, rotation);
        }
        self.frames.push(frame);
        Ok(())
    }

    /// Adds a collision part of the solid with this frame, positioned in the body's frame.
    fn touch_with(
        &mut self,
        shape: &Shape,
        material: String,
        frame: &Frame,
        centre: Vector3<f64>,
        rotation: Matrix3<f64>,
    ) {
        let (body, name) = (frame.body, frame.name.clone());
        let mut about = centre;
        let form = match shape {
            Shape::Box { size } => {
                self.boxes.push(CollisionBox {
                    body,
                    name,
                    material,
                    centre,
                    rotation,
                    half_size: Vector3::from(*size) * 0.5,
                });
                return;
            }
            Shape::Sphere { radius } => {
                self.spheres.push(CollisionSphere {
                    body,
                    name,
                    material,
                    centre,
                    radius: *radius,
                });
                return;
            }
            Shape::Disc { .. } => return,
            Shape::Cylinder { radius, height } => ColliderForm::Cylinder {
                radius: *radius,
                half: 0.5 * height,
            },
            Shape::Capsule { radius, height } => ColliderForm::Capsule {
                radius: *radius,
                half: 0.5 * height,
            },
            Shape::Ellipsoid { radii } => ColliderForm::Ellipsoid {
                radii: Vector3::from(*radii),
            },
            Shape::Hull { .. } => {
                let Some(polytope) = shape.polytope() else {
                    return; // refused by the checks
                };
                about += rotation * polytope.centroid();
                ColliderForm::Hull {
                    polytope: Arc::new(polytope),
                }
            }
        };
        self.colliders.push(Collider {
            body,
            name,
            material,
            centre: about,
            rotation,
            form,
        });
    }

    fn settle_masses(&mut self) {
        for (body, sum) in self.bodies.iter_mut().zip(&self.mass_sums) {
            body.mass = sum.mass;
            body.centre_of_mass = sum.moment / sum.mass;
            let steiner = SymmetricMatrix3::point_mass(sum.mass, &body.centre_of_mass).to_matrix();
            let about = SymmetricMatrix3::from_matrix(&(sum.inertia - steiner));
            let off = about.xy.abs() + about.xz.abs() + about.yz.abs();
            if off <= 1e-14 * (about.xx + about.yy + about.zz) {
                body.principal_inertia = Vector3::new(about.xx, about.yy, about.zz);
            } else {
                let eigen = about.to_matrix().symmetric_eigen();
                body.principal_inertia = eigen.eigenvalues;
                let mut axes = eigen.eigenvectors;
                if axes.determinant() < 0.0 {
                    // Left-handed axes would reverse the gyroscopic moment.
                    axes.column_mut(0).neg_mut();
                }
                body.principal_axes = Some(axes);
            }
        }
    }
}

/// A material, or the default.
fn named(material: Option<&String>, default: &str) -> String {
    material.map_or_else(|| default.to_owned(), String::clone)
}

fn coupled_apart(i: usize, solid: &SolidDescription) -> ModelError {
    let name = solid.coupled.as_ref().map(|c| c.joint.clone());
    ModelFault::CoupledApart(name.unwrap_or_default()).at(format!("solids[{i}].coupled.joint"))
}

fn tree(t: usize, bodies: &[Body], paths: &Paths) -> Tree {
    let own = || (0..bodies.len()).filter(|&b| bodies[b].tree == t);
    let first = own().next().unwrap_or(0);
    let range = first..first + own().count();
    let of_tree = |k: &usize| range.contains(&paths.body_of_velocity[*k]);
    let mut velocities = (0..paths.body_of_velocity.len()).filter(of_tree);
    let from = velocities.next();
    let n = from.map_or(0, |_| 1 + velocities.count());
    let from = from.unwrap_or(0);
    Tree {
        velocities: from..from + n,
        is_free: matches!(bodies[first].joint, Joint::Free(_)),
        self_contact: false,
        mass: bodies[range.clone()].iter().map(|b| b.mass).sum(),
        reach: (bodies[range.clone()].iter().filter(|b| b.parent.is_some()))
            .map(|b| b.position.norm())
            .sum(),
        bodies: range,
    }
}

/// The materials with a friction of their own.
fn own_frictions(description: &ModelDescription) -> Arc<[OwnFriction]> {
    let of = |own: &MaterialDescription| OwnFriction {
        material: own.name.clone(),
        friction_coefficient: own.friction,
    };
    description.materials.iter().map(of).collect()
}

fn wheels(
    description: &ModelDescription,
    index_of: &HashMap<&str, usize>,
    frames: &[Frame],
    bodies: &[Body],
    joints: &[JointProperties],
) -> Vec<Wheel> {
    let own = |name: &str| bodies.iter().find(|body| body.name == name);
    let joint_of = |name: &str| {
        let body = own(name).filter(|body| !body.is_coupled)?;
        body.joint.coordinate()
    };
    // Wheels that turn as one share the drive of one joint.
    let driving = |name: &str| {
        let body = own(name)?;
        let turns_alike = (body.joint.coupling()).is_none_or(|own| (own.ratio - 1.0).abs() <= 0.0);
        let coordinate = body.joint.coordinate().filter(|_| turns_alike)?;
        (!body.is_coupled || joints[coordinate].drive.is_none()).then_some(coordinate)
    };
    let mut wheels = Vec::new();
    for (wheel, tread) in description.wheels.iter().zip(description.treads()) {
        let Some(frame) = index_of.get(wheel.solid.as_str()).map(|&k| &frames[k]) else {
            continue;
        };
        let axle = frame.rotation * Vector3::from(wheel.axle).normalize();
        wheels.push(Wheel {
            name: wheel.name.clone(),
            body: frame.body,
            centre: frame.position,
            axle,
            spoke: perpendicular(&axle),
            radius: wheel.contact_radius.unwrap_or(wheel.radius),
            width: wheel.width.unwrap_or(0.0),
            rounding: wheel.rounding.unwrap_or(0.0),
            rollers: wheel.rollers.map(|angle| sin_cos(angle).into()),
            across: (description.materials.iter())
                .find(|own| own.name == wheel.material.as_deref().unwrap_or("wheel"))
                .and_then(MaterialDescription::across),
            grouser_height: wheel.grouser_height.unwrap_or(0.0),
            grousers: wheel.grousers.unwrap_or(0),
            tread,
            material: named(wheel.material.as_ref(), "wheel"),
            torque_limit: wheel.torque_limit,
            drive_sign: wheel.drive_sign,
            motor: wheel.motor,
            speed_gain: 0.0,
            joint: driving(&wheel.solid),
            share: 1.0,
            steering: wheel.steering.as_deref().and_then(joint_of),
            steering_limit: wheel.steering_limit.unwrap_or(0.0),
        });
    }
    for i in 0..wheels.len() {
        let alike = wheels.iter().filter(|other| other.joint == wheels[i].joint);
        wheels[i].share = 1.0 / alike.count() as f64;
    }
    wheels
}

/// An arbitrary unit vector perpendicular to a given unit vector.
fn perpendicular(axle: &Vector3<f64>) -> Vector3<f64> {
    let e = if axle.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    Rotation3::face_towards(axle, &e) * -Vector3::x()
}
