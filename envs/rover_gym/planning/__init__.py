"""Driving a rover by planning in the simulator itself (`docs/policies.md`).

`FieldPlan` computes the cost-to-go over a whole field, `Rollouts` simulates copies of the rover under many command
sequences, and `PlannerPolicy` chooses among them. `rover_gym.economy` plans simulations.
"""

from rover_gym.planning.field_plan import FieldPlan
from rover_gym.planning.planner_policy import PlannerOptions, PlannerPolicy
from rover_gym.planning.rollouts import Ends, Rollouts

__all__ = ["Ends", "FieldPlan", "PlannerOptions", "PlannerPolicy", "Rollouts"]
