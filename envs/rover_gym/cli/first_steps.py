"""What `rover` alone says: the commands to try first."""

import typer

from rover_gym.mechanics import __version__

#: Commands that a newcomer can type in this order, with what they do.
FIRST_STEPS = (
    ("rover drive", "drive to a goal on flat ground, and tell how it went"),
    ("rover drive --difficulty 1 --policy scan --output runs/first", "find a way among rocks, and keep the run"),
    ("rover replay runs/first/episode-0.h5 --html runs/first/replay.html", "watch that run in the browser"),
    ("rover plot runs/first/episode-0.h5", "look at its path, wheel loads, slip and energy"),
)


def say_first_steps() -> None:
    """Prints the first steps, and where to go on."""
    typer.echo(f"rover-gym {__version__}: a six-wheel Mars rover in a nonsmooth simulator\n\nTry first:\n")
    for command, meaning in FIRST_STEPS:
        typer.echo(f"  {command}\n      {meaning}\n")
    typer.echo("Recording, replay and plots need the extra demo: pip install 'rover-gym[demo]'.")
    typer.echo("All commands: rover --help. Completion by the Tab key: rover --install-completion.")
