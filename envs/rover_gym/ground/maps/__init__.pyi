from .fractal import fractal_map
from .map_files import read_map, read_mesh

__all__ = [
    "fractal_map",
    "read_map",
    "read_mesh",
]
