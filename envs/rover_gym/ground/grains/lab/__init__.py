"""The virtual laboratory: plate, shear and wheel tests on beds of balls, and laws of soft soil fitted to them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
