//! Places of contacts that change with their bodies, and products with their rows of H.

use nalgebra::Vector3;

use super::held_tree::{HeldContact, TangentScene};
use super::scratch::{Tangent, Varying};
use crate::contact::contact_slope::SlopeOfBody;
use crate::contact::jacobian::sides;
use crate::contact::limit;
use crate::contact::rows::{Place, Triple, add_scaled};
use crate::contact::{Contact, Part, clusters_of};
use crate::law::compliance::{Compliance, Yielding};
use crate::multibody::{Model, Poses};
use crate::scalar::{Dual, Lane, Vec3};

impl<T: Lane> Tangent<T> {
    /// Places all contacts at the predicted end of the step.
    #[inline(always)]
    pub(super) fn place_contacts(&mut self, scene: &TangentScene<'_>) {
        self.contacts.clear();
        let contacts = scene.held.step.contacts.iter();
        for (contact, held) in contacts.zip(&scene.held.contacts) {
            let varying = self.place(scene.model, contact, held);
            self.contacts.push(varying);
        }
    }

    #[inline(always)]
    fn place(&self, model: &Model, contact: &Contact, held: &HeldContact) -> Varying<T> {
        let token = self.token;
        let poses = &self.poses_end;
        let mut slopes = [T::splat(token, 0.0); 13];
        if held.joint.is_none() {
            add_slopes(
                &mut slopes,
                twist(model, poses, contact.body),
                &held.slope.own,
            );
            if let (Some(other), Some(slope)) = (contact.other, &held.slope.other) {
                add_slopes(&mut slopes, twist(model, poses, other.body), slope);
            }
        }
        let origin = poses.origin_of(model.bodies()[contact.body].tree);
        let mut x = vector(&contact.point, &slopes[..3]);
        x.x.slope -= origin.x.slope;
        x.y.slope -= origin.y.slope;
        x.z.slope -= origin.z.slope;
        let mut gap = Dual::new(T::splat(token, contact.gap), slopes[12]);
        if let (Some(joint), Some((_, sign, 0))) = (held.joint, limit::joint_row(model, contact)) {
            gap.slope = T::splat(token, sign) * self.end.joints[joint].slope;
        }
        let [n, t, b] = contact.frame.rows();
        Varying {
            place: Place {
                x,
                n: vector(&n, &slopes[3..6]),
                t: vector(&t, &slopes[6..9]),
                b: vector(&b, &slopes[9..12]),
            },
            gap,
        }
    }

    /// `Hᵀ x` of a contact, x (nv).
    #[inline(always)]
    pub(super) fn local(
        &self,
        scene: &TangentScene<'_>,
        i: usize,
        x: &[Dual<T>],
    ) -> Triple<Dual<T>> {
        let contact = &scene.held.step.contacts[i];
        let zero = Dual::splat(self.token, 0.0);
        let mut sum = [zero; 3];
        if let Some((k, sign, row)) = limit::joint_row(scene.model, contact) {
            sum[row] = zero.like(sign) * x[k];
            return sum;
        }
        let poses = &self.poses_end;
        for (body, sign, path) in sides(scene.model.mechanism(), contact) {
            let place = self.seen_from(scene.model, i, contact, body);
            let sign = zero.like(sign);
            path.for_each_row(
                #[inline(always)]
                |m| poses.motions[m],
                &place,
                #[inline(always)]
                |k, row| add_scaled(&mut sum, &row, sign * x[k]),
            );
        }
        sum
    }

    /// `y += H p` of a contact.
    #[inline(always)]
    pub(super) fn push(&mut self, scene: &TangentScene<'_>, i: usize, p: [f64; 3]) {
        let contact = &scene.held.step.contacts[i];
        let number = |x: f64| Dual::splat(self.token, x);
        if let Some((k, sign, row)) = limit::joint_row(scene.model, contact) {
            self.y[k] += number(sign * p[row]);
            return;
        }
        for (body, sign, path) in sides(scene.model.mechanism(), contact) {
            let place = self.seen_from(scene.model, i, contact, body);
            let [force, moment] = place.wrench(p.map(|p| number(sign * p)));
            if let Some(first) = path.base {
                let both = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
                for (y, x) in self.y[first..].iter_mut().zip(both) {
                    *y += x;
                }
            }
            for mover in path.movers {
                let power = self.poses_end.motions[mover.motion].power(force, moment);
                self.y[mover.velocity] += power;
            }
        }
    }

    /// The place of a contact relative to the origin of another body's tree.
    #[inline(always)]
    fn seen_from(&self, model: &Model, i: usize, contact: &Contact, body: usize) -> Place<Dual<T>> {
        let mut place = self.contacts[i].place;
        let trees = [contact.body, body].map(|body| model.bodies()[body].tree);
        if trees[0] != trees[1] {
            let [own, other] = trees.map(|tree| self.poses_end.origin_of(tree));
            place.x += own - other;
        }
        place
    }

    /// The law of a contact that yields.
    #[inline(always)]
    pub(super) fn yielding(&self, scene: &TangentScene<'_>, i: usize) -> Option<Yielding<Dual<T>>> {
        let held = &scene.held.contacts[i];
        if !held.is_soft {
            return None;
        }
        let options = scene.options;
        let number = |x: f64| Dual::splat(self.token, x);
        let h = number(options.time_step);
        let zero = number(0.0);
        let one = T::splat(self.token, 1.0);
        let of = |part: Part| {
            let (tread, wheel) = part.tread(scene.model)?;
            let (mechanism, poses) = (scene.model.mechanism(), &self.poses_middle);
            let n = self.contacts[i].place.n;
            let own = tread.rolling(poses.rolling(mechanism, wheel, n, |k| self.v[k]));
            Some(Compliance {
                stiffness: own.stiffness * Dual::new(one, self.d_stiffness),
                damping: own.damping * Dual::new(one, self.d_damping),
                tangential: own.tangential * Dual::new(one, self.d_stiffness),
                ..own
            })
        };
        let contact = &scene.held.step.contacts[i];
        let other = contact.other.and_then(|other| of(other.part));
        let law = Compliance::in_series(of(contact.part), other)?;
        // As the step without a memory takes it.
        let mechanism = scene.model.mechanism();
        let [cluster, _] = clusters_of(scene.model, &contact.key);
        let weight = self.inertias.mass_of(mechanism, cluster) * number(options.gravity.norm()) * h;
        let u_N = self.local(scene, i, &self.v)[0];
        let step = (h, number(options.theta));
        let unknown = (T::mask(self.token, u32::MAX >> (32 - T::LANES)), weight);
        Some(law.over(step, self.contacts[i].gap, u_N, [zero; 3], unknown))
    }
}

/// Adds the derivatives of a contact along a displacement and turn of a body.
#[inline(always)]
fn add_slopes<T: Lane>(slopes: &mut [T; 13], moved: [T; 6], of_body: &SlopeOfBody) {
    for (moved, of_body) in moved.iter().zip(of_body) {
        for (sum, x) in slopes.iter_mut().zip(of_body) {
            *sum += *moved * moved.like(*x);
        }
    }
}

/// A vector with its derivatives.
#[inline(always)]
fn vector<T: Lane>(x: &Vector3<f64>, slopes: &[T]) -> Vec3<Dual<T>> {
    let number = |k: usize| Dual::new(slopes[k].like(x[k]), slopes[k]);
    Vec3::new(number(0), number(1), number(2))
}

/// Displacement of a body's origin and its turn, world axes.
#[inline(always)]
fn twist<T: Lane>(model: &Model, poses: &Poses<Dual<T>>, body: usize) -> [T; 6] {
    let origin = poses.origin_of(model.bodies()[body].tree);
    let pose = &poses.bodies[body];
    let slope = |v: Vec3<Dual<T>>| Vec3::new(v.x.slope, v.y.slope, v.z.slope);
    let value = |v: Vec3<Dual<T>>| Vec3::new(v.x.value, v.y.value, v.z.value);
    let shift = slope(origin) + slope(pose.r);
    let [x, y, z] = pose.R.columns();
    let turned = |axis| value(axis).cross(slope(axis));
    let turn = (turned(x) + turned(y) + turned(z)) * shift.x.like(0.5);
    [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z]
}
