//! The scene of an episode: ground, rocks, start, goal and properties of rover and world.

use std::sync::Arc;

use super::domain::{Domain, DomainDistribution};
use super::error::DrawError;
use super::pcg64::Pcg64;
use super::rocks::{RockDistribution, RockDraw, clear_radius};
use super::start::{FixedStart, Range, Start, StartDistribution, resting_pose, tilted_plane};
use crate::contact::detection::deepest_overlap;
use crate::geometry::{Plane, SphereField, Terrain};
use crate::integrator::StepOptions;
use crate::multibody::{Kinematics, coordinates};
use crate::simulation::{Placement, RoverScene};

/// Deepest overlap of rover and ground at a start, m; a deeper one is drawn again.
pub const START_OVERLAP: f64 = 0.01;

/// What the scenes of a task are drawn from.
#[derive(Clone, Debug)]
pub struct SceneDistribution {
    /// The rover before its masses are scaled, on any ground.
    pub rover: RoverScene,
    /// Options of its steps, before friction and gravity are drawn.
    pub options: StepOptions,
    /// Given ground of every episode, which has a plane; none where the plane is tilted.
    pub field: Option<Arc<SphereField>>,
    /// Rocks on the tilted plane, if there are any.
    pub rocks: Option<RockDistribution>,
    /// Whether the slope follows from the difficulty of the rocks.
    pub slope_by_difficulty: bool,
    /// Start and goal.
    pub start: StartDistribution,
    /// Properties of rover and world.
    pub domain: DomainDistribution,
    /// Distance from the goal within which no rock lies, m.
    pub goal_tolerance: f64,
}

/// What replaces the draws of one episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fixed {
    /// Start and goal.
    pub start: FixedStart,
    /// Difficulty of the rocks.
    pub difficulty: Option<f64>,
    /// Public coordinates and velocity (nv each), the latter at rest by default.
    pub state: Option<(Vec<f64>, Option<Vec<f64>>)>,
}

/// The ground of an episode.
#[derive(Clone, Debug)]
pub enum DrawnGround {
    /// A plane.
    Plane(Plane),
    /// Spheres on a plane.
    Field(Arc<SphereField>),
}

impl DrawnGround {
    /// As a simulation takes it.
    #[must_use]
    pub fn terrain(&self) -> Arc<dyn Terrain> {
        match self {
            Self::Plane(plane) => Arc::new(*plane),
            Self::Field(field) => field.clone(),
        }
    }
}

/// A drawn scene, in which the rover has room.
#[derive(Clone, Debug)]
pub struct DrawnScene {
    /// Slope, pose and goal.
    pub start: Start,
    /// The plane under everything.
    pub plane: Plane,
    /// Difficulty and rocks, where there are any.
    pub rocks: Option<RockDraw>,
    /// Properties of rover and world.
    pub domain: Domain,
    /// The ground.
    pub ground: DrawnGround,
    /// The rover with its masses scaled, on the ground, with friction and gravity of the episode.
    pub placement: Placement,
}

impl SceneDistribution {
    /// Draws scenes until the rover has room in one, at most `attempts`.
    ///
    /// `difficulty`: range that replaces that of the rocks' difficulty.
    ///
    /// # Errors
    /// `NoRoom`, and what model, ground, options or state refuse.
    pub fn draw(
        &self,
        random: &mut Pcg64,
        difficulty: Option<Range>,
        fixed: &Fixed,
        attempts: usize,
    ) -> Result<DrawnScene, DrawError> {
        let mut overlap = f64::NEG_INFINITY;
        for _ in 0..attempts {
            let drawn = self.draw_once(random, difficulty, fixed)?;
            overlap = drawn.deepest_overlap();
            if overlap >= -START_OVERLAP {
                return Ok(drawn);
            }
        }
        Err(DrawError::NoRoom { overlap, attempts })
    }

    /// Draws a scene, in which the rover may lack room. Every draw is made, whatever is fixed.
    fn draw_once(
        &self,
        random: &mut Pcg64,
        difficulty: Option<Range>,
        fixed: &Fixed,
    ) -> Result<DrawnScene, DrawError> {
        let rocks = self.rocks.as_ref();
        let rocks = rocks.map(|rocks| rocks.draw(random, difficulty, fixed.difficulty));
        let mut start = self.start.clone();
        if let (Some(rocks), true) = (rocks, self.slope_by_difficulty) {
            start.slope = rocks.slope();
        }
        let start = start.draw(random, &fixed.start);
        let domain = self.domain.draw(random);
        let (plane, ground) = match (&self.field, rocks) {
            (Some(field), _) => {
                let plane = field.ground().copied().unwrap_or_else(Plane::ground);
                (plane, DrawnGround::Field(field.clone()))
            }
            (None, rocks) => {
                let plane = tilted_plane(start.slope, start.uphill)?;
                let ground = match rocks {
                    Some(rocks) => DrawnGround::Field(Arc::new(rocks.lay_out(
                        &self.rover.model,
                        &start,
                        &plane,
                        clear_radius(&self.rover.model),
                        self.goal_tolerance,
                    )?)),
                    None => DrawnGround::Plane(plane),
                };
                (plane, ground)
            }
        };
        let scene = match domain.scaled(&self.rover.model)? {
            Some(scaled) => RoverScene::new(Arc::new(scaled), ground.terrain()),
            None => self.rover.on(ground.terrain()),
        };
        let options = domain.options(&self.options);
        options.check()?;
        let model = &*scene.model;
        let (q, v) = if let Some((q, v)) = &fixed.state {
            (q.clone(), v.clone())
        } else {
            let pose = resting_pose(model, &plane, start.position, start.heading)?;
            (pose, None)
        };
        let configuration = coordinates::from_public(model, &q)?;
        let v = v.unwrap_or_else(|| vec![0.0; model.nv()]);
        let v = coordinates::checked_velocity(model, &v)?;
        Ok(DrawnScene {
            start,
            plane,
            rocks,
            domain,
            placement: Placement {
                scene,
                options,
                configuration,
                v,
            },
            ground,
        })
    }
}

impl DrawnScene {
    /// Deepest gap of any part with the ground, m; 0 where nothing overlaps.
    fn deepest_overlap(&self) -> f64 {
        let RoverScene { model, terrain, .. } = &self.placement.scene;
        let kinematics = Kinematics::of(model, &self.placement.configuration);
        deepest_overlap(model, &kinematics, &**terrain)
    }
}
