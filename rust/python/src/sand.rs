//! Soils, the sand of a simulation, and one wheel on a virtual test bed.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use rover_core::quantity::{self as checks, Demand, QuantityError};
use rover_core::sand::test_bed::rules_within;
use rover_core::sand::{
    Bekker, OperatingPoint, Resistive, SandState, SandWheel, Soil, StressLaw, Sunk, TestBed,
    WheelInSand, WheelPerformance,
};

use crate::arguments::{Given, number, refused};
use crate::arrays::{Array, fresh, fresh_rows, rows};
use crate::errors::{Kind, Result, Value};
use crate::planar_ground::quantity;
use crate::shared::Release;

/// Numbers of a soil that are 0 where they are missing.
const OPTIONAL: [&str; 3] = ["stress_angle", "stress_angle_slip", "slip_sinkage"];

/// A soil from a mapping of its numbers, or from an object whose attribute `numbers` is one.
pub fn soil_of(given: &Bound<'_, PyAny>) -> Result<Soil> {
    let what = "a Soil or a mapping of its numbers";
    let wrong = |_| refused(given, Kind::Terrain, "soil", what);
    let numbers = given.getattr("numbers").unwrap_or_else(|_| given.clone());
    let numbers = numbers.cast_into::<PyMapping>().map_err(wrong)?;
    let mut soil = Soil {
        law: if numbers.contains("frictional_modulus")? {
            StressLaw::Bekker(Bekker::default())
        } else {
            StressLaw::Resistive(Resistive::default())
        },
        memory: 0.0,
        reload: 0.0,
    };
    for (name, own) in soil.numbers_mut() {
        if OPTIONAL.contains(&name) && !numbers.contains(name)? {
            continue;
        }
        let value = numbers.get_item(name).map_err(|_| {
            let message = format!("soil: has no {name}");
            Kind::Terrain.error("soil", message, Value::Text(name.to_owned()))
        })?;
        *own = number(&value, Kind::Terrain, name)?;
    }
    soil.check().map_err(|e| quantity(Kind::Terrain, &e))?;
    Ok(soil)
}

/// Numbers of a soil by their names.
pub fn numbers_of<'py>(py: Python<'py>, soil: &Soil) -> Result<Bound<'py, PyDict>> {
    let numbers = PyDict::new(py);
    for (name, value) in soil.clone().numbers_mut() {
        numbers.set_item(name, *value)?;
    }
    Ok(numbers)
}

/// The sand of a simulation as arrays.
pub fn sand_to_dict<'py>(
    py: Python<'py>,
    sand: &SandState,
    slip: &[f64],
    cell: f64,
) -> Result<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    let of = |value: fn(&WheelInSand) -> f64| sand.wheels.iter().map(value).collect::<Array>();
    let forces = sand.wheels.iter().map(|wheel| wheel.force);
    let moments = sand.wheels.iter().map(|wheel| wheel.moment);
    found.set_item("force", fresh_rows(forces))?;
    found.set_item("moment", fresh_rows(moments))?;
    found.set_item("sinkage", of(|wheel| wheel.sinkage))?;
    found.set_item("absorbed", of(|wheel| wheel.absorbed))?;
    found.set_item("slip", fresh(slip))?;
    let ruts = sand.ruts.cells().into_iter().map(|(i, k, depth)| {
        let place = |index| (f64::from(index) + 0.5) * cell;
        [place(i), place(k), depth]
    });
    found.set_item("ruts", fresh_rows(ruts))?;
    Ok(found)
}

/// A single wheel on a bed of soil, with prescribed speeds and vertical load.
///
/// Args:
///     soil: A `rover_gym.ground.sand.Soil`, or a mapping of its numbers.
///     radius: Radius of the wheel without grousers, m.
///     width: Its width, m.
///     rounding: Radius of its edges, m.
///     grouser_height: Height of its grousers, m.
///     grousers: Number of its grousers.
///     accuracy: Largest relative error of the forces that the discretisation of the wheel may
///         cause.
///
/// Raises:
///     TerrainError: A number of the soil is missing or out of its range.
///     OptionError: A number of the wheel is out of its range.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct WheelBed {
    bed: TestBed,
}

fn drive_of([speed, rate, slip_angle, load, gravity]: [f64; 5]) -> OperatingPoint {
    OperatingPoint {
        speed,
        rate,
        slip_angle,
        load,
        gravity,
    }
}

fn listed(found: WheelPerformance) -> [f64; 5] {
    let WheelPerformance {
        sinkage,
        drawbar,
        lateral,
        lift,
        torque,
    } = found;
    [sinkage, drawbar, lateral, lift, torque]
}

/// A number above 0.
fn positive(given: &Bound<'_, PyAny>, field: &str) -> Result<f64> {
    let value = number(given, Kind::Option, field)?;
    checks::positive(field, value).map_err(|e| quantity(Kind::Option, &e))
}

#[pymethods]
impl WheelBed {
    #[new]
    #[pyo3(signature = (soil, radius, width, rounding = Given::MISSING,
        grouser_height = Given::MISSING, grousers = Given::MISSING, accuracy = Given::MISSING),
        text_signature = "(soil, radius, width, rounding=0.0, grouser_height=0.0, grousers=0, \
                          accuracy=0.002)")]
    fn new(
        soil: &Bound<'_, PyAny>,
        radius: &Bound<'_, PyAny>,
        width: &Bound<'_, PyAny>,
        rounding: Given<'_>,
        grouser_height: Given<'_>,
        grousers: Given<'_>,
        accuracy: Given<'_>,
    ) -> Result<Self> {
        let soil = soil_of(soil)?;
        let grousers = grousers.whole(0, Kind::Option, "grousers")?;
        let wheel = SandWheel {
            radius: positive(radius, "radius")?,
            width: positive(width, "width")?,
            rounding: rounding.number(0.0, Kind::Option, "rounding")?,
            grouser_height: grouser_height.number(0.0, Kind::Option, "grouser_height")?,
            grousers: u32::try_from(grousers).unwrap_or(u32::MAX),
        };
        let (most, half) = (wheel.radius, 0.5 * wheel.width);
        for (field, value, range, high) in [
            ("rounding", wheel.rounding, "from 0 to half the width", half),
            (
                "grouser_height",
                wheel.grouser_height,
                "from 0 to the radius",
                most,
            ),
        ] {
            if !(0.0..=high).contains(&value) {
                let error = QuantityError::new(field, Demand::Within(range), value);
                return Err(quantity(Kind::Option, &error));
            }
        }
        let accuracy = accuracy.number(0.002, Kind::Option, "accuracy")?;
        let rules = rules_within(&wheel, &soil, accuracy);
        Ok(Self {
            bed: TestBed { wheel, soil, rules },
        })
    }

    /// Points at which the stress is evaluated.
    #[getter]
    fn n_points(&self) -> usize {
        self.bed.rules.n_points()
    }

    /// Radius of the wheel including the sand held between its grousers, m.
    #[getter]
    fn drum(&self) -> f64 {
        self.bed.wheel.drum()
    }

    /// Forces and sinkage in steady motion.
    ///
    /// Args:
    ///     drives: Speed of travel (m/s), rate of the wheel (rad/s, positive forward), slip angle
    ///         (rad, to the right), load (N) and gravity (m/s²) of each run, (n, 5).
    ///
    /// Returns:
    ///     Sinkage (m), drawbar pull, force to the right and lift (N), and driving torque (N m) of
    ///     each run, (n, 5); NaN if the soil cannot carry the load.
    ///
    /// Raises:
    ///     OptionError: `drives` has a wrong shape or an entry that is not finite.
    fn steady(&self, py: Python<'_>, drives: &Bound<'_, PyAny>) -> Result<Array> {
        let drives = rows::<5>(drives, "drives")?;
        let found = py.release(|| {
            let runs = drives
                .iter()
                .map(|drive| self.bed.steady(&drive_of(*drive)));
            let runs = runs.map(|run| run.map_or([f64::NAN; 5], listed));
            runs.collect::<Vec<_>>()
        })?;
        Ok(fresh_rows(found))
    }

    /// Forces in steady motion at a given sinkage.
    ///
    /// Args:
    ///     sinkage: Depth of the lowest point under the surface, m.
    ///     drives: As for `steady`; the load does not matter.
    ///
    /// Returns:
    ///     As `steady`, (n, 5).
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or is not finite.
    fn forces(&self, sinkage: &Bound<'_, PyAny>, drives: &Bound<'_, PyAny>) -> Result<Array> {
        let sinkage = number(sinkage, Kind::Option, "sinkage")?;
        let drives = rows::<5>(drives, "drives")?;
        let found = drives
            .iter()
            .map(|drive| listed(self.bed.at(sinkage, &drive_of(*drive))));
        Ok(fresh_rows(found.collect::<Vec<_>>()))
    }

    /// Simulates a run: the wheel starts on the surface, sinks in and drives.
    ///
    /// Args:
    ///     drives: As for `steady`, one row for each step, (n, 5).
    ///     mass: Mass that sinks with the wheel, kg.
    ///     time_step: Length of a step, s.
    ///
    /// Returns:
    ///     As `steady`, at the end of each step, (n, 5).
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape, is not finite, or is not positive.
    fn run(
        &self,
        drives: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        time_step: &Bound<'_, PyAny>,
    ) -> Result<Array> {
        let drives = rows::<5>(drives, "drives")?;
        let (mass, h) = (positive(mass, "mass")?, positive(time_step, "time_step")?);
        let mut state = Sunk::default();
        let found = drives.iter().map(|drive| {
            let drive = drive_of(*drive);
            listed(self.bed.advance(&mut state, &drive, mass, h))
        });
        Ok(fresh_rows(found.collect::<Vec<_>>()))
    }
}
