"""Driving a rover by planning in the simulator itself (`docs/policies.md`).

`FieldPlan` computes the cost-to-go over a whole field, `Futures` simulates copies of the rover under many command
sequences, and `PlannerPolicy` chooses among them. `rover_gym.economy` plans simulations.
"""

from rover_gym.planning.field_plan import FieldPlan
from rover_gym.planning.futures import Ends, Futures
from rover_gym.planning.planner_policy import PlannerOptions, PlannerPolicy

__all__ = ["Ends", "FieldPlan", "Futures", "PlannerOptions", "PlannerPolicy"]
