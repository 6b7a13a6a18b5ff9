"""Policies: the PD baseline, the scan planner, trained networks, planning in the simulator; their evaluation."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
