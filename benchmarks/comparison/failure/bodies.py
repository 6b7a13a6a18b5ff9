"""Scenes of a few free bodies: what they test is the law and the solver, not the rover."""

import time
from collections.abc import Iterator, Mapping

import numpy as np

from comparison.failure.finding import Finding, Row, for_each
from comparison.failure.rigid_bodies import (
    UP,
    Contact,
    G,
    Solver,
    Spring,
    World,
    box_inertia,
    corners,
    ours,
    stack,
)
from comparison.problems import problem_folder, recorded, residual
from rover_gym import solve_friction_contact

H = 1e-3  # s
SOLVERS: dict[str, Solver] = {f"solver {name}": ours(name) for name in ("auto", "nsgs", "newton")}
#: Gauss-Seidel that is given a hundred times the sweeps.
PATIENT: dict[str, Solver] = {"solver nsgs, 1e5 sweeps": ours("nsgs", max_iterations=100_000)}
CONVEX: dict[str, Solver] = {"convex law": ours("relaxed")}
PLANAR: dict[str, Solver] = {name: ours(name.split()[1], 1e-10, dimension=2) for name in SOLVERS}
#: At ten times this stiffness a cube of 1 kg on a slope rocks without end at this step.
SPRING = Spring(stiffness=1e4, damping=30.0, slip_speed=1e-2)
#: Given to springs to settle under the weight, s.
SETTLE = 1.0
#: What moves faster has left, m/s or rad/s.
FAST = 1e3
Method = Solver | Spring


def _fast(world: World) -> float:
    return float(np.abs(world.v).max())


def _rest(world: World, method: Method, steps: int) -> str:
    """Takes steps, or as many as springs need to settle; how it fails, or nothing."""
    if isinstance(method, Spring):
        return _settle(world, method)
    for _ in range(steps):
        world.step(method)
    return "" if world.converged else "not converged"


def _settle(world: World, spring: Spring) -> str:
    """Until the springs bear the weight."""
    spring.gaps = np.zeros(0)
    lowest = world.places[:, 2].copy()
    for _ in range(round(SETTLE / H)):
        world.step(spring)
        if not np.abs(world.v).max() < FAST:
            return "unstable"
    return f"sinks {1e3 * float((lowest - world.places[:, 2]).max()):.2g} mm"


@for_each()
def light_under_heavy(solve: Method, ratios: tuple[float, ...] = (1.0, 1e2, 1e4, 1e6)) -> Iterator[Row]:
    """A cube under one that is up to a million times heavier, at rest."""
    base = 0.0
    for ratio in ratios:
        world = stack((1.0, ratio), (0.9, 0.9))
        begin = time.process_time()
        remark = _rest(world, solve, 20)
        cost = time.process_time() - begin
        base = base or cost
        how = remark or (f"{cost / base:.1f} times the cost of ratio 1" if ratio > 1.0 else "")
        yield f"cube under one {ratio:g} times heavier", "rest", _fast(world), 1e-9, "m/s", how


@for_each()
def dragged(solve: Method, ratios: tuple[float, ...] = (1e2, 1e4, 1e6)) -> Iterator[Row]:
    """Two slabs, the lower pulled by the mean of both frictions: both accelerate with (mu2 - mu1) g / 2."""
    mu, steps = (0.30, 0.35), 20
    expected = 0.5 * (mu[1] - mu[0]) * G * H * steps
    for ratio in ratios:
        world = stack((1.0, ratio), mu, (1.0, 1.0, 0.2))
        force = 0.5 * (mu[0] + mu[1]) * G * (1.0 + ratio)
        remark = _settle(world, solve) if isinstance(solve, Spring) else ""
        before = world.v[:, 0].copy()
        world.forces = np.array([[force, 0.0, 0.0], [0.0, 0.0, 0.0]])
        for _ in range(steps):
            world.step(solve)
            if not np.abs(world.v).max() < FAST:
                remark = "unstable"
                break
        off = float(np.abs((world.v[:, 0] - before) / expected - 1.0).max())
        title = f"dragged under a slab {ratio:g} times heavier"
        how = remark if world.converged else "not converged"
        yield title, "both at (mu2 - mu1) g t / 2", off, 1e-6, "relative", how


@for_each()
def slope(solve: Method) -> Iterator[Row]:
    """A cube on a slope of tan = 0.5 with mu = 0.7 rests."""
    a, side = np.arctan(0.5), 0.2
    normal = (-float(np.sin(a)), 0.0, float(np.cos(a)))
    along = np.array([np.cos(a), 0.0, np.sin(a)])
    feet = [-0.5 * side * np.array(normal) + x * along + np.array([0.0, y, 0.0]) for x, y in corners((side, side))]

    def contacts(world: World) -> list[Contact]:
        return [Contact(0, -1, world.places[0] + foot, normal, 0.7) for foot in feet]

    world = World(np.zeros((1, 3)), contacts, inertias=box_inertia(1.0, (side, side, side)))
    how = _rest(world, solve, 20)
    if isinstance(solve, Spring):
        how = f"creeps at {1e3 * abs(float(world.v[0, :3] @ along)):.2g} mm/s"
    yield "cube on a slope, tan 0.5 of mu 0.7", "rest", _fast(world), 1e-9, "m/s", how


@for_each()
def one_object(solve: Solver) -> Iterator[Row]:
    """A recorded problem, 25 contacts and W of rank 49 of 75: the velocity is unique, the impulses are not.

    The number is the larger of two: the law's violation at any contact, recomputed here, and the distance from the
    velocity of another method (proximal point) at a tighter tolerance. No finding where the problem is not at hand.
    """
    for problem in (p for p in recorded(problem_folder()) if p.name == "OneObject-i100000-316"):
        W, q, mu = problem.W, problem.q, problem.mu
        other = W @ solve_friction_contact(W, q, mu, 1e-13, solver="proximal").impulses.ravel() + q
        begin = time.process_time()
        impulses, converged, iterations = solve(W, q, mu, None)
        spent = 1e3 * (time.process_time() - begin)
        off = float(np.abs(W @ impulses.ravel() + q - other).max())
        number = max(off, residual(problem, impulses.ravel())[1])
        how = f"{'' if converged else 'not converged; '}{spent:.1f} ms, {iterations} iterations"
        yield "OneObject, 25 contacts, rank 49 of 75", "unique velocity", number, 1e-8, "m/s", how


@for_each(beside=CONVEX)
def driven_particle(solve: Solver) -> Iterator[Row]:
    """A particle that is pushed to 2 m/s stays on its plane; the convex law lets it float."""
    mu, push = 0.3, np.array([0.3 * G + 4.0, 0.0])  # m/s², along the plane: it reaches 2 m/s
    gap, v, highest = 0.0, np.zeros(3), 0.0
    for _ in range(500):
        q = v + H * np.array([-G, *push])
        q[0] += gap / H
        p, _, _ = solve(np.eye(3), q, np.array([mu]), None)
        v = q + p[0]
        v[0] -= gap / H
        gap += H * v[0]
        highest = max(highest, abs(gap))
    how = f"floats; h mu v is {H * mu * 2.0:.1g} m" if highest > 1e-9 else ""
    yield "particle driven along a plane", "gap 0", highest, 1e-9, "m", how


@for_each()
def off_axis_push(solve: Solver, angles: tuple[float, ...] = (0.0, 17.0, 45.0, 73.0)) -> Iterator[Row]:
    """SimBenchmark's rolling test: a box with 25 balls on it is pushed: 0.7385 m/s² and 2/7 of it any way."""
    side, radius, push = 20.0, 0.5, 150.0
    spots = [(4.0 * i - 8.0, 4.0 * j - 8.0) for i in range(5) for j in range(5)]
    # F = m_box a + 25 m_ball 2/7 a + mu (m_box + 25 m_ball) g
    a = (push - 0.4 * 35.0 * G) / (10.0 + 25.0 * 2.0 / 7.0)

    def contacts(world: World) -> list[Contact]:
        x, y, _ = world.places[0]
        feet = [Contact(0, -1, (x + cx, y + cy, 0.0), UP, 0.4) for cx, cy in corners((side, side))]
        return feet + [Contact(i, 0, (b[0], b[1], 1.0), UP, 0.8) for i, b in enumerate(world.places[1:], start=1)]

    worst, heading = 0.0, 0.0
    for degrees in angles:
        d = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
        world = World(
            np.array([(0.0, 0.0, 0.5)] + [(x, y, 1.0 + radius) for x, y in spots]),
            contacts,
            np.array([10.0] + 25 * [1.0]),
            np.array([box_inertia(10.0, (side, side, 1.0))] + 25 * [np.full(3, 0.4 * radius**2)]),
            h=1e-2,
            forces=np.outer([push] + 25 * [0.0], d),
        )
        for _ in range(5):
            world.step(solve)
        expected = a * 5e-2 * np.array([1.0] + 25 * [2.0 / 7.0])
        worst = max(worst, float(np.abs(world.v[:, :3] @ d / expected - 1.0).max()))
        sideways = world.v[0, :3] @ np.array([-d[1], d[0], 0.0])
        heading = max(heading, abs(float(np.arctan2(sideways, world.v[0, :3] @ d))))
    yield "off-axis push of 25 balls on a box", "a = 0.7385 and 0.2110 m/s²", worst, 1e-8, "relative"
    yield "off-axis push, direction", "along the force", heading, 1e-8, "rad"


@for_each()
def stacks(solve: Method) -> Iterator[Row]:
    """Towers at rest, their lowest contacts carrying the weight."""
    towers = {
        "stack of 5": [1.0] * 5,
        "stack of 10": [1.0] * 10,
        "stack of 20": [1.0] * 20,
        "stack of 5, top 1000 times heavier": [1.0] * 4 + [1000.0],
        "stack of 10, masses 2^i": [2.0**i for i in range(10)],
    }
    for title, masses in towers.items():
        if isinstance(solve, Spring) and len(masses) > 5:
            continue  # minutes, and it fails before
        world = stack(masses, [0.8] * len(masses))
        how = _rest(world, solve, 3)
        load = abs(float(world.impulses[:4, 0].sum()) / (sum(masses) * G * H) - 1.0)
        yield title, "rest", _fast(world), 1e-9, "m/s", how
        yield f"{title}, load", "weight", load, 1e-9, "relative"


def _ball(height: float, radius: float, **options: float) -> World:
    """A ball that may bounce on the ground: the contact is there where it would close within half a step."""

    def contacts(world: World) -> list[Contact]:
        x, y, z = world.places[0]
        closes = z - radius + 0.5 * world.h * world.v[0, 2] <= 0.0
        return [Contact(0, -1, (x, y, z - radius), UP, 0.0)] if closes else []

    return World(np.array([[0.0, 0.0, height]]), contacts, **options)


@for_each()
def elastic_bounce(solve: Solver) -> Iterator[Row]:
    """A ball with e = 1 keeps its energy at any step."""
    worst = 0.0
    for h in (1e-4, 1e-3, 1e-2, 5e-2):
        world = _ball(5.0, 0.1, masses=10.0, inertias=0.04, h=h, restitution=1.0)
        start = 10.0 * G * 5.0
        for _ in range(round(4.0 / h)):
            world.step(solve)
        energy = 5.0 * float(world.v[0, 2] ** 2) + 10.0 * G * float(world.places[0, 2])
        worst = max(worst, (energy - start) ** 2)
    yield "elastic bounce, steps of 0.1 to 50 ms", "energy constant", worst, 1e-12, "J²"


@for_each()
def zeno_ball(solve: Solver) -> Iterator[Row]:
    """A ball with e = 0.9 from 1 m rests after sqrt(2h/g) (1 + e)/(1 - e) = 8.578949 s."""
    world = _ball(1.0, 0.0, restitution=0.9)
    moved, at_rest = 0.0, 0.0
    for k in range(9500):
        world.step(solve)
        if abs(world.v[0, 2]) > 1e-12:
            at_rest = (k + 1) * H
        if (k + 1) * H > 9.0:
            moved = max(moved, abs(float(world.v[0, 2])))
    yield "Zeno ball, e = 0.9", "at rest after 8.5789 s", moved, 1e-12, "m/s", f"at rest from {at_rest:.3f} s"


def _cradle(n: int, e: float, apart: float) -> World:
    """Balls of diameter 1 m in a row, so far apart, without gravity; the first one moves at 1 m/s."""

    def contacts(world: World) -> list[Contact]:
        x, rates = world.places[:, 0], world.v[:, 0]
        closes = np.diff(x) - 1.0 + 0.5 * world.h * np.diff(rates) <= 0.0
        return [Contact(i + 1, i, (x[i] + 0.5, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0) for i in np.flatnonzero(closes)]

    world = World(apart * np.outer(np.arange(n), [1.0, 0.0, 0.0]), contacts, restitution=e, gravity=0.0)
    world.v[0, 0] = 1.0
    return world


@for_each()
def cradle(solve: Solver) -> Iterator[Row]:
    """Newton's cradle, all touching: Moreau and Newton's law; with gaps: the last ball leaves."""
    cases = [(3, 1.0, (-1 / 3, 2 / 3, 2 / 3)), (3, 0.5, (0.0, 0.5, 0.5)), (5, 1.0, (-0.6, 0.4, 0.4, 0.4, 0.4))]
    for n, e, expected in cases:
        world = _cradle(n, e, 1.0)
        world.step(solve)
        off = float(np.abs(world.v[:, 0] - np.array(expected)).max())
        yield f"cradle of {n} touching, e = {e:g}", "Moreau and Newton's law", off, 1e-10, "m/s"
    world = _cradle(3, 1.0, 1.05)
    for _ in range(300):
        world.step(solve)
    off = float(np.abs(world.v[:, 0] - np.array([0.0, 0.0, 1.0])).max())
    yield "cradle of 3 with gaps, e = 1", "the last ball leaves", off, 1e-10, "m/s"


@for_each()
def _painleve(solve: Solver) -> Iterator[Row]:
    angle, mu, half = np.radians(60.0), 2.0, 1.0
    J = half**2 / 3.0  # per kg
    r = half * np.array([np.cos(angle), np.sin(angle)])  # from the tip to the centre
    W = np.array([[1.0 + r[0] ** 2 / J, -r[0] * r[1] / J], [-r[0] * r[1] / J, 1.0 + r[1] ** 2 / J]])
    # the tip slides towards the centre's side: the direction in which W_NN - mu W_NT < 0
    steps = (1e-2, 1e-4, 1e-6, 1e-8)
    impulses = [float(solve(W, np.array([-h * G, -1.0]), np.array([mu]), None)[0][0, 0]) for h in steps]
    spread = abs(impulses[1] / impulses[3] - 1.0) if impulses[3] else np.inf
    sticking = -np.linalg.solve(W, np.array([0.0, -1.0]))
    off = max(spread, abs(impulses[3] / float(sticking[0]) - 1.0))
    how = f"impulse {impulses[3]:.4f} N s a kg"
    yield "Painlevé's rod, mu 2, 60 degrees", "impulse finite, of any step", off, 1e-2, "relative", how


def painleve(_solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """Painlevé's rod, mu = 2 at 60 degrees: the impulse is finite and does not depend on the step."""
    return _painleve(PLANAR)


@for_each(beside=CONVEX)
def wedge(solve: Method) -> Iterator[Row]:
    """A cube in a steep groove (walls leaning by 20 degrees), mu 0.2 and 0.9: it stays."""
    a = np.radians(20.0)
    walls = [
        (np.array([x, side * 0.1, z]), (0.0, -side * np.cos(a), np.sin(a)))
        for side in (-1, 1)
        for x, z in corners((0.2, 0.2))
    ]
    for mu in (0.2, 0.9):

        def contacts(world: World, mu: float = mu) -> list[Contact]:
            return [Contact(0, -1, world.places[0] + place, normal, mu) for place, normal in walls]

        world = World(np.zeros((1, 3)), contacts, inertias=0.01)
        how = _rest(world, solve, 20)
        yield f"cube in a groove, mu {mu:g}", "rest", _fast(world), 1e-10, "m/s", how


@for_each()
def many_legs(solve: Method) -> Iterator[Row]:
    """A table on 100 legs: W of rank 6 of 300."""
    feet = np.random.default_rng(1).uniform(-1.0, 1.0, (100, 2))
    world = World(
        np.array([[0.0, 0.0, 1.0]]),
        lambda _: [Contact(0, -1, (x, y, 0.0), UP, 0.5) for x, y in feet],
        50.0,
        box_inertia(50.0, (2.0, 2.0, 0.1)),
    )
    begin = time.process_time()
    how = _rest(world, solve, 1)
    how = how or f"{(time.process_time() - begin) * 1e3:.0f} ms, {world.iterations} iterations"
    yield "table on 100 legs", "rest", _fast(world), 1e-10, "m/s", how


@for_each()
def billiard(solve: Solver) -> Iterator[Row]:
    """A ball strikes a rack of 15 along its axis: the answer is its own mirror image."""
    rack = [(0.5 * np.sqrt(3.0) * row, column - 0.5 * row, 0.0) for row in range(5) for column in range(row + 1)]
    places = np.array([(-1.0, 0.0, 0.0), *rack])
    pairs = [(i, j) for i in range(16) for j in range(i + 1, 16) if np.linalg.norm(places[i] - places[j]) < 1.0001]
    mirror = [int(np.argmin(np.linalg.norm(places - p * np.array([1.0, -1.0, 1.0]), axis=1))) for p in places]
    for mu in (0.0, 0.3):

        def contacts(_: World, mu: float = mu) -> list[Contact]:
            return [Contact(j, i, 0.5 * (places[i] + places[j]), places[j] - places[i], mu) for i, j in pairs]

        world = World(places, contacts, inertias=0.1, restitution=0.8, gravity=0.0)
        world.v[0, 0] = 1.0
        world.step(solve)
        off = float(np.abs(world.v - world.v[mirror] * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])).max())
        how = "" if world.converged else "not converged"
        yield f"billiard, mu {mu:g}", "mirror symmetry", off, 1e-11, "m/s", how


#: The scenes in the order of the table.
SCENES = (
    light_under_heavy,
    dragged,
    one_object,
    slope,
    driven_particle,
    off_axis_push,
    stacks,
    elastic_bounce,
    painleve,
    zeno_ball,
    cradle,
    billiard,
    wedge,
    many_legs,
)
#: Those on which Gauss-Seidel may only need more sweeps.
SLOW = (light_under_heavy, dragged, one_object, stacks)
#: Those of contacts that stay, which springs can be given too.
PERSISTENT = (light_under_heavy, dragged, slope, stacks, wedge, many_legs)
