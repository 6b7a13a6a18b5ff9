"""Maps and meshes of the ground: from files, and made by a seed.

These functions return arrays; `HeightField.from_file`, `HeightField.fractal` and `TriangleMesh.from_file` make terrains
of them.
"""

from rover_gym.maps.fractal import fractal_map
from rover_gym.maps.map_files import read_map, read_mesh

__all__ = ["fractal_map", "read_map", "read_mesh"]
