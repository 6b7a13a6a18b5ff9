"""The table of what `rover_gym` itself offers, with links to the chapters."""

import inspect

import rover_gym
from extensions.compiled import is_compiled


def home(name: str) -> str:
    """The full name under which a chapter documents a name of `rover_gym`."""
    thing = getattr(rover_gym, name)
    module = str(getattr(thing, "__module__", ""))
    room = "core" if is_compiled(thing) or not module.startswith("rover_gym.") else module.split(".")[1]
    return f"rover_gym.{room}.{name}"


def first_sentence(name: str) -> str:
    """The first line of a docstring."""
    return (inspect.getdoc(getattr(rover_gym, name)) or "").split("\n")[0].replace("|", r"\|")


def table() -> str:
    """The table, in Markdown."""
    things = {name: getattr(rover_gym, name) for name in rover_gym.__all__}
    names = [name for name, thing in things.items() if inspect.isclass(thing) or inspect.isroutine(thing)]
    rows = [f"| {{py:obj}}`{name} <{home(name)}>` | {first_sentence(name)} |" for name in names]
    return "\n".join(["| name | what it is |", "|---|---|", *rows]) + "\n"
