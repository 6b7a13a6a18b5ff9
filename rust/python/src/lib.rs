//! The border between `rover-core` and Python: conversions, exceptions, array views. No mechanics.
#![forbid(unsafe_code)]
#![allow(clippy::needless_pass_by_value)] // what pyo3 hands over

mod accuracy;
mod arguments;
mod arrays;
mod balls;
mod batch;
mod bed_arguments;
mod bed_options;
mod beds;
mod contacts;
mod disks;
mod draw;
mod elementary;
mod episode;
mod episode_batch;
mod episode_rules;
mod errors;
mod friction_contact;
mod generators;
mod given_problem;
mod height_field;
mod infos;
mod linearisation;
mod loops;
mod machines;
mod materials;
mod model;
mod motor;
mod options;
mod path_search;
mod picture;
mod planar;
mod planar_ground;
mod planar_machines;
mod plane;
mod rays;
mod reading;
mod report;
mod rover_grains;
mod sand;
mod shared;
mod signatures;
mod simulation;
mod snapshot;
mod soft_ground;
mod sphere_field;
mod stepping;
mod terrain;
mod triangle_mesh;
mod union;
mod vessels;

use pyo3::prelude::*;
use rover_core::scalar::Instructions;

use errors::{Kind, Value};

/// Environment variable with the instruction set that steps are to use.
const INSTRUCTIONS: &str = "ROVER_GYM_INSTRUCTIONS";

/// Uses the instruction set that the environment names, if it names one.
fn choose_instructions() -> errors::Result<()> {
    let Some(given) = std::env::var_os(INSTRUCTIONS) else {
        return Ok(());
    };
    let name = given.to_string_lossy().into_owned();
    Instructions::choose(&name).map_err(|error| {
        let message = format!("{INSTRUCTIONS}: {error}");
        Kind::Option.error(INSTRUCTIONS, message, Value::Text(name))
    })
}

/// Adds everything to the compiled module.
///
/// # Errors
/// As Python's, where a name cannot be added; `OptionError` where the environment asks for
/// instructions that this machine does not have.
pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    rover_core::caught::remember_places();
    errors::register(module)?;
    choose_instructions()?;
    module.add_class::<model::RoverModel>()?;
    module.add_class::<machines::Machine>()?;
    module.add_class::<motor::Motor>()?;
    module.add_class::<terrain::Terrain>()?;
    module.add_class::<plane::Plane>()?;
    module.add_class::<sphere_field::SphereField>()?;
    module.add_class::<height_field::HeightField>()?;
    module.add_class::<triangle_mesh::TriangleMesh>()?;
    module.add_class::<soft_ground::SoftGround>()?;
    module.add_class::<sand::WheelBed>()?;
    module.add_class::<union::Union>()?;
    module.add_class::<contacts::Contacts>()?;
    module.add_class::<stepping::AnySimulation>()?;
    module.add_class::<picture::PictureLook>()?;
    module.add_class::<simulation::Simulation>()?;
    module.add_class::<linearisation::Linearisation>()?;
    module.add_class::<linearisation::StepDerivatives>()?;
    module.add_class::<batch::SimulationBatch>()?;
    module.add_class::<draw::EpisodeDistribution>()?;
    module.add_class::<draw::DrawnEpisodes>()?;
    module.add_class::<episode_rules::EpisodeRules>()?;
    module.add_class::<episode::EpisodeRun>()?;
    module.add_class::<episode_batch::EpisodeBatch>()?;
    module.add_class::<path_search::PathSearch>()?;
    module.add_class::<report::StepReport>()?;
    module.add_class::<report::Energy>()?;
    module.add_class::<snapshot::Snapshot>()?;
    module.add_class::<friction_contact::SolverReport>()?;
    module.add_class::<friction_contact::FrictionContactSolution>()?;
    module.add_function(wrap_pyfunction!(accuracy::accuracy_options, module)?)?;
    module.add_function(wrap_pyfunction!(elementary::sin_cos, module)?)?;
    module.add_function(wrap_pyfunction!(elementary::atan2, module)?)?;
    module.add_function(wrap_pyfunction!(elementary::exp, module)?)?;
    module.add_function(wrap_pyfunction!(
        friction_contact::solve_friction_contact,
        module
    )?)?;
    module.add_function(wrap_pyfunction!(generators::seed_generators, module)?)?;
    module.add_function(wrap_pyfunction!(generators::standard_normals, module)?)?;
    module.add_class::<planar_ground::PlanarGround>()?;
    module.add_class::<planar_ground::Line>()?;
    module.add_class::<planar_ground::Sine>()?;
    module.add_class::<planar_ground::Spline>()?;
    module.add_class::<planar_ground::Polyline>()?;
    module.add_class::<contacts::PlanarContacts>()?;
    module.add_class::<planar::PlanarSimulation>()?;
    module.add_class::<planar_machines::BallSimulation>()?;
    module.add_class::<planar_machines::TwoWheelRoverSimulation>()?;
    module.add_class::<planar_machines::MirroredRoverSimulation>()?;
    module.add_class::<contacts::GrainContacts>()?;
    module.add_class::<beds::BedSimulation>()?;
    disks::register(module)?;
    balls::register(module)?;
    signatures::register(module)?;
    rover_grains::register(module)?;
    Ok(())
}
