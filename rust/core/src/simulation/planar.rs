//! A planar machine on a ground.

use std::sync::Arc;

use nalgebra::{SMatrix, SVector, Vector2};

use super::active_contact::LocatedContact;
use super::error::CommandError;
use super::rover_command::check;
use super::scene::{DenseOperator, Scene, Snapshot};
use super::state::State;
use super::stepping::Simulation;
use crate::integrator::{OptionsError, StepOptions};
use crate::multibody::{Energy, StateError};
use crate::planar::{
    Ball, ContactRule, Facing, Ground, MirroredRover, PlanarMachine, TwoWheelRover,
};
use crate::system::{PlanarContact, PlanarScratch, PlanarSystem};

/// A machine on a ground. The ground is shared.
#[derive(Clone, Debug)]
pub struct PlanarScene<const NV: usize, M> {
    /// The machine.
    pub machine: M,
    /// The ground.
    pub ground: Arc<dyn Ground>,
    /// Contact rule of discs on the ground.
    pub rule: ContactRule,
}

/// A planar machine on a ground, stepped through time.
pub type PlanarSimulation<const NV: usize, M> = Simulation<PlanarScene<NV, M>>;

/// The ball on a ground.
pub type BallSimulation = PlanarSimulation<3, Ball>;

/// The two-wheel rover on a ground.
pub type TwoWheelRoverSimulation = PlanarSimulation<5, TwoWheelRover>;

/// The six-wheel rover, driven straight on a ground.
pub type MirroredRoverSimulation = PlanarSimulation<7, MirroredRover<7>>;

impl<const NV: usize> DenseOperator for PlanarScratch<NV> {
    fn operator(&self) -> &[f64] {
        PlanarScratch::operator(self)
    }
}

impl LocatedContact for PlanarContact {
    type Vector = [f64; 2];

    fn normal(&self) -> [f64; 2] {
        self.n.into()
    }

    fn is_finite(&self) -> bool {
        let numbers = [&self.point, &self.foot, &self.n].into_iter().flatten();
        numbers.chain([&self.gap]).all(|x| x.is_finite())
    }
}

impl<const NV: usize, M: PlanarMachine<NV> + Clone> Scene for PlanarScene<NV, M> {
    type Configuration = SVector<f64, NV>;
    type Contact = PlanarContact;
    /// Torques, N m, positive forward.
    type Command = Vec<f64>;
    type Memory = ();
    type Parts = PlanarScratch<NV>;
    type System<'a>
        = PlanarSystem<'a, NV, M>
    where
        Self: 'a;

    fn nv(&self) -> usize {
        NV
    }

    fn command(&self) -> Vec<f64> {
        vec![0.0; self.machine.n_inputs()]
    }

    fn memory(&self) {}

    fn parts(&self) -> PlanarScratch<NV> {
        PlanarScratch::default()
    }

    fn contact_capacity(&self) -> usize {
        2 * self.machine.n_discs()
    }

    fn system<'a>(
        &'a self,
        command: &'a Vec<f64>,
        (): &'a (),
        parts: &'a mut PlanarScratch<NV>,
    ) -> PlanarSystem<'a, NV, M> {
        PlanarSystem {
            machine: &self.machine,
            ground: &*self.ground,
            rule: self.rule,
            inputs: command,
            parts,
        }
    }

    fn position(&self, _parts: &PlanarScratch<NV>, contact: &PlanarContact) -> [f64; 2] {
        contact.foot.into()
    }

    fn energy(&self, options: &StepOptions, state: &State<SVector<f64, NV>>) -> Energy {
        let v = SVector::<f64, NV>::from_column_slice(&state.v);
        let momentum = self.machine.mass_matrix(&state.configuration) * v;
        let gravity: Vector2<f64> = options.gravity.xy();
        Energy {
            kinetic: 0.5 * v.dot(&momentum),
            potential: self.machine.potential(&state.configuration, &gravity),
        }
    }

    fn fingerprint(&self) -> u64 {
        self.machine.fingerprint()
    }

    fn admits(&self, snapshot: &Snapshot<Self>) -> bool {
        let n_discs = self.machine.n_discs();
        let discs = snapshot.active.iter().map(|a| a.contact.key.disc as usize);
        let mut numbers = snapshot.state.configuration.iter().chain(&snapshot.command);
        snapshot.command.len() == self.machine.n_inputs()
            && numbers.all(|x| x.is_finite())
            && discs.into_iter().all(|disc| disc < n_discs)
    }
}

impl<const NV: usize, M: PlanarMachine<NV> + Clone> PlanarSimulation<NV, M> {
    /// At rest with all coordinates 0, no torque.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        machine: M,
        ground: Arc<dyn Ground>,
        rule: ContactRule,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        let scene = PlanarScene {
            machine,
            ground,
            rule,
        };
        Self::of(scene, SVector::zeros(), options)
    }

    /// The machine.
    pub fn machine(&self) -> &M {
        &self.scene.machine
    }

    /// Sets coordinates and rates; time 0, warm start forgotten, torques kept.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), StateError> {
        for (field, values) in [("q", q), ("v", v)] {
            if values.len() != NV {
                return Err(StateError::Length {
                    field,
                    expected: NV,
                    actual: values.len(),
                });
            }
            if let Some(index) = values.iter().position(|x| !x.is_finite()) {
                return Err(StateError::NotFinite {
                    field,
                    index,
                    value: values[index],
                });
            }
        }
        self.place(SVector::from_column_slice(q), v.to_vec());
        Ok(())
    }

    /// Sets the torques, N m, positive forward; each saturates at its limit
    /// ([`PlanarMachine::torque_limit`]).
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), CommandError> {
        let machine = &self.scene.machine;
        check("torques", inputs, machine.n_inputs())?;
        for (i, (own, input)) in self.command.iter_mut().zip(inputs).enumerate() {
            let limit = machine.torque_limit(i);
            *own = input.clamp(-limit, limit);
        }
        Ok(())
    }

    /// `M(q)` at the current q.
    pub fn mass_matrix(&self) -> SMatrix<f64, NV, NV> {
        self.machine().mass_matrix(self.q())
    }

    /// Current smallest gap of every disc, m; negative if it overlaps the ground.
    pub fn gaps(&self) -> Vec<f64> {
        let PlanarScene {
            machine,
            ground,
            rule,
        } = &self.scene;
        let mut facing: Vec<Facing> = Vec::new();
        let gap = |i: usize| {
            let disc = machine.disc(i, self.q());
            match rule {
                ContactRule::CentreHeight => ground.below(&disc.centre).distance,
                ContactRule::Nearest => {
                    // The nearest point is no farther than the one straight below.
                    let height = disc.centre.y - ground.height(disc.centre.x);
                    facing.clear();
                    ground.facing(&disc.centre, height.abs() * (1.0 + 1e-9), &mut facing);
                    let nearest = facing.iter().map(|f| f.distance);
                    nearest.fold(height, f64::min) - disc.radius
                }
            }
        };
        (0..machine.n_discs()).map(gap).collect()
    }
}
