//! The unit: a rover behind the states and rules of the standard.

use std::sync::Arc;

use rover_core::integrator::StepStatus;
use rover_core::multibody::{Model, ModelDescription};
use rover_core::simulation::RoverSimulation;

use crate::inertial::TrunkMotion;
use crate::reading::Reading;
use crate::refusal::Refusal;
use crate::saved::Saved;
use crate::scene_file::{SceneFile, Variable, VariableKind};
use crate::state::{Inputs, LastStep, Parameters, UnitMode};

/// Share of a time step by which a communication step may miss a whole number of them: masters add
/// up their times.
const STEP_ROUNDING: f64 = 1e-6;

/// Most time steps of a communication step.
const MOST_STEPS: f64 = 1e9;

/// States in which variables can be read, and in which they can be set.
const READABLE: [UnitMode; 3] = [
    UnitMode::InitializationMode,
    UnitMode::StepMode,
    UnitMode::Terminated,
];
const SETTABLE: [UnitMode; 3] = [
    UnitMode::Instantiated,
    UnitMode::InitializationMode,
    UnitMode::StepMode,
];

/// A unit.
pub struct Unit {
    scene: SceneFile,
    mode: UnitMode,
    parameters: Parameters,
    inputs: Inputs,
    time: f64,
    stop: Option<f64>,
    last: LastStep,
    rover: RoverSimulation,
}

impl Unit {
    /// In the state `Instantiated`.
    pub fn new(scene: SceneFile, token: &str) -> Result<Self, Refusal> {
        if token != scene.token {
            return Err(Refusal::Token {
                expected: scene.token,
                actual: token.to_owned(),
            });
        }
        let parameters = Parameters::of(&scene.options);
        let rover = begun(&scene, &parameters)?;
        Ok(Self {
            mode: UnitMode::Instantiated,
            parameters,
            inputs: Inputs::default(),
            time: 0.0,
            stop: None,
            last: LastStep::default(),
            rover,
            scene,
        })
    }

    /// Refuses a call outside of these states.
    pub fn demand(&self, call: &'static str, modes: &[UnitMode]) -> Result<(), Refusal> {
        let mode = self.mode;
        if modes.contains(&mode) {
            return Ok(());
        }
        Err(Refusal::OutOfOrder { call, mode })
    }

    /// Begins the initialisation; times in s.
    pub fn begin(&mut self, start: f64, stop: Option<f64>) -> Result<(), Refusal> {
        self.demand("fmi3EnterInitializationMode", &[UnitMode::Instantiated])?;
        finite("startTime", start)?;
        if let Some(stop) = stop
            && !(stop.is_finite() && stop >= start)
        {
            return Err(Refusal::OutOfRange {
                name: "stopTime".to_owned(),
                range: format!("finite and at least {start}"),
                value: stop,
            });
        }
        (self.time, self.stop, self.mode) = (start, stop, UnitMode::InitializationMode);
        Ok(())
    }

    /// Ends the initialisation.
    pub fn begin_steps(&mut self) -> Result<(), Refusal> {
        self.demand(
            "fmi3ExitInitializationMode",
            &[UnitMode::InitializationMode],
        )?;
        self.mode = UnitMode::StepMode;
        Ok(())
    }

    /// Ends the run.
    pub fn terminate(&mut self) -> Result<(), Refusal> {
        self.demand("fmi3Terminate", &[UnitMode::StepMode])?;
        self.mode = UnitMode::Terminated;
        Ok(())
    }

    /// Resets the unit to the state in which it was instantiated.
    pub fn reset(&mut self) -> Result<(), Refusal> {
        let parameters = Parameters::of(&self.scene.options);
        self.rover = begun(&self.scene, &parameters)?;
        (self.parameters, self.inputs) = (parameters, Inputs::default());
        (self.mode, self.time, self.stop) = (UnitMode::Instantiated, 0.0, None);
        self.last = LastStep::default();
        Ok(())
    }

    /// Steps from a time of the master by a whole number of time steps, s; whether all were solved
    /// to tolerance.
    pub fn step(&mut self, at: f64, by: f64) -> Result<bool, Refusal> {
        self.demand("fmi3DoStep", &[UnitMode::StepMode])?;
        let h = self.parameters.time_step;
        let slack = STEP_ROUNDING * h;
        let refuse = |name: &str, range: String, value| {
            let name = name.to_owned();
            Err(Refusal::OutOfRange { name, range, value })
        };
        let is_next = (at - self.time).abs() <= slack.max(1e-12 * at.abs()); // not if it is NaN
        if !is_next {
            let range = format!("where the last step ended, {}", self.time);
            return refuse("currentCommunicationPoint", range, at);
        }
        let n = (by / h).round();
        if !((1.0..=MOST_STEPS).contains(&n) && (by - n * h).abs() <= slack.max(1e-12 * by)) {
            let range = format!("a positive whole number of time steps of {h} s");
            return refuse("communicationStepSize", range, by);
        }
        if let Some(stop) = self.stop
            && at + by > stop + slack.max(1e-12 * stop.abs())
        {
            let range = format!("such that the step ends at the stop time {stop} at the latest");
            return refuse("communicationStepSize", range, by);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked"
        )]
        let report = {
            let before = TrunkMotion::of(&self.rover);
            let report = self.rover.step(n as usize)?;
            let inertial = before.readings(&self.rover, self.parameters.gravity, n * h);
            self.last = LastStep {
                inertial: Some(inertial),
                ..report.into()
            };
            report
        };
        self.time = at + by;
        Ok(report.status == StepStatus::Converged)
    }

    /// Time of the master, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Values of variables.
    pub fn numbers(&self, references: &[u32], values: &mut [f64]) -> Result<(), Refusal> {
        self.demand("fmi3GetFloat64", &READABLE)?;
        count(references.len(), values.len())?;
        let gravity = self.parameters.gravity;
        let reading = Reading::new(&self.rover, &self.last, gravity);
        for (&reference, value) in references.iter().zip(values) {
            let variable = self.variable(reference)?;
            let found = match variable.channel {
                VariableKind::Time => Some(self.time),
                VariableKind::Friction => Some(self.parameters.friction),
                VariableKind::Restitution => Some(self.parameters.restitution),
                VariableKind::TimeStep => Some(self.parameters.time_step),
                VariableKind::Gravity => self.parameters.gravity.get(variable.index).copied(),
                VariableKind::WheelTorque => self.torques().get(variable.index).copied(),
                VariableKind::Steering => self.steering().get(variable.index).copied(),
                channel => reading.get(channel, variable.index),
            };
            *value = variable.sign * found.ok_or(Refusal::NoVariable { reference })?;
        }
        Ok(())
    }

    /// Sets variables: all, or none.
    pub fn set_numbers(&mut self, references: &[u32], values: &[f64]) -> Result<(), Refusal> {
        self.demand("fmi3SetFloat64", &SETTABLE)?;
        count(references.len(), values.len())?;
        let (mut parameters, mut inputs) = (self.parameters.clone(), self.inputs.clone());
        for (&reference, &value) in references.iter().zip(values) {
            let variable = self.variable(reference)?;
            finite(&variable.name, value)?;
            let place = match variable.channel {
                VariableKind::WheelTorque => {
                    let torques = inputs.torques.get_or_insert_with(|| self.torques());
                    torques.get_mut(variable.index)
                }
                VariableKind::Steering => {
                    let steering = inputs.steering.get_or_insert_with(|| self.steering());
                    steering.get_mut(variable.index)
                }
                VariableKind::Friction => self.fixed(variable, Some(&mut parameters.friction))?,
                VariableKind::Restitution => {
                    self.fixed(variable, Some(&mut parameters.restitution))?
                }
                VariableKind::TimeStep => self.fixed(variable, Some(&mut parameters.time_step))?,
                VariableKind::Gravity => {
                    self.fixed(variable, parameters.gravity.get_mut(variable.index))?
                }
                _ => {
                    let (name, mode) = (variable.name.clone(), self.mode);
                    return Err(Refusal::ReadOnly { name, mode });
                }
            };
            *place.ok_or(Refusal::NoVariable { reference })? = variable.sign * value;
        }
        self.take(parameters, inputs)
    }

    /// The text of a variable.
    pub fn text(&self, reference: u32) -> Result<&str, Refusal> {
        self.demand("fmi3GetString", &READABLE)?;
        match self.variable(reference)?.channel {
            VariableKind::Model => Ok(&self.parameters.model),
            _ => Err(Refusal::NoVariable { reference }),
        }
    }

    /// Sets the text of a variable.
    pub fn set_text(&mut self, reference: u32, value: &str) -> Result<(), Refusal> {
        self.demand("fmi3SetString", &SETTABLE)?;
        let variable = self.variable(reference)?;
        if variable.channel != VariableKind::Model {
            return Err(Refusal::NoVariable { reference });
        }
        let mut parameters = self.parameters.clone();
        if let Some(model) = self.fixed(variable, Some(&mut parameters.model))? {
            value.clone_into(model);
        }
        self.take(parameters, self.inputs.clone())
    }

    /// Everything that changes.
    pub fn saved(&self) -> Saved {
        Saved {
            token: self.scene.token.clone(),
            mode: self.mode,
            parameters: self.parameters.clone(),
            inputs: self.inputs.clone(),
            time: self.time,
            stop: self.stop,
            last: self.last,
            rover: self.rover.snapshot(),
        }
    }

    /// Goes back to a state.
    pub fn restore(&mut self, saved: &Saved) -> Result<(), Refusal> {
        self.rover = self.restored(saved)?;
        self.mode = saved.mode;
        self.parameters.clone_from(&saved.parameters);
        self.inputs.clone_from(&saved.inputs);
        (self.time, self.stop, self.last) = (saved.time, saved.stop, saved.last);
        Ok(())
    }

    /// Refuses a state that [`Self::restore`] would refuse.
    pub fn check(&self, saved: &Saved) -> Result<(), Refusal> {
        self.restored(saved).map(drop)
    }

    fn restored(&self, saved: &Saved) -> Result<RoverSimulation, Refusal> {
        if saved.token != self.scene.token {
            let message = "is of another unit".to_owned();
            return Err(Refusal::State { message });
        }
        let mut rover = begun(&self.scene, &saved.parameters)?;
        rover.restore(&saved.rover)?;
        Ok(rover)
    }

    fn variable(&self, reference: u32) -> Result<&Variable, Refusal> {
        let found = self.scene.variables.get(&reference);
        found.ok_or(Refusal::NoVariable { reference })
    }

    /// The place of a parameter, before the steps begin.
    fn fixed<T>(&self, variable: &Variable, place: T) -> Result<T, Refusal> {
        if self.mode == UnitMode::StepMode {
            let (name, mode) = (variable.name.clone(), self.mode);
            return Err(Refusal::ReadOnly { name, mode });
        }
        Ok(place)
    }

    fn torques(&self) -> Vec<f64> {
        let set = &self.inputs.torques;
        (set.clone()).unwrap_or_else(|| self.rover.wheel_torques().to_vec())
    }

    fn steering(&self) -> Vec<f64> {
        let set = &self.inputs.steering;
        set.clone().unwrap_or_else(|| self.rover.steering())
    }

    /// Takes checked parameters and inputs.
    fn take(&mut self, parameters: Parameters, inputs: Inputs) -> Result<(), Refusal> {
        let mut anew = None;
        if parameters != self.parameters {
            anew = Some(begun(&self.scene, &parameters)?);
        }
        // A rover takes both or neither: the steering is the one that it may refuse.
        let rover = anew.as_mut().unwrap_or(&mut self.rover);
        if let Some(steering) = &inputs.steering {
            let set = rover.set_steering(steering);
            set.map_err(|e| self.scene.refusal(VariableKind::Steering, e))?;
        }
        if let Some(torques) = &inputs.torques {
            let set = rover.set_wheel_torques(torques);
            set.map_err(|e| self.scene.refusal(VariableKind::WheelTorque, e))?;
        }
        if let Some(rover) = anew {
            self.rover = rover;
        }
        (self.parameters, self.inputs) = (parameters, inputs);
        Ok(())
    }
}

/// The rover where every run begins.
fn begun(scene: &SceneFile, parameters: &Parameters) -> Result<RoverSimulation, Refusal> {
    let exported = model_of(&scene.model)?;
    let options = parameters.options(&scene.options);
    let terrain = scene.terrain.clone();
    if parameters.model.is_empty() {
        let mut rover = RoverSimulation::new(exported, terrain, options)?;
        rover.restore(&scene.start)?;
        return Ok(rover);
    }
    let model = model_of(&parameters.model)?;
    let names = |model: &Model| (joint_names(model), wheel_names(model));
    let mut first = RoverSimulation::new(exported.clone(), terrain.clone(), options.clone())?;
    first.restore(&scene.start)?;
    if names(&model) != names(&exported) || !first.q().is_of(&model) {
        let (joints, wheels) = names(&exported);
        return Err(Refusal::OtherModel { joints, wheels });
    }
    let mut rover = RoverSimulation::new(model, terrain, options)?;
    rover.set_state(first.q().clone(), first.v().to_vec());
    rover.set_commands(first.wheel_torques(), &first.steering())?;
    Ok(rover)
}

/// A model from TOML or JSON.
fn model_of(text: &str) -> Result<Arc<Model>, Refusal> {
    let description = if text.trim_start().starts_with('{') {
        ModelDescription::from_json(text)?
    } else {
        ModelDescription::from_toml(text)?
    };
    Ok(Arc::new(Model::from_description(description)?))
}

fn joint_names(model: &Model) -> Vec<String> {
    let description = model.description();
    (description.solids.iter())
        .filter(|solid| model.joint_index(&solid.name).is_some())
        .map(|solid| solid.name.clone())
        .collect()
}

fn wheel_names(model: &Model) -> Vec<String> {
    let wheels = model.description().wheels.iter();
    wheels.map(|wheel| wheel.name.clone()).collect()
}

fn finite(name: &str, value: f64) -> Result<(), Refusal> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Refusal::OutOfRange {
        name: name.to_owned(),
        range: "finite".to_owned(),
        value,
    })
}

pub fn count(expected: usize, actual: usize) -> Result<(), Refusal> {
    if expected == actual {
        return Ok(());
    }
    Err(Refusal::Count { expected, actual })
}
