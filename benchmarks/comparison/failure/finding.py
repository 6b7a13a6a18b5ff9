"""Result of a check, and scenes that give results for several methods."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any


@dataclass(frozen=True)
class Finding:
    """One number of one scene for one method.

    Attributes:
        scene: Short name.
        expected: In words, with its source or closed form.
        method: Variant, solver or engine.
        number: What was measured: an error, 0 at best, unless `expected` says otherwise.
        limit: The scene holds where `number` is not above it.
        unit: Of both.
        how: How it fails, or a remark.
    """

    scene: str
    expected: str
    method: str
    number: float
    limit: float
    unit: str
    how: str = ""

    @property
    def holds(self) -> bool:
        """Whether the number is within its limit; a number that is not finite is not."""
        return bool(self.number <= self.limit)


#: A finding without its method: scene, expected, number, limit, unit and perhaps how.
Row = tuple[Any, ...]
Scene = Callable[..., Iterator[Finding]]


def for_each(
    methods: Mapping[str, Any] | None = None, beside: Mapping[str, Any] | None = None
) -> Callable[[Callable[..., Iterator[Row]]], Scene]:
    """Makes a scene for one method a scene for several.

    Args:
        methods: By name, where the caller gives none.
        beside: Further ones, always.
    """

    def decorate(scene: Callable[..., Iterator[Row]]) -> Scene:
        @wraps(scene)
        def of_each(given: Mapping[str, Any] | None = methods, **options: Any) -> Iterator[Finding]:
            for name, method in {**(given or {}), **(beside or {})}.items():
                for title, expected, *rest in scene(method, **options):
                    yield Finding(title, expected, name, *rest)

        return of_each

    return decorate
