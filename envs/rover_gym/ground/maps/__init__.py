"""Maps and meshes of the ground: from files, or generated from a seed.

`read_map`, `read_mesh` and `fractal_map` return arrays; `HeightField.from_file`, `HeightField.fractal`,
`TriangleMesh.from_file` and `SphereField.from_file`, in `terrain_files`, make terrains of them. `patched_map` cuts a
height field into patches.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
