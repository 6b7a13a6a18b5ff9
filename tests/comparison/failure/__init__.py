"""Scenes on which methods fail, each with its expected value: `bodies` for law and solver, `rover` for the rover, `peers`."""
