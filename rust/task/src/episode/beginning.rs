//! The beginning of an episode: a drawn scene, and what is observed in it.

use std::sync::Arc;

use rayon::ThreadPool;

use super::error::EpisodeError;
use super::noise;
use super::rules::Rules;
use super::running::Episode;
use super::setting::EpisodeSetting;
use crate::draw::{Drawn, DrawnScene, Order, Pcg64, SceneDistribution, draw_many};

/// What the episodes of a task are drawn from.
#[derive(Clone, Debug)]
pub struct EpisodeDistribution {
    /// Distribution of the scenes.
    pub scenes: SceneDistribution,
    /// What they share.
    pub rules: Arc<Rules>,
    /// Force on the trunk beyond which the rover is high-centred, before masses and gravity are
    /// scaled, N.
    pub trunk_load_limit: f64,
}

/// A drawn episode, before its first control period.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// The scene.
    pub scene: DrawnScene,
    /// The episode.
    pub episode: Episode,
    /// The generator after the draws.
    pub random: Pcg64,
}

impl EpisodeDistribution {
    /// Draws one episode from each order; the other arguments are those of [`draw_many`].
    ///
    /// # Errors
    /// `Draw`, or `NotObservable` for a given state whose observation float32 cannot hold.
    pub fn draw(
        &self,
        orders: &[Order<'_>],
        attempts: usize,
        pool: Option<&ThreadPool>,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Beginning>>, EpisodeError> {
        let begin = |drawn: Drawn<'_>| self.begin(drawn);
        draw_many(&self.scenes, orders, attempts, &begin, pool, go_on)
    }

    fn begin(&self, drawn: Drawn<'_>) -> Result<Beginning, EpisodeError> {
        let Drawn {
            scene,
            rover,
            mut random,
        } = drawn;
        let domain = scene.domain;
        let setting = EpisodeSetting {
            goal: scene.start.goal,
            further: scene.start.further.clone(),
            domain,
            trunk_load_limit: self.trunk_load_limit * domain.mass_scale * domain.gravity_scale,
            difficulty: scene.rocks.map_or(0.0, |rocks| rocks.difficulty),
        };
        let mut normals = vec![0.0; self.rules.noise().len()];
        noise::draw(&mut random, &mut normals);
        let normals = self.rules.is_noisy().then_some(&normals[..]);
        let episode = Episode::begin(self.rules.clone(), setting, rover, normals)?;
        Ok(Beginning {
            scene,
            episode: episode.ok_or(EpisodeError::NotObservable)?,
            random,
        })
    }
}
