"""Scenes of the rover, for this project's variants and solvers."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.failure.finding import Row, for_each
from rover_gym import Plane, RoverGymError, RoverModel, Simulation, SphereField

G = 9.81  # m/s²
#: Weight on a front and on a side wheel at rest, N: half of the trunk's share and of an axle's or bogie's group.
FRONT, SIDE = G * (600.0 * 40.0 / 102.0 + 120.0) / 2.0, G * (600.0 * 62.0 / 204.0 + 120.0) / 2.0

Options = dict[str, Any]
METHODS: dict[str, Options] = {
    "linearised": {},
    "newton variant": {"variant": "newton"},
    "linearised, solver nsgs": {"solver": "nsgs"},
    "linearised, solver newton": {"solver": "newton"},
}
VARIANTS = dict(list(METHODS.items())[:2])


def start(
    description: dict[str, Any] | None = None,
    *,
    q: dict[int, float] | None = None,
    v: dict[int, float] | None = None,
    terrain: Plane | SphereField | None = None,
    **options: Any,
) -> Simulation:
    """The built-in rover, or a description of one, standing on flat ground unless told otherwise.

    Its wheels give their torque at any speed, as those of the engines beside it.
    """
    model = RoverModel() if description is None else RoverModel.from_dict(description)
    model = model.replace(wheel_stiffness=0.0, motor=None)  # the expected answers are those of rigid wheels
    place, velocity = np.zeros(model.nq), np.zeros(model.nv)
    place[1] = 0.35
    for index, value in (q or {}).items():
        place[index] = value
    for index, value in (v or {}).items():
        velocity[index] = value
    simulation = Simulation(model, terrain or Plane(), **options)
    simulation.set_state(place, velocity)
    return simulation


def fastest(simulation: Simulation) -> float:
    """Largest entry of the velocity, m/s or rad/s."""
    return float(np.abs(simulation.v).max())


@for_each(METHODS)
def loads(options: Options) -> Iterator[Row]:
    """Standing straight: W has rank 14 of 18."""
    simulation = start(**options)
    simulation.brake()
    simulation.step(200)
    expected = np.array([FRONT] * 2 + [SIDE] * 4)
    off = float(np.abs(simulation.wheel_forces[:, 0] / expected - 1.0).max())
    how = "" if off < 1e-6 else "another balance: W has rank 14 of 18, and braked wheels can squeeze each other"
    yield "standing on the flat, wheel loads", "1742.718 and 1483.041 N", off, 1e-6, "relative", how
    yield "standing on the flat, drift", "rest", fastest(simulation), 1e-12, "m/s"


@for_each(METHODS)
def straight(options: Options) -> Iterator[Row]:
    """Driving straight on the flat: nothing pushes it sideways."""
    simulation = start(**options)
    simulation.set_wheel_torques(np.full(6, 20.0))
    report = simulation.step(1000)
    how = "" if report.is_converged else "not converged in some step"
    yield "driving straight, sideways speed", "0", float(abs(simulation.v[2])), 1e-12, "m/s", how


@for_each(VARIANTS)
def incline(options: Options) -> Iterator[Row]:
    """At 0.999 and 1.001 of the friction angle's tangent."""
    for ratio in (0.999, 1.001):
        slope = math.atan(0.7 * ratio)
        simulation = start(
            q={0: -0.35 * math.sin(slope), 1: 0.35 * math.cos(slope), 5: slope},
            terrain=Plane((-math.sin(slope), math.cos(slope), 0.0)),
            **options,
        )
        simulation.brake()
        # a slide near the friction angle dies slowly: 0.001 mu g cos is 6 mm/s²
        simulation.step(4000 if ratio < 1.0 else 400)
        before, v0 = simulation.q[:3], simulation.v[:3]
        if ratio < 1.0:
            simulation.step(10_000)
            creep = float(np.linalg.norm(simulation.q[:3] - before)) / 50.0
            yield "incline at 0.999 mu, braked", "sticks", creep, 1e-12, "m/s", "creep over 10000 steps"
        else:
            simulation.step(2000)
            a = G * (math.sin(slope) - 0.7 * math.cos(slope))
            off = abs(float(np.linalg.norm(simulation.v[:3] - v0)) / 10.0 / a - 1.0)
            yield "incline at 1.001 mu, braked", "slides with g (sin - mu cos)", off, 1e-6, "relative"


@for_each(VARIANTS)
def heading(options: Options) -> Iterator[Row]:
    """Turning on the spot's circle through 90 degrees."""
    simulation = start(**options)
    simulation.set_steering([-0.4, -0.4, 0.0, 0.4, 0.0, 0.4])
    simulation.set_wheel_torques(np.full(6, 8.0))
    simulation.step(200)
    jump, last = 0.0, simulation.v[4]
    condition = 1.0
    while abs(simulation.q[4]) < math.pi * 0.75 and simulation.time <= 60.0:
        simulation.set_wheel_torques(np.full(6, 0.0 if abs(simulation.v[4]) > 0.6 else 8.0))
        simulation.step(2)
        jump, last = max(jump, abs(simulation.v[4] - last)), simulation.v[4]
        eigenvalues = np.linalg.eigvalsh(simulation.model.mass_matrix(simulation.q, "state"))
        condition = max(condition, float(eigenvalues[-1] / eigenvalues[0]))
    how = f"condition of M at most {condition:.0f}"
    yield "heading through 90 degrees", "no spike in the turn rate (10 ms)", jump, 0.1, "rad/s", how


@for_each({"the report's Cardan coordinates": "report"})
def heading_of_the_report(coordinates: Any) -> Iterator[Row]:
    """The report's coordinates are singular at a heading of 90 degrees."""
    model = RoverModel()
    q, v = np.zeros(21), np.zeros(21)
    q[1], v[4], v[3] = 0.35, 0.5, 0.1  # turning, and rolling a little as on any ground
    largest = 0.0
    for angle in np.radians([89.0, 89.9, 89.99, 89.999]):
        q[4] = angle
        largest = max(largest, float(np.abs(model.to_report(q, v)[1]).max()))
    eigenvalues = np.linalg.eigvalsh(model.mass_matrix(q, coordinates))
    try:
        q[4] = math.pi / 2.0
        rates = np.abs(model.to_report(q, v)[1]).max()
        how = f"at 90 degrees the rates are {rates:.1e} rad/s"
    except RoverGymError as error:
        how = f"at 90 degrees: {error}"
    how = f"largest coordinate rate at 89.999 degrees; condition of M {eigenvalues[-1] / eigenvalues[0]:.0e}; {how}"
    yield "heading through 90 degrees", "finite rates", largest, 1.0, "rad/s", how


@for_each(VARIANTS)
def wedged(options: Options) -> Iterator[Row]:
    """Each wheel between two stones of its own radius; then lying on its back; then on its side."""
    model = RoverModel()
    poses = model.poses(np.zeros(21), "state")
    places = np.array([poses[w][0] for w in model.solid_names if w.startswith("wheel")])
    centres = np.concatenate([places + np.array([dx, -0.12, 0.0]) for dx in (-0.16, 0.16)])
    simulation = start(q={1: 0.02}, terrain=SphereField(centres, np.full(len(centres), 0.1)), **options)
    simulation.brake()
    simulation.step(2000)
    how = f"{len(simulation.contacts)} contacts"
    yield "wheels wedged between two spheres", "rest", fastest(simulation), 1e-9, "m/s", how
    for title, pose in (
        ("on its back", {1: 0.5, 3: math.pi}),
        ("on its side, wheels flat on the ground", {1: 0.75, 3: math.pi / 2}),
    ):
        simulation = start(q=pose, **options)
        simulation.brake()
        simulation.step(3000)
        trunk = float(np.abs(simulation.v[:6]).max())  # bogies in the air swing on: their joints have no friction
        yield title, "rest of the trunk", trunk, 1e-9, "m/s", f"{len(simulation.contacts)} contacts"


#: Titles of rovers with odd masses: the parts that have them, by the beginning of their names, and the factor.
ODD_MASSES = {"trunk 100 times heavier": ("trunk", 100.0), "wheels 1000 times lighter": ("wheel", 1e-3)}


def with_odd_masses(description: dict[str, Any], part: str, factor: float) -> dict[str, Any]:
    """A description in which the solids of a part are heavier by a factor."""
    for solid in description["solids"]:
        solid["mass"] *= factor if solid["name"].startswith(part) else 1.0
    return description


@for_each(METHODS)
def masses(options: Options) -> Iterator[Row]:
    """Trunk a hundred times heavier, wheels a thousand times lighter, dropped from 5 cm."""
    for title, odd in ODD_MASSES.items():
        simulation = start(with_odd_masses(RoverModel().to_dict(), *odd), q={1: 0.40}, **options)
        simulation.brake()
        before = simulation.energy().total
        gain, deepest = 0.0, 0.0
        for _ in range(600):
            simulation.step()
            gain = max(gain, simulation.energy().total / before - 1.0)
            deepest = min(deepest, float(simulation.wheel_gaps.min()))
        off = max(fastest(simulation), abs(float(simulation.q[1]) - 0.35), gain)
        how = f"deepest {-deepest * 1e3:.2g} mm in landing"
        yield title, "rest at 0.35 m, no energy gained", off, 1e-6, "m/s, m, relative", how


@for_each(VARIANTS)
def wheel_spin(options: Options) -> Iterator[Row]:
    """260 N m on every wheel: all slip, and Coulomb gives v = mu g t whatever the loads."""
    simulation = start(RoverModel().replace(wheel_torque_limit=1e3).to_dict(), **options)
    simulation.set_wheel_torques(np.full(6, 260.0))
    simulation.step(460)
    off = abs(float(simulation.v[0]) / (0.7 * G * simulation.time) - 1.0)
    how = f"{simulation.v[0]:.2f} m/s"
    yield "wheels spinning at 260 N m for 2.3 s", "15.8 m/s: mu g t", off, 1e-2, "relative", how


@for_each(VARIANTS)
def drop(options: Options) -> Iterator[Row]:
    """From 2 m, at 5 ms: deepest penetration, and what is left of it when it stands."""
    for title, extra in (("", {}), (", step 1 ms", {"time_step": 1e-3})):
        simulation = start(q={1: 2.35}, **options, **extra)
        simulation.brake()
        deepest = 0.0
        for _ in range(round(3.0 / simulation.time_step)):
            simulation.step()
            deepest = min(deepest, float(simulation.wheel_gaps.min()))
        left = abs(float(simulation.q[1]) - 0.35)
        how = f"{-deepest * 1e3:.2g} mm deep in the step of the impact"
        yield f"dropped from 2 m{title}", "stands at 0.35 m", left, 1e-6, "m", how


@for_each(VARIANTS)
def mirror(options: Options) -> Iterator[Row]:
    """Driving over rocks that are their own mirror image: so is the motion."""
    rng = np.random.default_rng(4)
    x, z, r = rng.uniform(0.8, 4.0, 12), rng.uniform(0.3, 0.9, 12), rng.uniform(0.03, 0.08, 12)
    centres = np.concatenate([np.column_stack([x, 0.0 * x, s * z]) for s in (-1.0, 1.0)])
    description = RoverModel().replace(contact_radius=0.20).to_dict()
    simulation = start(description, q={1: 0.45}, terrain=SphereField(centres, np.tile(r, 2), Plane()), **options)
    simulation.set_wheel_torques(np.full(6, 40.0))
    simulation.step(400)
    off = float(np.abs(simulation.q[[2, 3, 4]]).max())
    how = f"{simulation.q[0]:.2f} m driven"
    yield "symmetric rover on symmetric rocks, 2 s", "no drift, roll or heading", off, 1e-9, "m, rad", how


def scaled(L: float) -> dict[str, Any]:
    """The rover with lengths times L and masses times L³; gains and torques scale so that times do with sqrt(L)."""
    description = RoverModel().to_dict()
    for solid in description["solids"]:
        solid["mass"] *= L**3
        for owner, keys in ((solid, ("position", "centre_of_mass")), (solid["shape"], ("size", "radius", "height"))):
            owner |= {key: (L * np.array(owner[key])).tolist() for key in keys if owner.get(key)}
        if hold := solid.get("hold"):
            solid["hold"] = {"stiffness": hold["stiffness"] * L**4, "damping": hold["damping"] * L**4.5}
    for wheel in description["wheels"]:
        wheel["radius"] *= L
        wheel["torque_limit"] *= L**4
    return description


@for_each(VARIANTS)
def froude(options: Options) -> Iterator[Row]:
    """Lengths times L, masses times L³, times times sqrt(L): the same run."""
    runs = []
    for L in (1.0, 3.0):
        simulation = start(scaled(L), q={1: 0.40 * L, 3: 0.05}, time_step=0.005 * math.sqrt(L), **options)
        simulation.set_steering([-0.2, -0.2, 0.0, 0.0, 0.0, 0.0])
        simulation.set_wheel_torques(np.full(6, 15.0 * L**4))
        simulation.step(400)
        runs.append(simulation.q / np.where(np.arange(21) < 3, L, 1.0))
    off = float(np.abs(runs[0] - runs[1])[:6].max())
    yield "Froude similarity, three times larger", "the same run", off, 1e-6, "m, rad"


@for_each(VARIANTS)
def dzhanibekov(options: Options) -> Iterator[Row]:
    """A solid with moments 1, 2, 3 spinning about the middle one turns over with a period of 39.105734 s."""
    shape = {"kind": "box", "size": [1, 1, 1]}
    solid = {"name": "body", "mass": 1.0, "shape": shape, "inertia": [1, 2, 3, 0, 0, 0]}
    free = {"gravity": (0.0, 0.0, 0.0), "v": {3: 0.01, 4: 1.0, 5: 0.01}, "q": {1: 1e3}}
    for h in (0.01, 0.005):
        simulation = start({"name": "solid", "solids": [solid], "wheels": []}, time_step=h, **free, **options)
        # Over one period the body-frame angular velocity comes back; over half of it w_y is reversed.
        omega = []
        for _ in range(round(90.0 / h)):
            simulation.step()
            omega.append(float(simulation.rotation[:, 1] @ simulation.v[3:6]))
        w, t = np.array(omega), h * np.arange(1, len(omega) + 1)
        k = np.flatnonzero((w[:-1] > 0.0) & (w[1:] <= 0.0))
        crossings = t[k] + h * w[k] / (w[k] - w[k + 1])
        period = float(np.diff(crossings).mean()) if len(crossings) > 1 else math.inf
        off, title = abs(period / 39.105734 - 1.0), f"Dzhanibekov, step {h * 1e3:g} ms"
        yield title, "period 39.105734 s", off, 1e-4, "relative", f"{period:.6f} s"


def disk(radius: float) -> dict[str, Any]:
    """A thin disc of 1 kg, free, its axle along z."""
    solid = {"name": "disk", "mass": 1.0, "shape": {"kind": "disc", "radius": radius}}
    wheel = {"name": "D", "solid": "disk", "axle": [0, 0, 1], "radius": radius, "torque_limit": 1.0, "drive_sign": -1.0}
    return {"name": "disk", "solids": [solid], "wheels": [wheel]}


@for_each(VARIANTS)
def euler_disk(options: Options) -> Iterator[Row]:
    """A disk of radius 0.0375 m in steady precession about its resting centre: Omega² = 4 g / (a sin alpha)."""
    a, step = 0.0375, 2e-5
    for alpha in (0.5, 0.2, 0.1):
        omega = math.sqrt(4.0 * G / (a * math.sin(alpha)))
        spin = -omega * math.sin(alpha) * np.array([0.0, -math.sin(alpha), math.cos(alpha)])
        pose = {1: a * math.sin(alpha), 3: alpha - math.pi / 2.0}
        simulation = start(disk(a), q=pose, v=dict(enumerate(spin, 3)), time_step=step, **options)
        turned, before = 0.0, simulation.rotation[:, 2]
        for _ in range(round(0.2 / step)):
            simulation.step()
            axle = simulation.rotation[:, 2]
            turned += math.atan2(before[2] * axle[0] - before[0] * axle[2], before[0] * axle[0] + before[2] * axle[2])
            before = axle
        rate = turned / simulation.time
        off, title = abs(rate / omega - 1.0), f"Euler's disk, alpha {alpha:g}, step 0.02 ms"
        yield title, f"{omega:.4f} rad/s", off, 1e-2, "relative", f"{rate:.4f} rad/s"


@for_each(VARIANTS)
def rolling_disk(options: Options) -> Iterator[Row]:
    """An upright disk of radius 0.1 m rolls stably above omega = sqrt(g / (3 a)) = 5.7184 rad/s and falls below."""
    a = 0.1
    critical = math.sqrt(G / (3.0 * a))
    for ratio, expected in ((1.15, "stays upright"), (0.85, "falls")):
        omega = -ratio * critical  # about +z it would roll backwards
        simulation = start(disk(a), q={1: a, 3: 1e-3}, v={0: -omega * a, 5: omega}, time_step=1e-3, **options)
        leaning = 0.0
        for _ in range(3000):
            simulation.step()
            leaning = max(leaning, abs(float(simulation.rotation[1, 2])))
        off = max(0.5 - leaning, 0.0) if expected == "falls" else leaning
        title = f"rolling disk at {ratio:g} of its critical speed"
        yield title, expected, off, 0.05, "1", f"leans by up to {leaning:.2g}"


#: The scenes in the order of the table.
SCENES = (
    loads,
    straight,
    incline,
    heading,
    heading_of_the_report,
    wedged,
    masses,
    wheel_spin,
    drop,
    mirror,
    froude,
    dzhanibekov,
    euler_disk,
    rolling_disk,
)
