//! The next scenes of many rovers, drawn on several threads.
//!
//! Each rover draws from its own generator, so that its scene depends neither on the other rovers
//! nor on the threads.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::ThreadPool;

use super::error::DrawError;
use super::pcg64::Pcg64;
use super::scene::{DrawnScene, Fixed, SceneDistribution};
use super::start::Range;
use crate::simulation::{Look, ReadingLayout, RoverSimulation};

/// The request of one rover's next scene.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The rover's generator, of which a copy draws.
    pub random: Pcg64,
    /// Range that replaces that of the rocks' difficulty.
    pub difficulty: Option<Range>,
    /// What replaces draws.
    pub fixed: &'a Fixed,
}

/// What all rovers share.
#[derive(Clone, Copy, Debug)]
pub struct Draw<'a> {
    /// What the scenes are drawn from.
    pub distribution: &'a SceneDistribution,
    /// Most scenes drawn for one rover until it has room.
    pub attempts: usize,
    /// Points of the height scan, see [`RoverSimulation::read`].
    pub scan: &'a [[f64; 2]],
    /// Standard deviation of each entry's noise in an observation; empty without noise.
    pub deviations: &'a [f64],
}

/// A drawn scene with its first reading.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// The scene.
    pub scene: DrawnScene,
    /// The first reading, with the goal as its target.
    pub reading: Vec<f64>,
    /// Noise of the first observation; empty without noise.
    pub noise: Vec<f64>,
    /// The generator after the draws.
    pub random: Pcg64,
}

impl Draw<'_> {
    /// Draws the scene of one rover. `stage`: a simulation to reuse, left in the drawn scene.
    ///
    /// # Errors
    /// As [`SceneDistribution::draw`].
    pub fn one(
        &self,
        order: &Order<'_>,
        stage: &mut Option<RoverSimulation>,
    ) -> Result<Beginning, DrawError> {
        let mut random = order.random;
        let scene =
            (self.distribution).draw(&mut random, order.difficulty, order.fixed, self.attempts)?;
        let simulation = match stage {
            Some(simulation) => {
                simulation.begin(scene.placement.clone())?;
                simulation
            }
            None => stage.insert(RoverSimulation::placed(scene.placement.clone())?),
        };
        let layout = ReadingLayout::new(simulation.model(), self.scan.len());
        let mut reading = vec![0.0; layout.size()];
        let look = Look {
            target: scene.start.goal,
            scan: self.scan,
        };
        simulation.read(&look, &mut reading);
        let noise = self.deviations.iter();
        let noise = noise.map(|deviation| random.normal() * deviation).collect();
        Ok(Beginning {
            scene,
            reading,
            noise,
            random,
        })
    }
}

/// Draws the next scenes of many rovers; `pool`: threads that help the caller's.
///
/// `go_on` is asked by the caller's thread from time to time; once it returns false the draw ends
/// with `None`.
///
/// # Errors
/// The error of the first rover that has one.
pub fn draw_many(
    draw: &Draw<'_>,
    orders: &[Order<'_>],
    pool: Option<&ThreadPool>,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Option<Vec<Beginning>>, DrawError> {
    let places: Vec<OnceLock<Result<Beginning, DrawError>>> =
        orders.iter().map(|_| OnceLock::new()).collect();
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let work = |go_on: &mut dyn FnMut() -> bool| {
        let mut stage = None;
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= orders.len() || stop.load(Ordering::Relaxed) {
                break;
            }
            let drawn = draw.one(&orders[i], &mut stage);
            let is_first = places[i].set(drawn).is_ok();
            assert!(is_first, "invariant: each rover is drawn once");
            if !go_on() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    };
    match pool.filter(|_| orders.len() > 1) {
        Some(pool) => pool.in_place_scope(|scope| {
            for _ in 0..pool.current_num_threads().min(orders.len() - 1) {
                scope.spawn(|_| work(&mut || true));
            }
            work(go_on);
        }),
        None => work(go_on),
    }
    let drawn: Option<Vec<_>> = places.into_iter().map(OnceLock::into_inner).collect();
    drawn.map(|drawn| drawn.into_iter().collect()).transpose()
}
