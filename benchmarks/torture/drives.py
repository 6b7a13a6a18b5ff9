"""The rover on ground of every kind: driven, dropped, thrown, buried."""

from functools import partial
from typing import Any

import numpy as np

from rover_gym import Plane, RoverModel, Simulation, SphereField
from torture.audit import Array, Audit
from torture.ledger import Bounds, Ledger, Regime

Random = np.random.Generator
VARIANTS = ("linearised", "newton")
LEVEL = Plane()
MODEL = RoverModel()


def log_uniform(random: Random, low: float, high: float) -> float:
    """Evenly drawn in the logarithm."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def variant(random: Random) -> str:
    """One of the two schemes."""
    return str(random.choice(VARIANTS))


def tilted(random: Random, steepest: float) -> Plane:
    """A plane through the origin with a slope up to so many degrees."""
    return Plane.tilted(np.radians(random.uniform(0.0, steepest)), random.uniform(-np.pi, np.pi))


def rocks(random: Random, ground: Plane | None = None) -> SphereField:
    """Rocks of a random abundance around the origin, the rover's own place among them."""
    return SphereField.rocks(
        random.uniform(0.01, 0.2),
        (-6.0, -6.0, 6.0, 6.0),
        int(random.integers(2**31)),
        min_diameter=0.08,
        burial=(0.0, 0.5),
        ground=ground,
    )


def highest(terrain: Plane | SphereField, x: float, z: float) -> float:
    """Height of the ground under a place, 0 where there is none, m."""
    if isinstance(terrain, Plane):
        return terrain.height(x, z)
    around = np.array([x, z]) + np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 9)] * 2), axis=-1).reshape(-1, 2)
    return float(np.nan_to_num(terrain.heights(around), nan=0.0).max())


def pose(random: Random, terrain: Plane | SphereField, *, above: float, lean: float = 0.0) -> Array:
    """A pose over the origin: any heading, joints bent a little, leaning up to so much (rad).

    Args:
        random: Draws it.
        terrain: The ground.
        above: Height of the trunk's origin over the ground, m.
        lean: Largest roll and pitch, rad.
    """
    q = np.zeros(MODEL.nq)
    q[6:] = random.uniform(-0.2, 0.2, MODEL.nq - 6)
    q[3:6] = random.uniform(-lean, lean), random.uniform(-np.pi, np.pi), random.uniform(-0.5, 0.5) * lean
    q[1] = highest(terrain, 0.0, 0.0) + above
    return q


def steer(random: Random, sim: Simulation) -> None:
    """Random set-points within the limit."""
    limit = sim.model.steering_limit
    sim.set_steering(random.uniform(-limit, limit, 6))


def drive(random: Random, audit: Audit, periods: int, steps: int, *, torque: float, kind: str | None = None) -> None:
    """Drives with constant, bang-bang or random torques and steering; beyond the motors' limit by joint torques.

    Args:
        random: Draws the commands.
        audit: Takes the steps.
        periods: Times that a command is given.
        steps: Of each.
        torque: Largest, N m.
        kind: Of the commands; drawn if not given.
    """
    kind = kind or str(random.choice(["constant", "bang-bang", "random"]))
    sim, commands = audit.sim, random.uniform(-1.0, 1.0, 12)
    for _ in range(periods):
        if kind == "random":
            commands = random.uniform(-1.0, 1.0, 12)
        elif kind == "bang-bang" and random.uniform() < 0.2:
            commands = random.choice([-1.0, 1.0], 12)
        if torque <= 150.0:
            sim.set_wheel_torques(torque * commands[:6])
        else:
            push = np.zeros(sim.model.nv - 6)
            push[np.array(sim.model.wheel_joint_indices) - 6] = torque * commands[:6]
            audit.push(push)
        sim.set_steering(sim.model.steering_limit * commands[6:])
        if not audit.run(steps):
            return


def standing(random: Random, terrain: Plane, **options: Any) -> Simulation:
    """A rover that rests on a plane."""
    sim = Simulation(options.pop("model", MODEL), terrain, **options)
    sim.set_state(sim.model.resting_pose(terrain, (0.0, 0.0), random.uniform(-np.pi, np.pi)))
    return sim


def torques(random: Random, ledger: Ledger, *, most: float) -> None:
    """Drives on the level with torques up to so many N m, at steps of 1 to 20 ms."""
    step = float(random.choice([1e-3, 5e-3, 1e-2, 2e-2]))
    sim = standing(random, LEVEL, variant=variant(random), time_step=step)
    drive(random, Audit(sim, ledger), 30, 20, torque=most)


def steps(random: Random, ledger: Ledger, *, chosen: str) -> None:
    """Drives with one scheme at steps of 10 us to 100 ms."""
    sim = standing(random, tilted(random, 20.0), variant=chosen, time_step=log_uniform(random, 1e-5, 0.1))
    drive(random, Audit(sim, ledger), 30, 20, torque=150.0)


def full_throttle(random: Random, ledger: Ledger, *, chosen: str) -> None:
    """All motors forward on the level for twenty seconds, at steps of 5, 10 and 20 ms."""
    step = float(random.choice([5e-3, 1e-2, 2e-2]))
    sim = standing(random, LEVEL, variant=chosen, time_step=step)
    sim.set_wheel_torques(np.full(6, 150.0))
    if random.uniform() < 0.5:
        steer(random, sim)
    Audit(sim, ledger).run(round(20.0 / step))


def spin(random: Random, ledger: Ledger) -> None:
    """Free flight, without input, turning at 1 to 1e4 rad/s, wheels too, at steps up to 100 ms."""
    gravity = (0.0, float(random.choice([0.0, -9.81])), 0.0)
    step = log_uniform(random, 1e-4, 0.1)
    sim = Simulation(gravity=gravity, variant=variant(random), time_step=step)
    q = pose(random, LEVEL, above=1e3, lean=np.pi)
    v = np.zeros(sim.model.nv)
    rate = log_uniform(random, 1.0, 1e4)
    v[:3] = random.normal(0.0, 1.0, 3)
    v[3:6] = rate * (axis := random.normal(0.0, 1.0, 3)) / np.linalg.norm(axis)
    if random.uniform() < 0.5:
        v[sim.model.wheel_joint_indices] = rate * random.normal(0.0, 1.0, 6)
    sim.set_state(q, v)
    Audit(sim, ledger).run(min(300, round(10.0 / step)))


def landing(random: Random, ledger: Ledger) -> None:
    """Lands turning at up to 1e3 rad/s, e = 0."""
    step = log_uniform(random, 1e-3, 0.05)
    sim = Simulation(variant=variant(random), time_step=step, friction=random.uniform(0.0, 2.0))
    v = np.zeros(sim.model.nv)
    v[3:6] = log_uniform(random, 1.0, 1e3) * (axis := random.normal(0.0, 1.0, 3)) / np.linalg.norm(axis)
    v[1] = -random.uniform(0.0, 20.0)
    sim.set_state(pose(random, LEVEL, above=random.uniform(1.0, 3.0), lean=np.pi), v)
    Audit(sim, ledger).run(400)


def deep(random: Random, ledger: Ledger, *, stony: bool) -> None:
    """Starts overlapping the ground, or rocks, by up to 0.4 m."""
    terrain = rocks(random) if stony else LEVEL
    sim = Simulation(terrain=terrain, variant=variant(random), time_step=log_uniform(random, 1e-3, 0.02))
    sim.set_state(pose(random, terrain, above=random.uniform(-0.1, 0.3), lean=0.5))
    drive(random, Audit(sim, ledger, deep=True), 10, 20, torque=150.0)


def upside_down(random: Random, ledger: Ledger) -> None:
    """On its back, its side, its nose: any attitude, dropped, wheels driven."""
    terrain = tilted(random, 30.0) if random.uniform() < 0.5 else rocks(random)
    sim = Simulation(terrain=terrain, variant=variant(random), time_step=log_uniform(random, 1e-3, 0.02))
    sim.set_state(pose(random, terrain, above=random.uniform(0.9, 1.5), lean=np.pi))
    drive(random, Audit(sim, ledger), 20, 20, torque=150.0)


def shot(random: Random, ledger: Ledger) -> None:
    """Into rocks at up to 100 m/s."""
    terrain = rocks(random)
    sim = Simulation(terrain=terrain, variant=variant(random), time_step=log_uniform(random, 1e-4, 0.05))
    v = np.zeros(sim.model.nv)
    v[:3] = log_uniform(random, 1.0, 100.0) * np.array([random.normal(), -abs(random.normal()), random.normal()]) / 1.7
    v[3:6] = random.normal(0.0, 3.0, 3)
    sim.set_state(pose(random, terrain, above=random.uniform(0.6, 1.5), lean=0.5), v)
    Audit(sim, ledger).run(300)


def stony(random: Random, ledger: Ledger) -> None:
    """Drives over rocks on slopes up to 20 degrees."""
    terrain = rocks(random, tilted(random, 20.0))
    sim = Simulation(terrain=terrain, variant=variant(random), time_step=log_uniform(random, 1e-3, 0.02))
    sim.set_state(pose(random, terrain, above=0.5))
    drive(random, Audit(sim, ledger), 30, 20, torque=150.0)


def steep(random: Random, ledger: Ledger) -> None:
    """Slopes to 60 degrees, friction 0 to 2."""
    sim = standing(
        random, tilted(random, 60.0), variant=variant(random), friction=random.uniform(0.0, 2.0), time_step=5e-3
    )
    drive(random, Audit(sim, ledger), 30, 20, torque=150.0)


def masses(random: Random, ledger: Ledger) -> None:
    """Masses times 0.1 to 10, all together and each solid's alone."""
    model = MODEL.replace(mass_scale=log_uniform(random, 0.1, 10.0))
    if random.uniform() < 0.5:
        own = [solid["mass"] * log_uniform(random, 0.1, 10.0) for solid in model.to_dict()["solids"]]
        model = model.replace(masses=own)
    step = log_uniform(random, 1e-3, 0.02)
    sim = standing(random, tilted(random, 20.0), model=model, variant=variant(random), time_step=step)
    drive(random, Audit(sim, ledger), 30, 20, torque=150.0)


def extreme_friction(random: Random, ledger: Ledger) -> None:
    """Friction of 1e-12 to 1e16."""
    mu = float(random.choice([1e-12, 1e-8, 1e4, 1e8, 1e12, 1e16]))
    sim = standing(random, tilted(random, 20.0), variant=variant(random), friction=mu, time_step=5e-3)
    drive(random, Audit(sim, ledger), 20, 20, torque=150.0)


def weightless(random: Random, ledger: Ledger) -> None:
    """Gravity of zero or a hundredth."""
    gravity = (0.0, float(random.choice([0.0, -0.0981])), 0.0)
    terrain = rocks(random) if random.uniform() < 0.5 else LEVEL
    step = log_uniform(random, 1e-3, 0.05)
    sim = Simulation(terrain=terrain, gravity=gravity, variant=variant(random), time_step=step)
    sim.set_state(pose(random, terrain, above=0.5))
    drive(random, Audit(sim, ledger), 20, 20, torque=float(random.choice([2.0, 150.0])))


def elastic(random: Random, ledger: Ledger, *, friction: float) -> None:
    """Tumbles over the ground with e = 1 at steps of 5 to 50 ms."""
    step = float(random.choice([5e-3, 2e-2, 5e-2]))
    restitution = 1.0 if friction == 0.0 else random.uniform(0.1, 1.0)
    terrain = LEVEL if random.uniform() < 0.5 else rocks(random)
    sim = Simulation(
        terrain=terrain, variant=variant(random), time_step=step, friction=friction, restitution=restitution
    )
    v = np.zeros(sim.model.nv)
    v[3:6] = random.normal(0.0, 2.0, 3)
    sim.set_state(pose(random, terrain, above=random.uniform(1.0, 2.0), lean=np.pi), v)
    Audit(sim, ledger).run(300)


def wedged(random: Random, ledger: Ledger) -> None:
    """Among some hundred spheres that touch trunk, beams and wheels at once, some overlapping them."""
    n = int(random.integers(50, 200))
    centres = random.uniform((-1.2, -0.7, -1.0), (1.2, 0.3, 1.0), (n, 3))
    terrain = SphereField(centres, random.uniform(0.02, 0.25, n), LEVEL if random.uniform() < 0.5 else None)
    sim = Simulation(terrain=terrain, variant=variant(random), time_step=log_uniform(random, 1e-3, 0.02))
    sim.set_state(pose(random, LEVEL, above=0.36, lean=0.3))
    drive(random, Audit(sim, ledger, deep=True), 5, 10, torque=150.0)


def anything(random: Random, ledger: Ledger, *, most: float) -> None:
    """Ground, law, step, torques, masses, pose and speed all drawn at once; restitution up to so much."""
    ground = tilted(random, 60.0)
    terrain = rocks(random, ground) if random.uniform() < 0.5 else ground
    sim = Simulation(
        MODEL.replace(mass_scale=log_uniform(random, 0.1, 10.0)),
        terrain,
        variant=variant(random),
        time_step=log_uniform(random, 1e-5, 0.1),
        friction=random.uniform(0.0, 2.0),
        restitution=random.uniform(0.0, most),
        theta=float(random.choice([0.5, 0.5, 0.7, 1.0])),
    )
    v = np.zeros(sim.model.nv)
    v[:6] = log_uniform(random, 0.1, 100.0) * random.normal(0.0, 0.5, 6)
    lean = float(random.choice([0.3, np.pi]))
    sim.set_state(pose(random, terrain, above=random.uniform(0.0, 1.5), lean=lean), v)
    drive(random, Audit(sim, ledger, deep=True), 10, 20, torque=log_uniform(random, 1.0, 1e4))


FREE = Bounds(gained=None)
DEEP = Bounds(lifted=None)
#: Up to 43 contacts between overlapping spheres that face each other: some of the first steps' problems have no answer.
WEDGED = Bounds(lifted=None, not_converged=5e-3)

REGIMES = [
    *[Regime(f"full throttle, {v}", partial(full_throttle, chosen=v), 12) for v in VARIANTS],
    *[Regime(f"torques to {t:g} N m", partial(torques, most=t), 40) for t in (20.0, 60.0, 150.0, 1e3, 1e4)],
    *[Regime(f"steps of 10 us to 100 ms, {v}", partial(steps, chosen=v), 40) for v in VARIANTS],
    Regime("free flight, to 1e4 rad/s", spin, 120),
    Regime("landing, to 1e3 rad/s", landing, 60),
    Regime("starts deep in the ground", partial(deep, stony=False), 120, DEEP),
    Regime("starts deep in rocks", partial(deep, stony=True), 120, DEEP),
    Regime("upside down", upside_down, 60),
    Regime("into rocks at 100 m/s", shot, 80),
    Regime("over rocks", stony, 40),
    Regime("slopes to 60 degrees", steep, 40),
    Regime("masses times 0.1 to 10", masses, 40),
    Regime("friction 1e-12 to 1e16", extreme_friction, 40),
    Regime("gravity 0 and g/100", weightless, 40),
    Regime("elastic, frictionless", partial(elastic, friction=0.0), 60),
    Regime("elastic with friction", partial(elastic, friction=0.7), 40, FREE),
    Regime("wedged between spheres", wedged, 120, WEDGED),
    Regime("anything, e = 0", partial(anything, most=0.0), 200, DEEP),
    Regime("anything, e to 1", partial(anything, most=1.0), 100, Bounds(gained=None, lifted=None)),
]
