"""Several rovers in one simulation: PettingZoo's parallel interface, and a vector of scenes for stable-baselines3.

`rover_gym.envs.several.sb3_rovers` has the vector for stable-baselines3, which it imports.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
