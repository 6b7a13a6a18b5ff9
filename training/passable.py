"""Finds the share of fields that have a way, an upper bound for every policy.

    python training/passable.py --terrain hills --difficulty 1.5 --difficulty 2 --fields 100

A field has a way if a rover has crossed it. `foresight` and `scan` try each field once. `anywhere` tries it up to
`--tries` times, its arcs drawn with another seed each time. `PlannerPolicy`, which knows the field, tries `--planned`
times what is left. Nobody has a limit of time but `--patience`.

A field that nobody crossed may still have a way, so the share is a lower bound of the true one. More tries raise it.
"""

import json
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from rover_gym.cli.console import plain_errors, plain_table
from rover_gym.cli.options import BUILT_IN, ModelName, named_model
from rover_gym.drive import ArcNetworkPolicy, PlannerPolicy
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.evaluation import drive_all, wilson_interval
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER
from rover_gym.drive.named_policy import named_policy
from rover_gym.envs.rover_env import RoverEnv

#: Who tries once, before the others.
ONCE = ("foresight", "scan")


class Drawing(ArcNetworkPolicy):
    """`ArcNetworkPolicy` whose arcs are drawn from the network's probabilities."""

    def predict(self, observation: Any, state: Any = None, episode_start: Any = None) -> Any:  # type: ignore[override]
        """The action, as `ArcNetworkPolicy.predict` with `deterministic=False`."""
        return super().predict(observation, state, episode_start, deterministic=False)


def crossed(
    arguments: dict[str, Any],
    fields: list[int],
    model: Any,
    *,
    tries: int,
    planned: int,
    patience: float,
    say: Callable[[str], None] = lambda _line: None,
) -> dict[int, str]:
    """Who crossed each field first, by its seed; "" where nobody did. `say` takes a line for each try."""
    found: dict[int, str] = dict.fromkeys(fields, "")
    periods = round(patience * 20.0)

    def attempt(name: str, make: Any, needs: dict[str, Any]) -> None:
        left = [seed for seed, who in found.items() if not who]
        if left:
            drives = drive_all(make, left, arguments={**arguments, **needs}, max_episode_steps=periods)
            found.update({drive.seed: name for drive in drives if drive.success})
            say(f"{name}: {sum(map(bool, found.values()))} of {len(found)} fields crossed")

    for name in ONCE:
        policy = named_policy(name, model)
        attempt(name, policy.make, dict(policy.arguments))
    network = ArcNetwork.read(FOLDER / ANYWHERE / ARCS_FILE)
    needs = dict(named_policy(ANYWHERE, model).arguments)
    for k in range(tries):
        attempt(ANYWHERE, partial(Drawing, network=network, seed=k), needs)
    for seed in [seed for seed, who in found.items() if not who]:
        if any(plans_to_goal(arguments, seed, k, periods) for k in range(planned)):
            found[seed] = "planner"
    return found


def plans_to_goal(arguments: dict[str, Any], seed: int, k: int, periods: int) -> bool:
    """Whether `PlannerPolicy` with the k-th seed reaches the goal of a field."""
    env = RoverEnv(**arguments)
    observation, info = env.reset(seed=seed)
    planner = PlannerPolicy(env, seed=k, threads=1)
    terminated = False
    for _ in range(periods):
        action, _ = planner.predict(observation)
        observation, _, terminated, _, info = env.step(action)
        if terminated:
            break
    env.close()
    return bool(info["success"])


@plain_errors
def passable(
    terrain: Annotated[str, typer.Option(help="rocks or hills.")] = "rocks",
    difficulty: Annotated[list[float] | None, typer.Option(help="Of the ground; repeat it for several.")] = None,
    model: ModelName = BUILT_IN,
    fields: Annotated[int, typer.Option(min=1, help="Number of fields.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first field.")] = 3_000_000,
    tries: Annotated[int, typer.Option(min=0, help="Of the network.")] = 30,
    planned: Annotated[int, typer.Option(min=0, help="Tries of the planner that knows the field.")] = 1,
    patience: Annotated[float, typer.Option(min=1.0, help="Longest episode, s.")] = 180.0,
    output: Annotated[Path | None, typer.Option(dir_okay=False, help="JSON file of who crossed what.")] = None,
) -> None:
    """Print the share of fields that have a way."""
    rover = named_model(model)
    table = [("difficulty", "fields with a way", "95% interval", "crossed first by")]
    crossings: dict[str, dict[int, str]] = {}
    say = partial(typer.echo, err=True)
    for level in difficulty or [1.0, 1.5, 2.0]:
        arguments: dict[str, Any] = {"terrain": terrain, "difficulty": level}
        arguments |= {} if model == BUILT_IN else {"model": model}
        seeds = list(range(seed, seed + fields))
        found = crossed(arguments, seeds, rover, tries=tries, planned=planned, patience=patience, say=say)
        crossings[f"{level:g}"] = found
        n = sum(map(bool, found.values()))
        low, high = wilson_interval(n, fields)
        who = ", ".join(f"{name} {count}" for name, count in Counter(filter(None, found.values())).most_common())
        if output is not None:
            output.write_text(json.dumps(crossings, indent=1) + "\n", encoding="utf-8")
        table.append((f"{level:g}", f"{n} of {fields}", f"{100.0 * low:.1f} to {high:.1%}", who))
    Console().print(plain_table(table))


if __name__ == "__main__":
    typer.run(passable)
