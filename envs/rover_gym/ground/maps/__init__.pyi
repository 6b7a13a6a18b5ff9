from .fractal import fractal_map as fractal_map
from .map_files import read_map as read_map, read_mesh as read_mesh
from .patches import patched_map as patched_map
