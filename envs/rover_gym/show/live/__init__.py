"""A rover that drives in real time behind a page in the browser; the loop runs without one, too."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
