//! A mirror-symmetric rover driven straight, reduced to its plane of symmetry.
//!
//! In a scene that is symmetric about the vertical plane through the heading (equal torques left
//! and right, no steering, ground that falls or rises along the heading only), the motion is
//! symmetric: z, roll, heading and every joint that does not turn about z stay at zero, and the two
//! joints of a mirrored pair have one angle. With `v = P w`, where the columns of P span the
//! remaining motion, the machine is
//!
//! ```text
//! Pᵀ M P ẇ + Pᵀ (N v + G) = Pᵀ T u + Pᵀ H p
//! ```
//!
//! This is a planar tree whose bodies are the pairs, twice as heavy. The two contacts of a pair of
//! wheels share one normal and one tangent; their impulses add up, and their lateral parts vanish.
//!
//! Coordinates: x, y of the base's origin, its angle, then the angle of each pair's joint relative
//! to its carrier. Only wheels touch the ground; boxes do not.

use nalgebra::{Matrix3, Vector3};

use super::error::PlanarError;
use super::tree::{DiscWheel, PlanarBody, PlanarTree};
use crate::multibody::{Body, Joint, JointAxis, JointModel, JointProperties, Model, Passive};

/// Relative difference up to which two sides count as mirror images.
const ALIKE: f64 = 1e-9;

/// The planar image of a mirrored rover: 3 coordinates of the base, one for each pair of joints.
#[derive(Clone, Debug)]
pub struct MirroredRover {
    model: Model,
    tree: PlanarTree,
    /// Bodies of the model that are each part of the tree.
    bodies: Vec<Vec<usize>>,
    wheel_names: Vec<Vec<String>>,
}

impl From<MirroredRover> for PlanarTree {
    fn from(rover: MirroredRover) -> Self {
        rover.tree
    }
}

fn inertia_of(body: &Body) -> Matrix3<f64> {
    let I = Matrix3::from_diagonal(&body.principal_inertia);
    body.principal_axes.map_or(I, |P| P * I * P.transpose())
}

impl MirroredRover {
    /// The planar image of a model, all joints that do not turn about z locked at zero.
    ///
    /// # Errors
    /// A joint that a lock has turned out of the plane, a body without its mirror image.
    pub fn new(model: &Model) -> Result<Self, PlanarError> {
        let across: Vec<(String, f64)> = model.bodies()[1..]
            .iter()
            .filter(|b| b.joint.axis().is_some_and(|axis| *axis != JointAxis::Z))
            .map(|b| (b.name.clone(), 0.0))
            .collect();
        let model = model
            .with_locked_joints(&across)
            .map_err(|_| PlanarError::NotMirrored {
                body: model.bodies()[0].name.clone(),
            })?;
        let (parts, bodies) = pair_bodies(&model)?;
        let (wheels, wheel_names) = pair_wheels(&model, &bodies)?;
        Ok(Self {
            tree: PlanarTree::new(parts, wheels, model.fingerprint()),
            model,
            bodies,
            wheel_names,
        })
    }

    /// The model with all joints locked that the plane does not have.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The image.
    #[must_use]
    pub fn tree(&self) -> &PlanarTree {
        &self.tree
    }

    /// Names of the joints that share each coordinate from the fourth on.
    #[must_use]
    pub fn joints(&self) -> Vec<Vec<String>> {
        let name = |&b: &usize| self.model.bodies()[b].name.clone();
        let names = |bodies: &Vec<usize>| bodies.iter().map(name).collect();
        self.bodies[1..].iter().map(names).collect()
    }

    /// Names of the wheels of each disc.
    #[must_use]
    pub fn wheel_names(&self) -> &[Vec<String>] {
        &self.wheel_names
    }

    /// Velocity indices of [`Self::model`] that follow planar coordinate
    /// `k`: the entries of P's column that are 1.
    #[must_use]
    pub fn full_indices(&self, k: usize) -> Vec<usize> {
        match k {
            0 | 1 => vec![k],
            2 => vec![5],
            _ => {
                let bodies = self.bodies[k - 2].iter();
                bodies.map(|&b| self.model.bodies()[b].velocity).collect()
            }
        }
    }
}

/// Groups the bodies of a planar tree by mirror images: the parts, and the bodies of each.
fn pair_bodies(model: &Model) -> Result<(Vec<PlanarBody>, Vec<Vec<usize>>), PlanarError> {
    let bodies = model.bodies();
    // Nothing rotates out of the plane, so z adds up along the tree.
    let mut z = vec![0.0; bodies.len()];
    for (b, body) in bodies.iter().enumerate() {
        let is_in_plane = match (&body.joint, body.parent) {
            (Joint::Free(_), _) => b == 0,
            (Joint::Revolute(joint), Some(_)) => {
                body.rotation.is_none() && joint.axis == JointAxis::Z
            }
            _ => false,
        };
        if !is_in_plane {
            return Err(PlanarError::NotMirrored {
                body: body.name.clone(),
            });
        }
        z[b] = body.parent.map_or(0.0, |parent| z[parent]) + body.position.z;
    }
    let is_plain = |joint: &&JointProperties| {
        joint.passive == Passive::default() && joint.limits.is_none() && joint.drive.is_none()
    };
    if let Some(joint) = model.joints().iter().find(|joint| !is_plain(joint)) {
        return Err(PlanarError::NotMirrored {
            body: bodies[joint.body].name.clone(),
        });
    }
    let size = bodies
        .iter()
        .map(|b| b.position.norm())
        .fold(1e-3, f64::max);
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let are_alike = |a: usize, b: usize| {
        let (p, q) = (&bodies[a], &bodies[b]);
        let (I, J) = (inertia_of(p), mirror * inertia_of(q) * mirror);
        (p.mass - q.mass).abs() <= ALIKE * p.mass
            && (p.position.xy() - q.position.xy()).norm() <= ALIKE * size
            && (p.centre_of_mass.xy() - q.centre_of_mass.xy()).norm() <= ALIKE * size
            && (z[a] + p.centre_of_mass.z + z[b] + q.centre_of_mass.z).abs() <= ALIKE * size
            && (I - J).norm() <= ALIKE * I.norm()
    };
    let mut part_of: Vec<Option<usize>> = vec![None; bodies.len()];
    let (mut parts, mut groups) = (Vec::new(), Vec::new());
    for (a, body) in bodies.iter().enumerate() {
        if part_of[a].is_some() {
            continue;
        }
        let part_of_parent = |b: usize| bodies[b].parent.and_then(|parent| part_of[parent]);
        let parent = part_of_parent(a).unwrap_or(0);
        let partner = (a..bodies.len()).find(|&b| {
            let has_same_parent = b == a || (a > 0 && part_of_parent(b) == Some(parent));
            has_same_parent && part_of[b].is_none() && are_alike(a, b)
        });
        let Some(partner) = partner else {
            return Err(PlanarError::NotMirrored {
                body: body.name.clone(),
            });
        };
        let group = if partner == a {
            vec![a]
        } else {
            vec![a, partner]
        };
        for &b in &group {
            part_of[b] = Some(parts.len());
        }
        parts.push(PlanarBody {
            parent,
            joint: body.position.xy(),
            mass: group.iter().map(|&b| bodies[b].mass).sum(),
            centre: body.centre_of_mass.xy(),
            inertia: group.iter().map(|&b| inertia_of(&bodies[b])[(2, 2)]).sum(),
            is_absolute: false,
            is_spinner: group.iter().all(|&b| bodies[b].is_spinner),
        });
        groups.push(group);
    }
    Ok((parts, groups))
}

/// Groups the wheels by the parts that carry them: the pairs, and the names of each.
#[allow(clippy::type_complexity)] // two lists
fn pair_wheels(
    model: &Model,
    bodies: &[Vec<usize>],
) -> Result<(Vec<DiscWheel>, Vec<Vec<String>>), PlanarError> {
    let mut pairs: Vec<(DiscWheel, f64, Vec<String>)> = Vec::new();
    for wheel in model.wheels() {
        let refused = || PlanarError::NotMirrored {
            body: wheel.name.clone(),
        };
        let part = bodies.iter().position(|b| b.contains(&wheel.body));
        let part = part.ok_or_else(refused)?;
        if wheel.axle.xy().norm() > ALIKE {
            return Err(refused());
        }
        let gain = wheel.joint.map_or(0.0, |_| wheel.drive_sign);
        let known = pairs.iter_mut().find(|(pair, ..)| {
            pair.part == part
                && (pair.centre - wheel.centre.xy()).norm() <= ALIKE * (1.0 + pair.centre.norm())
        });
        if let Some((pair, sign, names)) = known {
            let differs = |a: f64, b: f64| (a - b).abs() > ALIKE * a.abs();
            if differs(pair.radius, wheel.radius)
                || differs(pair.torque_limit, wheel.torque_limit)
                || differs(*sign, gain)
                || pair.motor != wheel.motor
            {
                return Err(refused());
            }
            pair.gain += gain;
            names.push(wheel.name.clone());
        } else {
            let pair = DiscWheel {
                part,
                centre: wheel.centre.xy(),
                radius: wheel.radius,
                torque_limit: wheel.torque_limit,
                gain,
                motor: wheel.motor,
            };
            pairs.push((pair, gain, vec![wheel.name.clone()]));
        }
    }
    for (pair, _, names) in &pairs {
        if names.len() != bodies[pair.part].len() {
            return Err(PlanarError::NotMirrored {
                body: names[0].clone(),
            });
        }
    }
    let split = pairs.into_iter().map(|(pair, _, names)| (pair, names));
    Ok(split.unzip())
}
