"""The campaign that tries to break everything: random scenes, damaged files and faults, seeded: `make torture`."""
