"""A drum or a silo around balls as a recording stores it."""

from __future__ import annotations

from typing import Any

from rover_gym.mechanics import Drum, Silo

LARGEST = 1e9  # m or rad/s


def stored_vessel(vessel: Drum | Silo | None) -> dict[str, Any] | None:
    """A vessel as JSON holds it; None for none."""
    if vessel is None:
        return None
    if isinstance(vessel, Drum):
        sizes = {"radius": vessel.radius, "length": vessel.length, "rate": vessel.rate}
        return {"kind": "drum", **sizes, "centre": list(vessel.centre)}
    return {
        "kind": "silo",
        "radius": vessel.radius,
        "floor": vessel.floor,
        "hole": vessel.hole,
        "axis": list(vessel.axis),
    }


def checked_vessel(vessel: Any) -> dict[str, Any] | None:
    """A vessel as a recording stores it; None for none.

    Raises:
        ValueError: It is no vessel; so do TypeError and KeyError.
    """
    if vessel is None:
        return None
    numbers = {"drum": ("radius", "length", "rate"), "silo": ("radius", "hole")}[vessel["kind"]]
    result: dict[str, Any] = {"kind": str(vessel["kind"]), **{name: float(vessel[name]) for name in numbers}}
    if result["kind"] == "drum":
        result["centre"] = [float(value) for value in vessel["centre"]]
    else:
        result["axis"] = [float(value) for value in vessel["axis"]]
        result["floor"] = None if vessel["floor"] is None else float(vessel["floor"])
    sizes = [value for value in result.values() if isinstance(value, float)]
    if not all(abs(value) <= LARGEST for value in sizes):
        raise ValueError("a number is not finite or too large")
    return result
