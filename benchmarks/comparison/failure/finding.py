"""Result of a check."""

from dataclasses import dataclass


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
