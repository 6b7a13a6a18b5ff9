//! Checks of the loops of a description.

use std::collections::{HashMap, HashSet};

use super::check_values::{in_range, place, within};
use super::closure::{LoopDescription, LoopKind, MAX_TERMS};
use super::{JointKind, ModelDescription};
use crate::multibody::error::{ModelError, ModelFault};

/// Checks names and numbers. Whether the loops close is seen when the machine is built.
pub(super) fn check_loops(
    description: &ModelDescription,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let mut names = HashSet::new();
    for (i, closure) in description.loops.iter().enumerate() {
        let at = |what: &str| format!("loops[{i}].{what}");
        if !names.insert(closure.name.as_str()) {
            return Err(ModelFault::DuplicateName(closure.name.clone()).at(at("name")));
        }
        let ends = [
            ("solid", Some(&closure.solid)),
            ("other", closure.other.as_ref()),
        ];
        for (what, name) in ends {
            let Some(name) = name else { continue };
            let Some(&solid) = solids.get(name.as_str()) else {
                return Err(ModelFault::UnknownName(name.clone()).at(at(what)));
            };
            let solid = &description.solids[solid];
            if closure.kind == LoopKind::Joint
                && (!solid.joint_kind().has_axis() || solid.locked.is_some())
            {
                return Err(ModelFault::NotForJoint {
                    what: "coordinate",
                    joint: if solid.locked.is_some() {
                        "locked"
                    } else {
                        solid.joint_kind().name()
                    },
                }
                .at(at(what)));
            }
        }
        check_fields(closure, at)?;
        check_ends(description, closure, i, solids)?;
    }
    Ok(())
}

/// Checks the numbers of a loop; `at` gives the path of its fields.
fn check_fields(closure: &LoopDescription, at: impl Fn(&str) -> String) -> Result<(), ModelError> {
    let is_joint = closure.kind == LoopKind::Joint;
    for (is_given, what, is_allowed) in [
        (closure.position.is_some(), "position", !is_joint),
        (
            closure.other_position.is_some(),
            "other_position",
            !is_joint,
        ),
        (
            closure.other_rotation.is_some(),
            "other_rotation",
            closure.kind == LoopKind::Weld,
        ),
        (closure.polynomial.is_some(), "polynomial", is_joint),
    ] {
        if is_given && !is_allowed {
            return Err(ModelFault::NotForLoop {
                what,
                kind: closure.kind.name(),
            }
            .at(at(what)));
        }
    }
    place(&at("position"), &closure.position.unwrap_or_default())?;
    place(
        &at("other_position"),
        &closure.other_position.unwrap_or_default(),
    )?;
    for angle in closure.other_rotation.iter().flatten() {
        in_range(
            &at("other_rotation"),
            *angle,
            1e3,
            "at most 1e3 rad either way",
        )?;
    }
    let terms = closure.polynomial.as_deref().unwrap_or(&[0.0]);
    let most = if closure.other.is_some() {
        MAX_TERMS
    } else {
        1
    };
    let range = if most == 1 {
        "one coefficient, since the loop has no other joint"
    } else {
        "one to five coefficients"
    };
    let n = terms.len();
    within((1..=most).contains(&n), &at("polynomial"), n as f64, range)?;
    for term in terms {
        in_range(&at("polynomial"), *term, 1e6, "at most 1e6 either way")?;
    }
    Ok(())
}

/// A loop from a free tree to another one, or to the world, has no place until a state is given.
fn check_ends(
    description: &ModelDescription,
    closure: &LoopDescription,
    i: usize,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    if closure.kind == LoopKind::Joint || is_placed(description, closure, solids) {
        return Ok(());
    }
    let needed = [
        (closure.other_position.is_none(), "other_position"),
        (
            closure.kind == LoopKind::Weld && closure.other_rotation.is_none(),
            "other_rotation",
        ),
    ];
    match needed.iter().find(|(is_missing, _)| *is_missing) {
        Some((_, what)) => Err(ModelFault::Missing.at(format!("loops[{i}].{what}"))),
        None => Ok(()),
    }
}

/// Whether the zero of all joints determines where both ends of a loop are, relative to each other.
pub(in crate::multibody) fn is_placed(
    description: &ModelDescription,
    closure: &LoopDescription,
    solids: &HashMap<&str, usize>,
) -> bool {
    let root = |name: &str| {
        let mut solid = solids.get(name).copied()?;
        while let Some(parent) = &description.solids[solid].parent {
            solid = *solids.get(parent.as_str())?;
        }
        Some(solid)
    };
    let is_free = |root: Option<usize>| {
        root.is_some_and(|root| description.solids[root].joint_kind() == JointKind::Free)
    };
    let first = root(&closure.solid);
    let second = closure.other.as_deref().and_then(root);
    first == second || !(is_free(first) || is_free(second))
}
