//! The next scenes of many rovers, drawn on several threads.
//!
//! Each rover draws from its own generator, so that its scene depends neither on the other rovers
//! nor on the threads.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::ThreadPool;

use super::error::DrawError;
use super::pcg64::Pcg64;
use super::scene::{DrawnScene, FixedDraws, SceneDistribution};
use super::start::Interval;
use rover_core::simulation::RoverSimulation;

/// The request of one rover's next scene.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The rover's generator, of which a copy draws.
    pub random: Pcg64,
    /// Range that replaces that of the rocks' difficulty.
    pub difficulty: Option<Interval>,
    /// What replaces draws.
    pub fixed: &'a FixedDraws,
}

/// A drawn scene.
#[derive(Debug)]
pub struct Drawn<'a> {
    /// The scene.
    pub scene: DrawnScene,
    /// The rover in it; another scene takes its place afterwards.
    pub rover: &'a RoverSimulation,
    /// The generator after the draws.
    pub random: Pcg64,
}

/// Draws the next scenes of many rovers and makes something of each.
///
/// `attempts`: most scenes drawn for one rover until it has room. `pool`: threads that help the
/// caller's. `go_on` is asked by the caller's thread from time to time; once it returns false the
/// draw ends with `None`.
///
/// # Errors
/// The error of the first rover that has one.
pub fn draw_many<T, E>(
    distribution: &SceneDistribution,
    orders: &[Order<'_>],
    attempts: usize,
    make: &(impl Fn(Drawn<'_>) -> Result<T, E> + Sync),
    pool: Option<&ThreadPool>,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Option<Vec<T>>, E>
where
    T: Send + Sync,
    E: From<DrawError> + Send + Sync,
{
    let draw = |order: &Order<'_>, stage: &mut Option<RoverSimulation>| {
        let mut random = order.random;
        let scene = distribution.draw(&mut random, order.difficulty, order.fixed, attempts)?;
        let placement = scene.placement.clone();
        let rover = match stage {
            Some(rover) => {
                rover.begin(placement).map_err(DrawError::from)?;
                rover
            }
            None => stage.insert(RoverSimulation::placed(placement).map_err(DrawError::from)?),
        };
        make(Drawn {
            scene,
            rover,
            random,
        })
    };
    let places: Vec<OnceLock<Result<T, E>>> = orders.iter().map(|_| OnceLock::new()).collect();
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let work = |go_on: &mut dyn FnMut() -> bool| {
        let mut stage = None;
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            if i >= orders.len() || stop.load(Ordering::Relaxed) {
                break;
            }
            // Each place is filled once, by the thread that counted up to it.
            let _ = places[i].set(draw(&orders[i], &mut stage));
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
