"""The compiled core: models, grounds, simulations and the contact solver.

Everything here is written in Rust and re-exported from the private module `rover_gym._core`; import it from here.
Lengths are in m, masses in kg, times in s, angles in rad. The world has x forward, y up and z to the right; wheels are
listed FL, FR, ML, BL, MR, BR.
"""

from rover_gym import _core
from rover_gym._core import *  # noqa: F403 - every public name, as `_core.pyi` lists them

__all__ = _core.__all__
