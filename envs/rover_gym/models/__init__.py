"""Models by name or file: import and export of URDF and MJCF, and checks of a model on level ground.

The module `model_files` implements `RoverModel.from_file`, `from_urdf`, `from_mjcf`, `to_file`, `to_urdf` and
`to_mjcf`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
