"""All regimes, by name and in the order of the table."""

from torture import drives, flat, law, learning, on_purpose

REGIMES = [*learning.REGIMES, *drives.REGIMES, *flat.REGIMES, *law.REGIMES]
BY_NAME = {regime.name: regime for regime in [*REGIMES, *on_purpose.REGIMES]}
