"""Entry points of the environments of this room, which take `sensors` as `Rover-v0` does."""

from functools import partial

from rover_gym.envs.sensors.sensor_suite import make_rover
from rover_gym.envs.tasks.arcs_env import RoverArcsEnv, RoverArcsVectorEnv
from rover_gym.envs.tasks.command_env import RoverCommandEnv, RoverCommandVectorEnv
from rover_gym.envs.tasks.goal_env import RoverGoalEnv, RoverGoalVectorEnv
from rover_gym.envs.tasks.trap_env import RoverTrapEnv, RoverTrapVectorEnv
from rover_gym.envs.vector.sensed_vector import make_rover_vector

make_arcs_rover = partial(make_rover, make=RoverArcsEnv)
make_command_rover = partial(make_rover, make=RoverCommandEnv)
make_goal_rover = partial(make_rover, make=RoverGoalEnv)
make_trap_rover = partial(make_rover, make=RoverTrapEnv)

make_arcs_vector = partial(make_rover_vector, make=RoverArcsVectorEnv)
make_command_vector = partial(make_rover_vector, make=RoverCommandVectorEnv)
make_goal_vector = partial(make_rover_vector, make=RoverGoalVectorEnv)
make_trap_vector = partial(make_rover_vector, make=RoverTrapVectorEnv)

for maker in (make_arcs_rover, make_command_rover, make_goal_rover, make_trap_rover):
    maker.metadata = make_rover.metadata  # type: ignore[attr-defined] # what Gymnasium asks of an entry point
