"""Makes the reference paths of the chart: `python -m comparison.references` (ten minutes).

Flat drive: Pinocchio's loop at 1 and 0.5 ms, extrapolated to a step of 0; it shares no code with this project's
dynamics, contact geometry or solver. Rug and rocks: this project's Newton variant at 0.05 ms. Each file says how far
the other of the two is away.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from reports import read_json

from comparison.peers import ours
from comparison.run import run
from comparison.scene import Array, RoverScene, distance
from comparison.scenes import flat_drive, rocks, rug

FOLDER = Path(__file__).parent / "references"
FINEST = 5e-5  # s
NO_CAP = 3600.0  # s


def load(name: str) -> Array:
    """(n, 2 or 3) reference path of a scene, m."""
    return np.array(read_json(FOLDER / f"{name}.json")["path"])


def _ours(scene: RoverScene, step: float = FINEST) -> Array:
    newton = next(v for v in ours.VARIANTS if v.name == "newton")
    return run(newton, scene, step, NO_CAP).positions


def _save(name: str, path: Array, meta: dict[str, Any]) -> None:
    data = {"meta": meta, "path": np.round(path, 8).tolist()}
    (FOLDER / f"{name}.json").write_text(json.dumps(data) + "\n", encoding="utf-8")


def make_flat_drive() -> None:
    """The flat drive's path in x and z since the end of the rest."""
    scene = flat_drive.scene()
    from comparison.peers import pinocchio_admm  # noqa: PLC0415 - only who makes references needs the peer

    coarse, fine = (flat_drive.driven(run(pinocchio_admm.VARIANTS[0], scene, step, NO_CAP)) for step in (1e-3, 5e-4))
    path = 2.0 * fine - coarse
    own = _ours(scene)[:, [0, 2]]
    first = round(flat_drive.REST / 0.1)
    away = distance(own[first:] - own[first], path)
    _save(
        "flat_drive",
        path,
        {
            "what": "trunk x and z since the end of the rest, m, every 0.1 s",
            "made_by": "Pinocchio and its ADMM solver at 1 and 0.5 ms, Richardson extrapolation to a step of 0",
            "rms_distance_of_our_newton_variant_at_0.05_ms_m": away,
        },
    )


def make_path(scene: RoverScene, peer_step: float = 1e-3) -> None:
    """The trunk's path of a scene, from this project at the finest step."""
    from comparison.peers import pinocchio_admm  # noqa: PLC0415 - as above

    path = _ours(scene)
    other = run(pinocchio_admm.VARIANTS[0], scene, peer_step, NO_CAP).positions
    _save(
        scene.name,
        path,
        {
            "what": "trunk x, y, z, m, every 0.1 s",
            "made_by": "this project's Newton variant at 0.05 ms",
            "rms_distance_of_ours_at_0.1_ms_m": distance(_ours(scene, 1e-4), path),
            f"rms_distance_of_Pinocchio_ADMM_at_{peer_step * 1e3:g}_ms_m": distance(other, path),
        },
    )


if __name__ == "__main__":
    wanted = sys.argv[1:] or ["flat_drive", "rug", "rocks"]
    if "flat_drive" in wanted:
        make_flat_drive()
    if "rug" in wanted:
        make_path(rug.scene())
    if "rocks" in wanted:
        make_path(rocks.scene())
