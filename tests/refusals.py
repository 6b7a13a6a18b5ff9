"""Errors that name the field of what they refuse."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

Errors = type[Exception] | tuple[type[Exception], ...]


@contextmanager
def refused(error: Errors, field: str | None, match: str | None = None) -> Iterator[pytest.ExceptionInfo[Exception]]:
    """The block must raise `error` for this field, with a message that matches."""
    with pytest.raises(error, match=match) as caught:
        yield caught
    assert getattr(caught.value, "field", None) == field
