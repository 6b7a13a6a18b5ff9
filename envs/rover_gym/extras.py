"""Optional packages: imported where they are needed; one that is missing names the extra that brings it."""

from importlib import import_module
from typing import Any


class MissingExtraError(ImportError):
    """A command needs packages that the base installation does not bring."""

    def __init__(self, package: str, extra: str) -> None:
        """Names the package that is missing and the extra that brings it."""
        super().__init__(f"{package} is not installed: pip install 'rover-gym[{extra}]'", name=package)


def require(package: str, extra: str) -> Any:
    """Imports a package.

    Args:
        package: Its name for `import`.
        extra: The extra of rover-gym that brings it.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise MissingExtraError(package.partition(".")[0], extra) from error
