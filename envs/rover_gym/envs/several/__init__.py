"""Several rovers in one simulation: PettingZoo's parallel interface, and a vector of scenes for stable-baselines3.

The classes are in `rover_gym.envs.several.pettingzoo_env` and `rover_gym.envs.several.sb3_rovers`, which import
PettingZoo and stable-baselines3.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
