//! Places of contacts that change with their bodies, and products with their rows of H.

use nalgebra::Vector3;

use super::held_places::Varying;
use super::held_system::HeldSystem;
use super::held_tree::HeldContact;
use crate::contact::contact_slope::SlopeOfBody;
use crate::contact::jacobian::sides;
use crate::contact::limit;
use crate::contact::rows::{Place, Triple, add_scaled, levelled};
use crate::contact::{Contact, Part};
use crate::law::compliance::Compliance;
use crate::multibody::{LaneConfiguration, Model, Poses};
use crate::scalar::{Dual, Lane, Vec3};

impl<T: Lane> HeldSystem<'_, T> {
    /// Places all contacts at the predicted end of the step, `q`.
    #[inline(always)]
    pub(super) fn place_contacts(&mut self, q: &LaneConfiguration<Dual<T>>) {
        let held = self.scene.held;
        let mut all = std::mem::take(&mut self.own.places.varying);
        all.clear();
        for (contact, own) in held.step.contacts.iter().zip(&held.contacts) {
            all.push(self.place(q, contact, own));
        }
        self.own.places.varying = all;
    }

    #[inline(always)]
    fn place(
        &self,
        q: &LaneConfiguration<Dual<T>>,
        contact: &Contact,
        held: &HeldContact,
    ) -> Varying<T> {
        let (model, token) = (self.scene.model, self.own.tree.token);
        let poses = &self.own.tree.poses_end;
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
            gap.slope = T::splat(token, sign) * q.joints[joint].slope;
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

    /// Writes the rows of Hᵀ of all contacts.
    #[inline(always)]
    pub(super) fn write_rows(&mut self) {
        let mut rows = std::mem::take(&mut self.own.rows);
        let mut starts = std::mem::take(&mut self.own.starts);
        rows.clear();
        starts.clear();
        let (model, zero) = (self.scene.model, self.number(0.0));
        let poses = &self.own.tree.poses_end;
        for (i, contact) in self.scene.held.step.contacts.iter().enumerate() {
            starts.push(rows.len());
            if let Some((k, sign, row)) = limit::joint_row(model, contact) {
                let mut own = [zero; 3];
                own[row] = zero.like(sign);
                rows.push((k, own));
                continue;
            }
            for (body, sign, path) in sides(model.mechanism(), contact) {
                let place = self.seen_from(i, contact, body);
                let sign = zero.like(sign);
                path.for_each_row(
                    #[inline(always)]
                    |m| poses.motions[m],
                    &place,
                    #[inline(always)]
                    |k, row| rows.push((k, [sign * row[0], sign * row[1], sign * row[2]])),
                );
                if contact.other.is_none() && contact.part.has_rigid_ends(model) {
                    for (_, row) in rows.iter_mut().skip(starts[i] + path.lead()) {
                        row[0] = levelled(row[0]);
                    }
                }
            }
        }
        starts.push(rows.len());
        (self.own.rows, self.own.starts) = (rows, starts);
    }

    /// The rows of Hᵀ of a contact, each with its velocity.
    #[inline(always)]
    fn rows(&self, i: usize) -> &[(usize, Triple<Dual<T>>)] {
        &self.own.rows[self.own.starts[i]..self.own.starts[i + 1]]
    }

    /// `Hᵀ x` of a contact, x (nv).
    #[inline(always)]
    pub(super) fn along(&self, i: usize, x: &[Dual<T>]) -> Triple<Dual<T>> {
        let mut sum = [self.number(0.0); 3];
        for (k, row) in self.rows(i) {
            add_scaled(&mut sum, row, x[*k]);
        }
        sum
    }

    /// `y += H p` of a contact.
    #[inline(always)]
    pub(super) fn push(&self, i: usize, p: &Triple<Dual<T>>, y: &mut [Dual<T>]) {
        for (k, row) in self.rows(i) {
            y[*k] += row[0] * p[0] + row[1] * p[1] + row[2] * p[2];
        }
    }

    /// The place of a contact relative to the origin of another body's tree.
    #[inline(always)]
    fn seen_from(&self, i: usize, contact: &Contact, body: usize) -> Place<Dual<T>> {
        let mut place = self.own.places.varying[i].place;
        let trees = [contact.body, body].map(|body| self.scene.model.bodies()[body].tree);
        if trees[0] != trees[1] {
            let [own, other] = trees.map(|tree| self.own.tree.poses_end.origin_of(tree));
            place.x += own - other;
        }
        place
    }

    /// Springs and damper of a contact that yields, at the velocity `v` (nv).
    #[inline(always)]
    pub(super) fn spring(&self, i: usize, v: &[Dual<T>]) -> Option<Compliance<Dual<T>>> {
        if !self.scene.held.contacts[i].is_soft {
            return None;
        }
        let contact = &self.scene.held.step.contacts[i];
        let own = self.spring_of(contact.part, i, v);
        match contact.other {
            None => own,
            Some(other) => Compliance::in_series(own, self.spring_of(other.part, i, v)),
        }
    }

    /// Spring and damper of a part at a contact.
    #[inline(always)]
    fn spring_of(&self, part: Part, i: usize, v: &[Dual<T>]) -> Option<Compliance<Dual<T>>> {
        let one = T::splat(self.own.tree.token, 1.0);
        let stiffness = Dual::new(one, self.own.d_stiffness);
        let (tread, wheel) = part.tread(self.scene.model)?;
        let (mechanism, poses) = (self.scene.model.mechanism(), &self.own.tree.poses_middle);
        let n = self.own.places.varying[i].place.n;
        let motion = poses.rolling(
            mechanism,
            wheel,
            n,
            #[inline(always)]
            |k| v[k],
        );
        let own = tread.rolling(motion);
        Some(Compliance {
            stiffness: own.stiffness * stiffness,
            damping: own.damping * Dual::new(one, self.own.d_damping),
            tangential: own.tangential * stiffness,
            ..own
        })
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
