//! The mechanism of a model and its inertias, as the sources of the dynamics read them.

use nalgebra::{Matrix3, Vector3};

use super::Body;
use super::properties::JointProperties;
use super::tree::{BodyPath, Paths, Tree};
use crate::multibody::inertias::{Inertia, Inertias};
use crate::multibody::joint::{Joint, JointModel};
use crate::multibody::mechanism::{Link, Mechanism, OwnJoint, PathVelocity, Symmetry, TreeSpan};
use crate::scalar::{Single, Vec3};

/// The mechanism of bodies with their paths.
pub(super) fn mechanism_of(
    bodies: &[Body],
    trees: &[Tree],
    joints: &[JointProperties],
    paths: &Paths,
    (n_poses, n_rotations): (usize, usize),
) -> Mechanism {
    let own = |has: fn(&Body) -> bool| (0..bodies.len()).filter(move |&b| has(&bodies[b]));
    let mut mechanism = Mechanism {
        joints: (joints.iter())
            .map(|joint| OwnJoint {
                body: joint.body,
                velocity: joint.velocity,
                cluster: 0,
                arm: 1.0,
            })
            .collect(),
        rotors: (0..joints.len())
            .filter(|&joint| joints[joint].passive.armature > 0.0)
            .collect(),
        coupled: own(|body| body.is_coupled).collect(),
        spinning: own(|body| body.is_spinner && !body.is_coupled)
            .map(|b| bodies[b].velocity)
            .collect(),
        n_poses,
        n_rotations,
        n_motions: paths.n_motions,
        ..Mechanism::default()
    };
    let mut pose = 0;
    for (t, tree) in trees.iter().enumerate() {
        // The first pose is the first body's, whether it is free or not.
        pose += usize::from(tree.is_free && t > 0);
        let first = mechanism.rows.len();
        for k in tree.velocities.clone() {
            mechanism.tree_of.push(t);
            add_row(&mut mechanism, bodies, paths, tree, k);
        }
        mechanism.trees.push(TreeSpan {
            bodies: tree.bodies.clone(),
            velocities: tree.velocities.clone(),
            rows: first..mechanism.rows.len(),
            is_free: tree.is_free,
            pose: if t > 0 { pose } else { 0 },
            cluster: t,
        });
    }
    for b in 0..bodies.len() {
        add_link(&mut mechanism, bodies, paths, b);
    }
    mechanism
}

/// Adds the row of velocity `k`, if it is a joint's.
fn add_row(mechanism: &mut Mechanism, bodies: &[Body], paths: &Paths, tree: &Tree, k: usize) {
    let b = paths.body_of_velocity[k];
    if !matches!(bodies[b].joint, Joint::Free(_)) {
        let own = &paths.of[b];
        let path = (own.velocities.iter())
            .skip(tree.lead())
            .take_while(|&&i| i <= k);
        let start = mechanism.columns.len();
        let first = tree.velocities.start + tree.lead();
        for (i, motion) in path.zip(&own.motions) {
            mechanism.columns.push(i - first);
            mechanism.column_motions.push(*motion);
        }
        mechanism.rows.push(start..mechanism.columns.len());
    }
    mechanism
        .diagonals
        .push(mechanism.columns.len().saturating_sub(1));
}

fn add_link(mechanism: &mut Mechanism, bodies: &[Body], paths: &Paths, b: usize) {
    let body = &bodies[b];
    let span = &mechanism.trees[body.tree];
    let BodyPath {
        velocities,
        motions,
    } = &paths.of[b];
    let rest = &velocities[span.lead()..];
    let first = span.velocities.start + span.lead();
    let last_row = (rest.last()).map(|&k| mechanism.rows[span.rows.start + k - first].clone());
    let n_rows = match &body.joint {
        Joint::Free(_) => 0,
        joint => joint.nv(),
    };
    let (path, movers) = (mechanism.paths.len(), mechanism.movers.len());
    mechanism.paths.extend(velocities);
    let pairs = rest.iter().zip(motions);
    (mechanism.movers).extend(pairs.map(|(&velocity, &motion)| PathVelocity { velocity, motion }));
    let mut others = bodies[b + 1..].iter();
    let is_leaf = !others.clone().any(|other| other.parent == Some(b));
    note_angles(mechanism, body);
    mechanism.links.push(Link {
        tree: body.tree,
        parent: body.parent.unwrap_or(b),
        position: body.position.into(),
        along: (0..3).find(|&k| (0..3).all(|i| i == k || body.position[i] == 0.0)),
        rotation: body.rotation.map(Into::into),
        joint: body.joint,
        velocity: body.velocity,
        motion: body.motion,
        is_spinner: body.is_spinner,
        is_leaf,
        is_plain_leaf: is_leaf && !body.is_coupled,
        is_last: !others.any(|other| other.parent == body.parent),
        is_centred: body.is_centred(),
        symmetry: symmetry_of(body),
        n_rows,
        row: last_row.unwrap_or_default(),
        path: path..mechanism.paths.len(),
        movers: movers..mechanism.movers.len(),
    });
}

/// Notes the velocities that turn a body, its angle and its rotation.
fn note_angles(mechanism: &mut Mechanism, body: &Body) {
    let (joint, k) = (&body.joint, body.velocity);
    if let Some(rate) = joint
        .turning()
        .filter(|_| body.is_coupled || !body.is_spinner)
    {
        (mechanism.turning).extend((0..joint.n_motions()).map(|i| (k + i, rate)));
    }
    if let Some((number, coupling)) = joint.angle().filter(|_| !body.is_spinner) {
        let own = mechanism.angles.len();
        (mechanism.coupled_angles).extend(coupling.map(|coupling| (own, coupling)));
        mechanism.angles.push(number);
    }
    if joint.first_angle().is_some() {
        mechanism.rotating.push((*joint, k));
    }
}

/// The inertias of bodies.
pub(super) fn inertias_of(
    mechanism: &Mechanism,
    bodies: &[Body],
    trees: &[Tree],
    joints: &[JointProperties],
) -> Inertias<f64> {
    let mut inertias = Inertias::new(Single::best(), mechanism);
    inertias.bodies = bodies.iter().map(inertia_of).collect();
    let rotors = mechanism.rotors.iter();
    inertias.rotors = rotors.map(|&j| joints[j].passive.armature).collect();
    inertias.trees = trees.iter().map(|tree| tree.mass).collect();
    inertias.mass = bodies.iter().map(|body| body.mass).sum();
    inertias
}

fn inertia_of(body: &Body) -> Inertia<f64> {
    let I = &body.principal_inertia;
    let [rest, first, second] = match symmetry_of(body) {
        Symmetry::AboutX => [I.y, I.x - I.y, 0.0],
        Symmetry::AboutY => [I.x, I.y - I.x, 0.0],
        Symmetry::AboutZ => [I.x, I.z - I.x, 0.0],
        Symmetry::None | Symmetry::Turned => [I.z, I.x - I.z, I.y - I.z],
    };
    let P = body.principal_axes.unwrap_or_else(Matrix3::identity);
    Inertia {
        mass: body.mass,
        centre: body.centre_of_mass.into(),
        rest,
        first,
        second,
        axes: [0, 1].map(|k| Vec3::from(Vector3::from(P.column(k)))),
    }
}

fn symmetry_of(body: &Body) -> Symmetry {
    let I: &Vector3<f64> = &body.principal_inertia;
    let is_equal = |a: f64, b: f64| (a - b).abs() <= 1e-14 * I.sum();
    if body.principal_axes.is_some() {
        Symmetry::Turned
    } else if is_equal(I.x, I.y) {
        Symmetry::AboutZ
    } else if is_equal(I.x, I.z) {
        Symmetry::AboutY
    } else if is_equal(I.y, I.z) {
        Symmetry::AboutX
    } else {
        Symmetry::None
    }
}
