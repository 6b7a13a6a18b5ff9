//! Tracks become rows of wheels whose joints follow that of the first.

use std::collections::HashSet;

use nalgebra::{Matrix3, Vector3};

use super::check_values::{
    direction, in_range, length, material, moderate, place, positive, within,
};
use super::tracks::MOST_TRACK_WHEELS;
use super::yielding::Share;
use super::{
    CouplingDescription, JointKind, ModelDescription, SolidDescription, TrackDescription,
    WheelDescription,
};
use crate::multibody::error::{ModelError, ModelFault};

impl ModelDescription {
    /// Replaces all tracks by solids and wheels.
    ///
    /// # Errors
    /// The first invalid entry of a track.
    pub(in crate::multibody) fn lay_tracks(&mut self) -> Result<(), ModelError> {
        if self.tracks.is_empty() {
            return Ok(());
        }
        let known: HashSet<&str> = self.solids.iter().map(|own| own.name.as_str()).collect();
        for (i, track) in self.tracks.iter().enumerate() {
            check_track(track, &known, |what| format!("tracks[{i}].{what}"))?;
        }
        let tracks = std::mem::take(&mut self.tracks);
        let own: f64 = self.solids.iter().map(|solid| solid.mass).sum();
        let mass = own + tracks.iter().map(|track| track.mass).sum::<f64>();
        let more: usize = tracks.iter().map(|track| track.wheels).sum();
        let n = self.wheels.len() + more;
        for track in &tracks {
            let shared = Share { mass, n }.of_cylinder(track.radius);
            let end = self.end_of_tree(&track.solid);
            let (solids, wheels): (Vec<_>, Vec<_>) =
                (0..track.wheels).map(|k| track.wheel(k, shared)).unzip();
            self.solids.splice(end..end, solids);
            self.wheels.extend(wheels);
        }
        Ok(())
    }

    /// Index behind the last solid of the tree of a solid.
    fn end_of_tree(&self, name: &str) -> usize {
        let solids = || self.solids.iter().enumerate();
        let begin = solids().find(|(_, own)| own.name == name);
        let begin = begin.map_or(0, |(k, _)| k);
        let mut roots = solids().skip(begin + 1);
        let next = roots.find(|(_, own)| own.parent.is_none());
        next.map_or(self.solids.len(), |(k, _)| k)
    }
}

impl TrackDescription {
    fn name_of(&self, k: usize) -> String {
        if k == 0 {
            self.name.clone()
        } else {
            format!("{}_{}", self.name, k + 1)
        }
    }

    /// Distance of the last wheel from the first, m.
    fn run(&self) -> f64 {
        (Vector3::from(self.to) - Vector3::from(self.from)).norm()
    }

    /// The k-th wheel: a ring with its share of the mass. `shared`: default stiffness and damping.
    fn wheel(&self, k: usize, shared: [f64; 2]) -> (SolidDescription, WheelDescription) {
        let name = self.name_of(k);
        let part = k as f64 / (self.wheels - 1) as f64;
        let at = |i: usize| self.from[i] + part * (self.to[i] - self.from[i]);
        let mass = self.mass / self.wheels as f64;
        let follows = CouplingDescription {
            joint: self.name.clone(),
            ratio: 1.0,
            offset: 0.0,
        };
        let solid = SolidDescription {
            name: name.clone(),
            parent: Some(self.solid.clone()),
            joint: Some(JointKind::Revolute),
            position: Some([at(0), at(1), at(2)]),
            axis: Some(self.axle),
            mass,
            inertia: Some(ring(mass * self.radius * self.radius, self.axle)),
            hold: self.hold.filter(|_| k == 0),
            coupled: (k > 0).then_some(follows),
            ..SolidDescription::default()
        };
        let is_end = k == 0 || k + 1 == self.wheels;
        let share = if is_end { 0.5 } else { 1.0 };
        let [stiffness, damping] = match self.stiffness {
            Some(stiffness) => [stiffness, self.damping.unwrap_or(0.0)],
            None => shared,
        };
        let wheel = WheelDescription {
            name: name.clone(),
            solid: name,
            axle: self.axle,
            radius: self.radius,
            width: self.width,
            rounding: self.rounding,
            stiffness: Some(share * stiffness),
            damping: Some(share * damping),
            // A belt lies still on the ground from its first wheel to its last.
            relaxation_length: (stiffness > 0.0).then(|| self.run()),
            material: self.material.clone(),
            torque_limit: self.torque_limit / self.wheels as f64,
            drive_sign: self.drive_sign,
            motor: self.motor,
            speed_gain: self.speed_gain.map(|gain| gain / self.wheels as f64),
            ..WheelDescription::default()
        };
        (solid, wheel)
    }
}

/// Inertia of a thin ring about its centre, `about` its axle: xx, yy, zz, xy, xz, yz.
fn ring(about: f64, axle: [f64; 3]) -> [f64; 6] {
    let s = Vector3::from(axle).normalize();
    let I = (Matrix3::identity() + s * s.transpose()) * (0.5 * about);
    [
        I[(0, 0)],
        I[(1, 1)],
        I[(2, 2)],
        I[(0, 1)],
        I[(0, 2)],
        I[(1, 2)],
    ]
}

/// Checks the fields of a track; those that its wheels have are checked with them, too.
fn check_track(
    track: &TrackDescription,
    known: &HashSet<&str>,
    at: impl Fn(&str) -> String,
) -> Result<(), ModelError> {
    if !known.contains(track.solid.as_str()) {
        return Err(ModelFault::UnknownName(track.solid.clone()).at(at("solid")));
    }
    for k in 0..track.wheels.min(MOST_TRACK_WHEELS) {
        let name = track.name_of(k);
        if known.contains(name.as_str()) {
            return Err(ModelFault::DuplicateName(name).at(at("name")));
        }
    }
    let (n, is_within) = (
        track.wheels,
        (2..=MOST_TRACK_WHEELS).contains(&track.wheels),
    );
    within(is_within, &at("wheels"), n as f64, "from 2 to 100")?;
    place(&at("from"), &track.from)?;
    place(&at("to"), &track.to)?;
    length(&at("radius"), track.radius)?;
    direction(&at("axle"), track.axle)?;
    positive(&at("mass"), track.mass)?;
    in_range(&at("mass"), track.mass, 1e12, "at most 1e12 kg")?;
    moderate(&at("torque_limit"), track.torque_limit)?;
    for (what, value) in [
        ("width", track.width),
        ("rounding", track.rounding),
        ("stiffness", track.stiffness),
        ("damping", track.damping),
    ] {
        moderate(&at(what), value.unwrap_or(0.0))?;
    }
    if track.damping.is_some() && track.stiffness.is_none() {
        return Err(ModelFault::Missing.at(at("stiffness")));
    }
    material(&at("material"), track.material.as_ref())?;
    if let Some(motor) = track.motor {
        motor.check(|field| at(&format!("motor.{field}")))?;
    }
    if let Some(gain) = track.speed_gain {
        positive(&at("speed_gain"), gain)?;
        in_range(&at("speed_gain"), gain, 1e12, "at most 1e12 N m s/rad")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_turns_about_any_axle_with_all_of_its_mass() {
        let axle = [0.3, -0.5, 0.8];
        let [xx, yy, zz, xy, xz, yz] = ring(2.0, axle);
        let I = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let s = Vector3::from(axle).normalize();
        assert!((I * s - s * 2.0).norm() < 1e-14);
        let across = s.cross(&Vector3::x()).normalize();
        assert!((I * across - across).norm() < 1e-14);
    }
}
