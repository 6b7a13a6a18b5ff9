"""Methods of compiled classes that a room of the package defines, imported when one is first used."""

from importlib import import_module
from typing import Any


class Deferred:
    """A method until it is first used: its module is imported, and sets the method itself.

    Args:
        module: Full name of the module.
        name: Name of the method.
    """

    def __init__(self, module: str, name: str) -> None:
        self._module, self._name = module, name

    def __get__(self, instance: object, owner: type) -> Any:
        import_module(self._module)
        return getattr(owner if instance is None else instance, self._name)


def defer(cls: type, module: str, *names: str) -> None:
    """Lets a module define methods of a class that it sets when it is imported."""
    for name in names:
        setattr(cls, name, Deferred(module, name))
