"""Scenes on which methods fail, each with its expected value: `bodies` for law and solver, `rover`, and `peers`."""
