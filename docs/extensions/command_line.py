"""The page of the command line: every command with its arguments and options as tables, from the command itself."""

import re
from collections.abc import Iterator
from typing import Any

import typer

from rover_gym.cli import app as rover

INTRODUCTION = """# The command line

The same text as `rover --help` and `rover COMMAND --help`.
"""


def commands(command: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    """A command, then those below it in the order of its help."""
    yield path, command
    for name, below in getattr(command, "commands", {}).items():
        if not below.hidden:
            yield from commands(below, (*path, name))


def cell(text: str) -> str:
    """A text in a cell of a table."""
    return re.sub(r"\s+", " ", text).replace("|", r"\|").strip()


def row(parameter: Any, context: Any) -> tuple[str, str]:
    """How a parameter is written, and what it means, with its default and range."""
    written, text = parameter.get_help_record(context)
    names, _, value = cell(written).partition(" <")
    meaning, _, facts = text.rstrip("]").partition("  [")
    for fact in sorted(filter(None, facts.split("; ")), key=lambda fact: fact.startswith("default")):
        if fact.startswith("default: "):
            meaning += f" Default: `{fact.removeprefix('default: ')}`."
        else:
            meaning = f"{meaning.rstrip('.')} ({fact.replace('<=', ' ≤ ').strip()})."
    return f"`{names}`" + (f" {value.rstrip('>')}" if value else ""), cell(meaning)


def table(head: tuple[str, str], rows: list[tuple[str, str]]) -> str:
    """A table in Markdown."""
    lines = [head, ("---", "---"), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def section(path: tuple[str, ...], command: Any) -> str:
    """A command: usage, what it does, its arguments and options, or the commands below it."""
    context = typer.Context(command, info_name=" ".join(path))
    usage = " ".join([*path, *command.collect_usage_pieces(context)])
    parts = [f"{'#' * min(len(path), 3)}# `{' '.join(path)}`", f"```console\n{usage}\n```", command.help or ""]
    below = [one for one in getattr(command, "commands", {}).values() if not one.hidden]
    if below:
        parts.append(table(("command", "what it does"), [(f"`{one.name}`", cell(summary(one))) for one in below]))
    for title, kind in (("argument", "argument"), ("option", "option")):
        listed = [one for one in command.params if one.param_type_name == kind and not getattr(one, "hidden", False)]
        if listed:
            parts.append(table((title, "meaning"), [row(one, context) for one in listed]))
    if command.epilog:
        parts.append(command.epilog)
    return "\n\n".join(part for part in parts if part)


def summary(command: Any) -> str:
    """The first paragraph of a command's help."""
    return (command.help or "").split("\n\n")[0]


def page() -> str:
    """The whole page, in Markdown."""
    listed = commands(typer.main.get_command(rover), ("rover",))
    return "\n\n".join([INTRODUCTION, *(section(path, command) for path, command in listed)]) + "\n"
