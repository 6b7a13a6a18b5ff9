"""Scenes of a few free bodies: what they test is the law and the solver, not the rover."""

import time
from collections.abc import Iterator, Mapping

import numpy as np

from comparison.failure.finding import Finding
from comparison.failure.rigid_bodies import (
    Contact,
    G,
    Solver,
    Spring,
    World,
    box_inertia,
    corners,
    ours,
    relaxed,
    stack,
)
from comparison.problems import problem_folder, recorded, residual
from rover_gym import solve_friction_contact

H = 1e-3  # s
SOLVERS: dict[str, Solver] = {f"solver {name}": ours(name) for name in ("auto", "nsgs", "newton")}
#: Gauss-Seidel that is given a hundred times the sweeps.
PATIENT: dict[str, Solver] = {"solver nsgs, 1e5 sweeps": ours("nsgs", max_iterations=100_000)}
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


def light_under_heavy(
    solvers: Mapping[str, Method], ratios: tuple[float, ...] = (1.0, 1e2, 1e4, 1e6)
) -> Iterator[Finding]:
    """A cube under one that is up to a million times heavier, at rest."""
    for name, solve in solvers.items():
        base = 0.0
        for ratio in ratios:
            world = stack((1.0, ratio), H, (0.9, 0.9))
            begin = time.process_time()
            remark = _rest(world, solve, 20)
            cost = time.process_time() - begin
            base = base or cost
            yield Finding(
                f"cube under one {ratio:g} times heavier",
                "rest",
                name,
                _fast(world),
                1e-9,
                "m/s",
                remark or (f"{cost / base:.1f} times the cost of ratio 1" if ratio > 1.0 else ""),
            )


def dragged(solvers: Mapping[str, Method], ratios: tuple[float, ...] = (1e2, 1e4, 1e6)) -> Iterator[Finding]:
    """Two slabs, the lower pulled by the mean of both frictions: both accelerate with (mu2 - mu1) g / 2."""
    mu, steps = (0.30, 0.35), 20
    expected = 0.5 * (mu[1] - mu[0]) * G * H * steps
    for name, solve in solvers.items():
        for ratio in ratios:
            world = stack((1.0, ratio), H, mu, (1.0, 1.0, 0.2))
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
            yield Finding(
                f"dragged under a slab {ratio:g} times heavier",
                "both at (mu2 - mu1) g t / 2",
                name,
                off,
                1e-6,
                "relative",
                remark if world.converged else "not converged",
            )


def slope(solvers: Mapping[str, Method]) -> Iterator[Finding]:
    """A cube on a slope of tan = 0.5 with mu = 0.7 rests."""
    a, side = np.arctan(0.5), 0.2
    normal = (-float(np.sin(a)), 0.0, float(np.cos(a)))
    along = np.array([np.cos(a), 0.0, np.sin(a)])
    feet = [
        -0.5 * side * np.array(normal) + x * along + np.array([0.0, y, 0.0])
        for x in (-0.5 * side, 0.5 * side)
        for y in (-0.5 * side, 0.5 * side)
    ]
    for name, solve in solvers.items():
        world = World(
            np.ones(1),
            np.array([box_inertia(1.0, (side, side, side))]),
            np.zeros((1, 3)),
            lambda w: [Contact(0, -1, w.places[0] + foot, normal, 0.7) for foot in feet],
            H,
        )
        how = _rest(world, solve, 20)
        if isinstance(solve, Spring):
            how = f"creeps at {1e3 * abs(float(world.v[0, :3] @ along)):.2g} mm/s"
        yield Finding("cube on a slope, tan 0.5 of mu 0.7", "rest", name, _fast(world), 1e-9, "m/s", how)


def one_object(solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """A recorded problem, 25 contacts and W of rank 49 of 75: the velocity is unique, the impulses are not.

    The number is the larger of two: the law's violation at any contact, recomputed here, and the distance from the
    velocity of another method (proximal point) at a tighter tolerance. No finding where the problem is not at hand.
    """
    name_of_problem = "OneObject-i100000-316"
    for problem in (p for p in recorded(problem_folder()) if p.name == name_of_problem):
        W, q, mu = problem.W, problem.q, problem.mu
        other = W @ solve_friction_contact(W, q, mu, 1e-13, solver="proximal").impulses.ravel() + q
        for name, solve in solvers.items():
            begin = time.process_time()
            impulses, converged, iterations = solve(W, q, mu, None)
            spent = 1e3 * (time.process_time() - begin)
            off = float(np.abs(W @ impulses.ravel() + q - other).max())
            number = max(off, residual(problem, impulses.ravel())[1])
            remark = f"{spent:.1f} ms, {iterations} iterations"
            how = remark if converged else f"not converged; {remark}"
            yield Finding("OneObject, 25 contacts, rank 49 of 75", "unique velocity", name, number, 1e-8, "m/s", how)


def driven_particle(solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """A particle that is pushed to 2 m/s stays on its plane; the convex law lets it float."""
    mu, push = 0.3, np.array([0.3 * G + 4.0, 0.0])  # m/s², along the plane: it reaches 2 m/s
    for name, solve in {**solvers, "convex law": relaxed}.items():
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
        yield Finding("particle driven along a plane", "gap 0", name, highest, 1e-9, "m", how)


def off_axis_push(solvers: dict[str, Solver], angles: tuple[float, ...] = (0.0, 17.0, 45.0, 73.0)) -> Iterator[Finding]:
    """SimBenchmark's rolling test: a box with 25 balls on it is pushed: 0.7385 m/s² and 2/7 of it any way."""
    side, radius, push = 20.0, 0.5, 150.0
    spots = [(4.0 * i - 8.0, 4.0 * j - 8.0) for i in range(5) for j in range(5)]
    # F = m_box a + 25 m_ball 2/7 a + mu (m_box + 25 m_ball) g
    a = (push - 0.4 * 35.0 * G) / (10.0 + 25.0 * 2.0 / 7.0)
    for name, solve in solvers.items():
        worst, heading = 0.0, 0.0
        for degrees in angles:
            d = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])

            def contacts(world: World) -> list[Contact]:
                x, y, _ = world.places[0]
                found = [
                    Contact(0, -1, (x + cx, y + cy, 0.0), (0.0, 0.0, 1.0), 0.4) for cx, cy in corners((side, side))
                ]
                balls = world.places[1:]
                return found + [
                    Contact(i, 0, (b[0], b[1], 1.0), (0.0, 0.0, 1.0), 0.8) for i, b in enumerate(balls, start=1)
                ]

            world = World(
                np.array([10.0] + 25 * [1.0]),
                np.array([box_inertia(10.0, (side, side, 1.0))] + 25 * [np.full(3, 0.4 * radius**2)]),
                np.array([(0.0, 0.0, 0.5)] + [(x, y, 1.0 + radius) for x, y in spots]),
                contacts,
                1e-2,
            )
            world.forces = np.zeros((26, 3))
            world.forces[0] = push * d
            for _ in range(5):
                world.step(solve)
            expected = a * 5e-2
            worst = max(
                worst,
                abs(float(world.v[0][:3] @ d) / expected - 1.0),
                float(np.abs(world.v[1:, :3] @ d / (expected * 2.0 / 7.0) - 1.0).max()),
            )
            sideways = world.v[0, :3] @ np.array([-d[1], d[0], 0.0])
            heading = max(heading, abs(float(np.arctan2(sideways, world.v[0, :3] @ d))))
        yield Finding("off-axis push of 25 balls on a box", "a = 0.7385 and 0.2110 m/s²", name, worst, 1e-8, "relative")
        yield Finding("off-axis push, direction", "along the force", name, heading, 1e-8, "rad")


def stacks(solvers: Mapping[str, Method]) -> Iterator[Finding]:
    """Towers at rest, their lowest contacts carrying the weight."""
    towers = {
        "stack of 5": [1.0] * 5,
        "stack of 10": [1.0] * 10,
        "stack of 20": [1.0] * 20,
        "stack of 5, top 1000 times heavier": [1.0] * 4 + [1000.0],
        "stack of 10, masses 2^i": [2.0**i for i in range(10)],
    }
    for name, solve in solvers.items():
        for title, masses in towers.items():
            if isinstance(solve, Spring) and len(masses) > 5:
                continue  # minutes, and it fails before
            world = stack(masses, H, [0.8] * len(masses))
            how = _rest(world, solve, 3)
            weight = sum(masses) * G * H
            load = abs(float(world.impulses[:4, 0].sum()) / weight - 1.0)
            yield Finding(title, "rest", name, _fast(world), 1e-9, "m/s", how)
            yield Finding(f"{title}, load", "weight", name, load, 1e-9, "relative")


def elastic_bounce(solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """A ball with e = 1 keeps its energy at any step."""
    for name, solve in solvers.items():
        worst = 0.0
        for h in (1e-4, 1e-3, 1e-2, 5e-2):
            world = World(
                np.full(1, 10.0),
                np.full((1, 3), 0.04),
                np.array([[0.0, 0.0, 5.0]]),
                lambda w: (
                    [Contact(0, -1, (0.0, 0.0, w.places[0, 2] - 0.1), (0.0, 0.0, 1.0), 0.0)]
                    if w.places[0, 2] - 0.1 + 0.5 * w.h * w.v[0, 2] <= 0.0
                    else []
                ),
                h,
                restitution=1.0,
            )
            start = 10.0 * G * 5.0
            for _ in range(round(4.0 / h)):
                world.step(solve)
            energy = 5.0 * float(world.v[0, 2] ** 2) + 10.0 * G * float(world.places[0, 2])
            worst = max(worst, (energy - start) ** 2)
        yield Finding("elastic bounce, steps of 0.1 to 50 ms", "energy constant", name, worst, 1e-12, "J²")


def zeno_ball(solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """A ball with e = 0.9 from 1 m rests after sqrt(2h/g) (1 + e)/(1 - e) = 8.578949 s."""
    for name, solve in solvers.items():
        world = World(
            np.ones(1),
            np.ones((1, 3)),
            np.array([[0.0, 0.0, 1.0]]),
            lambda w: (
                [Contact(0, -1, w.places[0], (0.0, 0.0, 1.0), 0.0)]
                if w.places[0, 2] + 0.5 * w.h * w.v[0, 2] <= 0.0
                else []
            ),
            H,
            restitution=0.9,
        )
        moved, at_rest = 0.0, 0.0
        for k in range(9500):
            world.step(solve)
            if abs(world.v[0, 2]) > 1e-12:
                at_rest = (k + 1) * H
            if (k + 1) * H > 9.0:
                moved = max(moved, abs(float(world.v[0, 2])))
        yield Finding(
            "Zeno ball, e = 0.9", "at rest after 8.5789 s", name, moved, 1e-12, "m/s", f"at rest from {at_rest:.3f} s"
        )


def cradle(solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """Newton's cradle, all touching: Moreau and Newton's law; with gaps: the last ball leaves."""
    cases = [(3, 1.0, (-1 / 3, 2 / 3, 2 / 3)), (3, 0.5, (0.0, 0.5, 0.5)), (5, 1.0, (-0.6, 0.4, 0.4, 0.4, 0.4))]
    for name, solve in solvers.items():
        for n, e, expected in cases:
            v = np.zeros((n, 6))
            v[0, 0] = 1.0
            world = World(
                np.ones(n),
                np.ones((n, 3)),
                np.array([(float(i), 0.0, 0.0) for i in range(n)]),
                lambda w: [
                    Contact(i + 1, i, w.places[i] + np.array([0.5, 0.0, 0.0]), (1.0, 0.0, 0.0), 0.0)
                    for i in range(len(w.masses) - 1)
                ],
                H,
                restitution=e,
                gravity=0.0,
                v=v,
            )
            world.step(solve)
            off = float(np.abs(world.v[:, 0] - np.array(expected)).max())
            yield Finding(f"cradle of {n} touching, e = {e:g}", "Moreau and Newton's law", name, off, 1e-10, "m/s")
        v = np.zeros((3, 6))
        v[0, 0] = 1.0
        world = World(
            np.ones(3),
            np.ones((3, 3)),
            np.array([(1.05 * i, 0.0, 0.0) for i in range(3)]),
            lambda w: [
                Contact(i + 1, i, w.places[i] + np.array([0.5, 0.0, 0.0]), (1.0, 0.0, 0.0), 0.0)
                for i in range(2)
                if w.places[i + 1, 0] - w.places[i, 0] - 1.0 + 0.5 * w.h * (w.v[i + 1, 0] - w.v[i, 0]) <= 0.0
            ],
            H,
            restitution=1.0,
            gravity=0.0,
            v=v,
        )
        for _ in range(300):
            world.step(solve)
        off = float(np.abs(world.v[:, 0] - np.array([0.0, 0.0, 1.0])).max())
        yield Finding("cradle of 3 with gaps, e = 1", "the last ball leaves", name, off, 1e-10, "m/s")


def painleve(solvers: Mapping[str, Solver]) -> Iterator[Finding]:  # noqa: ARG001 - dimension 2 solvers are made here
    """Painlevé's rod, mu = 2 at 60 degrees: the impulse is finite and does not depend on the step."""
    angle, mu, half = np.radians(60.0), 2.0, 1.0
    J = half**2 / 3.0  # per kg
    r = half * np.array([np.cos(angle), np.sin(angle)])  # from the tip to the centre
    W = np.array([[1.0 + r[0] ** 2 / J, -r[0] * r[1] / J], [-r[0] * r[1] / J, 1.0 + r[1] ** 2 / J]])
    for name in ("auto", "nsgs", "newton"):
        impulses = []
        for h in (1e-2, 1e-4, 1e-6, 1e-8):
            # the tip slides towards the centre's side: the direction in which W_NN - mu W_NT < 0
            q = np.array([-h * G, -1.0])
            answer = solve_friction_contact(W, q, np.array([mu]), 1e-10, dimension=2, solver=name)  # type: ignore[arg-type]
            impulses.append(float(answer.impulses[0, 0]))
        spread = abs(impulses[1] / impulses[3] - 1.0) if impulses[3] else np.inf
        sticking = -np.linalg.solve(W, np.array([0.0, -1.0]))
        off = max(spread, abs(impulses[3] / float(sticking[0]) - 1.0))
        yield Finding(
            "Painlevé's rod, mu 2, 60 degrees",
            "impulse finite, of any step",
            f"solver {name}",
            off,
            1e-2,
            "relative",
            f"impulse {impulses[3]:.4f} N s a kg",
        )


def wedge(solvers: Mapping[str, Method]) -> Iterator[Finding]:
    """A cube in a steep groove (walls leaning by 20 degrees), mu 0.2 and 0.9: it stays."""
    a = np.radians(20.0)
    methods: dict[str, Method] = {**solvers, "convex law": relaxed}
    for name, solve in methods.items():
        for mu in (0.2, 0.9):

            def contacts(world: World, mu: float = mu) -> list[Contact]:
                return [
                    Contact(
                        0, -1, world.places[0] + np.array([x, side * 0.1, z]), (0.0, -side * np.cos(a), np.sin(a)), mu
                    )
                    for side in (-1, 1)
                    for x in (-0.1, 0.1)
                    for z in (-0.1, 0.1)
                ]

            world = World(np.ones(1), np.full((1, 3), 0.01), np.zeros((1, 3)), contacts, H)
            how = _rest(world, solve, 20)
            yield Finding(
                f"cube in a groove, mu {mu:g}",
                "rest",
                name,
                _fast(world),
                1e-10,
                "m/s",
                how,
            )


def many_legs(solvers: Mapping[str, Method]) -> Iterator[Finding]:
    """A table on 100 legs: W of rank 6 of 300."""
    rng = np.random.default_rng(1)
    feet = rng.uniform(-1.0, 1.0, (100, 2))
    for name, solve in solvers.items():
        world = World(
            np.full(1, 50.0),
            np.array([box_inertia(50.0, (2.0, 2.0, 0.1))]),
            np.array([[0.0, 0.0, 1.0]]),
            lambda _: [Contact(0, -1, (x, y, 0.0), (0.0, 0.0, 1.0), 0.5) for x, y in feet],
            H,
        )
        begin = time.process_time()
        how = _rest(world, solve, 1)
        remark = how if how else f"{(time.process_time() - begin) * 1e3:.0f} ms, {world.iterations} iterations"
        yield Finding(
            "table on 100 legs",
            "rest",
            name,
            _fast(world),
            1e-10,
            "m/s",
            remark,
        )


def billiard(solvers: Mapping[str, Solver]) -> Iterator[Finding]:
    """A ball strikes a rack of 15 along its axis: the answer is its own mirror image."""
    d = 1.0
    rack = [(0.5 * np.sqrt(3.0) * row * d, (column - 0.5 * row) * d) for row in range(5) for column in range(row + 1)]
    places = np.array([(-d, 0.0, 0.0)] + [(x, y, 0.0) for x, y in rack])
    pairs = [(i, j) for i in range(16) for j in range(i + 1, 16) if np.linalg.norm(places[i] - places[j]) < 1.0001 * d]
    mirror = [int(np.argmin(np.linalg.norm(places - p * np.array([1.0, -1.0, 1.0]), axis=1))) for p in places]
    for name, solve in solvers.items():
        for mu in (0.0, 0.3):
            v = np.zeros((16, 6))
            v[0, 0] = 1.0
            world = World(
                np.ones(16),
                np.full((16, 3), 0.1),
                places.copy(),
                lambda _, mu=mu: [
                    Contact(j, i, 0.5 * (places[i] + places[j]), places[j] - places[i], mu) for i, j in pairs
                ],
                H,
                restitution=0.8,
                gravity=0.0,
                v=v,
            )
            world.step(solve)
            image = world.v[mirror] * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
            yield Finding(
                f"billiard, mu {mu:g}",
                "mirror symmetry",
                name,
                float(np.abs(world.v - image).max()),
                1e-11,
                "m/s",
                "" if world.converged else "not converged",
            )


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
