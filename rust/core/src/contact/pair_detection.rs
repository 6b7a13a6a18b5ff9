//! Detection of the contacts between bodies that a step must consider.
//!
//! Two parts can touch if they belong to different trees or, in a model with self-contact
//! ([`crate::multibody::ModelDescription::self_contact`]), to bodies of one tree that no joint
//! connects. There is no sweep between bodies: parts that move by more than a third of their
//! thicknesses against each other in a step may pass (`tests/machines/test_several.py`).

use super::activation::Activation;
use super::body_motion::{BodyMotion, Still};
use super::detection::fastest_way;
use super::frame::ContactFrame;
use super::jacobian::relative_velocity;
use super::pair::{Contact, ContactKey, OtherSide};
use super::part::Part;
use super::relocation::place_pair;
use crate::geometry::Sphere;
use crate::geometry::broad_phase::IntervalSweep;
use crate::geometry::query::pairs;
use crate::multibody::{Kinematics, Model};

/// Scratch of the search, allocated once for a model.
#[derive(Clone, Debug, Default)]
pub struct PairSearch {
    /// Empty if no two parts of the model can touch.
    parts: Vec<Part>,
    balls: Vec<Sphere>,
    sweep: IntervalSweep,
}

impl PairSearch {
    /// Scratch for a model.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let parts: Vec<Part> = Part::all(model).collect();
        let mut later = parts.iter().enumerate();
        if !later.any(|(i, a)| (parts[i + 1..].iter()).any(|b| can_touch(model, *a, *b))) {
            return Self::default();
        }
        Self {
            balls: Vec::with_capacity(parts.len()),
            sweep: IntervalSweep::with_capacity(parts.len()),
            parts,
        }
    }
}

/// Whether two parts are a candidate pair.
fn can_touch(model: &Model, a: Part, b: Part) -> bool {
    model.can_touch(a.body(model), b.body(model))
}

/// Adds the contacts between bodies of a configuration with velocity `v` (nv) to `out`;
/// `kinematics` as for [`super::detect`].
pub fn detect_pairs(
    model: &Model,
    kinematics: &Kinematics,
    v: &[f64],
    activation: &Activation,
    search: &mut PairSearch,
    out: &mut Vec<Contact>,
) {
    let machine = Still::new(model.mechanism(), kinematics.poses(), v);
    detect_pairs_of(model, &machine, activation, search, out);
}

/// Adds the contacts between bodies to `out`, with poses and velocities from `motion`.
pub(crate) fn detect_pairs_of(
    model: &Model,
    motion: &impl BodyMotion,
    activation: &Activation,
    search: &mut PairSearch,
    out: &mut Vec<Contact>,
) {
    let PairSearch {
        parts,
        balls,
        sweep,
    } = search;
    if parts.is_empty() {
        return;
    }
    let reach = activation.hover;
    let first_origin = motion.origin(parts[0].body(model));
    balls.clear();
    balls.extend(parts.iter().map(|part| {
        let body = part.body(model);
        let shift = motion.origin(body) - first_origin;
        let (R, r) = motion.pose(body);
        let way = match activation.lead.abs() {
            lead if lead > 0.0 => lead * fastest_way(&part.place_at(model, (&R, &r)), body, motion),
            _ => 0.0,
        };
        Sphere::new(r + R * part.centre(model) + shift, part.bound(model) + way)
    }));
    let is_wanted = |i: usize, j: usize| can_touch(model, parts[i], parts[j]);
    for &(i, j) in sweep.pairs(balls, reach, is_wanted) {
        // Wheels come first, so a contact that involves a wheel belongs to the wheel.
        let (part, other) = (parts[i as usize], parts[j as usize]);
        let ways = [i, j].map(|k| balls[k as usize].radius - parts[k as usize].bound(model));
        let reach = reach.max(ways[0] + ways[1]);
        let other = OtherSide {
            part: other,
            body: other.body(model),
        };
        let (first, second) = place_pair(model, motion, other.part, part);
        pairs::visit_pair(&first, &second, reach, |point| {
            let contact = Contact {
                key: ContactKey::between(part, point.feature, other.part),
                part,
                body: part.body(model),
                other: Some(other),
                point: point.point,
                frame: ContactFrame::of_pair(&second, point),
                gap: point.gap,
                excess: 0.0,
            };
            let u_N = || (contact.frame.n).dot(&relative_velocity(motion, &contact));
            if activation.admits(contact.gap, u_N) {
                out.push(contact);
            }
        });
    }
}
