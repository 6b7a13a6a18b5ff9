//! The ground of episodes: drawn anew for each, or the same for all.

use std::sync::Arc;

use super::hills::HillDistribution;
use super::sand::SandDistribution;
use rover_core::geometry::{
    HeightField, Plane, SoftGround, SphereField, Terrain, TerrainError, TriangleMesh, Union,
};

/// What the ground of episodes is.
#[derive(Clone, Debug)]
pub enum GroundDistribution {
    /// A plane with the slope of the start.
    Tilted,
    /// A given ground for all episodes.
    Given(DrawnGround),
    /// Hills, whose slope follows from the difficulty of the rocks.
    Hills(HillDistribution),
    /// Sand with ripples, on a plane with the slope of the start.
    Sand(SandDistribution),
}

/// The ground of an episode, by its kind.
#[derive(Clone, Debug)]
pub enum DrawnGround {
    /// A plane.
    Plane(Plane),
    /// Spheres, on a plane or not.
    Field(Arc<SphereField>),
    /// A map of heights.
    Map(Arc<HeightField>),
    /// A mesh.
    Mesh(Arc<TriangleMesh>),
    /// Sand under a surface, and what that is.
    Soft(Arc<SoftGround>, Arc<DrawnGround>),
    /// Several as one, and what they are.
    Union(Arc<Union>, Arc<[DrawnGround]>),
}

impl DrawnGround {
    /// Together with another.
    ///
    /// # Errors
    /// As [`Union::new`].
    pub fn with(self, other: Self) -> Result<Self, TerrainError> {
        let parts = [self, other];
        let union = Union::new(parts.iter().map(Self::terrain).collect())?;
        Ok(Self::Union(Arc::new(union), parts.into()))
    }

    /// What a machine that does not sink stands on, as a simulation takes it.
    ///
    /// # Errors
    /// As [`Union::new`].
    pub fn firm(&self) -> Result<Arc<dyn Terrain>, TerrainError> {
        Ok(match self {
            Self::Soft(_, surface) => surface.terrain(),
            Self::Union(_, parts) => {
                let parts: Result<_, _> = parts.iter().map(Self::firm).collect();
                Arc::new(Union::new(parts?)?)
            }
            _ => self.terrain(),
        })
    }

    /// Ground as a simulation takes it.
    #[must_use]
    pub fn terrain(&self) -> Arc<dyn Terrain> {
        match self {
            Self::Plane(plane) => Arc::new(*plane),
            Self::Field(field) => field.clone(),
            Self::Map(map) => map.clone(),
            Self::Mesh(mesh) => mesh.clone(),
            Self::Soft(soft, _) => soft.clone(),
            Self::Union(union, _) => union.clone(),
        }
    }

    /// Height of the ground without the spheres on it, m; None where it is not known.
    #[must_use]
    pub fn height(&self, x: f64, z: f64) -> Option<f64> {
        match self {
            Self::Plane(plane) => plane.height(x, z),
            Self::Field(field) => field.ground().and_then(|plane| plane.height(x, z)),
            Self::Map(map) => map.height(x, z),
            Self::Mesh(mesh) => mesh.height(x, z),
            Self::Soft(soft, _) => soft.height(x, z),
            Self::Union(_, parts) => {
                let heights = parts.iter().filter_map(|part| part.height(x, z));
                heights.reduce(f64::max)
            }
        }
    }
}
