"""`rover speed`: how fast a batch of rovers is here, and where its time goes."""

import json
from dataclasses import asdict
from enum import StrEnum
from typing import Annotated, Any

import typer

from rover_gym.cli.console import plain_errors, progress_bar
from rover_gym.vector.throughput import measure_speed


class SpeedTerrain(StrEnum):
    """What the rovers drive on."""

    plane = "plane"
    sphere_field = "sphere_field"


@plain_errors
def speed(
    num_envs: Annotated[int, typer.Option(min=1, max=100_000, help="Number of rovers.")] = 64,
    threads: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Threads that step them. Default: one per core.")
    ] = None,
    terrain: Annotated[
        SpeedTerrain, typer.Option(help="Flat ground, or rocks with a height scan.")
    ] = SpeedTerrain.plane,
    rounds: Annotated[int, typer.Option(min=1, max=1_000_000, help="Measurements of each; the fastest counts.")] = 200,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Step a batch of rovers with one thread and with several, and a SyncVectorEnv, and print how fast they are."""
    arguments: dict[str, Any] = {"terrain": terrain.value, "height_scan": terrain is SpeedTerrain.sphere_field}
    with progress_bar() as bar:
        task = bar.add_task("speed", total=rounds + 1, state=f"{num_envs} rovers")
        result = measure_speed(
            num_envs, threads, rounds=rounds, progress=lambda: bar.update(task, advance=1), **arguments
        )
    if as_json:
        derived = ("physics_share", "speed_up", "gain", "steps_per_second")
        typer.echo(json.dumps(asdict(result) | {name: getattr(result, name) for name in derived}, indent=2))
        return
    typer.echo(
        f"{result.num_envs} rovers, {result.threads} threads: {result.step * 1e6:.0f} us a step of the batch, "
        f"{result.steps_per_second:.0f} environment steps a second\n"
        f"  inside the physics    {result.physics_share:.1%}\n"
        f"  over one thread       {result.speed_up:.2f} times (physics)\n"
        f"  over SyncVectorEnv    {result.gain:.1f} times\n"
        f"  reset of one rover    {result.reset * 1e6:.0f} us"
    )
