"""Driving a rover by planning in the simulator itself (`docs/policies.md`).

`FieldPlan` knows the way over a whole field, `Futures` drives copies of the rover by many sequences of commands, and
`PlannerPolicy` chooses among them. `rover_gym.economy` plans simulations.
"""

from rover_gym.planning.field_plan import FieldPlan
from rover_gym.planning.futures import Ends, Futures
from rover_gym.planning.planner_policy import PlannerOptions, PlannerPolicy

__all__ = ["Ends", "FieldPlan", "Futures", "PlannerOptions", "PlannerPolicy"]
