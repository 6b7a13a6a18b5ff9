//! Points, axes, poses and coordinates of a machine by their names.

use nalgebra::{Matrix3, Vector3};

use super::joint::JointModel;
use super::kinematics::Kinematics;
use super::model::{Frame, Model};
use super::momentum::centre_of_mass;

/// Where a point of a solid's frame is in the world, m.
fn place(kinematics: &Kinematics, frame: &Frame, local: &Vector3<f64>) -> Vector3<f64> {
    let point = frame.position + frame.rotation * local;
    kinematics.origin(frame.body) + kinematics.point(frame.body, &point)
}

/// Named points and axes in the world frame: the origin of every solid and the model's tags, m; the
/// unit axle of every wheel, `axle_FL` and so on; the mass centre, `centre_of_mass`, m.
#[must_use]
pub fn tags(model: &Model, kinematics: &Kinematics) -> Vec<(String, Vector3<f64>)> {
    let mut tags = Vec::new();
    for frame in model.frames() {
        let origin = kinematics.origin(frame.body) + kinematics.point(frame.body, &frame.position);
        tags.push((frame.name.clone(), origin));
    }
    for tag in &model.description().tags {
        if let Some(frame) = model.frames().iter().find(|f| f.name == tag.solid) {
            tags.push((
                tag.name.clone(),
                place(kinematics, frame, &tag.position.into()),
            ));
        }
    }
    for wheel in model.wheels() {
        tags.push((
            format!("axle_{}", wheel.name),
            kinematics.R(wheel.body) * wheel.axle,
        ));
    }
    tags.push((
        "centre_of_mass".to_owned(),
        centre_of_mass(model, kinematics),
    ));
    tags
}

/// Name, origin (m) and rotation matrix of every solid in the world frame.
pub fn poses<'a>(
    model: &'a Model,
    kinematics: &'a Kinematics,
) -> impl Iterator<Item = (&'a str, Vector3<f64>, Matrix3<f64>)> {
    model.frames().iter().map(|frame| {
        let origin = kinematics.origin(frame.body) + kinematics.point(frame.body, &frame.position);
        (
            frame.name.as_str(),
            origin,
            kinematics.R(frame.body) * frame.rotation,
        )
    })
}

/// Names of the coordinates: x, y, z, roll, heading, pitch of the first root, then the joints; of
/// another body the name stands before a dot.
#[must_use]
pub fn coordinate_names(model: &Model) -> Vec<String> {
    let mut names = Vec::with_capacity(model.nv());
    for (b, body) in model.bodies().iter().enumerate() {
        let names_of_joint = body.joint.names().iter();
        names.extend(names_of_joint.map(|&x| match x {
            "" => body.name.clone(),
            x if b == 0 => x.to_owned(),
            x => format!("{}.{x}", body.name),
        }));
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::multibody::Configuration;

    #[test]
    fn the_rover_at_zero_has_its_solids_where_they_are_described() {
        let model = Model::rover();
        let kinematics = Kinematics::of(&model, &Configuration::zero(&model));
        let tags = tags(&model, &kinematics);
        for (name, origin, R) in poses(&model, &kinematics) {
            let (_, tag) = tags.iter().find(|(other, _)| other == name).unwrap();
            assert_eq!(*tag, origin);
            assert!((R.determinant() - 1.0).abs() < 1e-14);
        }
        let axles = tags.iter().filter(|(name, _)| name.starts_with("axle_"));
        assert!(
            axles
                .clone()
                .all(|(_, axle)| (axle.norm() - 1.0).abs() < 1e-14)
        );
        assert_eq!(axles.count(), 6);
        assert_eq!(coordinate_names(&model).len(), model.nv());
    }
}
