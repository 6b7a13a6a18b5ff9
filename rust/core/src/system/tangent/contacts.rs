//! Places of contacts that change with their bodies, and products with their rows of H.

use super::held_tree::{HeldContact, TangentScene};
use super::pass::Tangent;
use crate::contact::Contact;
use crate::contact::contact_slope::SlopeOfBody;
use crate::contact::jacobian::sides;
use crate::contact::limit;
use crate::contact::rows::{Place, Triple, add_scaled};
use crate::law::compliance::Yielding;
use crate::multibody::{Model, Poses};
use crate::scalar::{Dual, Lane, Vec3};

/// A contact with its derivatives: its place relative to its body's tree, and its gap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Varying<T> {
    pub place: Place<Dual<T>>,
    pub gap: Dual<T>,
}

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
        let mut add = |body: usize, slope: &SlopeOfBody| {
            let moved = twist(model, poses, body);
            for (moved, slope) in moved.iter().zip(slope) {
                for (sum, x) in slopes.iter_mut().zip(slope) {
                    *sum += *moved * T::splat(token, *x);
                }
            }
        };
        if held.joint.is_none() {
            add(contact.body, &held.slope.own);
            if let (Some(other), Some(slope)) = (contact.other, &held.slope.other) {
                add(other.body, slope);
            }
        }
        let number = |x: f64, slope: T| Dual::new(T::splat(token, x), slope);
        let vector = |x: &[f64], k: usize| {
            Vec3::new(
                number(x[0], slopes[k]),
                number(x[1], slopes[k + 1]),
                number(x[2], slopes[k + 2]),
            )
        };
        let origin = poses.origin_of(model.bodies()[contact.body].tree);
        let mut x = vector(contact.point.as_slice(), 0);
        for (x, origin) in [
            (&mut x.x, origin.x),
            (&mut x.y, origin.y),
            (&mut x.z, origin.z),
        ] {
            x.slope -= origin.slope;
        }
        let [n, t, b] = contact.frame.rows();
        let mut gap = number(contact.gap, slopes[12]);
        if let (Some(joint), Some((_, sign))) = (held.joint, limit::row(model, contact)) {
            gap.slope = T::splat(token, sign) * self.end.joints[joint].slope;
        }
        Varying {
            place: Place {
                x,
                n: vector(n.as_slice(), 3),
                t: vector(t.as_slice(), 6),
                b: vector(b.as_slice(), 9),
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
        if let Some((k, sign)) = limit::row(scene.model, contact) {
            sum[0] = zero.like(sign) * x[k];
            return sum;
        }
        let poses = &self.poses_end;
        for (body, sign, path) in sides(scene.model.mechanism(), contact) {
            let place = self.seen_from(scene.model, i, contact, body);
            let sign = zero.like(sign);
            path.for_each_row(
                |m| poses.motions[m],
                &place,
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
        if let Some((k, sign)) = limit::row(scene.model, contact) {
            self.y[k] += number(sign * p[0]);
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
            place.x = place.x + (own - other);
        }
        place
    }

    /// The law of a contact that yields.
    #[inline(always)]
    pub(super) fn yielding(&self, scene: &TangentScene<'_>, i: usize) -> Option<Yielding<Dual<T>>> {
        let compliance = scene.held.contacts[i].compliance?;
        let options = scene.options;
        let number = |x: f64| Dual::splat(self.token, x);
        let h = number(options.time_step);
        let zero = number(0.0);
        let one = T::splat(self.token, 1.0);
        let law = crate::law::compliance::Compliance {
            stiffness: number(compliance.stiffness) * Dual::new(one, self.d_stiffness),
            damping: number(compliance.damping) * Dual::new(one, self.d_damping),
        };
        // As the step without a memory takes it.
        let weight = self.inertias.mass * number(options.gravity.norm()) * h;
        let u_N = self.local(scene, i, &self.v)[0];
        let step = (h, number(options.theta));
        Some(law.over(step, self.contacts[i].gap, u_N, [weight, zero, zero]))
    }
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
