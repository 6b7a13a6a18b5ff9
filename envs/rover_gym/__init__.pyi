from .core import (
    BusyError as BusyError,
    CommandError as CommandError,
    HeightField as HeightField,
    InternalError as InternalError,
    ModelError as ModelError,
    Motor as Motor,
    OptionError as OptionError,
    Plane as Plane,
    ProblemError as ProblemError,
    RoverGymError as RoverGymError,
    RoverModel as RoverModel,
    Simulation as Simulation,
    Snapshot as Snapshot,
    SphereField as SphereField,
    StateError as StateError,
    StepError as StepError,
    Terrain as Terrain,
    TerrainError as TerrainError,
    TriangleMesh as TriangleMesh,
    Union as Union,
    __version__ as __version__,
    accuracy_options as accuracy_options,
    solve_friction_contact as solve_friction_contact,
)
from .drive.pd.pd_policy import PDPolicy as PDPolicy
from .envs.rover_env import RoverEnv as RoverEnv
from .envs.several.making import parallel_env as parallel_env
