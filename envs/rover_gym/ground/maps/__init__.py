"""Maps and meshes of the ground: from files, or generated from a seed.

These functions return arrays; `HeightField.from_file`, `HeightField.fractal`, `TriangleMesh.from_file` and
`SphereField.from_file`, in `terrain_files`, make terrains of them.
"""

import rover_gym.ground.maps.terrain_files  # noqa: F401 - methods of the terrains
from rover_gym.ground.maps.fractal import fractal_map
from rover_gym.ground.maps.map_files import read_map, read_mesh

__all__ = ["fractal_map", "read_map", "read_mesh"]
