"""`rover speed`: how fast a batch of rovers is here, and where the time of its environment goes."""

import datetime
import os
from dataclasses import asdict
from enum import StrEnum
from typing import Annotated, Any

import typer

from rover_gym.cli.console import AsJson, Results, plain_errors, progress_bar
from rover_gym.core import __version__
from rover_gym.envs.vector.throughput import ExploringSpeed, VectorSpeed, measure_exploring, measure_speed, processor

#: Steps of an environment for each round of the physics alone, which is as much work as ten.
_STEPS_A_ROUND = 20


class SpeedTerrain(StrEnum):
    """What the rovers drive on."""

    plane = "plane"
    rocks = "rocks"


@plain_errors
def speed(
    num_envs: Annotated[int, typer.Option(min=1, max=100_000, help="Number of rovers.")] = 64,
    threads: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Threads that step them. Default: one per core.")
    ] = None,
    terrain: Annotated[
        SpeedTerrain | None, typer.Option(help="Only flat ground, or only rocks (with a height scan). Default: both.")
    ] = None,
    torque: Annotated[float, typer.Option(min=0.0, max=1e3, help="Largest torque of exploring rovers, N m.")] = 60.0,
    rounds: Annotated[int, typer.Option(min=1, max=1_000_000, help="Steps of each environment that are timed.")] = 200,
    as_json: AsJson = False,
) -> None:
    """Measure how many rovers this machine simulates."""
    grounds = list(SpeedTerrain) if terrain is None else [terrain]
    exploring_rounds = -(-rounds // _STEPS_A_ROUND)
    measured: dict[str, tuple[ExploringSpeed, VectorSpeed]] = {}
    with progress_bar() as bar:
        task = bar.add_task("speed", total=len(grounds) * (rounds + exploring_rounds + 2), state=f"{num_envs} rovers")

        def advance() -> None:
            bar.update(task, advance=1)

        for ground in grounds:
            exploring = measure_exploring(
                num_envs, threads, ground=ground.value, torque=torque, rounds=exploring_rounds, progress=advance
            )
            arguments: dict[str, Any] = {"terrain": ground.value, "height_scan": ground is SpeedTerrain.rocks}
            measured[ground.value] = (
                exploring,
                measure_speed(num_envs, threads, rounds=rounds, progress=advance, **arguments),
            )
    first = next(iter(measured.values()))[0]
    machine = {
        "processor": processor(),
        "cores": os.cpu_count(),
        "instruction_set": first.instruction_set,
        "date": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "packages": {"rover-gym": __version__},
    }
    with Results(as_json=as_json) as results:
        results.add(machine=machine, grounds={name: _fields(*two) for name, two in measured.items()})
    if as_json:
        return
    typer.echo(f"{machine['processor']}, {machine['cores']} cores, {machine['instruction_set']}; {machine['date']}")
    typer.echo(f"rover-gym {__version__}; {num_envs} rovers, {first.threads} threads")
    for name, (exploring, environment) in measured.items():
        _print_exploring(name, exploring)
        _print_environment(environment)


def _fields(exploring: ExploringSpeed, environment: VectorSpeed) -> dict[str, Any]:
    derived = ("physics_share", "speed_up", "gain", "steps_per_second")
    return {
        "exploring": asdict(exploring) | {"simulated": exploring.simulated},
        "environment": asdict(environment) | {name: getattr(environment, name) for name in derived},
    }


def _print_exploring(name: str, result: ExploringSpeed) -> None:
    typer.echo(
        f"\n{name}: torques of up to {result.torque:g} N m and set-points redrawn every 10 steps of 5 ms\n"
        f"  {result.rover_steps:.0f} rover-steps/s, {result.simulated:.0f} simulated s/s\n"
        f"  a step of the batch: median {result.median * 1e6:.0f} us, 99.9% within {result.slow * 1e6:.0f} us, "
        f"largest {result.slowest * 1e6:.0f} us"
    )


def _print_environment(result: VectorSpeed) -> None:
    typer.echo(
        f"  environment: {result.step * 1e6:.0f} us a step of the batch, "
        f"{result.steps_per_second:.0f} environment steps a second\n"
        f"    inside the physics    {result.physics_share:.1%}\n"
        f"    over one thread       {result.speed_up:.2f} times (physics)\n"
        f"    over SyncVectorEnv    {result.gain:.1f} times\n"
        f"    reset of one rover    {result.reset * 1e6:.0f} us"
    )
