"""Policies that do without the height scan: the PD baseline, the one for sand, random actions."""
