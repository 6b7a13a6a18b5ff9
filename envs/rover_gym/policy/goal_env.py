"""`RoverGoal-v0`: `Dict` observations for hindsight replay. The class docstring is the card."""

from typing import Any, Literal

from rover_gym.env.rover_env import RoverEnv
from rover_gym.policy.command_env import RoverCommandEnv
from rover_gym.policy.goal_observation import GoalObservation


class RoverGoalEnv(GoalObservation):
    """Drive the rover of `RoverCommand-v0` to a goal that can be replaced in hindsight.

    A `GoalObservation` around a `RoverCommandEnv`, as one environment with the interface of Gymnasium-Robotics'
    `GoalEnv`: `compute_reward`, `compute_terminated` and `compute_truncated` take goals `(..., 2)`. Action, ends and
    info are those of `RoverCommand-v0`.

    ## Observation

    | key           | space                    | meaning                                                              |
    |---------------|--------------------------|----------------------------------------------------------------------|
    | observation   | `Box((size,), float32)`  | the features without the goal; cosine and sine of the heading        |
    | achieved_goal | `Box((2,), float64)`     | x and z of the trunk's origin on the map, m                          |
    | desired_goal  | `Box((2,), float64)`     | x and z of the goal, m                                               |

    ## Reward

    `compute_reward(achieved_goal, desired_goal, info)`: with `reward_type="sparse"` 1 within `goal_tolerance` of the
    goal, else 0; with `"dense"` `exp(-d)` with the distance d, m.

    ## Arguments

    Those of `RoverCommand-v0`, where `waypoints` must be 1, and in addition:

    | name        | default  | meaning               |
    |-------------|----------|-----------------------|
    | reward_type | "sparse" | "sparse" or "dense"   |

    ## Version history

    - v0: numbers may change until the first release.
    """

    #: As of the rover's environment.
    metadata = RoverEnv.metadata

    def __init__(self, *, reward_type: Literal["sparse", "dense"] = "sparse", **arguments: Any) -> None:
        rover = RoverCommandEnv(**arguments)
        super().__init__(rover, reward_type)
        self.metadata = rover.metadata
