"""How an episode ended, in words."""

WORDS = {
    "goal": "reached the goal",
    "time": "ran out of time",
    "roll_over": "rolled over",
    "high_centred": "got stuck on its belly",
    "battery": "emptied its battery",
    "step_failed": "could not be simulated further",
}


def outcome_words(end: str) -> str:
    """The end of an episode, as `Episode.end` and a recording's `outcome` name it, in words."""
    return WORDS.get(end, end.replace("_", " "))
