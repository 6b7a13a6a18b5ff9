//! The scene of an episode: ground, rocks, start, goal and properties of rover and world.

use std::sync::Arc;

use super::domain::{Domain, DomainDistribution};
use super::error::{DrawError, Unsuitable};
use super::ground::{DrawnGround, GroundDistribution};
use super::pcg64::Pcg64;
use super::rocks::{RockDistribution, RockDraw, clear_radius};
use super::start::{FixedStart, Interval, Start, StartDistribution};
use super::way;
use rover_core::contact::detection::deepest_overlap;
use rover_core::contact::placement::{PlacementError, resting_on, resting_pose};
use rover_core::geometry::{Plane, Terrain};
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Kinematics, coordinates};
use rover_core::simulation::{PlacedRover, RoverScene};

/// Deepest overlap of rover and ground at a start, m; a deeper one is drawn again.
pub const START_OVERLAP: f64 = 0.01;

/// What the scenes of a task are drawn from.
#[derive(Clone, Debug)]
pub struct SceneDistribution {
    /// The rover before its masses are scaled, on any ground.
    pub rover: RoverScene,
    /// Options of its steps, before friction and gravity are drawn.
    pub options: StepOptions,
    /// Ground.
    pub ground: GroundDistribution,
    /// Rocks on the tilted plane or on the hills, if there are any.
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
pub struct FixedDraws {
    /// Start and goal.
    pub start: FixedStart,
    /// Difficulty of the rocks.
    pub difficulty: Option<f64>,
    /// Seed of the rocks' sizes and places, and the piece of the hills, below 2⁶³.
    pub field_seed: Option<u64>,
    /// Public coordinates and velocity (nv each), the latter at rest by default.
    pub state: Option<(Vec<f64>, Option<Vec<f64>>)>,
}

/// A drawn scene, in which the rover has room.
#[derive(Clone, Debug)]
pub struct DrawnScene {
    /// Slope, pose and goal.
    pub start: Start,
    /// Difficulty and rocks, where there are any.
    pub rocks: Option<RockDraw>,
    /// Properties of rover and world.
    pub domain: Domain,
    /// The ground.
    pub ground: DrawnGround,
    /// The rover with its masses scaled, on the ground, with friction and gravity of the episode.
    pub placement: PlacedRover,
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
        difficulty: Option<Interval>,
        fixed: &FixedDraws,
        attempts: usize,
    ) -> Result<DrawnScene, DrawError> {
        let mut last = None;
        for _ in 0..attempts {
            match self.draw_once(random, difficulty, fixed)? {
                Ok(drawn) => {
                    let overlap = drawn.deepest_overlap();
                    if overlap >= -START_OVERLAP {
                        return Ok(drawn);
                    }
                    let depth = -overlap;
                    last = Some(DrawError::NoRoom { depth, attempts });
                }
                Err(why) => last = Some(DrawError::Unsuitable { why, attempts }),
            }
        }
        Err(last.unwrap_or(DrawError::NoRoom {
            depth: f64::INFINITY,
            attempts,
        }))
    }

    /// Draws a scene, in which the rover may lack room. Every draw is made, whatever is fixed.
    fn draw_once(
        &self,
        random: &mut Pcg64,
        difficulty: Option<Interval>,
        fixed: &FixedDraws,
    ) -> Result<Result<DrawnScene, Unsuitable>, DrawError> {
        let rocks = self.rocks.as_ref();
        let given = (fixed.difficulty, fixed.field_seed);
        let rocks = rocks.map(|rocks| rocks.draw(random, difficulty, given));
        let mut start = self.start.clone();
        if let (Some(rocks), true) = (rocks, self.slope_by_difficulty) {
            start.slope = rocks.slope();
        }
        let start = start.draw(random, &fixed.start);
        let domain = self.domain.draw(random);
        let ground = self.lay_out(random, &start, rocks, fixed.field_seed)?;
        let terrain = ground.terrain();
        let scene = match domain.scaled(&self.rover.model)? {
            Some(scaled) => RoverScene::new(Arc::new(scaled), terrain),
            None => self.rover.on(terrain),
        };
        let options = domain.options(&self.options);
        options.check()?;
        // Wheels sink into sand once they have stood on it.
        let firm = ground.firm()?;
        let (model, terrain) = (&*scene.model, &*firm);
        // Over a plane every place is known, and every way leads uphill alike.
        let plane = terrain.ground().filter(|_| !terrain.has_surface());
        let (q, v) = if let Some((q, v)) = &fixed.state {
            (q.clone(), v.clone())
        } else if let Some(plane) = plane {
            let pose = resting_pose(model, plane, start.position, start.heading)?;
            (pose, None)
        } else {
            match resting_on(model, terrain, start.position, start.heading) {
                Ok(pose) => (pose, None),
                Err(PlacementError::State(error)) => return Err(error.into()),
                Err(why) => return Ok(Err(why.into())),
            }
        };
        if plane.is_none() {
            let mut from = start.position;
            for to in start.goals() {
                let [x, z] = to;
                if terrain.height(x, z).is_none() {
                    return Ok(Err(Unsuitable::NoGoal { x, z }));
                }
                if !way::leads(|x, z| ground.height(x, z), from, to) {
                    return Ok(Err(Unsuitable::NoWay { from, to }));
                }
                from = to;
            }
        }
        let configuration = coordinates::from_public(model, &q)?;
        let v = v.unwrap_or_else(|| vec![0.0; model.nv()]);
        let v = coordinates::checked_velocity(model, &v)?;
        Ok(Ok(DrawnScene {
            start,
            rocks,
            domain,
            placement: PlacedRover {
                scene,
                options,
                configuration,
                v,
            },
            ground,
        }))
    }

    /// The ground of an episode.
    fn lay_out(
        &self,
        random: &mut Pcg64,
        start: &Start,
        rocks: Option<RockDraw>,
        field_seed: Option<u64>,
    ) -> Result<DrawnGround, DrawError> {
        let model = &self.rover.model;
        let (radius, tolerance) = (clear_radius(model), self.goal_tolerance);
        match &self.ground {
            GroundDistribution::Given(ground) => Ok(ground.clone()),
            GroundDistribution::Tilted => {
                let plane = Plane::tilted(start.slope, start.uphill)?;
                let Some(rocks) = rocks else {
                    return Ok(DrawnGround::Plane(plane));
                };
                let field = rocks.lay_out(model, start, &plane, radius, tolerance)?;
                Ok(DrawnGround::Field(Arc::new(field)))
            }
            GroundDistribution::Hills(hills) => {
                let difficulty = rocks.map_or(0.0, |rocks| rocks.difficulty);
                let map = hills.draw(random, difficulty, field_seed).lay_out(start)?;
                let map = DrawnGround::Map(Arc::new(map));
                let surface = map.terrain();
                self.with_rocks(map, &*surface, start, rocks)
            }
            GroundDistribution::Sand(sand) => {
                let difficulty = rocks.map_or(0.0, |rocks| rocks.difficulty);
                let plane = Plane::tilted(start.slope, start.uphill)?;
                let drawn = sand.draw(random, difficulty, field_seed);
                let surface = match drawn.lay_out(start, &plane)? {
                    Some(map) => DrawnGround::Map(Arc::new(map)),
                    None => DrawnGround::Plane(plane),
                };
                let firm = surface.terrain();
                let soft = Arc::new(drawn.soil.under(firm.clone()));
                let soft = DrawnGround::Soft(soft, Arc::new(surface));
                self.with_rocks(soft, &*firm, start, rocks)
            }
        }
    }

    /// A ground with rocks on its surface.
    fn with_rocks(
        &self,
        ground: DrawnGround,
        surface: &dyn Terrain,
        start: &Start,
        rocks: Option<RockDraw>,
    ) -> Result<DrawnGround, DrawError> {
        let model = &self.rover.model;
        let (radius, tolerance) = (clear_radius(model), self.goal_tolerance);
        let field = match rocks {
            Some(rocks) => rocks.lay_on(model, start, surface, radius, tolerance)?,
            None => None,
        };
        Ok(match field {
            Some(field) => ground.with(DrawnGround::Field(Arc::new(field)))?,
            None => ground,
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
