"""Ensembles of drives: one drive says little where contacts make and break, so errors are taken over many.

Every member of a scene's ensemble differs in what shifts the phase of its impacts. The reference of a member is this
project's Newton variant at 0.05 ms (rocks: 0.1 ms); beside it is kept how far the linearised variant at the same step
is from it. `python -m comparison.ensembles` makes `references/ensembles.json` (ten minutes).
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from reports import read_json

from comparison.peers import Variant
from comparison.peers.ours import OurRunner
from comparison.run import run
from comparison.scene import SAMPLE, Array, Phase, RoverScene, distance
from comparison.scenes import flat_drive, parked, rocks, rug
from rover_gym import SphereField

FILE = Path(__file__).parent / "references" / "ensembles.json"
SIZE = 12
#: The start of a drive over rocks, before its ways part: 1 s of rest and 2 s of driving.
SHORT = 3.0  # s


@dataclass(frozen=True)
class Ensemble:
    """Drives that differ in the phase of their impacts.

    Attributes:
        name: Key in the results.
        title: For the table.
        differ: In what the members differ, in words.
        members: All of them.
        windows: Titles of the stretches over which the error is taken, and their ends, s.
        finest: Step of the reference, s.
        has_reference: Whether paths are compared; otherwise the error is the creep, and 0 the reference.
    """

    name: str
    title: str
    differ: str
    members: tuple[RoverScene, ...]
    windows: dict[str, float]
    finest: float = 5e-5
    has_reference: bool = True

    def errors(self, positions: Array, reference: Array | None) -> dict[str, float]:
        """RMS distance of the path (m), or creep (m/s), over each window."""
        if reference is None:
            rows = round(parked.WINDOW / SAMPLE)
            creep = float(np.linalg.norm(positions[-1] - positions[-1 - rows])) / parked.WINDOW
            return dict.fromkeys(self.windows, creep)
        ends = {title: round(end / SAMPLE) + 1 for title, end in self.windows.items()}
        return {title: distance(positions[:end], reference[:end]) for title, end in ends.items()}


def _flat(member: int) -> RoverScene:
    scene, rng = flat_drive.scene(), np.random.default_rng(member)
    q = scene.q.copy()
    q[1] += rng.uniform(0.0, 0.04)
    angle, torque = rng.uniform(0.05, 0.15), rng.uniform(15.0, 25.0)
    drive = Phase(10.0, (-angle, -angle, 0.0, 0.0, 0.0, 0.0), (torque,) * 6)
    return replace(scene, q=q, phases=(scene.phases[0], drive))


def _rug(member: int) -> RoverScene:
    scene, rng = rug.scene(), np.random.default_rng(member)
    q = scene.q.copy()
    q[[0, 2]] += rng.uniform(-0.05, 0.05, 2)
    return replace(scene, q=q)


def _rocks(member: int) -> RoverScene:
    scene, rng = rocks.scene(), np.random.default_rng(member)
    q = scene.q.copy()
    q[1] += rng.uniform(0.0, 0.05)
    field = SphereField.rocks(0.05, (-2.0, -2.0, 8.0, 2.0), member, max_diameter=0.15, burial=0.5)
    return replace(scene, q=q, spheres=np.column_stack([field.centres, field.radii]))


def _parked(member: int) -> RoverScene:
    return parked.scene(float(np.random.default_rng(member).uniform(5.0, 34.5)))


def _many(make: Callable[[int], RoverScene]) -> tuple[RoverScene, ...]:
    return tuple(make(member) for member in range(1, SIZE + 1))


def ensembles() -> list[Ensemble]:
    """All of them."""
    parking = ("parked", "parked", "slope of 5 to 34.5 degrees")
    return [
        Ensemble(
            "flat_drive",
            "drive of 12 s on flat ground",
            "drop of 5 to 9 cm, steering of 0.05 to 0.15 rad, torques of 15 to 25 N m",
            _many(_flat),
            {"all 12 s": 12.0},
        ),
        Ensemble(
            "rug", "10 s on the report's rug", "start moved by up to 5 cm each way", _many(_rug), {"all 10 s": 10.0}
        ),
        Ensemble(
            "rocks",
            "7 s over small rocks",
            "field of rocks, drop of up to 5 cm more",
            _many(_rocks),
            {"first 3 s": SHORT, "all 7 s": 7.0},
            finest=1e-4,
        ),
        Ensemble(*parking, _many(_parked), {"creep": 10.0}, has_reference=False),
    ]


def drive(scene: RoverScene, step: float, cap: float = 1e3, **options: Any) -> tuple[Array, float]:
    """Path of ours and CPU time per simulated second.

    Raises:
        RuntimeError: The run did not get to its end.
    """
    trace = run(Variant("rover-gym", "", partial(OurRunner, **options), "", ""), scene, step, cap)
    if trace.failure:
        raise RuntimeError(f"{scene.name} at {step} s: {trace.failure}")
    return trace.positions, trace.cpu / trace.simulated


def load() -> dict[str, list[dict[str, Any]]]:
    """By ensemble, for every member its `path` and the linearised variant's `distance` (by window, m)."""
    data = read_json(FILE)["members"]
    return {name: [{**m, "path": np.array(m["path"])} for m in members] for name, members in data.items()}


def main() -> None:
    """Makes the references of those that are named, or of all."""
    data: dict[str, Any] = read_json(FILE, {"members": {}})
    data["meta"] = {
        "what": "trunk x, y, z, m, every 0.1 s",
        "made_by": "this project's Newton variant at 0.05 ms, rocks at 0.1 ms",
        "distance": "of the linearised variant at the same step, RMS, m",
    }
    for ensemble in ensembles():
        if not ensemble.has_reference or (sys.argv[1:] and ensemble.name not in sys.argv[1:]):
            continue
        rows = []
        for scene in ensemble.members:
            path, _ = drive(scene, ensemble.finest, variant="newton")
            other, _ = drive(scene, ensemble.finest)
            rows.append({"distance": ensemble.errors(other, path), "path": np.round(path, 7).tolist()})
            print(ensemble.name, len(rows), rows[-1]["distance"], flush=True)  # noqa: T201 - minutes pass
        data["members"][ensemble.name] = rows
        FILE.write_text(json.dumps(data) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
