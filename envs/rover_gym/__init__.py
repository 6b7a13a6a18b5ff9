"""rover-gym: a nonsmooth simulator of a six-wheel Mars rover, with Gymnasium environments.

The package consists of the subpackages below. Each one may import those above it, never those below it:

    core             the compiled core: models, grounds, simulations, the contact solver; checks of arguments, files
    models           models from and to URDF and MJCF files
    ground           what a terrain is made of; maps, sand, grains
    record           runs in HDF5: recording and reading
    show.frames      images of a rover: frames and video
    scenes           simulations made for a scene: the cheapest that it permits, and the experiments of the 2010 report
    derivatives      products with the derivatives of trajectories, also in PyTorch and JAX
    identification   parameters of a recorded run, with their uncertainty
    envs             `Rover-v0` with its sensors and vectors, and what all environments share
    drive.commands   what policies see, and what turns their commands into actions
    drive.pd         policies that do without the height scan: the PD baseline, the one for sand
    drive.search     the cheapest way over a height scan, a map or a field
    drive.forecast   networks in files; what becomes of a rover on each arc
    drive.scan       the policy that plans over the height scan
    drive.arcs       policies that choose among its arcs by a network
    drive.planning   the policy that plans with the simulator itself
    drive            policies by name, their evaluation and benchmark
    envs.tasks       the environments with other actions or tasks
    learn            training with stable-baselines3
    show.replay      saved runs for the browser, VRML and glTF
    show.figures     figures of saved runs
    exports          runs, policies, simulations and contact problems for other programs
    show.live        a rover that is driven in the browser
    ros              a rover as a ROS 2 node
    cli              the command `rover`
"""

import lazy_loader

from rover_gym.core import HeightField, RoverModel, SphereField, Terrain, TriangleMesh
from rover_gym.core.deferred import defer
from rover_gym.envs.registration import register_environments

register_environments()

_METHODS = ("from_file", "from_urdf", "from_mjcf", "to_file", "to_urdf", "to_mjcf", "_opened")
defer(RoverModel, "rover_gym.models.model_files", *_METHODS)
for _cls, _names in (
    (SphereField, ["from_file"]),
    (HeightField, ["from_file", "fractal"]),
    (TriangleMesh, ["from_file"]),
    (Terrain, ["_opened"]),
):
    defer(_cls, "rover_gym.ground.maps.terrain_files", *_names)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
