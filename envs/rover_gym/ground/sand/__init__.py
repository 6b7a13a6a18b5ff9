"""Wheels on sand: soils, a virtual test bed for one wheel, and fits to measurements."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
