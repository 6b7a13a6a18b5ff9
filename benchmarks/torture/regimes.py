"""All regimes, by name and in the order of the table."""

from torture import damage, doors, drives, faults, flat, joined, law, learning, maps, on_purpose, round_trips, sizes

PAGES = (learning, drives, joined, flat, law, round_trips, sizes, damage, doors, maps, faults)
REGIMES = [regime for page in PAGES for regime in page.REGIMES]
BY_NAME = {regime.name: regime for regime in [*REGIMES, *on_purpose.REGIMES]}
