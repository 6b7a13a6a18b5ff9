//! `PathSearch`: the cheapest of many paths over a height scan.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_task::paths::search::STEPS;
use rover_task::paths::{
    Arcs, MapTask, Outline, PathCosts, PathProblem, PathSearch as Core, PlanarPose, ScanShape,
    SearchTask, WayMap,
};

use crate::arguments::{Named, at_least_one, count, finite, positive, refused};
use crate::arrays::{Array, array, finite_shaped, shaped, triple, two, vector};
use crate::errors::{Kind, Result};

/// Beam search for the cheapest path of a rover over a height scan.
///
/// `rover_gym.drive.ScanPolicy` uses it; `rover_gym.drive.PathCosts` defines the cost of a path.
/// A pose consists of the distance ahead, the distance to the right, m, and the turn to the left,
/// rad.
///
/// Args:
///     scan: Rows, columns and spacing, m, of the height scan.
///     outline: Geometry of the rover in the trunk's frame: `wheels` (n_wheels, 2) and `underside`
///         (n, 2), x and z, m; `clearance` (n,) of the underside, m; `plane_fit` (3, n_wheels), the
///         matrix from the heights under the wheels to height and slopes of the ground plane;
///         `x_c`, x of the point that follows the path, m; `radius` of the wheels, m.
///     costs: The fields of `PathCosts`.
///     first: Arcs for the first segment of a path: `poses` (n, 4, 3), `direction` (n,), 1 or -1,
///         and `commands` (n, 3), speed, curvature and sideways motion.
///     further: Arcs for the following segments: `poses` and `direction`.
///     reach: The rover's reach, m.
///     arrival: Distance within which the goal is reached, m.
///
/// Raises:
///     OptionError: An argument is missing, not a number, or has a wrong shape.
#[pyclass(module = "rover_gym.core")]
pub struct PathSearch {
    inner: Core,
    map: Option<WayMap>,
}

/// Rows of M finite numbers, of any leading shape.
fn rows<const M: usize>(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    field: &str,
) -> Result<Vec<[f64; M]>> {
    let what = format!("(..., {M})");
    let fits = |shape: &[usize]| shape.last() == Some(&M);
    let (flat, _) = finite_shaped(value, kind, (field, &what), fits)?;
    Ok(flat.as_chunks::<M>().0.to_vec())
}

/// Poses of any leading shape.
fn poses(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Vec<PlanarPose>> {
    let rows = rows(value, kind, field)?.into_iter();
    Ok(rows
        .map(|[ahead, right, heading]| PlanarPose {
            ahead,
            right,
            heading,
        })
        .collect())
}

fn arcs(given: &Bound<'_, PyAny>, outer: &'static str) -> Result<Arcs> {
    let named = Named::mapping(given, outer, Kind::Option)?;
    let (poses, direction) = (
        named.need("poses", poses)?,
        named.need("direction", vector)?,
    );
    if poses.len() != STEPS * direction.len() || direction.is_empty() {
        let what = format!("for arcs of {STEPS} poses each, at least one");
        return Err(refused(given, Kind::Option, outer, &what));
    }
    Ok(Arcs {
        poses: poses.as_chunks::<STEPS>().0.to_vec(),
        direction,
    })
}

/// Three rows of equal length.
fn plane_fit(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[Vec<f64>; 3]> {
    let fits = |shape: &[usize]| matches!(shape, [3, _]);
    let (flat, shape) = shaped(value, kind, (field, "(3, n_wheels)"), fits)?;
    let n = shape[1];
    Ok([0, 1, 2].map(|i| flat[i * n..(i + 1) * n].to_vec()))
}

fn outline(given: &Bound<'_, PyAny>) -> Result<Outline> {
    let named = Named::mapping(given, "outline", Kind::Option)?;
    let read = Outline {
        wheels: named.need("wheels", rows)?,
        underside: named.need("underside", rows)?,
        clearance: named.need("clearance", vector)?,
        plane_fit: named.need("plane_fit", plane_fit)?,
        x_c: named.need("x_c", finite)?,
        radius: named.need("radius", finite)?,
    };
    let fits = read.plane_fit[0].len() == read.wheels.len();
    if !fits || read.clearance.len() != read.underside.len() || read.radius <= 0.0 {
        let what = "of equal lengths, with a positive radius";
        return Err(refused(given, Kind::Option, "outline", what));
    }
    Ok(read)
}

fn costs(given: &Bound<'_, PyAny>) -> Result<PathCosts> {
    let named = Named::mapping(given, "costs", Kind::Option)?;
    let cost = |name: &str| named.need(name, finite);
    Ok(PathCosts {
        belly: cost("belly")?,
        margin: cost("margin")?,
        climb: cost("climb")?,
        step: cost("step")?,
        lean: cost("lean")?,
        facing: cost("facing")?,
        swerve: cost("swerve")?,
        switch: cost("switch")?,
        reverse: cost("reverse")?,
        memory: cost("memory")?,
        later: cost("later")?,
        depth: named.need("depth", at_least_one)?,
        width: named.need("width", at_least_one)?,
        length: cost("length")?,
    })
}

fn scan_shape(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<ScanShape> {
    let wrong = || refused(value, kind, field, "two rows and columns or more, and m");
    let given: [Bound<'_, PyAny>; 3] = value.extract().map_err(|_| wrong())?;
    let [rows, columns, spacing] = &given;
    let read = ScanShape {
        rows: count(rows, kind, field)?,
        columns: count(columns, kind, field)?,
        spacing: finite(spacing, kind, field)?,
    };
    let fits = |n: usize| (2..=10_000).contains(&n);
    if fits(read.rows) && fits(read.columns) && read.spacing > 0.0 {
        return Ok(read);
    }
    Err(wrong())
}

#[pymethods]
impl PathSearch {
    #[new]
    #[pyo3(signature = (**options), text_signature = "(*, scan, outline, costs, first, further, reach, arrival)")]
    fn new(py: Python<'_>, options: Option<&Bound<'_, PyDict>>) -> Result<Self> {
        let given = Named::keywords(py, options)?;
        let arcs_of = |name: &'static str| given.need(name, |value, _, _| arcs(value, name));
        let scan = given.need("scan", scan_shape)?;
        let outline = given.need("outline", |value, _, _| outline(value))?;
        let costs = given.need("costs", |value, _, _| costs(value))?;
        let (first, commands) = given.need("first", |value, kind, name| {
            let commands = Named::mapping(value, "first", kind)?.need("commands", rows)?;
            let first = arcs(value, "first")?;
            if commands.len() != first.direction.len() {
                let field = format!("{name}.commands");
                return Err(refused(value, kind, &field, "a command for each arc"));
            }
            Ok((first, commands))
        })?;
        let further = arcs_of("further")?;
        let reach = given.need("reach", positive)?;
        let arrival = given.need("arrival", finite)?;
        given.finish()?;
        let search = PathProblem {
            scan,
            outline,
            costs,
            commands,
            first,
            further,
            reach,
            arrival,
        };
        Ok(Self {
            inner: Core::new(search),
            map: None,
        })
    }

    /// Returns the first arc of the cheapest path.
    ///
    /// Args:
    ///     heights: `(rows * columns,)` heights of the scan, m.
    ///     goal: The goal ahead and to the right of the point that follows the path, m.
    ///     command: `(3,)` the present command; its first entry is 0 if the rover starts to move.
    ///     boldness: Factor on the costs of underside, climb and lean.
    ///     traps: `(n, 3)` poses at which the rover got stuck.
    ///     retreat: Required direction of the first arc, 1 or -1, while the rover backs off; 0 if
    ///         both are allowed.
    ///     extra: `(n,)` additional cost of each first arc, m; none by default.
    ///     ways: `(rows * columns,)` cost-to-go from each point of the scan to the goal, m; the
    ///         straight distance by default.
    ///
    /// Returns:
    ///     The index of the arc among the first arcs.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or an entry that is not finite.
    #[pyo3(signature = (
        heights, goal, command, boldness, traps, retreat, extra = None, ways = None
    ))]
    #[expect(clippy::too_many_arguments)]
    fn best(
        &mut self,
        heights: &Bound<'_, PyAny>,
        goal: &Bound<'_, PyAny>,
        command: &Bound<'_, PyAny>,
        boldness: f64,
        traps: &Bound<'_, PyAny>,
        retreat: f64,
        extra: Option<&Bound<'_, PyAny>>,
        ways: Option<&Bound<'_, PyAny>>,
    ) -> Result<usize> {
        let task = SearchTask {
            goal: two(goal, Kind::Option, "goal")?,
            command: triple(command, Kind::Option, "command")?,
            boldness,
            traps: poses(traps, Kind::Option, "traps")?,
            retreat: (retreat != 0.0).then_some(retreat),
            extra: match extra {
                Some(given) => finite_entries(given, self.inner.n_first(), "extra", "costs")?,
                None => Vec::new(),
            },
            ways: match ways {
                Some(given) => self.at_points(given, "ways")?,
                None => Vec::new(),
            },
        };
        let heights = self.at_points(heights, "heights")?;
        Ok(self.inner.best(&heights, &task))
    }

    /// Cost-to-go to a goal from every cell of a map (Dijkstra 1959).
    ///
    /// The rover moves from a cell to one of its eight neighbours, with its heading towards it. The
    /// cost is the distance plus the costs of underside, climb and lean. A wheel over unknown
    /// ground gets the mean height of the other wheels; if the ground under all wheels is unknown,
    /// the cost is the distance alone.
    ///
    /// Args:
    ///     heights: (rows, columns) heights, m, NaN where unknown; 3 to 2000 rows and columns. The
    ///         first row is the farthest ahead; columns run from left to right.
    ///     spacing: Distance of rows and columns, m.
    ///     goal: Row and column of the goal. From the border to a goal outside the map, the
    ///         straight distance counts.
    ///     boldness: Factor on the costs of underside, climb and lean.
    ///     extra: (rows, columns) additional cost per metre in each cell, at least 0; none by
    ///         default.
    ///
    /// Returns:
    ///     (rows, columns) costs-to-go, in metres of level ground.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or an entry out of range.
    #[pyo3(signature = (heights, spacing, goal, boldness, extra = None))]
    fn ways(
        &mut self,
        heights: &Bound<'_, PyAny>,
        spacing: &Bound<'_, PyAny>,
        goal: &Bound<'_, PyAny>,
        boldness: &Bound<'_, PyAny>,
        extra: Option<&Bound<'_, PyAny>>,
    ) -> Result<Array> {
        let refuse = |value, field, what| refused(value, Kind::Option, field, what);
        let read = array(heights, Kind::Option, "heights")?;
        let shape = match *read.as_array().shape() {
            [rows, columns] if [rows, columns].iter().all(|n| (3..=2000).contains(n)) => {
                [rows, columns]
            }
            _ => return Err(refuse(heights, "heights", "3 to 2000 rows and columns")),
        };
        let seen: Vec<f64> = read.as_array().iter().copied().collect();
        if seen.iter().any(|height| height.is_infinite()) {
            return Err(refuse(heights, "heights", "finite, or nan"));
        }
        let price = match extra {
            None => vec![0.0; seen.len()],
            Some(given) => {
                let read = array(given, Kind::Option, "extra")?;
                let price: Vec<f64> = read.as_array().iter().copied().collect();
                if read.as_array().shape() != shape
                    || !price.iter().all(|more| more.is_finite() && *more >= 0.0)
                {
                    let what = "a finite price of at least 0 for each height";
                    return Err(refuse(given, "extra", what));
                }
                price
            }
        };
        let spacing = positive(spacing, Kind::Option, "spacing")?;
        let aim = two(goal, Kind::Option, "goal")?;
        if !aim.iter().all(|at| at.is_finite()) {
            return Err(refuse(goal, "goal", "finite"));
        }
        let bold = finite(boldness, Kind::Option, "boldness")?;
        if bold < 0.0 {
            return Err(refuse(boldness, "boldness", "at least 0"));
        }
        if self.map.as_ref().map(WayMap::shape) != Some((shape, spacing)) {
            self.map = None;
        }
        let inner = &self.inner;
        let map = self.map.get_or_insert_with(|| inner.map(shape, spacing));
        let found = map.ways(&MapTask {
            heights: &seen,
            extra: &price,
            goal: aim,
            boldness: bold,
        });
        Ok(Array::shaped(found, &shape))
    }

    /// Features of the ground under the rover at given poses.
    ///
    /// Args:
    ///     heights: `(rows * columns,)` heights of the scan, m.
    ///     poses: `(..., 3)` poses.
    ///
    /// Returns:
    ///     (n, n_wheels + 3), for each pose: the heights under the wheels minus the mean height
    ///     under the wheels now, and the smallest gap under the rover, both divided by the wheel
    ///     radius; then the slopes ahead and to the right of the plane fitted to the ground under
    ///     the wheels.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or an entry that is not finite.
    fn under(
        &mut self,
        heights: &Bound<'_, PyAny>,
        poses: &Bound<'_, PyAny>,
    ) -> Result<Array<f32>> {
        let heights = self.at_points(heights, "heights")?;
        let poses = self::poses(poses, Kind::Option, "poses")?;
        let found = self.inner.under(&heights, &poses);
        Ok(Array::shaped(
            found,
            &[poses.len(), self.inner.n_wheels() + 3],
        ))
    }
}

/// `n` finite numbers; `what`: their plural.
fn finite_entries(given: &Bound<'_, PyAny>, n: usize, field: &str, what: &str) -> Result<Vec<f64>> {
    let found = vector(given, Kind::Option, field)?;
    if found.len() == n && found.iter().all(|value| value.is_finite()) {
        return Ok(found);
    }
    let what = format!("{n} finite {what}");
    Err(refused(given, Kind::Option, field, &what))
}

impl PathSearch {
    /// A finite number for each point of the scan.
    fn at_points(&self, given: &Bound<'_, PyAny>, field: &str) -> Result<Vec<f64>> {
        finite_entries(given, self.inner.n_heights(), field, field)
    }
}
