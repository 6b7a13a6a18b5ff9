//! The channels of an observation: name, unit, size, scale, bounds and value of each field,
//! declared once.

use std::ops::Range;

use rover_core::multibody::Model;
use rover_core::simulation::seen_from;

use super::progress::Progress;
use super::settings::Settings;

/// What the sizes and scales of an observation follow from.
#[derive(Clone, Copy, Debug)]
pub struct Sizes<'a> {
    /// The machine.
    pub model: &'a Model,
    /// Entries of an action.
    pub actions: usize,
    /// Goals of an episode.
    pub goals: usize,
    /// Whether there is a battery.
    pub has_battery: bool,
    /// Points of the height scan.
    pub points: usize,
    /// Magnitude of gravity, m/s².
    pub gravity: f64,
}

impl Sizes<'_> {
    /// 1 with several goals, else 0.
    fn courses(&self) -> usize {
        usize::from(self.goals > 1)
    }

    fn wheels(&self) -> usize {
        self.model.wheels().len()
    }
}

/// The value of an entry of 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// A number.
    Fixed(f64),
    /// For velocities: 1, but this number for a wheel's rate.
    Rates(f64),
    /// Mean weight on a wheel.
    WheelLoad,
    /// The number of goals.
    Goals,
}

impl Scale {
    /// The scale as the built-in rover's card states it.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::Fixed(scale) => scale.to_string(),
            Self::Rates(scale) => format!("1, wheels {scale}"),
            Self::WheelLoad => "m g / 6".to_owned(),
            Self::Goals => "goals".to_owned(),
        }
    }

    /// The scale of each of `n` entries.
    fn entries(self, sizes: &Sizes<'_>, n: usize) -> Vec<f64> {
        let model = sizes.model;
        match self {
            Self::Fixed(scale) => vec![scale; n],
            Self::Rates(scale) => {
                let joints = model.wheels().iter().filter_map(|wheel| wheel.joint);
                let wheels: Vec<_> = joints.map(|joint| model.joint_velocity(joint)).collect();
                let is_wheel = model.joint_velocities().iter().map(|k| wheels.contains(k));
                let rates = is_wheel.map(|is_wheel| if is_wheel { scale } else { 1.0 });
                std::iter::repeat_n(1.0, n - model.n_joints())
                    .chain(rates)
                    .collect()
            }
            Self::WheelLoad => vec![model.mass() * sizes.gravity / sizes.wheels() as f64; n],
            Self::Goals => vec![sizes.goals as f64; n],
        }
    }
}

/// An episode at the end of a control period.
#[derive(Clone, Copy, Debug)]
pub struct EpisodeMoment<'a> {
    /// Settings of the task.
    pub settings: &'a Settings,
    /// Reading of the rover, without heights.
    pub reading: &'a [f64],
    /// The goal after the present one, (x, z), m; the present one if it is the last.
    pub next_goal: [f64; 2],
    /// The episode's state outside the simulation.
    pub progress: &'a Progress,
}

impl EpisodeMoment<'_> {
    /// The goal after the present one, ahead and to the right of the trunk, m.
    fn next_goal_seen(&self) -> [f64; 2] {
        let [x, z, heading] = [self.reading[0], self.reading[2], self.reading[4]];
        let [ahead, right, _] = seen_from([x, z], heading, self.next_goal);
        [ahead, right]
    }
}

/// Where the entries of a channel come from. Channels stand in this order.
#[derive(Clone, Copy, Debug)]
pub enum ChannelValue {
    /// The entries of the reading with the same indices.
    Reading,
    /// The last action.
    Action,
    /// A function of the episode and the entry's index in the channel.
    Episode(fn(&EpisodeMoment<'_>, usize) -> f64),
    /// Heights of the ground, which may come later.
    Heights,
}

use ChannelValue::{Action, Episode, Heights, Reading};

/// A field of an observation.
#[derive(Debug)]
pub struct Channel {
    /// Name of the field.
    pub name: &'static str,
    /// Unit before scaling.
    pub unit: &'static str,
    /// Meaning, in a few words.
    pub meaning: &'static str,
    /// Number of entries; without any, an observation lacks it.
    size: fn(&Sizes<'_>) -> usize,
    /// By what entries are divided.
    pub scale: Scale,
    /// Least and largest scaled entry.
    pub bounds: [f64; 2],
    /// Where the entries come from.
    pub value: ChannelValue,
}

impl Channel {
    /// Whether entries have no bounds. Such entries have noise; flags, fractions, unit vectors,
    /// distances and actions do not.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        self.bounds.iter().all(|bound| bound.is_infinite())
    }
}

const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
const FLAG: [f64; 2] = [0.0, 1.0];
const UNIT: [f64; 2] = [-1.0, 1.0];

const ONE: Scale = Scale::Fixed(1.0);
const GAP: Scale = Scale::Fixed(0.1);
const GOAL: Scale = Scale::Fixed(10.0);

/// Channels: name, unit, meaning, scale, bounds, size and value.
macro_rules! channels {
    ($($name:literal [$unit:literal] $meaning:literal / $scale:expr, in $bounds:expr,
        size $size:expr, $value:expr;)*) => {
        &[$(Channel {
            name: $name,
            unit: $unit,
            meaning: $meaning,
            size: $size,
            scale: $scale,
            bounds: $bounds,
            value: $value,
        }),*]
    };
}

/// The fields of an observation, in order. Up to `goal_distance` they are the first entries of a
/// reading ([`rover_core::simulation::ReadingLayout`]).
pub const CHANNELS: &[Channel] = channels! {
    "q" ["m, rad"] "trunk x, y, z, roll, heading, pitch; joint angles"
        / ONE, in ANY, size |n| n.model.nv(), Reading;
    "velocity" ["m/s, rad/s"] "trunk linear and angular in the trunk frame; joint rates"
        / Scale::Rates(10.0), in ANY, size |n| 6 + n.model.n_joints(), Reading;
    "wheel_gap" ["m"] "distance of each wheel to ground and rocks"
        / GAP, in ANY, size |n| n.wheels(), Reading;
    "wheel_contact" [""] "1 where the gap is at most 1 mm, else 0"
        / ONE, in FLAG, size |n| n.wheels(), Reading;
    "normal_force" ["N"] "ground and rocks on wheel, along each contact's normal"
        / Scale::WheelLoad, in ANY, size |n| n.wheels(), Reading;
    "tangential_force" ["N"] "the same, rolling then lateral, wheel by wheel"
        / Scale::WheelLoad, in ANY, size |n| 2 * n.wheels(), Reading;
    "ground_normal" [""] "the normal of the ground, over 1 m, in the trunk frame"
        / ONE, in UNIT, size |_| 3, Reading;
    "goal" ["m"] "goal ahead and to the right of the trunk, horizontal"
        / GOAL, in ANY, size |_| 2, Reading;
    "goal_distance" ["m"] "horizontal distance from the trunk's origin to the goal"
        / GOAL, in [0.0, f64::INFINITY], size |_| 1, Reading;
    "previous_action" [""] "the action before this observation, 0 at reset"
        / ONE, in UNIT, size |n| n.actions, Action;
    "stuck" [""] "fraction of the time to high-centring that has passed"
        / ONE, in FLAG, size |_| 1,
        Episode(|now, _| (now.progress.stuck_time / now.settings.stuck_time).min(1.0));
    "charge" [""] "fraction of the battery's charge"
        / ONE, in FLAG, size |n| usize::from(n.has_battery),
        Episode(|now, _| {
            let battery = now.settings.battery.unwrap_or(f64::INFINITY);
            (1.0 - now.progress.energy / battery).max(0.0)
        });
    "next_goal" ["m"] "the goal after the present one, ahead and to the right of the trunk, horizontal"
        / GOAL, in ANY, size |n| 2 * n.courses(),
        Episode(|now, i| now.next_goal_seen()[i]);
    "waypoints_remaining" [""] "goals still to reach"
        / Scale::Goals, in FLAG, size |n| n.courses(),
        Episode(|now, _| {
            now.settings.goals.saturating_sub(now.progress.reached) as f64
        });
    "height_scan" ["m"] "heights of ground and rocks over the trunk's origin, from the front, each row from the left"
        / ONE, in ANY, size |n| n.points, Heights;
};

/// A field of the observations of a task.
#[derive(Debug)]
pub struct Field {
    /// Channel of the field: name, unit and meaning.
    pub channel: &'static Channel,
    /// Entries of the observation that belong to the field.
    pub entries: Range<usize>,
    /// By what each is divided.
    pub scale: Vec<f64>,
}

/// The fields that observations have.
#[must_use]
pub fn fields(sizes: &Sizes<'_>) -> Vec<Field> {
    let mut start = 0;
    let sized = CHANNELS
        .iter()
        .map(|channel| (channel, (channel.size)(sizes)));
    let present = sized.filter(|(_, size)| *size > 0);
    present
        .map(|(channel, size)| {
            start += size;
            Field {
                channel,
                entries: start - size..start,
                scale: channel.scale.entries(sizes, size),
            }
        })
        .collect()
}
