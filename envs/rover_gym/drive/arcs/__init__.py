"""Policies that choose among the planner's arcs by a network."""
