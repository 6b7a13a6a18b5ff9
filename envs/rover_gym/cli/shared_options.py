"""Options that several commands share, declared once as a dataclass."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any, get_type_hints


def takes(kind: type[Any], **defaults: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Makes a command take the fields of a dataclass as options, and gives it an instance as its first argument.

    Args:
        kind: The dataclass, whose fields are annotated as options.
        **defaults: Defaults of this command in the place of the dataclass's.
    """
    shared = get_type_hints(kind, include_extras=True)

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(command).parameters.values())[1:]
        given = {field.name: defaults.get(field.name, field.default) for field in fields(kind)}
        unknown = defaults.keys() - given.keys()
        assert not unknown, f"{kind.__name__} has no {sorted(unknown)}"  # noqa: S101 - a mistake in this package
        added = [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if value is MISSING else value,
                annotation=shared[name],
            )
            for name, value in given.items()
        ]

        @functools.wraps(command)
        def called(**options: Any) -> None:
            command(kind(**{name: options.pop(name) for name in given}), **options)

        hints = get_type_hints(command, include_extras=True)
        hints.pop(next(iter(inspect.signature(command).parameters)))
        called.__annotations__ = hints | shared
        called.__signature__ = inspect.Signature([*own, *added])  # type: ignore[attr-defined]
        return called

    return decorate
