//! A planar machine on a ground.

use std::sync::Arc;

use super::active_contact::LocatedContact;
use super::error::CommandError;
use super::rover_command::check;
use super::scene::{DenseOperator, Scene, Snapshot};
use super::state::State;
use super::stepping::Simulation;
use crate::integrator::{OptionsError, StepOptions};
use crate::multibody::{Energy, StateError, coordinates};
use crate::planar::{ContactRule, PlanarDisc, PlanarFacing, PlanarGround, PlanarTree};
use crate::system::{PlanarContact, PlanarScratch, PlanarSystem};

/// A machine on a ground. Both are shared.
#[derive(Clone, Debug)]
pub struct PlanarScene {
    /// The machine.
    pub machine: Arc<PlanarTree>,
    /// The ground.
    pub ground: Arc<dyn PlanarGround>,
    /// Contact rule of discs on the ground.
    pub rule: ContactRule,
}

/// A planar machine on a ground, stepped through time.
pub type PlanarSimulation = Simulation<PlanarScene>;

impl DenseOperator for PlanarScratch {
    fn operator(&self) -> &[f64] {
        PlanarScratch::operator(self)
    }
}

impl LocatedContact for PlanarContact {
    fn normal(&self) -> [f64; 2] {
        self.n.into()
    }

    fn is_finite(&self) -> bool {
        let numbers = [&self.point, &self.foot, &self.n].into_iter().flatten();
        numbers.chain([&self.gap]).all(|x| x.is_finite())
    }
}

impl Scene for PlanarScene {
    type Configuration = Vec<f64>;
    type Moved = Vec<f64>;
    type Contact = PlanarContact;
    /// Torques, N m, positive forward.
    type Command = Vec<f64>;
    type Memory = ();
    type Parts = PlanarScratch;
    type System<'a> = PlanarSystem<'a>;

    fn nv(&self) -> usize {
        self.machine.nv()
    }

    fn moved(&self, q: &Vec<f64>) -> Vec<f64> {
        q.clone()
    }

    fn command(&self) -> Vec<f64> {
        vec![0.0; self.machine.n_inputs()]
    }

    fn memory(&self) {}

    fn parts(&self) -> PlanarScratch {
        PlanarScratch::default()
    }

    fn contact_capacity(&self) -> usize {
        2 * self.machine.n_wheels()
    }

    fn system<'a>(
        &'a self,
        _: &StepOptions,
        command: &'a Vec<f64>,
        (): &'a mut (),
        parts: &'a mut PlanarScratch,
    ) -> PlanarSystem<'a> {
        PlanarSystem {
            machine: &self.machine,
            ground: &*self.ground,
            rule: self.rule,
            inputs: command,
            parts,
        }
    }

    fn position(&self, _parts: &PlanarScratch, contact: &PlanarContact) -> [f64; 2] {
        contact.foot.into()
    }

    fn energy(
        &self,
        options: &StepOptions,
        state: &State<Vec<f64>>,
        _command: &Self::Command,
    ) -> Energy {
        let gravity = options.gravity.xy();
        let (energy, _) = (self.machine).energy(&state.configuration, &state.v, &gravity);
        energy
    }

    fn fingerprint(&self) -> u64 {
        self.machine.fingerprint()
    }

    fn admits(&self, snapshot: &Snapshot<Self>) -> bool {
        let n_discs = self.machine.n_wheels();
        let discs = snapshot.active.iter().map(|a| a.contact.key.disc as usize);
        let mut numbers = snapshot.state.configuration.iter().chain(&snapshot.command);
        snapshot.state.configuration.len() == self.machine.nv()
            && snapshot.command.len() == self.machine.n_inputs()
            && numbers.all(|x| x.is_finite())
            && discs.into_iter().all(|disc| disc < n_discs)
    }
}

impl PlanarSimulation {
    /// At rest with all coordinates 0, no torque.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn new(
        machine: impl Into<PlanarTree>,
        ground: Arc<dyn PlanarGround>,
        rule: ContactRule,
        options: StepOptions,
    ) -> Result<Self, OptionsError> {
        let machine = Arc::new(machine.into());
        let q = vec![0.0; machine.nv()];
        let scene = PlanarScene {
            machine,
            ground,
            rule,
        };
        Self::of(scene, q, options)
    }

    /// The machine.
    #[must_use]
    pub fn machine(&self) -> &PlanarTree {
        &self.scene.machine
    }

    /// Sets coordinates and rates; time 0, warm start forgotten, torques kept.
    ///
    /// # Errors
    /// Wrong length or an entry that is not finite; nothing is changed then.
    pub fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), StateError> {
        for (field, values) in [("q", q), ("v", v)] {
            coordinates::check(field, values, self.machine().nv())?;
        }
        self.place(q.to_vec(), v.to_vec());
        Ok(())
    }

    /// Sets the torques, N m, positive forward; each saturates at its limit
    /// ([`PlanarTree::torque_limit`]).
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

    /// `M(q)` (nv × nv, row-major) at the current q.
    #[must_use]
    pub fn mass_matrix(&self) -> Vec<f64> {
        let machine = self.machine();
        let mut M = vec![0.0; machine.nv() * machine.nv()];
        machine.mass_matrix(&machine.poses(self.q()), &mut M);
        M
    }

    /// Discs of the wheels now.
    #[must_use]
    pub fn discs(&self) -> Vec<PlanarDisc> {
        let poses = self.machine().poses(self.q());
        let discs = 0..self.machine().n_wheels();
        discs.map(|i| self.machine().disc(i, &poses)).collect()
    }

    /// Current smallest gap of every disc, m; negative if it overlaps the ground.
    #[must_use]
    pub fn gaps(&self) -> Vec<f64> {
        let PlanarScene { ground, rule, .. } = &self.scene;
        let mut facing: Vec<PlanarFacing> = Vec::new();
        let gap = |disc: &PlanarDisc| match rule {
            ContactRule::CentreHeight => ground.below(&disc.centre).distance,
            ContactRule::Nearest => {
                // The nearest point is no farther than the one straight below.
                let height = disc.centre.y - ground.height(disc.centre.x);
                facing.clear();
                ground.facing(&disc.centre, height.abs() * (1.0 + 1e-9), &mut facing);
                let nearest = facing.iter().map(|f| f.distance);
                nearest.fold(height, f64::min) - disc.radius
            }
        };
        self.discs().iter().map(gap).collect()
    }
}
