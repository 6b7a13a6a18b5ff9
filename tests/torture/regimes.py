"""All regimes, by name and in the order of the table."""

from torture import drives, flat, law, learning

REGIMES = [*learning.REGIMES, *drives.REGIMES, *flat.REGIMES, *law.REGIMES]
BY_NAME = {regime.name: regime for regime in REGIMES}
