//! Scenes of free spheres after SimBenchmark: a block that falls in a heap, the same with elastic
//! impacts, balls that bounce, balls that roll on a box that is pushed.
//!
//! The first three: spheres of 10 kg and radius 0.1 m without friction.
//! SimBenchmark's y and z are exchanged: y is up here.

use rover_core::geometry::terrain::rocks::SplitMix64;
use rover_core::integrator::{OptionsError, Stabilisation, StepError, StepOptions};
use rover_core::nalgebra::Vector3;
use serde::Serialize;

use crate::free_spheres::SphereKind;
use crate::scenes::{G, options};
use crate::slab::Slab;
use crate::sphere_simulation::SphereSimulation;
use crate::{ProjectedToConvergence, Stepper};

/// Spheres of every scene but rolling.
pub const KIND: SphereKind = SphereKind {
    mass: 10.0,
    radius: 0.1,
};

/// Balls of the rolling scene.
pub const BALL: SphereKind = SphereKind {
    mass: 1.0,
    radius: 0.5,
};

/// Rolling: μ between the box and the ground.
pub const GROUND_FRICTION: f64 = 0.4;

/// Rolling: the force on the box, N.
pub const PUSH: f64 = 150.0;

/// Rolling: the box without its push. 20 m wide, as SimBenchmark's.
const BOX: Slab = Slab {
    mass: 10.0,
    half: Vector3::new(10.0, 0.5, 10.0),
    friction: 0.8,
    push: Vector3::new(0.0, 0.0, 0.0),
};

/// Distance of neighbours' centres in the block, m.
pub const SPACING: f64 = 0.21;

/// How far a centre is moved off the lattice at most along each axis, m.
pub const JITTER: f64 = 1e-3;

/// Interval of measurement, s; a longer step is measured at each step.
pub const SAMPLE: f64 = 0.01;

/// Which way the box is pushed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Push {
    /// Along x.
    X,
    /// Along z.
    Z,
    /// 60 degrees from x towards z, SimBenchmark's "diagonal".
    Diagonal,
}

impl Push {
    /// Unit vector.
    #[must_use]
    pub fn direction(self) -> Vector3<f64> {
        match self {
            Self::X => Vector3::x(),
            Self::Z => Vector3::z(),
            Self::Diagonal => Vector3::new(0.5, 0.0, 0.75_f64.sqrt()),
        }
    }
}

/// A scene of free spheres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SphereScene {
    /// 6 x 6 x 6 spheres, e = 0, lowest centres 0.11 m above the plane.
    Block,
    /// 6 x 6 x 6 spheres, e = 1, lowest centres 1.1 m above the plane.
    ElasticBlock,
    /// 7 x 7 balls 0.4 m apart, centres at 5 m, e = 1.
    Bouncing,
    /// A box of 10 kg is pushed over the plane with 150 N, 5 x 5 balls of 1
    /// kg and 2 m apart roll on it.
    Rolling(Push),
}

/// What is done about penetration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Treatment {
    /// Nothing: it stays as the velocity law leaves it.
    VelocityLevel,
    /// The rover's projection of the step's contacts.
    Projection,
    /// [`ProjectedToConvergence`].
    Convergence,
}

impl SphereScene {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Block,
        Self::ElasticBlock,
        Self::Bouncing,
        Self::Rolling(Push::X),
        Self::Rolling(Push::Z),
        Self::Rolling(Push::Diagonal),
    ];

    /// What the figures call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Block => "666",
            Self::ElasticBlock => "elastic 666",
            Self::Bouncing => "bouncing",
            Self::Rolling(Push::X) => "rolling, along x",
            Self::Rolling(Push::Z) => "rolling, along z",
            Self::Rolling(Push::Diagonal) => "rolling, diagonal",
        }
    }

    /// Simulated time, s.
    #[must_use]
    pub fn duration(self) -> f64 {
        match self {
            Self::Block | Self::ElasticBlock => 10.0,
            Self::Bouncing => 20.0,
            Self::Rolling(_) => 4.0,
        }
    }

    /// Newton's e.
    #[must_use]
    pub fn restitution(self) -> f64 {
        match self {
            Self::ElasticBlock | Self::Bouncing => 1.0,
            Self::Block | Self::Rolling(_) => 0.0,
        }
    }

    /// Coefficient of friction of contacts with the plane and between spheres.
    #[must_use]
    pub fn friction(self) -> f64 {
        if matches!(self, Self::Rolling(_)) {
            GROUND_FRICTION
        } else {
            0.0
        }
    }

    /// Mass and radius of the scene's spheres.
    #[must_use]
    pub fn kind(self) -> SphereKind {
        if matches!(self, Self::Rolling(_)) {
            BALL
        } else {
            KIND
        }
    }

    /// The scene's box and its centre, m; None without a box.
    #[must_use]
    pub fn slab(self) -> Option<(Slab, Vector3<f64>)> {
        let Self::Rolling(push) = self else {
            return None;
        };
        let push = push.direction() * PUSH;
        Some((Slab { push, ..BOX }, Vector3::new(0.0, BOX.half.y, 0.0)))
    }

    /// What is done about penetration in it: an elastic scene is never
    /// projected, for a projection lifts spheres, which is energy.
    #[must_use]
    pub fn treatments(self) -> &'static [Treatment] {
        match self {
            Self::Block => &[
                Treatment::Convergence,
                Treatment::Projection,
                Treatment::VelocityLevel,
            ],
            Self::ElasticBlock | Self::Bouncing => &[Treatment::VelocityLevel],
            Self::Rolling(_) => &[Treatment::Projection],
        }
    }

    /// Exact accelerations of the box and of its balls, m/s², where there are any.
    ///
    /// A ball that rolls on a plate takes 2/7 of its acceleration:
    /// `F = m a + 25 · 2/7 m_b a + μ g (m + 25 m_b)`.
    #[must_use]
    pub fn accelerations(self) -> Option<[Vector3<f64>; 2]> {
        let (slab, _) = self.slab()?;
        let balls = self.centres().len() as f64 * BALL.mass;
        let force = PUSH - GROUND_FRICTION * G * (slab.mass + balls);
        let a = slab.push / PUSH * (force / (slab.mass + balls * 2.0 / 7.0));
        Some([a, a * (2.0 / 7.0)])
    }

    /// Centres of the spheres at the start, m.
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
            Self::Rolling(_) => return lattice(5, 1, 2.0, 2.0 * BOX.half.y + BALL.radius),
            Self::Block => 0.11,
            Self::ElasticBlock => 1.1,
        };
        // SplitMix64 is short, so that other programs can make the same block.
        let mut random = SplitMix64::new(1);
        let mut points = lattice(6, 6, SPACING, lowest);
        for x in points.iter_mut().flat_map(|x| x.iter_mut()) {
            *x += JITTER * (2.0 * random.uniform() - 1.0);
        }
        points
    }

    /// All at rest.
    ///
    /// # Errors
    /// A time step out of its range.
    pub fn start(
        self,
        time_step: f64,
        treatment: Treatment,
    ) -> Result<SphereSimulation, OptionsError> {
        let options = StepOptions {
            stabilisation: match treatment {
                Treatment::VelocityLevel => Stabilisation::None,
                Treatment::Projection | Treatment::Convergence => Stabilisation::Projection,
            },
            // A plastic impact is taken where it would come within the
            // step, so that nothing is first let in.
            forecast: if self == Self::Block { 1.0 } else { 0.5 },
            ..options(self.friction(), self.restitution(), time_step)
        };
        let mut simulation = match self.slab() {
            Some(slab) => SphereSimulation::with_slab(self.kind(), self.centres(), slab, options)?,
            None => SphereSimulation::new(self.kind(), self.centres(), options)?,
        };
        if treatment == Treatment::Convergence {
            let stepper = Stepper::ProjectedToConvergence(ProjectedToConvergence::default());
            simulation = simulation.with_stepper(stepper);
        }
        Ok(simulation)
    }
}

/// What a run showed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SphereRun {
    /// s.
    pub time_step: f64,
    /// Mean over the samples of the sum of squared penetrations, m².
    pub penetration: f64,
    /// Sum of squared penetrations at the end, m².
    pub last_penetration: f64,
    /// Largest such sum of any sample, m².
    pub largest_penetration: f64,
    /// Deepest penetration of any sample, m.
    pub deepest: f64,
    /// Mean over the samples of (E − E0)², J².
    pub energy_error: f64,
    /// Largest |E − E0| / E0 of any sample.
    pub energy_change: f64,
    /// Energy at the start, J.
    pub energy: f64,
    /// Mean over the samples of the box's squared velocity error and the
    /// balls' mean of theirs, m²/s²; rolling only.
    pub velocity_error: Option<f64>,
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

/// Squared error of the velocities after `time` (s): the box's, and the mean of the balls', m²/s².
fn velocity_error(
    simulation: &SphereSimulation,
    accelerations: &[Vector3<f64>; 2],
    time: f64,
) -> f64 {
    let n = simulation.centres().len() - 1;
    let [slab, ball] = accelerations.map(|a| a * time);
    let balls: f64 = (0..n)
        .map(|i| (simulation.velocity(i) - ball).norm_squared())
        .sum();
    (simulation.velocity(n) - slab).norm_squared() + balls / n as f64
}

/// Runs a scene for `duration` seconds; `clock` tells CPU time in s.
///
/// # Errors
/// A step that failed, in words.
pub fn run(
    scene: SphereScene,
    time_step: f64,
    treatment: Treatment,
    duration: f64,
    clock: impl Fn() -> f64,
) -> Result<SphereRun, SphereRunError> {
    let mut simulation = scene.start(time_step, treatment)?;
    let energy = simulation.energy();
    let accelerations = scene.accelerations();
    // Rounded, so that a step that divides the interval does so; non-negative and far below 2^32.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = |x: f64| x.round() as usize;
    let per_sample = count(SAMPLE / time_step).max(1);
    let n_samples = count(duration / (time_step * per_sample as f64)).max(1);
    let mut out = SphereRun {
        time_step,
        penetration: 0.0,
        last_penetration: 0.0,
        largest_penetration: 0.0,
        deepest: 0.0,
        energy_error: 0.0,
        energy_change: 0.0,
        energy,
        velocity_error: accelerations.map(|_| 0.0),
        cpu_ms_per_s: 0.0,
        us_per_step: 0.0,
        n_contacts: 0,
        iterations: 0.0,
        converged: 0.0,
    };
    let share = 1.0 / n_samples as f64;
    let mut cpu = 0.0;
    for _ in 0..n_samples {
        let start = clock();
        let report = simulation.step(per_sample)?;
        cpu += clock() - start;
        let penetration = simulation.penetration();
        let change = simulation.energy() - energy;
        out.penetration += share * penetration.sum_of_squares;
        out.last_penetration = penetration.sum_of_squares;
        out.largest_penetration = out.largest_penetration.max(penetration.sum_of_squares);
        out.deepest = out.deepest.max(penetration.deepest);
        out.energy_error += share * change * change;
        out.energy_change = out.energy_change.max((change / energy).abs());
        if let (Some(sum), Some(a)) = (&mut out.velocity_error, &accelerations) {
            *sum += share * velocity_error(&simulation, a, simulation.time());
        }
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
