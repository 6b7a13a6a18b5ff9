//! Scenes of free spheres after SimBenchmark: a block that falls in a heap, the same with elastic impacts, balls that bounce.
//!
//! Spheres of 10 kg and radius 0.1 m without friction. SimBenchmark's y and z are exchanged: y is up here.

use rover_core::integrator::{OptionsError, Stabilisation, StepError, StepOptions};
use rover_core::nalgebra::Vector3;
use serde::Serialize;

use crate::free_spheres::{SphereKind, SphereSimulation};
use crate::scenes::options;

/// Of every scene.
pub const KIND: SphereKind = SphereKind {
    mass: 10.0,
    radius: 0.1,
};

/// Distance of neighbours' centres in the block, m.
pub const SPACING: f64 = 0.21;

/// How far a centre is moved off the lattice at most along each axis, m.
pub const JITTER: f64 = 1e-3;

/// Interval of measurement, s; a longer step is measured at each step.
pub const SAMPLE: f64 = 0.01;

/// Numbers by splitmix64: short, so that other programs can make the same block.
#[derive(Clone, Copy, Debug)]
pub struct Random(u64);

impl Random {
    /// From a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub fn in_unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        (z >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// One of the scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// 6 x 6 x 6 spheres, e = 0, lowest centres 0.11 m above the plane.
    Block,
    /// The same with e = 1, lowest centres at 1.1 m.
    ElasticBlock,
    /// 7 x 7 balls 0.4 m apart, centres at 5 m, e = 1.
    Bouncing,
}

impl Scene {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Block, Self::ElasticBlock, Self::Bouncing];

    /// What the figures call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Block => "666",
            Self::ElasticBlock => "elastic 666",
            Self::Bouncing => "bouncing",
        }
    }

    /// Simulated time, s.
    #[must_use]
    pub fn duration(self) -> f64 {
        if self == Self::Bouncing { 20.0 } else { 10.0 }
    }

    /// Newton's e.
    #[must_use]
    pub fn restitution(self) -> f64 {
        if self == Self::Block { 0.0 } else { 1.0 }
    }

    /// Centres at the start, m.
    #[must_use]
    pub fn centres(self) -> Vec<Vector3<f64>> {
        let lattice = |n: usize, layers: usize, spacing: f64, lowest: f64| {
            let middle = 0.5 * (n - 1) as f64;
            let mut points = Vec::with_capacity(n * n * layers);
            for j in 0..layers {
                for i in 0..n {
                    for k in 0..n {
                        let (x, z) = (i as f64 - middle, k as f64 - middle);
                        let y = lowest + spacing * j as f64;
                        points.push(Vector3::new(spacing * x, y, spacing * z));
                    }
                }
            }
            points
        };
        let lowest = match self {
            Self::Bouncing => return lattice(7, 1, 0.4, 5.0),
            Self::Block => 0.11,
            Self::ElasticBlock => 1.1,
        };
        let mut random = Random::new(1);
        let mut points = lattice(6, 6, SPACING, lowest);
        for x in points.iter_mut().flat_map(|x| x.iter_mut()) {
            *x += JITTER * (2.0 * random.in_unit() - 1.0);
        }
        points
    }

    /// The spheres at rest.
    ///
    /// `projects`: whether penetration is projected out, where impacts are plastic. Elastic scenes never do: a projection lifts spheres,
    /// which is energy.
    ///
    /// # Errors
    /// A time step out of its range.
    pub fn start(self, time_step: f64, projects: bool) -> Result<SphereSimulation, OptionsError> {
        let is_plastic = self == Self::Block;
        let options = StepOptions {
            stabilisation: if projects && is_plastic {
                Stabilisation::Projection
            } else {
                Stabilisation::None
            },
            // A plastic impact is taken where it would come within the step, so that nothing is first let in.
            forecast: if is_plastic { 1.0 } else { 0.5 },
            ..options(0.0, self.restitution(), time_step)
        };
        SphereSimulation::new(KIND, self.centres(), options)
    }
}

/// What a run showed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SphereRun {
    /// s.
    pub time_step: f64,
    /// Mean over the samples of the sum of squared penetrations, m².
    pub penetration: f64,
    /// The same sum at the end, m².
    pub last_penetration: f64,
    /// Deepest penetration of any sample, m.
    pub deepest: f64,
    /// Mean over the samples of (E − E0)², J².
    pub energy_error: f64,
    /// Largest |E − E0| / E0 of any sample.
    pub energy_change: f64,
    /// Energy at the start, J.
    pub energy: f64,
    /// CPU time in steps per simulated second, ms.
    pub cpu_ms_per_s: f64,
    /// CPU time of a step, us.
    pub us_per_step: f64,
    /// Most contacts in a step.
    pub n_contacts: usize,
    /// Iterations of the contact solver per step.
    pub iterations: f64,
    /// Steps whose contact problem was solved to tolerance, as a share of all samples' intervals.
    pub converged: f64,
}

/// Runs a scene for `duration` seconds; `clock` tells CPU time in s.
///
/// # Errors
/// A step that failed, in words.
pub fn run(
    scene: Scene,
    time_step: f64,
    projects: bool,
    duration: f64,
    clock: impl Fn() -> f64,
) -> Result<SphereRun, SphereRunError> {
    let mut simulation = scene.start(time_step, projects)?;
    let energy = simulation.energy();
    // Rounded, so that a step that divides the interval does so; non-negative and far below 2^32.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = |x: f64| x.round() as usize;
    let per_sample = count(SAMPLE / time_step).max(1);
    let n_samples = count(duration / (time_step * per_sample as f64)).max(1);
    let mut out = SphereRun {
        time_step,
        penetration: 0.0,
        last_penetration: 0.0,
        deepest: 0.0,
        energy_error: 0.0,
        energy_change: 0.0,
        energy,
        cpu_ms_per_s: 0.0,
        us_per_step: 0.0,
        n_contacts: 0,
        iterations: 0.0,
        converged: 0.0,
    };
    let mut cpu = 0.0;
    for _ in 0..n_samples {
        let start = clock();
        let report = simulation.step(per_sample)?;
        cpu += clock() - start;
        let penetration = simulation.penetration();
        let change = simulation.energy() - energy;
        out.penetration += penetration.sum_of_squares / n_samples as f64;
        out.last_penetration = penetration.sum_of_squares;
        out.deepest = out.deepest.max(penetration.deepest);
        out.energy_error += change * change / n_samples as f64;
        out.energy_change = out.energy_change.max((change / energy).abs());
        out.n_contacts = out.n_contacts.max(report.n_contacts);
        out.iterations += report.iterations as f64;
        out.converged += if report.is_converged() { 1.0 } else { 0.0 };
    }
    let n_steps = (n_samples * per_sample) as f64;
    out.iterations /= n_steps;
    out.converged /= n_samples as f64;
    out.us_per_step = 1e6 * cpu / n_steps;
    out.cpu_ms_per_s = 1e3 * cpu / (n_steps * time_step);
    Ok(out)
}

/// Why a run stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SphereRunError {
    /// An option out of its range.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A step that failed.
    #[error(transparent)]
    Step(#[from] StepError),
}
