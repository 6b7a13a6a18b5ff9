"""The scenes of a single body: a ball that rolls over a flat map and over a sine, a box that lies on a flat map."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from comparison.peers import LeftOut
from comparison.scene import Array, distance, steps_in
from comparison.surfaces.rolling import over_curve, over_facets, rolled
from comparison.surfaces.scene import BodyRunner, BodyScene, largest_false_impulse
from rover_gym import HeightField

Builder = Callable[[BodyScene, float], BodyRunner]
#: Between two compared places, s; a multiple of every step.
SAMPLE = 0.01
#: Of a flat map; none is the plane.
EDGE_SPACINGS: tuple[float | None, ...] = (None, 0.5, 0.1, 0.05, 0.02)
HEADING = 0.2  # rad, of the ball over the edges and of the box, so that they meet columns, rows and diagonals
HALF = np.array([0.3, 0.1, 0.2])  # m, of the box
SETTLED = 0.1  # s after the start, from which on impulses count: springs that roll take their shape
SINE_SPACINGS = (0.2, 0.1, 0.05, 0.025)
AMPLITUDE, WAVELENGTH = 0.1, 2.0  # m


@dataclass(frozen=True)
class Run:
    """What an engine made of a body.

    Attributes:
        path: (n, 3) places of the centre after every step, the start first, m.
        velocities: (n, 3) of the centre, m/s.
        cpu_ms_per_s: CPU time of the steps over the simulated time.
    """

    path: Array
    velocities: Array
    cpu_ms_per_s: float


def roll(make: Builder, scene: BodyScene, step: float, cap: float) -> Run:
    """Rolls the ball twice: once to time it, once to read it after every step.

    Raises:
        LeftOut: The engine cannot be given the scene, or takes more CPU time than `cap` (s).
    """
    runner = make(scene, step)
    centre = scene.centre.copy()
    if scene.rest:
        runner.advance(steps_in(scene.rest, step))
        centre[1] = runner.state()[0][1]
    runner.launch(centre)
    n, chunk, cpu = steps_in(scene.duration, step), steps_in(0.1, step), 0.0
    for _ in range(n // chunk):
        begin = time.process_time()
        runner.advance(chunk)
        cpu += time.process_time() - begin
        if cpu > cap:
            raise LeftOut(f"more than {cap:g} s of CPU time")
    runner.launch(centre)
    states = [runner.state()]
    for _ in range(n):
        runner.advance(1)
        states.append(runner.state())
    path, velocities = (np.array(part) for part in zip(*states, strict=True))
    return Run(path, velocities, 1e3 * cpu / scene.duration)


def flat(spacing: float | None) -> HeightField | None:
    """A level map under the ball's way over the edges and under the box."""
    if spacing is None:
        return None
    n_x, n_z = (int(np.ceil(length / spacing - 1e-9)) + 1 for length in (4.0, 1.5))
    return HeightField(np.zeros((n_z, n_x)), spacing, origin=(-0.5, -0.5))


def over_edges(spacing: float | None, duration: float) -> BodyScene:
    """A ball of 0.2 m at 1 m/s over level ground, on which it has rested."""
    velocity = np.array([np.cos(HEADING), 0.0, np.sin(HEADING)])
    return BodyScene(flat(spacing), np.array([0.0, 0.2, 0.0]), velocity, duration, 0.2, rest=0.5)


def inner_edges(spacing: float, duration: float) -> int:
    """Columns, rows and diagonals that the ball crosses."""
    x, z = np.cos(HEADING) * duration, np.sin(HEADING) * duration
    return round((x + z + abs(x - z)) / spacing)


def row_each(spacings: Iterable[float | None], measure: Callable[[Any], dict[str, Any]]) -> list[dict[str, Any]]:
    """A row a spacing: what is measured, or why an engine has failed."""
    rows = []
    for spacing in spacings:
        try:
            found = measure(spacing)
        except (LeftOut, RuntimeError, ArithmeticError) as error:
            found = {"failure": str(error).splitlines()[0][:120]}
        rows.append({"spacing": spacing, **found})
    return rows


def measure_edges(make: Builder, step: float, duration: float, cap: float) -> list[dict[str, Any]]:
    """A row a spacing: error of the path, m, distance from the same engine's on its plane, false impulse, cost."""
    on_plane: list[Array] = []

    def measure(spacing: float | None) -> dict[str, Any]:
        scene = over_edges(spacing, duration)
        run = roll(make, scene, step, cap)
        travelled = run.path - run.path[0]
        times = step * np.arange(len(travelled))
        if spacing is None:
            on_plane.append(travelled)
        if not on_plane:
            raise LeftOut("not run on the plane")
        return {
            "error": distance(travelled, times[:, None] * scene.velocity),
            "from_plane": distance(travelled, on_plane[0]),
            "impulse": largest_false_impulse(run.velocities[steps_in(SETTLED, step) :], step),
            "lowest": float(travelled[:, 1].min()),
            "cpu_ms_per_s": run.cpu_ms_per_s,
        }

    return row_each(EDGE_SPACINGS, measure)


def at_rest(spacing: float | None, duration: float) -> BodyScene:
    """A box that lies on level ground."""
    centre = np.array([0.0, HALF[1], 0.0])
    return BodyScene(flat(spacing), centre, np.zeros(3), duration, half=HALF, heading=HEADING)


def lie(make: Builder, scene: BodyScene, step: float, cap: float) -> tuple[Run, int]:
    """Lets the body lie, and counts the most contacts of a step.

    Raises:
        LeftOut: The engine cannot be given the scene, or takes more CPU time than `cap` (s).
    """
    runner, cpu = make(scene, step), 0.0
    states, contacts = [runner.state()], 0
    for _ in range(steps_in(scene.duration, step)):
        begin = time.process_time()
        runner.advance(1)
        cpu += time.process_time() - begin
        states.append(runner.state())
        contacts = max(contacts, runner.contacts())
        if cpu > cap:
            raise LeftOut(f"more than {cap:g} s of CPU time")
    path, velocities = (np.array(part) for part in zip(*states, strict=True))
    return Run(path, velocities, 1e3 * cpu / scene.duration), contacts


def measure_rest(make: Builder, step: float, duration: float, cap: float) -> list[dict[str, Any]]:
    """A row a spacing: largest way of the box's centre, m, false impulse, most contacts, cost.

    The false impulse counts after `SETTLED`, as springs sink at first.
    """

    def measure(spacing: float | None) -> dict[str, Any]:
        run, contacts = lie(make, at_rest(spacing, duration), step, cap)
        return {
            "error": float(np.linalg.norm(run.path - run.path[0], axis=1).max()),
            "impulse": largest_false_impulse(run.velocities[steps_in(SETTLED, step) :], step),
            "contacts": contacts,
            "cpu_ms_per_s": run.cpu_ms_per_s,
        }

    return row_each(EDGE_SPACINGS, measure)


def wave(spacing: float) -> HeightField:
    """A sine along x with a crest at 0; no row of it lies under the ball's way."""
    x = spacing * np.arange(round(-0.6 / spacing), round(6.0 / spacing) + 1)
    heights, n_z = AMPLITUDE * np.cos(2.0 * np.pi / WAVELENGTH * x), round(1.2 / spacing)
    return HeightField(np.tile(heights, (n_z + 1, 1)), spacing, origin=(float(x[0]), (0.3 - n_z // 2) * spacing))


def over_wave(spacing: float, duration: float) -> BodyScene:
    """A ball of 0.5 m that leaves the crest at 1 m/s; it never leaves the ground."""
    centre = np.array([0.0, AMPLITUDE + 0.5, 0.0])
    return BodyScene(wave(spacing), centre, np.array([1.0, 0.0, 0.0]), duration, 0.5)


def smooth_path(times: Array) -> Array:
    """(k, 2) of that ball on the sine itself, m."""
    x, k = np.linspace(-1.0, 6.0, 70_001), 2.0 * np.pi / WAVELENGTH
    path = over_curve(x, AMPLITUDE * np.cos(k * x), -AMPLITUDE * k * np.sin(k * x), 0.5)
    return rolled(path, np.zeros(len(path)), 0.0, 1.0, times)


def faceted_path(field: HeightField, times: Array) -> Array:
    """(k, 2) of that ball on the map's facets, m."""
    x = field.origin[0] + field.spacing[0] * np.arange(field.shape[1])
    return rolled(*over_facets(x, field.grid[0].astype(float), 0.5), 0.0, 1.0, times)


def measure_wave(make: Builder, step: float, duration: float, cap: float) -> list[dict[str, Any]]:
    """A row a spacing: distance from the path on the facets and on the sine, m, and cost."""
    times = SAMPLE * np.arange(steps_in(duration, SAMPLE) + 1)

    def measure(spacing: float) -> dict[str, Any]:
        scene = over_wave(spacing, duration)
        run = roll(make, scene, step, cap)
        sampled = run.path[:: steps_in(SAMPLE, step), :2]
        assert scene.field is not None
        return {
            "error": distance(sampled, faceted_path(scene.field, times)),
            "from_sine": distance(sampled, smooth_path(times)),
            "cpu_ms_per_s": run.cpu_ms_per_s,
        }

    return row_each(SINE_SPACINGS, measure)
