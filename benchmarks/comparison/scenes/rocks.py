"""Seven seconds over a field of small rocks on a plane: 111 spheres of up to 15 cm, half buried.

Wheels of radius 0.20 m, the built-in steering gains, 1 s of rest, then 6 s with 20 N m a wheel. Wheels climb, slip and
drop; the path still converges. Reference: this project's Newton variant at a step of 0.05 ms.
"""

import numpy as np

from comparison.scene import Phase, RoverScene, rigid
from comparison.scenes.rug import error
from rover_gym import SphereField

__all__ = ["error", "scene"]

SEED = 2


def scene() -> RoverScene:
    """The field and the drive over it."""
    q = np.zeros(21)
    q[1] = 0.45
    field = SphereField.rocks(0.05, (-2.0, -2.0, 8.0, 2.0), SEED, max_diameter=0.15, burial=0.5)
    return RoverScene(
        name="rocks",
        title="7 s over small rocks",
        machine=rigid(contact_radius=0.20),
        q=q,
        phases=(Phase(1.0), Phase(6.0, torques=(20.0,) * 6)),
        spheres=np.column_stack([field.centres, field.radii]),
        thin_wheels=True,
    )
