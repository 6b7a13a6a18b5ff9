"""Grains: beds of balls in space and of disks in the plane, scenes on them and in vessels, trials, recordings.

>>> from rover_gym.ground.grains import settled_balls
>>> bed = settled_balls(200, 0.2, 0.2, radius_min=0.009, radius_max=0.011)
>>> 0.02 < bed.surface < 0.04
True

>>> from rover_gym.ground.grains import rover_on_disks
>>> sim = rover_on_disks(count=222, layers=3)
>>> sim.set_torques([50.0, 50.0])
>>> sim.step(100).steps
100
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
