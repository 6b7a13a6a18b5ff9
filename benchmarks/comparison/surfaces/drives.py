"""The scenes of the rover: level ground as a map beside the plane, and hills."""

from typing import Any

import numpy as np

from comparison.peers import LeftOut, Variant
from comparison.run import run
from comparison.scene import Array, Phase, RoverScene, Trace, distance, steps_in
from comparison.scenes.flat_drive import machine
from comparison.surfaces.our_surfaces import ROVERS_ON_BALLS, RoverOnBalls
from rover_gym import HeightField

#: Between two compared places, s.
SAMPLE = 0.05
#: Time at rest before the drive over level ground, s, and spacings of its map, m.
REST = 1.0
FLAT_SPACINGS = (None, 0.25, 0.05)
SEEDS = (1, 2, 3, 4)
#: Of the hills.
SPACING, ROUGHNESS, LONGEST_WAVE = 0.25, 0.05, 4.0  # m
#: x_min and z_min of the maps, and their size, m.
CORNER, SIZE = (-2.0, -2.0), (8.0, 4.5)
#: Steps of the references of the hills, s: the second is the reference, the first tells how far it may be off.
REFERENCE_STEPS = (1e-4, 5e-5)


def level(spacing: float | None, duration: float) -> RoverScene:
    """The rover of the flat drive, dropped from 5 cm, at rest for a second, then driven in a curve."""
    field = None
    if spacing is not None:
        n_x, n_z = (int(np.ceil(length / spacing - 1e-9)) + 1 for length in SIZE)
        field = HeightField(np.zeros((n_z, n_x)), spacing, origin=CORNER)
    q = np.zeros(21)
    q[1] = 0.50
    return RoverScene(
        name="level",
        title="drive on level ground",
        machine=machine(),
        q=q,
        phases=(Phase(REST), Phase(duration, (-0.1, -0.1, 0.0, 0.0, 0.0, 0.0), (20.0,) * 6)),
        normal=(0.0, 1.0, 0.0) if field is None else None,
        heights=field,
        sample=SAMPLE,
    )


def hills(seed: int, duration: float) -> RoverScene:
    """The same rover, with balls for wheels in every engine, over fractal ground, from where it stands braked."""
    field = HeightField.fractal(SIZE, SPACING, ROUGHNESS, longest_wave=LONGEST_WAVE, seed=seed, origin=CORNER)
    scene = RoverScene(
        name=f"hills {seed}",
        title="drive over hills",
        machine=machine(),
        q=np.zeros(21),
        phases=(Phase(duration, (-0.1, -0.1, 0.0, 0.0, 0.0, 0.0), (30.0,) * 6),),
        normal=None,
        heights=field,
        brake=True,
        sample=SAMPLE,
    )
    scene.q[1] = float(field.grid.max()) + 0.45
    standing = RoverOnBalls(scene, 0.005)
    standing.advance(1000)
    return RoverScene(**(vars(scene) | {"q": standing.simulation.q, "brake": False}))


def _run(variant: Variant, scene: RoverScene, step: float, cap: float) -> Trace:
    """Of the engine in the scene.

    Raises:
        LeftOut: The engine cannot be given the scene, or does not finish it.
    """
    trace = run(variant, scene, step, cap)
    if trace.failure:
        raise LeftOut(trace.failure)
    return trace


def measure_level(variant: Variant, step: float, duration: float, cap: float) -> list[dict[str, Any]]:
    """A row a spacing: distance of the driven path from the same engine's on its plane, m, and cost."""
    rows: list[dict[str, Any]] = []
    on_plane: Array | None = None
    for spacing in FLAT_SPACINGS:
        row: dict[str, Any] = {"spacing": spacing}
        rows.append(row)
        try:
            trace = _run(variant, level(spacing, duration), step, cap)
        except LeftOut as left_out:
            row["failure"] = left_out.reason
            continue
        driven = trace.positions[steps_in(REST, SAMPLE) :]
        driven = driven - driven[0]
        on_plane = driven if spacing is None else on_plane
        if on_plane is None:
            row["failure"] = "not run on the plane"
            continue
        row |= {"error": distance(driven, on_plane), "cpu_ms_per_s": 1e3 * trace.cpu / trace.simulated}
    return rows


def hill_references(duration: float, seeds: tuple[int, ...]) -> dict[int, tuple[RoverScene, Array, float]]:
    """By seed: the drive, the path of our finest run, and its distance from the run at twice its step, m."""
    found = {}
    for seed in seeds:
        scene = hills(seed, duration)
        coarse, fine = (_run(ROVERS_ON_BALLS[0], scene, step, 1e3).positions for step in REFERENCE_STEPS)
        found[seed] = scene, fine, distance(coarse, fine)
    return found


def measure_hills(
    variant: Variant, step: float, references: dict[int, tuple[RoverScene, Array, float]], cap: float
) -> dict[str, Any]:
    """Median and all of the errors of the drives, m, and their mean cost."""
    errors, costs = [], []
    for scene, path, _ in references.values():
        try:
            trace = _run(variant, scene, step, cap)
        except LeftOut as left_out:
            return {"failure": left_out.reason}
        errors.append(distance(trace.positions, path))
        costs.append(1e3 * trace.cpu / trace.simulated)
    return {"error": float(np.median(errors)), "errors": errors, "cpu_ms_per_s": float(np.mean(costs))}
