"""Simulated sensors of the rover, as observations for policies and other programs (`docs/sensors.md`)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
