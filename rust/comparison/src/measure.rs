//! Order, drift, energy and cost of a scheme.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use rover_core::integrator::StepError;
use rover_core::planar::{ContactRule, Line, PlanarBall};
use rover_core::simulation::PlanarSimulation;

use serde::Serialize;

use crate::error::MeasureError;
use crate::scenes::{
    G, MASS, WHEEL_LOAD, ball_above, ball_on_sine, bouncing_at, driving, flight, flight_at,
    options, rolling, sliding,
};
use crate::{EventDriven, SCHEMES, Scheme, SchemeFamily, Stepper};

/// Steps of one scene from the coarsest, each half of the one before, and the error at each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConvergenceCurve {
    /// s.
    pub h: Vec<f64>,
    /// In the scene's unit; none where the run failed or left the scene by more than 10.
    pub error: Vec<Option<f64>>,
}

impl ConvergenceCurve {
    /// Slope of the straight line through log error against log h; none
    /// with fewer than three errors.
    #[must_use]
    pub fn order(&self) -> Option<f64> {
        let points: Vec<(f64, f64)> = self
            .h
            .iter()
            .zip(&self.error)
            .filter_map(|(h, e)| e.filter(|e| *e > 0.0).map(|e| (h.ln(), e.ln())))
            .collect();
        let n = points.len() as f64;
        if n < 3.0 {
            return None;
        }
        let (x, y) = points
            .iter()
            .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
        let (above, below) = points.iter().fold((0.0, 0.0), |(a, b), (px, py)| {
            (a + (px - x) * (py - y), b + (px - x) * (px - x))
        });
        Some(above / below)
    }
}

/// Number of halvings that a curve shows.
const HALVINGS: u32 = 4;

fn curve(
    duration: f64,
    coarsest: usize,
    mut error_with: impl FnMut(usize, f64) -> Result<f64, MeasureError>,
) -> ConvergenceCurve {
    let mut curve = ConvergenceCurve {
        h: Vec::new(),
        error: Vec::new(),
    };
    for k in 0..=HALVINGS {
        let n = coarsest << k;
        let h = duration / n as f64;
        let error = error_with(n, h).ok().filter(|e| e.is_finite() && *e < 10.0);
        curve.h.push(h);
        curve.error.push(error);
    }
    curve
}

/// Which motion a curve is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BenchmarkMotion {
    /// The two-wheel rover in the air, against the closed form.
    Flight,
    /// The ball rolling in a valley.
    Rolling,
    /// The ball sliding in a valley.
    Sliding,
    /// The two-wheel rover driving over a sine.
    Driving,
}

/// Duration of the motions, s.
pub const DURATION: f64 = 0.64;

/// Steps of the reference over the duration.
const REFERENCE: usize = 4096;

fn run(
    mut simulation: PlanarSimulation,
    stepper: &Stepper,
    n: usize,
) -> Result<Vec<f64>, MeasureError> {
    simulation.step_with(stepper, n)?;
    Ok(simulation.q().clone())
}

/// Coordinates at the end of a motion in n steps, m and rad.
///
/// # Errors
/// A step that cannot be taken.
pub fn end_of(
    scheme: &Scheme,
    motion: BenchmarkMotion,
    n: usize,
) -> Result<Vec<f64>, MeasureError> {
    let h = DURATION / n as f64;
    match motion {
        BenchmarkMotion::Flight => run(flight(scheme, h)?, &scheme.stepper(WHEEL_LOAD, 0.0), n),
        BenchmarkMotion::Rolling => run(rolling(scheme, h)?, &scheme.stepper(MASS, 0.0), n),
        BenchmarkMotion::Sliding => run(sliding(scheme, h)?, &scheme.stepper(MASS, 0.0), n),
        BenchmarkMotion::Driving => run(driving(scheme, h)?, &scheme.stepper(WHEEL_LOAD, 0.0), n),
    }
}

/// The event-driven scheme of the list: the reference where there is no closed form.
#[must_use]
pub fn reference_scheme() -> Scheme {
    SCHEMES[6]
}

/// Coordinates at the end of a motion: closed form, or the event-driven scheme with 4096 steps.
///
/// # Errors
/// A step that cannot be taken.
pub fn reference(motion: BenchmarkMotion) -> Result<Vec<f64>, MeasureError> {
    match motion {
        BenchmarkMotion::Flight => Ok(flight_at(DURATION)?.as_slice().to_vec()),
        _ => end_of(&reference_scheme(), motion, REFERENCE),
    }
}

/// Error at the end of a motion, the largest of all coordinates, m and rad.
///
/// # Errors
/// No reference.
pub fn order_in(
    scheme: &Scheme,
    motion: BenchmarkMotion,
    coarsest: usize,
) -> Result<ConvergenceCurve, MeasureError> {
    let exact = reference(motion)?;
    let error = |n, _| {
        let end = end_of(scheme, motion, n)?;
        Ok(end
            .iter()
            .zip(&exact)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())))
    };
    Ok(curve(DURATION, coarsest, error))
}

/// Restitution of the bouncing ball.
pub const RESTITUTION: f64 = 0.8;

/// Mean error of the velocity of a bouncing ball over 2 s and 16 starting heights, m/s.
#[must_use]
pub fn order_across_impacts(scheme: &Scheme, coarsest: usize) -> ConvergenceCurve {
    let duration = 2.0;
    curve(duration, coarsest, |n, h| {
        let mut sum = 0.0;
        for phase in 0..16 {
            // Heights spread by the golden section, so that impacts fall anywhere in a step.
            let gap = 1.0 + 0.3 * (f64::from(phase) * 0.618_033_988_75).fract();
            let mut simulation = ball_above(scheme, &options(0.0, RESTITUTION, h), gap)?;
            let stepper = scheme.stepper(MASS, RESTITUTION);
            for _ in 0..n {
                simulation.step_with(&stepper, 1)?;
                let exact = bouncing_at(gap, RESTITUTION, simulation.time()).1;
                sum += (simulation.v()[1] - exact).abs();
            }
        }
        Ok(sum / (16 * n) as f64)
    })
}

/// Largest gap and deepest penetration of the wheels during the drive over the sine, m.
#[must_use]
pub fn drift(scheme: &Scheme, coarsest: usize) -> ConvergenceCurve {
    curve(DURATION, coarsest, |n, h| {
        let mut simulation = driving(scheme, h)?;
        let stepper = scheme.stepper(WHEEL_LOAD, 0.0);
        let mut worst = 0.0_f64;
        for _ in 0..n {
            simulation.step_with(&stepper, 1)?;
            worst = simulation
                .gaps()
                .iter()
                .fold(worst, |m, gap| m.max(gap.abs()));
        }
        Ok(worst)
    })
}

/// What happens to the energy, relative to that of the drop or of the descent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EnergyBehaviour {
    /// Change over 60 s of bouncing with e = 1 at 5 ms (penalty: 1 ms, here and below).
    pub elastic: Option<f64>,
    /// Largest growth in a step of a ball that drops with e = 0 and stays.
    pub growth: Option<f64>,
    /// Speed at the end of that, m/s.
    pub rest: Option<f64>,
    /// Change over 60 s of rolling to and fro in a valley at 5 ms.
    pub rolling: Option<f64>,
}

/// Step of the energy's runs, s: the penalty's stiffness allows no larger one.
fn energy_step(scheme: &Scheme) -> f64 {
    if matches!(scheme.kind, SchemeFamily::Penalty(..)) {
        1e-3
    } else {
        5e-3
    }
}

/// Relative change of the energy of a ball that bounces from 1 m with e = 1 for so many steps.
///
/// # Errors
/// A step that cannot be taken.
pub fn elastic_change(scheme: &Scheme, duration: f64) -> Result<f64, MeasureError> {
    let h = energy_step(scheme);
    let mut simulation = ball_above(scheme, &options(0.0, 1.0, h), 1.0)?;
    let before = simulation.energy().total();
    simulation.step_with(&scheme.stepper(MASS, 1.0), count(duration, h))?;
    Ok((simulation.energy().total() - before) / (MASS * G))
}

/// Largest relative growth of the energy in a step of a ball that drops
/// from 1 m with e = 0, and its speed after 5 s, m/s.
///
/// # Errors
/// A step that cannot be taken.
pub fn drop_and_rest(scheme: &Scheme) -> Result<(f64, f64), MeasureError> {
    let h = energy_step(scheme);
    let mut simulation = ball_above(scheme, &options(0.5, 0.0, h), 1.0)?;
    let stepper = scheme.stepper(MASS, 0.0);
    let mut growth = 0.0_f64;
    for _ in 0..count(5.0, h) {
        let before = simulation.energy().total();
        simulation.step_with(&stepper, 1)?;
        growth = growth.max(simulation.energy().total() - before);
    }
    let v = rover_core::nalgebra::Vector3::from_column_slice(simulation.v());
    Ok((growth / (MASS * G), v.norm()))
}

/// Change of the energy of a ball that rolls to and fro in a valley,
/// relative to that of a descent by 0.2 m.
///
/// # Errors
/// A step that cannot be taken.
pub fn rolling_change(scheme: &Scheme, duration: f64) -> Result<f64, MeasureError> {
    let h = energy_step(scheme);
    let mut simulation = ball_on_sine(scheme, &options(0.9, 0.0, h), -0.3, 0.0)?;
    let before = simulation.energy().total();
    simulation.step_with(&scheme.stepper(MASS, 0.0), count(duration, h))?;
    Ok((simulation.energy().total() - before) / (MASS * G * 0.2))
}

fn count(duration: f64, h: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand
    let n = (duration / h).round() as usize;
    n
}

/// See [`EnergyBehaviour`].
#[must_use]
pub fn energy(scheme: &Scheme) -> EnergyBehaviour {
    let drop = drop_and_rest(scheme).ok();
    EnergyBehaviour {
        elastic: elastic_change(scheme, 60.0).ok(),
        growth: drop.map(|d| d.0),
        rest: drop.map(|d| d.1),
        rolling: rolling_change(scheme, 60.0).ok(),
    }
}

/// Time of a step of the drive over the sine at 2.5 ms, µs, the least of several runs; outer
/// iterations in a step; whether all converged.
///
/// # Errors
/// A step that cannot be taken.
pub fn cost(scheme: &Scheme) -> Result<(f64, f64, bool), MeasureError> {
    let n = 256;
    let mut answer = (f64::INFINITY, 0.0, false);
    for _ in 0..20 {
        let mut simulation = driving(scheme, DURATION / n as f64)?;
        let stepper = scheme.stepper(WHEEL_LOAD, 0.0);
        let start = Instant::now();
        let report = simulation.step_with(&stepper, n)?;
        black_box(simulation.q());
        let time = start.elapsed().as_secs_f64() * 1e6 / n as f64;
        let iterations = report.newton_iterations as f64 / n as f64;
        answer = (answer.0.min(time), iterations, report.is_converged());
    }
    Ok(answer)
}

/// A ball at rest on a slope below the friction angle: speed downhill (m/s)
/// after 2 s, where 0 is expected.
///
/// # Errors
/// A step that cannot be taken.
pub fn creep(scheme: &Scheme) -> Result<f64, MeasureError> {
    let (alpha, mu) = (0.3_f64, 0.5);
    let ground = Line::new(-alpha.tan(), 0.0)?;
    // No friction turns it: a block.
    let block = PlanarBall::new(MASS, 0.3, 1e12)?;
    let options = scheme.options(&options(mu, 0.0, 1e-3));
    let mut simulation =
        PlanarSimulation::new(block, Arc::new(ground), ContactRule::Nearest, options)?;
    simulation.set_state(&[0.0, 0.3 / alpha.cos(), 0.0], &[0.0; 3])?;
    simulation.step_with(&scheme.stepper(MASS, 0.0), 2000)?;
    Ok(simulation.v()[0].hypot(simulation.v()[1]))
}

/// Time at which the event-driven scheme stops for a ball dropped from 1 m with restitution e, s;
/// none if it does not stop.
///
/// # Errors
/// A step that cannot be taken for another reason.
pub fn accumulation(e: f64, duration: f64) -> Result<Option<f64>, MeasureError> {
    let scheme = reference_scheme();
    let h = 5e-3;
    let mut simulation = ball_above(&scheme, &options(0.0, e, h), 1.0)?;
    let stepper = EventDriven::default();
    while simulation.time() < duration {
        match simulation.step_with(&stepper, 1) {
            Ok(_) => {}
            Err(StepError::Accumulation { time, .. }) => return Ok(Some(time)),
            Err(other) => return Err(other.into()),
        }
    }
    Ok(None)
}

/// Everything about a scheme.
#[derive(Clone, Debug, Serialize)]
pub struct SchemeMeasurement {
    /// For tables.
    pub name: &'static str,
    /// The rover in the air.
    pub flight: ConvergenceCurve,
    /// The ball rolling.
    pub rolling: ConvergenceCurve,
    /// The ball sliding.
    pub sliding: ConvergenceCurve,
    /// The rover driving.
    pub driving: ConvergenceCurve,
    /// L1 in the velocity across impacts.
    pub impacts: ConvergenceCurve,
    /// Gap during the drive.
    pub drift: ConvergenceCurve,
    /// Fitted orders of the six, in this order.
    pub orders: [Option<f64>; 6],
    /// Long runs.
    pub energy: EnergyBehaviour,
    /// Block on a slope, m/s.
    pub creep: Option<f64>,
    /// µs a step.
    pub cost: Option<f64>,
    /// Outer iterations a step.
    pub iterations: Option<f64>,
    /// Whether every step of the drive at 2.5 ms converged.
    pub is_converged: Option<bool>,
}

/// Measures a scheme; minutes for all in debug mode, seconds in release.
///
/// # Errors
/// No reference.
pub fn measure(scheme: &Scheme) -> Result<SchemeMeasurement, MeasureError> {
    // The penalty's stiffness bounds its step.
    let finer = if matches!(scheme.kind, SchemeFamily::Penalty(..)) {
        16
    } else {
        1
    };
    let coarsest = 16 * finer;
    let [flight, rolling, sliding, driving] = [
        order_in(scheme, BenchmarkMotion::Flight, 16)?,
        order_in(scheme, BenchmarkMotion::Rolling, coarsest)?,
        order_in(scheme, BenchmarkMotion::Sliding, coarsest)?,
        order_in(scheme, BenchmarkMotion::Driving, coarsest)?,
    ];
    let impacts = order_across_impacts(scheme, 100 * finer);
    let drift = drift(scheme, coarsest);
    let cost = cost(scheme).ok();
    let orders =
        [&flight, &rolling, &sliding, &driving, &impacts, &drift].map(ConvergenceCurve::order);
    Ok(SchemeMeasurement {
        name: scheme.name,
        orders,
        flight,
        rolling,
        sliding,
        driving,
        impacts,
        drift,
        energy: energy(scheme),
        creep: creep(scheme).ok(),
        cost: cost.map(|c| c.0),
        iterations: cost.map(|c| c.1),
        is_converged: cost.map(|c| c.2),
    })
}
