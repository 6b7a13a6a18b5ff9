//! What all episodes of a task share.

use std::ops::Range;
use std::sync::Arc;

use super::channels::{ChannelValue, Field, Sizes, fields};
use super::ending::Ending;
use super::error::{EpisodeError, check_lengths};
use super::progress::Progress;
use super::quantities::Quantities;
use super::settings::Settings;
use rover_core::multibody::Model;
use rover_core::simulation::ReadingLayout;

/// Indices of what an episode needs in a reading without heights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadingIndices {
    /// Leading entries that an observation shares with it.
    pub shared: usize,
    /// Indices of the [`super::Quantities`] in the reading, in order.
    pub scalars: Range<usize>,
    /// Size of the reading.
    pub size: usize,
}

/// Checked settings for the models of one size.
#[derive(Clone, Debug)]
pub struct Rules {
    model: Arc<Model>,
    settings: Settings,
    inverse_scale: Vec<f64>,
    noise: Vec<f64>,
    places: ReadingIndices,
    own_entries: Vec<(usize, usize, ChannelValue)>,
    sizes: [usize; 3],
    steering: Steering,
}

/// Which entry of an action's steering each wheel follows.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Steering {
    /// By wheel; None where actions do not steer it.
    entries: Vec<Option<usize>>,
    n_entries: usize,
}

impl Steering {
    /// One entry for each steering joint, in the order of the wheels: wheels that share a joint
    /// share its entry.
    fn of(model: &Model) -> Self {
        let mut joints = Vec::new();
        let mut entry_of = |joint: usize| {
            let known = joints.iter().position(|own| *own == joint);
            known.unwrap_or_else(|| {
                joints.push(joint);
                joints.len() - 1
            })
        };
        let entries = (model.wheels().iter())
            .map(|wheel| wheel.steering.map(&mut entry_of))
            .collect();
        Self {
            entries,
            n_entries: joints.len(),
        }
    }

    /// Actions do not steer.
    fn none(model: &Model) -> Self {
        Self {
            entries: vec![None; model.wheels().len()],
            n_entries: 0,
        }
    }
}

/// What a reading's size depends on.
const SIZES: [&str; 3] = ["simulation.v", "simulation.joints", "simulation.wheels"];

/// The numbers of a model in the order of [`SIZES`].
fn sizes(model: &Model) -> [usize; 3] {
    [model.nv(), model.n_joints(), model.wheels().len()]
}

/// Rules are equal if episodes under them are.
impl PartialEq for Rules {
    fn eq(&self, other: &Self) -> bool {
        self.settings == other.settings
            && self.sizes == other.sizes
            && self.steering == other.steering
    }
}

impl Rules {
    /// Rules for a model.
    ///
    /// # Errors
    /// `Length`, `OutOfRange`.
    ///
    /// # Panics
    /// If an observation did not begin with a part of a reading, or end with the heights.
    pub fn new(model: Arc<Model>, settings: Settings) -> Result<Self, EpisodeError> {
        let layout = ReadingLayout::new(&model, 0);
        let place = |name: &str| {
            let found = layout.fields().iter().find(|(own, _)| *own == name);
            found.map_or(0..0, |(_, place)| place.clone())
        };
        let shared = place("target").end;
        let places = ReadingIndices {
            shared,
            // The last entry of the target is the distance to the goal.
            scalars: shared - 1..place("solver").end,
            size: layout.size(),
        };
        let n_wheels = model.wheels().len();
        let steering = if settings.max_steering > 0.0 {
            Steering::of(&model)
        } else {
            Steering::none(&model)
        };
        check_lengths([("torque_limits", settings.torque_limits.len(), n_wheels)])?;
        settings.check(model.trees()[0].is_free)?;
        let mut rules = Self {
            inverse_scale: Vec::new(),
            noise: Vec::new(),
            own_entries: Vec::new(),
            sizes: sizes(&model),
            model,
            settings,
            places,
            steering,
        };
        for field in rules.observation() {
            let (start, size) = (field.entries.start, field.entries.len());
            match field.channel.value {
                ChannelValue::Reading => assert!(field.entries.end <= shared, "of the reading"),
                ChannelValue::Heights => assert_eq!(size, rules.settings.scan.len(), "all heights"),
                value => rules.own_entries.push((start, size, value)),
            }
            let inverse = field.scale.iter().map(|scale| 1.0 / scale);
            rules.inverse_scale.extend(inverse);
            if rules.settings.noise > 0.0 {
                let deviation = rules.settings.noise * f64::from(field.channel.is_measured());
                rules.noise.extend(field.entries.map(|_| deviation));
            }
        }
        let own = rules.own_entries.iter();
        let mut end = shared;
        for (start, size, _) in own {
            assert_eq!(*start, end, "a reading, then the episode's own");
            end += size;
        }
        assert_eq!(end, rules.n_state(), "the heights last");
        Ok(rules)
    }

    /// The fields of an observation.
    #[must_use]
    pub fn observation(&self) -> Vec<Field> {
        fields(&Sizes {
            model: &self.model,
            actions: self.n_actions(),
            goals: self.settings.goals,
            has_battery: self.settings.battery.is_some(),
            points: self.settings.scan.len(),
            gravity: self.settings.gravity,
        })
    }

    /// The model that they were made for.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Checks that a model has readings of this size, and wheels that can be steered as far as an
    /// action asks.
    ///
    /// # Errors
    /// `Length`, `OutOfRange`.
    pub fn check_model(&self, model: &Model) -> Result<(), EpisodeError> {
        let own = sizes(model).into_iter().zip(self.sizes);
        let lists = SIZES.into_iter().zip(own);
        check_lengths(lists.map(|(field, (actual, expected))| (field, actual, expected)))?;
        let is_steered = |wheel: usize| self.steering.entries[wheel].is_some();
        let limit = (model.wheels().iter().enumerate())
            .filter(|(wheel, _)| is_steered(*wheel))
            .map(|(_, own)| own.steering.map_or(0.0, |_| own.steering_limit))
            .fold(f64::INFINITY, f64::min);
        if self.settings.max_steering > limit * (1.0 + 1e-12) {
            return Err(EpisodeError::OutOfRange {
                field: "max_steering",
                range: "within the steering limit of every steered wheel",
                value: self.settings.max_steering,
            });
        }
        Ok(())
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Wheels of a rover.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.settings.torque_limits.len()
    }

    /// Entries of an action: a torque for each wheel, and a set-point for each steering joint if
    /// actions steer.
    #[must_use]
    pub fn n_actions(&self) -> usize {
        self.n_wheels() + self.n_steering()
    }

    /// Entries of an action's steering.
    #[must_use]
    pub fn n_steering(&self) -> usize {
        self.steering.n_entries
    }

    /// Which of them each wheel follows; None where actions do not steer it.
    #[must_use]
    pub fn steering_entries(&self) -> &[Option<usize>] {
        &self.steering.entries
    }

    /// Commands of a rover: a torque and a set-point for each wheel.
    #[must_use]
    pub fn n_commands(&self) -> usize {
        2 * self.n_wheels()
    }

    /// Entries of an observation.
    #[must_use]
    pub fn size(&self) -> usize {
        self.inverse_scale.len()
    }

    /// Entries of an observation before the heights.
    #[must_use]
    pub fn n_state(&self) -> usize {
        self.size() - self.settings.scan.len()
    }

    /// First entry, number and value of the fields after the reading and before the heights.
    #[must_use]
    pub fn own_entries(&self) -> &[(usize, usize, ChannelValue)] {
        &self.own_entries
    }

    /// Leading entries that a reading and an observation share.
    #[must_use]
    pub fn n_shared(&self) -> usize {
        self.places.shared
    }

    /// The ending after a control period: a failed step takes precedence, then the goal, then
    /// rolling over, high-centring, the battery, coming free and leaving the field.
    #[must_use]
    pub fn ending(&self, now: &Quantities, progress: &Progress, has_failed: bool) -> Ending {
        let settings = &self.settings;
        if has_failed {
            Ending::StepFailed
        } else if progress.reached >= settings.goals {
            Ending::Goal
        } else if now.cos_tilt < settings.cos_max_tilt {
            Ending::RollOver
        } else if progress.stuck_time >= settings.stuck_time {
            Ending::HighCentred
        } else if (settings.battery).is_some_and(|battery| progress.energy >= battery) {
            Ending::BatteryEmpty
        } else if (settings.free_distance).is_some_and(|free| progress.away >= free) {
            Ending::Free
        } else if (settings.field_margin).is_some_and(|margin| progress.outside > margin) {
            Ending::LeftField
        } else {
            Ending::None
        }
    }

    /// ReadingIndices in a reading.
    #[must_use]
    pub fn places(&self) -> &ReadingIndices {
        &self.places
    }

    /// Inverse of the observation's scale (size).
    #[must_use]
    pub fn inverse_scale(&self) -> &[f64] {
        &self.inverse_scale
    }

    /// Standard deviation of each entry's noise (size); empty without noise.
    #[must_use]
    pub fn noise(&self) -> &[f64] {
        &self.noise
    }

    /// Whether observations have noise.
    #[must_use]
    pub fn is_noisy(&self) -> bool {
        !self.noise.is_empty()
    }
}
