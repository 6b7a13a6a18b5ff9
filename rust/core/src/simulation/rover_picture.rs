//! Colour pictures of a rover and its ground.

use super::rover::RoverSimulation;
use crate::geometry::SphereField;
use crate::geometry::picture::{Drawing, Look, PictureScene, Pixel, RutRelief, Shot, take};
use crate::geometry::ray::Ray;
use crate::multibody::landmarks;

/// What a picture shows besides the ground.
#[derive(Clone, Copy, Default)]
pub struct Shown<'a> {
    /// What is drawn of the rover's solids, by their names.
    pub drawings: &'a [(String, Drawing)],
    /// Solids that only cast shadows, such as the one that carries the camera.
    pub hidden: &'a [String],
    /// Grains around the rover.
    pub balls: Option<&'a SphereField>,
}

impl RoverSimulation {
    /// The pixels of rays, with ruts where wheels have left the sand, and the rover where it is
    /// now. Drawings of solids that the model lacks are left out.
    #[must_use]
    pub fn take_picture(
        &self,
        look: &Look,
        shown: &Shown<'_>,
        rays: &[Ray],
        shot: &Shot,
    ) -> Vec<Pixel> {
        let (model, kinematics) = (self.model(), self.kinematics());
        let placed = landmarks::poses(model, &kinematics).filter_map(|(name, origin, R)| {
            let (_, drawing) = shown.drawings.iter().find(|(solid, _)| solid == name)?;
            let is_seen = !shown.hidden.iter().any(|hidden| hidden == name);
            Some((drawing.placed(origin, R), is_seen))
        });
        let terrain = &**self.terrain();
        let ruts = self.sand().zip(terrain.soft());
        let ruts = ruts.and_then(|(sand, soft)| RutRelief::new(&sand.ruts, soft.cell));
        let scene = PictureScene::new(terrain, ruts, shown.balls, placed.collect());
        take(&scene, look, rays, shot)
    }
}
