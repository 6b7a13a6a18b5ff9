"""All regimes, by name and in the order of the table."""

from torture import damage, drives, faults, flat, law, learning, on_purpose

REGIMES = [*learning.REGIMES, *drives.REGIMES, *flat.REGIMES, *law.REGIMES, *damage.REGIMES, *faults.REGIMES]
BY_NAME = {regime.name: regime for regime in [*REGIMES, *on_purpose.REGIMES]}
