"""The environment `Rover-v0`: its card and arguments, its task, and its control period."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
