"""Simulations made for a scene.

`plan` chooses the cheapest simulation that a scene permits: model, ground, time-stepping scheme and step size, each
with a reason. `inclined_plane` and `sphere_rug` are experiments of the report of 2010; a closed form exists for
`ball_on_slope`.

    >>> from rover_gym import Plane
    >>> from rover_gym.scenes import Scene, plan
    >>> straight = plan(Scene(Plane(), steered=False, equal_torques=True), accuracy="balanced")
    >>> straight.kind
    'planar'
    >>> rover = straight.rover()
    >>> rover.set_wheel_torques([15.0] * 6)
    >>> rover.step(200).is_converged
    True

A scene states what will never happen in it, and the plan leaves out only what that permits. A command that needs a part
left out is refused. `docs/economy.md` gives the error and the cost of each economy, and the command that measures them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
