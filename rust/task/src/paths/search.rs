//! The cheapest of many paths (beam search).
#![expect(
    clippy::cast_possible_truncation,
    reason = "numbers of cells within some hundred metres"
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the machine's instructions"
)]

use super::{GroundGrid, Outline, PathCosts, PathRisk, PlanarPose, ScanShape, WayMap};
use rover_core::scalar::elementary::{atan2, exp, sin_cos};
use rover_core::scalar::instructions::Single;

/// Poses on an arc.
pub const STEPS: usize = 4;

/// Over the rover's reach, the distance within which two ends of paths count as one.
const SAME_PLACE: f64 = 0.2;

/// The turn within which two ends of paths count as one, rad.
const SAME_HEADING: f64 = 0.25;

/// While the rover backs off: the further cost of a change of the command, since wheels that are
/// being steered do not push, over that of other times.
const RETREAT_SWERVE: f64 = 4.0;

/// While the rover backs off: the cost of a metre to the goal.
const RETREAT_TO_GO: f64 = 0.2;

/// Decay of a trap's cost over the rover's reach, and with the cosine of the turn from it.
const TRAP_SIZE: f64 = 0.3;
const TRAP_TURN: f64 = 10.0;

/// Largest bearing of the goal that costs, rad.
const MAX_BEARING: f64 = 2.0;

/// Arcs of constant command that a path may be made of.
#[derive(Clone, Debug)]
pub struct Arcs {
    /// Poses after equal parts of each arc, from its beginning.
    pub poses: Vec<[PlanarPose; STEPS]>,
    /// 1 forward, -1 backward.
    pub direction: Vec<f64>,
}

/// What a search searches.
#[derive(Clone, Debug)]
pub struct PathProblem {
    /// The height scan.
    pub scan: ScanShape,
    /// The rover.
    pub outline: Outline,
    /// What a path costs.
    pub costs: PathCosts,
    /// The arcs that a path may begin with.
    pub first: Arcs,
    /// Speed, curvature and sideways of each of them.
    pub commands: Vec<[f64; 3]>,
    /// The arcs that it may go on with.
    pub further: Arcs,
    /// The rover's reach, m.
    pub reach: f64,
    /// Distance within which the goal is reached, m.
    pub arrival: f64,
}

/// A place ahead and to the right, m, and the heading, rad, where the rover got stuck.
pub type Trap = PlanarPose;

/// What a search starts from.
#[derive(Clone, Debug)]
pub struct SearchTask {
    /// The goal ahead and to the right of the point that follows the path, m.
    pub goal: [f64; 2],
    /// The present command; its first entry is 0 at a start.
    pub command: [f64; 3],
    /// Factor on the costs of belly, climb and lean.
    pub boldness: f64,
    /// Where the rover got stuck.
    pub traps: Vec<Trap>,
    /// Direction of the first arc while the rover backs off; `None` for a free choice.
    pub retreat: Option<f64>,
    /// A further cost of each first arc, m; empty for none.
    pub extra: Vec<f64>,
    /// Way to the goal from each point of the scan, m; empty for the straight way.
    pub ways: Vec<f64>,
}

/// A path that is being extended.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Index of the path's first arc.
    root: usize,
    end: PlanarPose,
    /// Direction of its last arc.
    direction: f64,
    cost: f64,
    /// Smallest distance from the goal so far, m.
    nearest: f64,
    /// Index at which the heights under the wheels at the path's end begin in the list of all.
    wheels: usize,
}

/// Finds paths for a rover.
#[derive(Clone, Debug)]
pub struct PathSearch {
    inner: PathProblem,
    risk: PathRisk,
    /// `later` to the power of each arc's number.
    discount: Vec<f64>,
    heights: Vec<f32>,
    seen: Vec<f32>,
    wheels: [Vec<f32>; 2],
    paths: [Vec<Path>; 2],
}

impl PathSearch {
    /// A search.
    #[must_use]
    pub fn new(inner: PathProblem) -> Self {
        let step = inner.costs.length * inner.reach / STEPS as f64;
        let grid = GroundGrid::new(inner.scan, &inner.outline.points(), inner.outline.x_c);
        let risk = PathRisk::new(grid, &inner.outline, &inner.costs, step);
        let powers = std::iter::successors(Some(1.0), |power| Some(power * inner.costs.later));
        Self {
            discount: powers.take(inner.costs.depth).collect(),
            seen: vec![0.0; risk.grid().n_points()],
            heights: Vec::new(),
            wheels: Default::default(),
            paths: Default::default(),
            risk,
            inner,
        }
    }

    /// Arcs that a path may begin with.
    #[must_use]
    pub fn n_first(&self) -> usize {
        self.inner.commands.len()
    }

    /// Wheels of the rover.
    #[must_use]
    pub fn n_wheels(&self) -> usize {
        self.risk.n_wheels()
    }

    /// Points of the scan.
    #[must_use]
    pub fn n_heights(&self) -> usize {
        self.risk.grid().n_heights()
    }

    /// A map over which the rover's ways cost what its paths do.
    #[must_use]
    pub fn map(&self, shape: [usize; 2], spacing: f64) -> WayMap {
        WayMap::new(shape, spacing, &self.inner.outline, &self.inner.costs)
    }

    /// What lies under the rover in poses, over heights in the order of the scan: for each pose the
    /// heights under the wheels over the mean of the present ones, the least gap under the rover,
    /// both over the wheels' radius, and the slopes ahead and to the right.
    ///
    /// # Panics
    ///
    /// The heights are not as many as the scan has points.
    pub fn under(&mut self, heights: &[f64], poses: &[PlanarPose]) -> Vec<f32> {
        let Self {
            risk,
            heights: grid,
            seen,
            ..
        } = self;
        risk.grid().spread(heights, grid);
        let (n, radius) = (risk.n_wheels(), risk.radius());
        risk.grid().under(grid, PlanarPose::default(), seen);
        let level = seen[..n].iter().sum::<f32>() / n as f32;
        let mut found = Vec::with_capacity(poses.len() * (n + 3));
        for pose in poses {
            let stand = risk.stand(grid, *pose, seen);
            found.extend(seen[..n].iter().map(|height| (height - level) / radius));
            found.extend([stand.gap, stand.ahead, stand.right]);
        }
        found
    }

    /// The first arc of the cheapest path over heights in the order of the scan.
    ///
    /// # Panics
    ///
    /// The heights are not as many as the scan has points.
    pub fn best(&mut self, heights: &[f64], task: &SearchTask) -> usize {
        Single::best().vectorize(
            #[inline(always)]
            || self.find(heights, task),
        )
    }

    #[inline(always)]
    fn find(&mut self, heights: &[f64], task: &SearchTask) -> usize {
        self.risk.grid().spread(heights, &mut self.heights);
        self.begin(task);
        if let Some(direction) = task.retreat {
            let [paths, _] = &self.paths;
            let ways = paths.iter().filter(|path| path.direction * direction > 0.0);
            let total = |path: &Path| path.cost + RETREAT_TO_GO * self.to_go(path, task);
            return cheapest(ways.map(|path| (path.root, total(path))));
        }
        for arc in 1..self.inner.costs.depth {
            self.extend(task, self.discount[arc]);
        }
        let [paths, _] = &self.paths;
        let total = |path: &Path| path.cost + self.to_go(path, task);
        cheapest(paths.iter().map(|path| (path.root, total(path))))
    }

    /// The paths of one arc.
    #[inline(always)]
    fn begin(&mut self, task: &SearchTask) {
        let Self {
            inner,
            risk,
            heights,
            seen,
            wheels: [wheels, _],
            paths: [paths, _],
            ..
        } = self;
        let (costs, n) = (&inner.costs, risk.n_wheels());
        risk.grid().under(heights, PlanarPose::default(), seen);
        let now = seen[..n].to_vec();
        let moves = f64::from(u8::from(task.command[0] != 0.0));
        let backs_off = f64::from(u8::from(task.retreat.is_some()));
        let swerve = costs.swerve * (moves + RETREAT_SWERVE * backs_off);
        wheels.clear();
        paths.clear();
        for (root, poses) in inner.first.poses.iter().enumerate() {
            let (direction, command) = (inner.first.direction[root], inner.commands[root]);
            let (mut nearest, mut sum, mut before) = (f64::INFINITY, 0.0_f32, now.clone());
            for pose in poses {
                let cost = risk.of(heights, *pose, &before, seen);
                nearest = nearest.min(pose.distance(task.goal[0], task.goal[1]));
                // What lies behind the goal costs nothing.
                sum += if nearest < inner.arrival { 0.0 } else { cost };
                before.copy_from_slice(&seen[..n]);
            }
            let change: f64 = (1..3).map(|k| (command[k] - task.command[k]).abs()).sum();
            let turns_back = command[0] * task.command[0] < 0.0;
            let cost = task.boldness * f64::from(sum)
                + costs.memory * nearness(poses, task, inner.reach)
                + swerve * change
                + task.extra.get(root).copied().unwrap_or(0.0)
                + if turns_back { costs.switch } else { 0.0 }
                + if direction < 0.0 { costs.reverse } else { 0.0 };
            paths.push(Path {
                root,
                end: poses[STEPS - 1],
                direction,
                cost,
                nearest,
                wheels: wheels.len(),
            });
            wheels.extend_from_slice(&before);
        }
    }

    /// Puts every further arc behind each of the cheapest paths.
    #[inline(always)]
    fn extend(&mut self, task: &SearchTask, discount: f64) {
        let kept = self.apart(task);
        let Self {
            inner,
            risk,
            heights,
            seen,
            wheels,
            paths,
            ..
        } = self;
        let (costs, n) = (&inner.costs, risk.n_wheels());
        let [wheels, longer_wheels] = wheels;
        let [paths, longer] = paths;
        longer.clear();
        longer_wheels.clear();
        let mut before = vec![0.0; n];
        for path in kept.iter().map(|i| paths[*i]) {
            let (sine, cosine) = sin_cos(path.end.heading);
            for (arc, direction) in inner.further.poses.iter().zip(&inner.further.direction) {
                let poses = arc.map(|pose| path.end.then(sine, cosine, pose));
                let (mut nearest, mut sum) = (path.nearest, 0.0_f32);
                before.copy_from_slice(&wheels[path.wheels..path.wheels + n]);
                for pose in poses {
                    let cost = risk.of(heights, pose, &before, seen);
                    nearest = nearest.min(pose.distance(task.goal[0], task.goal[1]));
                    sum += if nearest < inner.arrival { 0.0 } else { cost };
                    before.copy_from_slice(&seen[..n]);
                }
                let more = discount
                    * (task.boldness * f64::from(sum)
                        + costs.memory * nearness(&poses, task, inner.reach))
                    + if direction * path.direction < 0.0 {
                        costs.switch
                    } else {
                        0.0
                    }
                    + if *direction < 0.0 { costs.reverse } else { 0.0 };
                longer.push(Path {
                    root: path.root,
                    end: poses[STEPS - 1],
                    direction: *direction,
                    cost: path.cost + more,
                    nearest,
                    wheels: longer_wheels.len(),
                });
                longer_wheels.extend_from_slice(&before);
            }
        }
        std::mem::swap(wheels, longer_wheels);
        std::mem::swap(paths, longer);
    }

    /// The cheapest paths whose ends are apart from those of cheaper ones.
    fn apart(&self, task: &SearchTask) -> Vec<usize> {
        let [paths, _] = &self.paths;
        let mut order: Vec<(f64, usize)> = paths
            .iter()
            .enumerate()
            .map(|(i, path)| (path.cost + self.to_go(path, task), i))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let place = SAME_PLACE * self.inner.reach;
        let mut cells: Vec<[i64; 3]> = Vec::new();
        let mut kept = Vec::new();
        for (_, i) in order {
            let end = paths[i].end;
            let sizes = [
                (end.ahead, place),
                (end.right, place),
                (end.heading, SAME_HEADING),
            ];
            let cell = sizes.map(|(value, size)| (value / size).round_ties_even() as i64);
            if cells.contains(&cell) {
                continue;
            }
            cells.push(cell);
            kept.push(i);
            if kept.len() == self.inner.costs.width {
                break;
            }
        }
        kept
    }

    /// Way from the end of a path to the goal, m, turns included; 0 for one that passes it.
    fn to_go(&self, path: &Path, task: &SearchTask) -> f64 {
        let inner = &self.inner;
        if path.nearest < inner.arrival {
            return 0.0;
        }
        let (distance, ahead, right) = if task.ways.is_empty() {
            let (ahead, right) = (task.goal[0] - path.end.ahead, task.goal[1] - path.end.right);
            ((ahead * ahead + right * right).sqrt(), ahead, right)
        } else {
            self.risk.grid().way(&task.ways, path.end)
        };
        let (sine, cosine) = sin_cos(path.end.heading);
        let bearing = atan2(ahead * sine + right * cosine, ahead * cosine - right * sine).abs();
        let facing = inner.costs.facing * bearing.min(MAX_BEARING);
        distance + facing * distance.min(inner.reach)
    }
}

/// How close poses come to the traps, 1 at one, summed over the traps.
fn nearness(poses: &[PlanarPose], task: &SearchTask, reach: f64) -> f64 {
    let size = TRAP_SIZE * reach;
    let by_trap = task.traps.iter().map(|trap| {
        let at = poses.iter().map(|pose| {
            let distance = pose.distance(trap.ahead, trap.right);
            let turned = 1.0 - sin_cos(pose.heading - trap.heading).1;
            -distance * distance / (size * size) - TRAP_TURN * turned
        });
        exp(at.fold(f64::NEG_INFINITY, f64::max))
    });
    by_trap.sum()
}

/// The first of the cheapest; 0 if there is none.
fn cheapest(costs: impl Iterator<Item = (usize, f64)>) -> usize {
    let best = costs.fold((0, f64::INFINITY), |best, next| {
        if next.1 < best.1 { next } else { best }
    });
    best.0
}
