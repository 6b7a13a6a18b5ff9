"""Docstrings in Google's style as the manual prints them.

A field that its class describes under `Attributes:` is printed where the field stands, once. A docstring of a property
or a constant is prose from its first word: what stands before a colon is no type.
"""

import inspect
import re
from collections.abc import Collection
from typing import Any

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

from extensions.cards import CARDS
from extensions.compiled import is_compiled

BEFORE_NAPOLEON, AFTER_NAPOLEON = 400, 600


def split_attributes(lines: list[str], heading: str = "Attributes:") -> tuple[list[str], dict[str, list[str]]]:
    """A class's docstring without one of its sections, and the lines about each name of that section."""
    if heading not in lines:
        return lines, {}
    begin = lines.index(heading)
    end = next((i for i in range(begin + 1, len(lines)) if lines[i] and not lines[i].startswith(" ")), len(lines))
    fields: dict[str, list[str]] = {}
    name = ""
    for line in lines[begin + 1 : end]:
        if entry := re.fullmatch(r" {4}(\w+): (.*)", line):
            name = entry[1]
            fields[name] = [entry[2]]
        elif name:
            fields[name].append(line.removeprefix(" " * 8))
    return lines[:begin] + lines[end:], fields


def speaks_for_itself(member: Any) -> bool:
    """Whether a property or a routine has a docstring of its own."""
    text = member.__doc__ if inspect.isdatadescriptor(member) or inspect.isroutine(member) else None
    return bool(text) and not text.startswith("Alias for field number")  # a named tuple's own word


def describe_fields(_app: Sphinx, _what: str, _name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Moves what a class says of its fields to the fields, where Sphinx looks for comments, if each gets an entry."""
    if not isinstance(obj, type) or isinstance(getattr(options, "members", None), Collection | None):
        return  # only some members are printed, or none
    rest, fields = split_attributes(lines)
    own = {*vars(obj), *vars(obj).get("__annotations__", {})}
    inherited = {name for base in obj.__mro__[1:] for name in vars(base).get("__annotations__", {})}
    is_moved = set(fields) <= own | inherited
    _, arguments = split_attributes(lines, "Args:")  # those of a data class are its fields
    told = {**arguments, **(fields if is_moved else {})}
    told = {name: text for name, text in told.items() if name in own and not speaks_for_itself(vars(obj).get(name))}
    if told:
        analyzer = ModuleAnalyzer.for_module(obj.__module__)
        analyzer.analyze()
        for field, text in told.items():
            analyzer.attr_docs.setdefault((obj.__qualname__, field), [*text, ""])
    if is_moved:
        lines[:] = rest


def print_values_as_prose(_app: Sphinx, what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    """Begins the docstring of a value with an empty comment, in which Napoleon finds no type before a colon."""
    if what in ("attribute", "property", "data") and any(lines):
        lines[:0] = ["..", ""]


def shorten_cards(_app: Sphinx, _what: str, _name: str, obj: object, _options: Any, lines: list[str]) -> None:
    """An environment's card appears as its first line, since the whole has its own page."""
    for page, environment in CARDS.items():
        if obj is environment:
            lines[1:] = ["", f"Action, observation, reward and arguments: :doc:`{page} </_generated/{page.lower()}>`."]


def escape_bars(_app: Sphinx, _what: str, _name: str, _obj: object, _options: Any, lines: list[str]) -> None:
    """A bar is a norm, no substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def skip_offered_again(_app: Sphinx, what: str, _name: str, obj: object, _skip: bool, _options: Any) -> bool | None:
    """A room that offers what is compiled does not document it a second time."""
    return True if what == "module" and is_compiled(obj) else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    for listener in (describe_fields, print_values_as_prose, shorten_cards):
        app.connect("autodoc-process-docstring", listener, priority=BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", escape_bars, priority=AFTER_NAPOLEON)
    app.connect("autodoc-skip-member", skip_offered_again)
    return {"parallel_read_safe": True}
