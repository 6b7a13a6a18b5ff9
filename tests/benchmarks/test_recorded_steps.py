"""Steps are taken anew from recorded states, and a change of the scheme is found."""

from comparison.recorded_steps import compare, drives, record
from rich.console import Console

SILENT = Console(quiet=True)


def test_steps_taken_anew_are_the_same_and_a_changed_scheme_is_found() -> None:
    every = drives()
    assert len(every) >= 60
    names = ("rover, rocks", "four-bar with dry joints", "disks", "joined machines 0")
    played = {name: every[name] for name in names}
    recorded = record(played, SILENT)
    assert compare(played, recorded, SILENT) == 0
    engine, _ = played["rover, rocks"]
    other = {"rover, rocks": (engine, every["rover among rocks, theta 0.6"][1])}
    assert compare(other, recorded, SILENT) > 0
