//! A rover and a bed of balls, stepped together.
//!
//! Both keep their own simulation, with state, commands, contacts and snapshots. A step moves both
//! as one system: the balls by the law of [`crate::system::grains`], the rover's contacts with them
//! by [`TreeAmongGrains`], and its contacts with the ground by its own law. It is taken with the
//! options of the bed.

use super::active_contact::ActiveContact;
use super::grains::GrainSimulation;
use super::rover::RoverSimulation;
use super::scene::{AcceptedStep, Scene};
use super::state::Moved;
use crate::caught::caught;
use crate::contact::Part;
use crate::geometry::query::dispatch;
use crate::geometry::{PlacedShape, Sphere, SupportMap};
use crate::integrator::{
    Integrator, NoProbe, StateMut, StepError, StepOptions, StepReport, StepScratch, WarmStart,
};
use crate::multibody::{Kinematics, LaneConfiguration};
use crate::system::grains::{self, GrainContact, GrainError, Grid, Mover, OVERLAP};
use crate::system::{
    CompositeContact, CompositeKey, CompositeScratch, GrainTouch, TreeAmongGrains,
};
use nalgebra::Vector3;

type Both = (Vec<f64>, LaneConfiguration<f64>);

/// A rover and a bed that cannot be stepped together.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum TogetherError {
    /// The time steps or gravities differ.
    #[error("{field}: the rover has {rover}, the grains {grains}")]
    Differs {
        /// `time_step`, or an entry of `gravity`.
        field: &'static str,
        /// Value of the rover, s or m/s².
        rover: f64,
        /// Value of the bed, s or m/s².
        grains: f64,
    },
    /// A part of the rover is in a grain.
    #[error("position: {part} penetrates ball {grain} by {depth} m")]
    Overlap {
        /// Name of the part.
        part: String,
        /// Number of the grain.
        grain: usize,
        /// m.
        depth: f64,
    },
    /// μ.
    #[error(transparent)]
    Friction(#[from] GrainError),
}

/// Joins the steps of a rover and a bed. It holds scratch and one coefficient, no state.
#[derive(Clone, Debug)]
pub struct RoverInGrains {
    friction: f64,
    warm_start: WarmStart<CompositeKey>,
    scratch: StepScratch<Both, CompositeContact>,
    parts: CompositeScratch,
}

impl RoverInGrains {
    /// For these two; `friction`: μ of the rover's parts on grains.
    ///
    /// # Errors
    /// Another time step or gravity of the two, a part of the rover deeper in a grain than
    /// [`OVERLAP`] of the smallest radius, a coefficient that is negative or not finite.
    pub fn new(
        rover: &RoverSimulation,
        bed: &GrainSimulation<3>,
        friction: f64,
    ) -> Result<Self, TogetherError> {
        grains::GrainFriction {
            wheels: friction,
            ..bed.description().friction
        }
        .check()
        .map_err(GrainError::from)?;
        for (field, own, theirs) in [
            ("time_step", rover.options.time_step, bed.options.time_step),
            ("gravity[0]", rover.options.gravity.x, bed.options.gravity.x),
            ("gravity[1]", rover.options.gravity.y, bed.options.gravity.y),
            ("gravity[2]", rover.options.gravity.z, bed.options.gravity.z),
        ] {
            if own.to_bits() != theirs.to_bits() {
                return Err(TogetherError::Differs {
                    field,
                    rover: own,
                    grains: theirs,
                });
            }
        }
        check_apart(rover, bed)?;
        Ok(Self::with_friction(friction, rover, bed))
    }

    fn with_friction(friction: f64, rover: &RoverSimulation, bed: &GrainSimulation<3>) -> Self {
        let q = (bed.q().clone(), rover.scene.moved(rover.q()));
        let room = bed.scene.contact_capacity() + rover.scene.contact_capacity();
        Self {
            friction,
            warm_start: WarmStart::with_capacity(room, 0),
            scratch: StepScratch::new(&q, room),
            parts: CompositeScratch::default(),
        }
    }

    /// μ of the rover's parts on grains.
    #[must_use]
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Gap of each wheel now to the nearest grain or the ground, m.
    #[must_use]
    pub fn wheel_gaps(&self, rover: &RoverSimulation, bed: &GrainSimulation<3>) -> Vec<f64> {
        let contacts = rover.wheel_contacts();
        let to_grains = gaps_to_grains(rover, bed);
        let both = contacts.iter().zip(to_grains);
        both.map(|(contact, gap)| contact.gap.min(gap)).collect()
    }

    /// Deepest overlap now, m: of grains with anything, and of the rover with grains.
    #[must_use]
    pub fn penetration(&self, rover: &RoverSimulation, bed: &GrainSimulation<3>) -> f64 {
        let mut deepest = bed.penetration();
        let parts = Part::all(rover.model());
        visit_near(rover, bed, parts, 0.0, |_, _, gap| {
            deepest = deepest.max(-gap);
        });
        deepest
    }

    /// Takes n steps with both, or fewer once `go_on` returns false.
    ///
    /// # Errors
    /// A step that cannot be taken. Both stay where they were before it.
    pub fn step(
        &mut self,
        rover: &mut RoverSimulation,
        bed: &mut GrainSimulation<3>,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<StepReport, StepError> {
        rover.begin_call();
        bed.begin_call();
        let options = StepOptions {
            friction_coefficient: rover.options.friction_coefficient,
            materials: rover.options.materials.clone(),
            ..bed.options.clone()
        };
        let result = self.steps(rover, bed, &options, n, go_on);
        rover.parts.gaps_to_grains = gaps_to_grains(rover, bed);
        let report = result.clone().unwrap_or_default();
        rover.end_call(report);
        bed.end_call(report);
        result
    }

    fn steps(
        &mut self,
        rover: &mut RoverSimulation,
        bed: &mut GrainSimulation<3>,
        options: &StepOptions,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<StepReport, StepError> {
        let mut total = StepReport::default();
        for _ in 0..n {
            total.merge(&self.one_step(rover, bed, options)?);
            if !go_on() {
                break;
            }
        }
        if total.steps > 0 {
            self.list_contacts(rover, bed);
        }
        Ok(total)
    }

    fn one_step(
        &mut self,
        rover: &mut RoverSimulation,
        bed: &mut GrainSimulation<3>,
        options: &StepOptions,
    ) -> Result<StepReport, StepError> {
        let n_bed = bed.scene.nv();
        let own = std::mem::take(&mut bed.state.configuration);
        let mut q = (own, rover.scene.moved(rover.q()));
        let mut v = [&bed.state.v[..], &rover.state.v[..]].concat();
        let mut time = bed.state.time;
        self.join_warm_starts(rover, bed);
        let mut system = TreeAmongGrains {
            bed: (bed.scene).system(&bed.options, &bed.command, &mut bed.memory, &mut bed.parts),
            tree: (rover.scene).system(
                &rover.options,
                &rover.command,
                &mut rover.memory,
                &mut rover.parts,
            ),
            friction: self.friction,
            parts: &mut self.parts,
        };
        let taken = caught(|| {
            options.variant.step(
                &mut system,
                options,
                StateMut {
                    configuration: &mut q,
                    v: &mut v,
                    time: &mut time,
                },
                &mut self.warm_start,
                &mut self.scratch,
                &mut NoProbe,
            )
        });
        drop(system);
        bed.state.configuration = q.0;
        Moved::write(&q.1, &mut rover.state.configuration);
        let report = match taken {
            Ok(taken) => taken?,
            Err(fault) => {
                // Scratch anew; the state is that before the step.
                *self = Self::with_friction(self.friction, rover, bed);
                rover.scene.recover(&mut rover.parts, &mut rover.memory);
                bed.scene.recover(&mut bed.parts, &mut bed.memory);
                let time = bed.state.time;
                return Err(StepError::Internal { time, fault });
            }
        };
        bed.state.v.copy_from_slice(&v[..n_bed]);
        rover.state.v.copy_from_slice(&v[n_bed..]);
        bed.state.time = time;
        rover.state.time += options.time_step;
        self.part_warm_starts(rover, bed);
        rover.scene.after_step(AcceptedStep {
            options,
            state: &mut rover.state,
            memory: &mut rover.memory,
            parts: &mut rover.parts,
            warm_start: &mut rover.warm_start,
            scratch: &rover.scratch,
        });
        self.rest(rover, bed, options);
        Ok(report)
    }

    /// The impulses of both and of the touches, in the order of the keys.
    fn join_warm_starts(&mut self, rover: &RoverSimulation, bed: &GrainSimulation<3>) {
        #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
        let n = bed.description().grains.len() as u32;
        let all = &mut self.warm_start.impulses;
        all.clear();
        let of_bed = &bed.warm_start.impulses;
        all.extend(
            (of_bed.iter().filter(|(key, _)| key.a < n))
                .map(|(k, p)| (CompositeKey::Grains(*k), *p)),
        );
        let own = &rover.warm_start.impulses;
        all.extend(own.iter().map(|(k, p)| (CompositeKey::Tree(*k), *p)));
        all.extend(
            (of_bed.iter().filter(|(key, _)| key.a >= n))
                .map(|(k, p)| (CompositeKey::Touch(*k), *p)),
        );
        self.warm_start.persistent.clear();
        self.warm_start.stored.clone_from(&rover.warm_start.stored);
    }

    fn part_warm_starts(&self, rover: &mut RoverSimulation, bed: &mut GrainSimulation<3>) {
        rover.warm_start.clear();
        bed.warm_start.clear();
        rover.warm_start.stored.clone_from(&self.warm_start.stored);
        for (key, p) in &self.warm_start.impulses {
            match key {
                CompositeKey::Grains(key) | CompositeKey::Touch(key) => {
                    bed.warm_start.impulses.push((*key, *p));
                }
                CompositeKey::Tree(key) => rover.warm_start.impulses.push((*key, *p)),
            }
        }
    }

    /// Lets grains sleep and wake after a step.
    fn rest(&self, rover: &RoverSimulation, bed: &mut GrainSimulation<3>, options: &StepOptions) {
        bed.memory.count_step(options.time_step, &bed.parts);
        let Some(sleep) = &bed.scene.sleep else {
            return;
        };
        let (mut contacts, mut impulses) = (Vec::new(), Vec::new());
        let local = self.scratch.impulses().as_chunks::<3>().0;
        for (contact, p) in self.scratch.contacts().iter().zip(local) {
            let contact = match contact {
                CompositeContact::Grains(contact) => *contact,
                CompositeContact::Touch(touch) => GrainContact {
                    key: touch.key,
                    n: touch.contact.frame.n,
                    point: touch.contact.point,
                    gap: touch.contact.gap,
                    gap_start: touch.gap_start,
                },
                CompositeContact::Tree(_) => continue,
            };
            contacts.push(contact);
            impulses.extend_from_slice(p);
        }
        let kinematics = rover.kinematics();
        let mover = |part: Part| {
            let body = part.body(rover.model());
            let shape = part.place(rover.model(), &kinematics);
            let centre = shape.centre();
            let speed = |x: &Vector3<f64>| {
                let velocity = kinematics.point_velocity(rover.model(), body, x, rover.v());
                velocity.norm()
            };
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let rim = axes.map(|e| speed(&(centre + e * shape.bound())));
            Mover {
                centre: kinematics.origin(body) + centre,
                radius: shape.bound(),
                speed: rim.into_iter().fold(speed(&centre), f64::max),
            }
        };
        let movers: Vec<_> = Part::all(rover.model()).map(mover).collect();
        let step = grains::StepTaken {
            scene: &bed.scene.description,
            weight_impulse: options.gravity.norm() * options.time_step,
            q: &bed.state.configuration,
            v: &mut bed.state.v,
            contacts: &contacts,
            impulses: &impulses,
            count: bed.memory.count,
            movers: &movers,
        };
        (bed.memory.sleep).update(sleep, step, &mut bed.warm_start);
    }

    /// Gives each simulation the contacts of the last step: the rover also those with grains.
    fn list_contacts(&self, rover: &mut RoverSimulation, bed: &mut GrainSimulation<3>) {
        let impulses = self.scratch.impulses().as_chunks::<3>().0;
        let velocities = self.scratch.velocities().as_chunks::<3>().0;
        let local = impulses.iter().zip(velocities);
        rover.active.clear();
        bed.active.clear();
        for (contact, (impulse, velocity)) in self.scratch.contacts().iter().zip(local) {
            let (impulse, velocity) = (*impulse, *velocity);
            match contact {
                CompositeContact::Grains(contact) => bed.active.push(ActiveContact {
                    contact: *contact,
                    position: contact.point.into(),
                    impulse,
                    velocity,
                }),
                CompositeContact::Tree(contact)
                | CompositeContact::Touch(GrainTouch { contact, .. }) => {
                    rover.active.push(ActiveContact {
                        contact: *contact,
                        position: rover.scene.position(&rover.parts, contact),
                        impulse,
                        velocity,
                    });
                }
            }
        }
    }
}

/// Calls `visit` with the number of every ball near a part of the rover and the gap, m, between
/// them now. Balls farther than `reach` (m) may be left out.
fn visit_near(
    rover: &RoverSimulation,
    bed: &GrainSimulation<3>,
    parts: impl Iterator<Item = Part>,
    reach: f64,
    mut visit: impl FnMut(Part, usize, f64),
) {
    let (model, grains) = (rover.model(), &bed.description().grains);
    let kinematics = Kinematics::of(model, rover.q());
    let mut grid = Grid::<3>::default();
    grid.fill(bed.q(), grains.radius(), 2.0 * grains.largest());
    for part in parts {
        let shape = part.place(model, &kinematics);
        let origin = kinematics.origin(part.body(model));
        let centre: [f64; 3] = (origin + shape.centre()).into();
        let reach = shape.bound() + grains.largest() + reach;
        grid.near(&centre, reach, |item| {
            let ball = PlacedShape::Sphere(Sphere::new(
                Vector3::from(item.centre) - origin,
                item.radius,
            ));
            let gap = dispatch::nearest_points(&ball, &shape).gap;
            visit(part, item.index as usize, gap);
        });
    }
}

/// Gap of each wheel now to the nearest grain, m; infinite without one within its radius.
fn gaps_to_grains(rover: &RoverSimulation, bed: &GrainSimulation<3>) -> Vec<f64> {
    let wheels = rover.model().wheels();
    let mut gaps = vec![f64::INFINITY; wheels.len()];
    let reach = wheels.iter().map(|wheel| wheel.radius);
    let reach = reach.fold(0.0, f64::max);
    let parts = (0..wheels.len()).map(Part::Wheel);
    visit_near(rover, bed, parts, reach, |part, _, gap| {
        if let Part::Wheel(i) = part {
            gaps[i] = gaps[i].min(gap);
        }
    });
    gaps
}

/// Checks that no part of the rover is in a grain.
fn check_apart(rover: &RoverSimulation, bed: &GrainSimulation<3>) -> Result<(), TogetherError> {
    let (model, grains) = (rover.model(), &bed.description().grains);
    let mut deepest: Option<(Part, usize, f64)> = None;
    visit_near(rover, bed, Part::all(model), 0.0, |part, grain, gap| {
        if gap < deepest.map_or(-OVERLAP * grains.smallest(), |d| d.2) {
            deepest = Some((part, grain, gap));
        }
    });
    match deepest {
        None => Ok(()),
        Some((part, grain, gap)) => Err(TogetherError::Overlap {
            part: part.name(model).to_owned(),
            grain,
            depth: -gap,
        }),
    }
}
