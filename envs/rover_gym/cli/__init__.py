"""The console command `rover`."""

import sys
from typing import Annotated

import typer

from rover_gym.cli.benchmark_command import benchmark
from rover_gym.cli.console import DEBUG, one_line, say_first_steps
from rover_gym.cli.drive_command import drive
from rover_gym.cli.evaluate_command import evaluate
from rover_gym.cli.export_command import dataset, export
from rover_gym.cli.grains_command import grains, pit, rover as rover_on_bed, track
from rover_gym.cli.grains_lab_commands import plate, shear, wheel
from rover_gym.cli.live_command import live
from rover_gym.cli.model_command import model
from rover_gym.cli.planar_commands import planar
from rover_gym.cli.replay_command import plot, replay
from rover_gym.cli.report_command import report
from rover_gym.cli.ros_command import ros
from rover_gym.cli.sand_commands import sand
from rover_gym.cli.scene_command import scene
from rover_gym.cli.speed_command import speed
from rover_gym.cli.train_command import ManySeeds, train
from rover_gym.cli.usage import PlainUsage
from rover_gym.core import __version__

app = typer.Typer(
    rich_markup_mode=None,
    cls=PlainUsage,
    help="Drive a six-wheel Mars rover in a nonsmooth simulator.",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    epilog=f"Errors are one line; with {DEBUG}=1 in the environment they include a traceback.",
)

DRIVE = "Drive and watch"
POLICIES = "Policies"
WORLDS = "Rovers and grounds"
EXCHANGE = "Other programs"

for _command in (drive, live, replay, plot):
    app.command(rich_help_panel=DRIVE)(_command)
app.command(rich_help_panel=POLICIES)(evaluate)
app.command(rich_help_panel=POLICIES)(benchmark)
app.command(rich_help_panel=POLICIES, cls=ManySeeds)(train)
app.command(rich_help_panel=POLICIES)(speed)
app.add_typer(model, name="model", rich_help_panel=WORLDS)
app.command(rich_help_panel=WORLDS)(scene)
app.add_typer(sand, name="sand", rich_help_panel=WORLDS)
for _command in (rover_on_bed, track, pit, plate, shear, wheel):
    grains.command()(_command)
app.add_typer(grains, name="grains", rich_help_panel=WORLDS)
app.add_typer(planar, name="planar", rich_help_panel=WORLDS)
app.command(rich_help_panel=WORLDS)(report)
app.add_typer(export, name="export", rich_help_panel=EXCHANGE)
app.command(rich_help_panel=EXCHANGE)(dataset)
app.command(rich_help_panel=EXCHANGE)(ros)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rover-gym {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def rover(
    context: typer.Context,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Drive a six-wheel Mars rover in a nonsmooth simulator."""
    if context.invoked_subcommand is None:
        say_first_steps(context.command)


def main() -> None:
    """Entry point of the console command."""
    try:
        with one_line({}):
            app()
    except typer.Exit as end:
        sys.exit(end.exit_code)
