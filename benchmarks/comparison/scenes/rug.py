"""The report's rug: 1250 fixed spheres under the rover, gravity 0.0981 m/s², the first 10 s.

The rover of the report's runs (wheels of radius 0.30 m, 880 kg) is dropped on the rug and driven with 0.4 N m a wheel.
Restitution is 0, since no peer has Newton's; the rest is section 6.2 of the report. Reference: this project's Newton
variant at a step of 0.05 ms.
"""

import numpy as np

from comparison.scene import Array, Phase, RoverScene, Trace, distance
from rover_gym import SphereField
from rover_gym.scenes import sphere_rug
from rover_gym.scenes.report_scenes import FRONT_STEERING, GRAVITY, report_model


def scene() -> RoverScene:
    """The rug."""
    model = report_model()
    q = np.zeros(model.nq)
    q[:3] = sphere_rug.start
    q[model.steering_joint_indices[:2]] = FRONT_STEERING
    field = SphereField.rug()
    steering = (FRONT_STEERING, FRONT_STEERING, 0.0, 0.0, 0.0, 0.0)
    return RoverScene(
        name="rug",
        title="10 s on the report's rug of 1250 spheres",
        machine=model.to_dict(),
        q=q,
        phases=(Phase(10.0, steering, (sphere_rug.wheel_torque,) * 6),),
        normal=None,
        spheres=np.column_stack([field.centres, field.radii]),
        friction=sphere_rug.friction,
        gravity=GRAVITY,
        thin_wheels=True,
    )


def error(trace: Trace, reference: Array) -> float:
    """Root mean square distance of the trunk's path from the reference, m."""
    return distance(trace.positions, reference)
