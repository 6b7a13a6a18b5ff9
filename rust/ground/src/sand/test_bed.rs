//! A virtual test bed for one wheel: speed of travel, rim speed and slip angle are prescribed, and
//! the wheel is free to sink under its load.
//!
//! x is forward in the wheel's plane, y up and z along the axle, to the right. The bed may be
//! tilted along x; load and forces are then those along and across its surface.

use nalgebra::{Vector3, Vector6};

use super::memory::{Memory, WheelTwist};
use super::patch::{Bed, Derivatives, Reaction, WheelPose, react};
use super::soil::Soil;
use super::wheel::{GaussRules, Points, SandWheel};
use friction_contact::scalar::elementary::sin_cos;

/// What a test bed prescribes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatingPoint {
    /// Speed of travel, m/s.
    pub speed: f64,
    /// Angular rate of the wheel, positive forward, rad/s.
    pub rate: f64,
    /// Angle from the wheel's plane to the direction of travel, to the right, rad.
    pub slip_angle: f64,
    /// Normal load, N.
    pub load: f64,
    /// Gravity along the normal of the surface, m/s².
    pub gravity: f64,
}

/// What a test bed measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelPerformance {
    /// Depth of the lowest point of the drum under the undisturbed surface, m.
    pub sinkage: f64,
    /// Force of the sand on the wheel in its plane, positive forward, N.
    pub drawbar: f64,
    /// Force of the sand on the wheel along its axle, to the right, N.
    pub lateral: f64,
    /// Normal force of the sand, N.
    pub lift: f64,
    /// Torque that drives the wheel, N m.
    pub torque: f64,
}

/// A wheel in a soil, with the Gauss rules of its integrals.
#[derive(Clone, Debug)]
pub struct TestBed {
    /// The wheel.
    pub wheel: SandWheel,
    /// The soil.
    pub soil: Soil,
    /// Gauss rules.
    pub rules: GaussRules,
}

/// State of a wheel on a test bed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sunk {
    /// m.
    pub sinkage: f64,
    /// Rate of the sinkage, m/s.
    pub rate: f64,
    /// What the sand remembers.
    pub memory: Memory,
}

/// Numbers of points, from the fewest on: along and across the drum, along an edge, along and
/// across a side wall.
const TRIALS: [[usize; 5]; 9] = [
    [8, 1, 4, 2, 2],
    [8, 1, 4, 4, 2],
    [12, 1, 6, 4, 2],
    [8, 1, 8, 8, 2],
    [8, 2, 8, 8, 3],
    [16, 2, 16, 16, 3],
    [16, 2, 16, 16, 4],
    [16, 3, 16, 16, 6],
    [24, 4, 24, 24, 8],
];

/// What the trials are compared with.
const FINEST: [usize; 5] = [24, 12, 24, 24, 24];

/// Rules of a trial.
fn rules_of([along, across, edge, wall, radial]: [usize; 5]) -> GaussRules {
    GaussRules::new(Points {
        drum: [along, across],
        edge,
        wall: [wall, radial],
    })
}

impl OperatingPoint {
    fn twist(&self) -> WheelTwist {
        let (sin, cos) = sin_cos(self.slip_angle);
        WheelTwist {
            linear: Vector3::new(self.speed * cos, 0.0, self.speed * sin),
            angular: Vector3::new(0.0, 0.0, -self.rate),
        }
    }
}

/// The coarsest rules whose forces on a wheel are within `tolerance` of the finest, relative to the
/// largest force, over sinkages from a twentieth to a half of the radius, slips and slip angles;
/// the finest trial if none is.
#[must_use]
pub fn rules_within(wheel: &SandWheel, soil: &Soil, tolerance: f64) -> GaussRules {
    let forces = |points: [usize; 5]| -> Vec<Vector3<f64>> {
        let bed = TestBed {
            wheel: *wheel,
            soil: soil.clone(),
            rules: rules_of(points),
        };
        let mut found = Vec::new();
        for share in [0.05, 0.15, 0.5] {
            for [rate, slip_angle] in [[0.0, 0.3], [0.8, 0.0], [1.2, 0.5], [3.0, 0.1], [1.0, 1.3]] {
                let drive = OperatingPoint {
                    speed: 1.0,
                    rate: rate / wheel.radius,
                    slip_angle,
                    load: 1.0,
                    gravity: 9.81,
                };
                let memory = Memory::steady(&drive.twist(), wheel.drum());
                let force = bed.force(share * wheel.drum(), &memory, &drive, Derivatives::Wrench);
                found.push(force.wrench.fixed_rows::<3>(0).into());
            }
        }
        found
    };
    let exact = forces(FINEST);
    let is_good = |points: &[usize; 5]| {
        let pairs = forces(*points);
        let mut pairs = pairs.iter().zip(&exact);
        pairs.all(|(found, exact)| (found - exact).norm() <= tolerance * exact.norm())
    };
    let found = TRIALS.iter().find(|points| is_good(points));
    rules_of(*found.unwrap_or(&TRIALS[TRIALS.len() - 1]))
}

/// Most trials of a search for the sinkage.
const MOST_TRIALS: usize = 80;

/// Sinkage, relative to the drum's radius, up to which it is searched.
const DEEPEST: f64 = 3.0;

impl TestBed {
    /// The reaction at a sinkage, m, with a memory.
    #[must_use]
    pub fn force(
        &self,
        sinkage: f64,
        memory: &Memory,
        drive: &OperatingPoint,
        want: Derivatives,
    ) -> Reaction {
        let bed = Bed {
            place: Vector3::zeros(),
            normal: Vector3::y(),
            relief: None,
            highest: 0.0,
            gravity: drive.gravity,
        };
        let pose = WheelPose {
            centre: Vector3::new(0.0, self.wheel.drum() - sinkage, 0.0),
            axle: Vector3::z(),
        };
        react(
            (&self.wheel, &self.rules),
            &self.soil,
            &bed,
            &pose,
            memory,
            want,
        )
    }

    fn measured(sinkage: f64, wrench: &Vector6<f64>) -> WheelPerformance {
        WheelPerformance {
            sinkage,
            drawbar: wrench[0],
            lateral: wrench[2],
            lift: wrench[1],
            torque: wrench[5],
        }
    }

    /// The forces of steady motion at a sinkage, m.
    #[must_use]
    pub fn at(&self, sinkage: f64, drive: &OperatingPoint) -> WheelPerformance {
        let memory = Memory::steady(&drive.twist(), self.wheel.drum());
        let force = self.force(sinkage, &memory, drive, Derivatives::Wrench);
        Self::measured(sinkage, &force.wrench)
    }

    /// Steady motion: the sinkage at which the sand bears the load, and the forces there. None if
    /// the sand does not bear it within one and a half diameters.
    #[must_use]
    pub fn steady(&self, drive: &OperatingPoint) -> Option<WheelPerformance> {
        let radius = self.wheel.drum();
        let memory = Memory::steady(&drive.twist(), radius);
        let lift = |sinkage: f64| {
            self.force(sinkage, &memory, drive, Derivatives::Wrench)
                .wrench[1]
        };
        let (mut low, mut high) = (0.0, 0.02 * radius);
        while lift(high) < drive.load {
            low = high;
            high *= 1.25;
            if high > DEEPEST * radius {
                return None;
            }
        }
        for _ in 0..MOST_TRIALS {
            let middle = 0.5 * (low + high);
            if high - low < 1e-7 * radius {
                break;
            }
            if lift(middle) < drive.load {
                low = middle;
            } else {
                high = middle;
            }
        }
        let force = self.force(high, &memory, drive, Derivatives::Wrench);
        Some(Self::measured(high, &force.wrench))
    }

    /// A step of h (s) of a wheel that sinks with a mass, kg. Returns what is measured at its end.
    ///
    /// Newton's method finds the rate at the end of the step, and bisection where that leaves the
    /// bracket.
    pub fn advance(
        &self,
        state: &mut Sunk,
        drive: &OperatingPoint,
        mass: f64,
        h: f64,
    ) -> WheelPerformance {
        let radius = self.wheel.drum();
        let mut twist = drive.twist();
        let times = (h, self.soil.memory);
        let mut rate = state.rate;
        let mut found = (state.memory, state.sinkage, Vector6::zeros());
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..MOST_ITERATIONS {
            twist.linear.y = -rate;
            let recalled = state.memory.after(&twist, radius, times);
            let sinkage = state.sinkage + h * rate;
            let want = Derivatives::Slopes {
                by_memory: recalled.fresh,
                by_pose: h,
            };
            let force = self.force(sinkage, &recalled.memory, drive, want);
            found = (recalled.memory, sinkage, force.wrench);
            let residual = mass * (rate - state.rate) - h * (drive.load - force.wrench[1]);
            if residual < 0.0 {
                low = rate;
            } else {
                high = rate;
            }
            // The force may change along a step by several times what its slope says.
            let newton = rate - residual / (mass - h * force.slope[(1, 1)].min(0.0));
            let is_near = low < newton && newton < high && k < MOST_NEWTON;
            let middle = 0.5 * (low + high);
            let next = if is_near || !middle.is_finite() {
                newton
            } else {
                middle
            };
            let moved = (next - rate).abs();
            rate = next;
            if moved < 1e-12 + 1e-9 * rate.abs() {
                break;
            }
        }
        *state = Sunk {
            sinkage: found.1,
            rate,
            memory: found.0,
        };
        Self::measured(found.1, &found.2)
    }
}

/// Most iterations of a step. After the first ones its bracket is halved.
const MOST_ITERATIONS: usize = 60;
const MOST_NEWTON: usize = 16;
