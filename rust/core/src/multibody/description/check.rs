//! Checks of a description, in the order of its text.

use std::collections::{HashMap, HashSet};
use std::f64::consts::FRAC_PI_2;

use super::check_loops::check_loops;
use super::check_shapes::check_shapes;
use super::check_values::{
    direction, finite, in_range, length, material, moderate, not_negative, place, positive, within,
};
use super::join::check_machines;
use super::joint::{JointKind, JointLimits};
use super::masses::mass_left;
use super::{
    MAX_SHAPES, MAX_SOLIDS, MAX_TRIANGLES, ModelDescription, SolidDescription, WheelDescription,
};
use crate::multibody::error::{ModelError, ModelFault};

/// Least angle of rollers from the axle, rad. At 0 they would turn in place of the wheel.
const LEAST_ROLLER_ANGLE: f64 = 0.01;

/// Largest friction across a wheel over that along: the ratio scales a row of the contact problem.
const MOST_ACROSS: f64 = 100.0;

/// Checks the whole description, in the order of its text.
pub(in crate::multibody) fn check(description: &ModelDescription) -> Result<(), ModelError> {
    if description.solids.is_empty() {
        return Err(ModelFault::NoSolids.at("solids"));
    }
    let n_shapes = description.solids.iter().map(|s| s.shapes.len()).sum();
    let drawings = description.solids.iter().flat_map(|s| &s.drawings);
    let n_triangles = drawings.map(|drawing| drawing.faces.len()).sum();
    for (field, what, count, limit) in [
        ("solids", "solids", description.solids.len(), MAX_SOLIDS),
        ("wheels", "wheels", description.wheels.len(), MAX_SOLIDS),
        ("tags", "tags", description.tags.len(), MAX_SOLIDS),
        ("loops", "loops", description.loops.len(), MAX_SOLIDS),
        (
            "materials",
            "materials",
            description.materials.len(),
            MAX_SOLIDS,
        ),
        ("solids", "shapes", n_shapes, MAX_SHAPES),
        ("solids", "triangles", n_triangles, MAX_TRIANGLES),
    ] {
        if count > limit {
            return Err(ModelFault::TooMany { what, count, limit }.at(field));
        }
    }
    let mut solids: HashMap<&str, usize> = HashMap::new();
    for (i, solid) in description.solids.iter().enumerate() {
        if solids.contains_key(solid.name.as_str()) {
            return Err(
                ModelFault::DuplicateName(solid.name.clone()).at(format!("solids[{i}].name"))
            );
        }
        check_joint(i, solid, &solids)?;
        check_body(i, solid)?;
        solids.insert(&solid.name, i);
    }
    check_trees(description)?;
    check_wheels(description, &solids)?;
    check_tags(description, &solids)?;
    check_materials(description)?;
    check_loops(description, &solids)?;
    check_machines(description, &solids)
}

/// Checks the joint of a solid. `before`: the solids listed before it.
fn check_joint(
    i: usize,
    solid: &SolidDescription,
    before: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].{what}");
    let missing = |what: &str| ModelFault::Missing.at(at(what));
    let kind = solid.joint_kind();
    let has_axis = kind.has_axis();
    let given = [
        (solid.parent.is_some(), "parent", kind != JointKind::Free),
        (
            solid.position.is_some(),
            "position",
            kind != JointKind::Free,
        ),
        (
            solid.rotation.is_some(),
            "rotation",
            kind != JointKind::Free,
        ),
        (solid.axis.is_some(), "axis", has_axis),
        (solid.hold.is_some(), "hold", has_axis),
        (solid.spring.is_some(), "spring", has_axis),
        (solid.damping.is_some(), "damping", has_axis),
        (solid.friction.is_some(), "friction", has_axis),
        (solid.armature.is_some(), "armature", has_axis),
        (solid.limits.is_some(), "limits", has_axis),
        (solid.drive.is_some(), "drive", kind == JointKind::Revolute),
        (solid.coupled.is_some(), "coupled", has_axis),
        (solid.locked.is_some(), "locked", has_axis),
    ];
    // An accidental root would fall out of its machine.
    if i > 0 && solid.parent.is_none() && solid.joint.is_none() {
        return Err(missing("parent"));
    }
    let unwanted = (given.iter()).find(|(is_given, _, is_allowed)| *is_given && !is_allowed);
    if let Some((_, what, _)) = unwanted {
        return Err(ModelFault::NotForJoint {
            what,
            joint: kind.name(),
        }
        .at(at(what)));
    }
    if let Some(parent) = &solid.parent
        && !before.contains_key(parent.as_str())
    {
        return Err(ModelFault::UnknownParent(parent.clone()).at(at("parent")));
    }
    if kind == JointKind::Free {
        return Ok(());
    }
    if has_axis {
        direction(&at("axis"), solid.axis.ok_or_else(|| missing("axis"))?)?;
    }
    let position = solid.position.ok_or_else(|| missing("position"))?;
    place(&at("position"), &position)?;
    for angle in solid.rotation.iter().flatten() {
        in_range(&at("rotation"), *angle, 1e3, "at most 1e3 rad either way")?;
    }
    check_properties(i, solid, before)
}

/// Checks spring, damper, rotor and drive of a revolute or prismatic joint.
fn check_properties(
    i: usize,
    solid: &SolidDescription,
    before: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].{what}");
    if let Some(value) = solid.locked {
        in_range(&at("locked"), value, 1e9, "at most 1e9 rad")?;
    }
    if let Some(hold) = solid.hold {
        moderate(&at("hold.stiffness"), hold.stiffness)?;
        moderate(&at("hold.damping"), hold.damping)?;
    }
    if let Some(spring) = solid.spring {
        moderate(&at("spring.stiffness"), spring.stiffness)?;
        in_range(&at("spring.rest"), spring.rest, 1e9, "at most 1e9 rad or m")?;
    }
    moderate(&at("damping"), solid.damping.unwrap_or(0.0))?;
    moderate(&at("friction"), solid.friction.unwrap_or(0.0))?;
    moderate(&at("armature"), solid.armature.unwrap_or(0.0))?;
    check_limits(i, solid)?;
    if let Some(drive) = solid.drive {
        moderate(&at("drive.torque_limit"), drive.torque_limit)?;
        if let Some(motor) = drive.motor {
            motor.check(|field| at(&format!("drive.motor.{field}")))?;
        }
    }
    let Some(coupled) = &solid.coupled else {
        return Ok(());
    };
    if !before.contains_key(coupled.joint.as_str()) {
        return Err(ModelFault::UnknownName(coupled.joint.clone()).at(at("coupled.joint")));
    }
    in_range(
        &at("coupled.ratio"),
        coupled.ratio,
        1e6,
        "at most 1e6 either way",
    )?;
    in_range(
        &at("coupled.offset"),
        coupled.offset,
        1e9,
        "at most 1e9 rad or m",
    )?;
    for (is_given, what) in [
        (solid.hold.is_some(), "hold"),
        (solid.limits.is_some(), "limits"),
        (solid.drive.is_some(), "drive"),
        (solid.locked.is_some(), "locked"),
    ] {
        if is_given {
            return Err(ModelFault::NotForJoint {
                what,
                joint: "coupled",
            }
            .at(at(what)));
        }
    }
    Ok(())
}

/// Checks the stops of a joint.
fn check_limits(i: usize, solid: &SolidDescription) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].limits.{what}");
    let Some(limits) = solid.limits else {
        return Ok(());
    };
    let JointLimits { lower, upper } = limits;
    for (field, value) in [("lower", lower), ("upper", upper)] {
        in_range(&at(field), value, 1e9, "at most 1e9 rad or m either way")?;
    }
    if lower < upper {
        return Ok(());
    }
    Err(ModelFault::NotBelow {
        value: lower,
        upper,
    }
    .at(at("lower")))
}

/// Checks that the solids of a tree are listed together.
fn check_trees(description: &ModelDescription) -> Result<(), ModelError> {
    let mut roots: HashMap<&str, usize> = HashMap::new();
    let mut current = 0;
    for (i, solid) in description.solids.iter().enumerate() {
        let root = match solid.parent.as_deref() {
            None => i,
            Some(parent) => roots.get(parent).copied().unwrap_or(current),
        };
        if solid.parent.is_some() && root != current {
            return Err(ModelFault::OtherTree(description.solids[root].name.clone())
                .at(format!("solids[{i}].parent")));
        }
        current = root;
        roots.insert(&solid.name, root);
    }
    Ok(())
}

/// Checks mass, shape and inertia of a solid.
fn check_body(i: usize, solid: &SolidDescription) -> Result<(), ModelError> {
    let at = |what: &str| format!("solids[{i}].{what}");
    positive(&at("mass"), solid.mass)?;
    let is_within = (1e-9..=1e12).contains(&solid.mass);
    within(is_within, &at("mass"), solid.mass, "from 1e-9 to 1e12 kg")?;
    check_shapes(i, solid)?;
    place(
        &at("centre_of_mass"),
        &solid.centre_of_mass.unwrap_or_default(),
    )?;
    for entry in solid.inertia.iter().flatten() {
        in_range(&at("inertia"), *entry, 1e24, "at most 1e24 kg m²")?;
    }
    let of_solid = |error: ModelError| error.within(&format!("solids[{i}]"));
    mass_left(solid).map_err(of_solid)?;
    let inertia = solid.mass_properties().map_err(of_solid)?.inertia;
    let principal = inertia.symmetric_eigenvalues();
    let (sum, largest) = (principal.sum(), principal.max());
    if principal.min() <= 0.0 || largest > (sum - largest) * (1.0 + 1e-9) {
        return Err(ModelFault::ImpossibleInertia(principal.into()).at(at("inertia")));
    }
    Ok(())
}

fn check_tags(
    description: &ModelDescription,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let mut names = HashSet::new();
    for (i, tag) in description.tags.iter().enumerate() {
        let at = |what: &str| format!("tags[{i}].{what}");
        if solids.contains_key(tag.name.as_str()) || !names.insert(tag.name.as_str()) {
            return Err(ModelFault::DuplicateName(tag.name.clone()).at(at("name")));
        }
        if !solids.contains_key(tag.solid.as_str()) {
            return Err(ModelFault::UnknownName(tag.solid.clone()).at(at("solid")));
        }
        place(&at("position"), &tag.position)?;
        for angle in tag.rotation.iter().flatten() {
            in_range(&at("rotation"), *angle, 1e3, "at most 1e3 rad either way")?;
        }
    }
    Ok(())
}

fn check_materials(description: &ModelDescription) -> Result<(), ModelError> {
    let mut names = HashSet::new();
    for (i, own) in description.materials.iter().enumerate() {
        let at = |what: &str| format!("materials[{i}].{what}");
        material(&at("name"), Some(&own.name))?;
        if !names.insert(own.name.as_str()) {
            return Err(ModelFault::DuplicateName(own.name.clone()).at(at("name")));
        }
        moderate(&at("friction"), own.friction)?;
        if let Some(across) = own.friction_across {
            moderate(&at("friction_across"), across)?;
            positive(&at("friction"), own.friction)?;
            in_range(
                &at("friction_across"),
                across,
                own.friction * MOST_ACROSS,
                "at most 100 times the friction along",
            )?;
        }
    }
    Ok(())
}

/// Checks width, rounding, grousers and rollers of a wheel; `at` gives the path of its fields.
fn check_width(at: &impl Fn(&str) -> String, wheel: &WheelDescription) -> Result<(), ModelError> {
    let (width, rounding) = (wheel.width.unwrap_or(0.0), wheel.rounding.unwrap_or(0.0));
    if width != 0.0 {
        not_negative(&at("width"), width)?;
        length(&at("width"), width)?;
    }
    not_negative(&at("rounding"), rounding)?;
    let radius = wheel.contact_radius.unwrap_or(wheel.radius);
    for (is_within, range) in [
        (rounding <= 0.5 * width, "at most half the wheel's width"),
        (rounding < radius, "smaller than the wheel's radius"),
    ] {
        within(is_within, &at("rounding"), rounding, range)?;
    }
    let height = wheel.grouser_height.unwrap_or(0.0);
    not_negative(&at("grouser_height"), height)?;
    let range = "at most the wheel's radius";
    within(height <= radius, &at("grouser_height"), height, range)?;
    let angle = wheel.rollers.unwrap_or(FRAC_PI_2);
    let is_crossed = (LEAST_ROLLER_ANGLE..=FRAC_PI_2).contains(&angle.abs());
    let range = "from 0.01 to π/2 rad either way";
    within(is_crossed, &at("rollers"), angle, range)
}

/// Checks how a wheel yields; `at` gives the path of its fields.
fn check_compliance(
    at: &impl Fn(&str) -> String,
    wheel: &WheelDescription,
) -> Result<(), ModelError> {
    if let Some(deflection) = wheel.deflection {
        positive(&at("deflection"), deflection)?;
        in_range(&at("deflection"), deflection, 0.5, "at most 0.5")?;
    }
    if let Some(stiffness) = wheel.stiffness {
        not_negative(&at("stiffness"), stiffness)?;
        in_range(&at("stiffness"), stiffness, 1e12, "at most 1e12 N/m")?;
    }
    let damping = wheel.damping.unwrap_or(0.0);
    not_negative(&at("damping"), damping)?;
    in_range(&at("damping"), damping, 1e12, "at most 1e12 N s/m")?;
    let mut beside = vec![("damping", damping)];
    if let Some(ratio) = wheel.tangential_ratio {
        positive(&at("tangential_ratio"), ratio)?;
        in_range(&at("tangential_ratio"), ratio, 1e6, "at most 1e6")?;
        beside.push(("tangential_ratio", ratio));
    }
    if let Some(relaxation) = wheel.relaxation_length {
        length(&at("relaxation_length"), relaxation)?;
        beside.push(("relaxation_length", relaxation));
    }
    let is_rigid = match wheel.stiffness {
        Some(stiffness) => stiffness == 0.0,
        None => wheel.deflection.is_none(),
    };
    match beside.into_iter().find(|(_, value)| *value != 0.0) {
        Some((field, value)) => {
            let range = "given beside a stiffness or a deflection";
            within(!is_rigid, &at(field), value, range)
        }
        None => Ok(()),
    }
}

fn check_wheels(
    description: &ModelDescription,
    solids: &HashMap<&str, usize>,
) -> Result<(), ModelError> {
    let mut names = HashSet::new();
    for (i, wheel) in description.wheels.iter().enumerate() {
        let at = |what: &str| format!("wheels[{i}].{what}");
        if !names.insert(wheel.name.as_str()) {
            return Err(ModelFault::DuplicateName(wheel.name.clone()).at(at("name")));
        }
        let find = |field: &str, name: &String| {
            let found = solids.get(name.as_str()).copied();
            found.ok_or_else(|| ModelFault::UnknownName(name.clone()).at(at(field)))
        };
        let mut solid = find("solid", &wheel.solid)?;
        if description.solids[solid].drive.is_some() {
            return Err(ModelFault::NotForJoint {
                what: "drive",
                joint: "wheel's",
            }
            .at(format!("solids[{solid}].drive")));
        }
        direction(&at("axle"), wheel.axle)?;
        length(&at("radius"), wheel.radius)?;
        if let Some(radius) = wheel.contact_radius {
            length(&at("contact_radius"), radius)?;
        }
        check_width(&at, wheel)?;
        check_compliance(&at, wheel)?;
        material(&at("material"), wheel.material.as_ref())?;
        if let Some(radius) = description.solids[solid].disc_radius(&wheel.axle)
            && (radius - wheel.radius).abs() > 1e-9 * radius
        {
            return Err(ModelFault::RadiusContradictsShape {
                value: wheel.radius,
                solid: wheel.solid.clone(),
                shape: radius,
            }
            .at(at("radius")));
        }
        moderate(&at("torque_limit"), wheel.torque_limit)?;
        finite(&at("drive_sign"), &[wheel.drive_sign])?;
        if (wheel.drive_sign.abs() - 1.0).abs() > 0.0 {
            return Err(ModelFault::NotASign(wheel.drive_sign).at(at("drive_sign")));
        }
        if let Some(motor) = wheel.motor {
            motor.check(|field| at(&format!("motor.{field}")))?;
        }
        if let Some(gain) = wheel.speed_gain {
            positive(&at("speed_gain"), gain)?;
            in_range(&at("speed_gain"), gain, 1e12, "at most 1e12 N m s/rad")?;
        }
        if let Some(name) = &wheel.steering {
            let steering = find("steering", name)?;
            // Parents precede their children, so the ascent terminates.
            while solid > steering {
                let parent = description.solids[solid].parent.as_deref();
                solid = parent.and_then(|p| solids.get(p).copied()).unwrap_or(0);
            }
            if solid != steering || description.solids[steering].parent.is_none() {
                return Err(ModelFault::SteeringNotAbove(name.clone()).at(at("steering")));
            }
            let Some(limit) = wheel.steering_limit else {
                return Err(ModelFault::Missing.at(at("steering_limit")));
            };
            moderate(&at("steering_limit"), limit)?;
        }
    }
    Ok(())
}
