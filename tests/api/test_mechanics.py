"""`rover_gym.mechanics`: the public face of the compiled module."""

import pickle
import pydoc

import pytest

import rover_gym
from rover_gym import _core, mechanics


def test_it_offers_all_that_is_compiled() -> None:
    assert set(mechanics.__all__) == {name for name in vars(_core) if not name.startswith("_")} | {
        "__version__",
        "Terrain",
    }


@pytest.mark.parametrize("name", [name for name in mechanics.__all__ if isinstance(getattr(mechanics, name), type)])
def test_a_class_says_where_it_is_found(name: str) -> None:
    found = getattr(mechanics, name)
    assert (found.__module__, found.__qualname__) == ("rover_gym.mechanics", name)
    assert pickle.loads(pickle.dumps(found)) is found  # noqa: S301 - our own
    title = pydoc.plain(pydoc.render_doc(found)).splitlines()[0]
    assert title == f"Python Library Documentation: class {name} in module rover_gym.mechanics"


def test_what_most_programs_need_is_in_the_package_itself() -> None:
    shared = set(rover_gym.__all__) & set(mechanics.__all__)
    assert {"Simulation", "RoverModel", "Plane", "SphereField", "RoverGymError", "solve_friction_contact"} <= shared
    for name in shared:
        assert getattr(rover_gym, name) is getattr(mechanics, name)
