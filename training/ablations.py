"""Measures what a network that imitates loses without parts of what it sees.

    rover train rocks
    python training/ablations.py runs/train/rocks-seed1 --seed 1 --seed 2 --seed 3

The labels of a run of `rover train` are learned anew, with a part of the observation set to zero, in learning and in
driving. The states are those that the run's networks visited, which saw everything.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from rover_gym.cli.console import plain_errors, plain_table
from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.drive import ArcNetwork, ArcNetworkPolicy, ScanPolicy
from rover_gym.drive.evaluation import drive_all
from rover_gym.learn.arc_config import ArcPPOConfig, ImitationConfig
from rover_gym.learn.arc_learner import ArcVecEnv, imitate, make_model, network_of

#: Parts of the observation that are hidden, by name of the row.
HIDDEN = {"everything": (), "no clocks": ("clocks",), "no scan": ("scan",), "no command": ("command",)}


def hide(observed: Any, parts: tuple[str, ...]) -> Any:
    """An observation, or labels with theirs, with some parts set to zero."""
    return {name: np.zeros_like(values) if name in parts else values for name, values in observed.items()}


@dataclass(frozen=True)
class Blind(ArcNetwork):
    """A network that does not see some parts."""

    hidden: tuple[str, ...] = ()

    def __call__(self, observation: Any) -> Any:
        """The logits of the arcs."""
        return super().__call__(hide(observation, self.hidden))


@plain_errors
def ablations(
    run: Annotated[Path, typer.Argument(help="The run's folder, with its labels.")],
    seed: Annotated[list[int] | None, typer.Option(help="Of the network; repeat it for several.")] = None,
    difficulty: Annotated[list[float] | None, typer.Option(help="Of the rocks; repeat it for several.")] = None,
    fields: Annotated[int, typer.Option(min=1, help="Number of fields.")] = 100,
    first: Annotated[int, typer.Option(min=0, help="Seed of the first field.")] = 4_000_000,
    epochs: Annotated[int, typer.Option(min=1, help="Passes over the labels.")] = 4,
) -> None:
    """Print the goals that networks reach which do not see everything."""
    rounds = [dict(np.load(path)) for path in sorted(run.glob("labels-*.npz"))]
    if not rounds:
        refuse(OptionError, "run", str(run), "has no labels")
    levels, settings = difficulty or [1.0, 1.5], ImitationConfig(epochs=epochs, batch_size=512)
    table = [("seen", "seed", *(f"goals of {fields}, {level:g}" for level in levels))]
    for name, hidden in HIDDEN.items():
        for one in seed or [1]:
            model = make_model(ArcPPOConfig(batch_size=128), ArcVecEnv(None, 2), one, "cpu")
            imitate(model.policy, [hide(labels, hidden) for labels in rounds], settings, one)
            network = Blind(network_of(model.policy).arrays, hidden)
            goals = []
            for level in levels:
                arguments = {"terrain": "rocks", "difficulty": level, **ScanPolicy.arguments()}
                drives = drive_all(
                    lambda env, network=network: ArcNetworkPolicy(env, network),  # type: ignore[misc]
                    range(first, first + fields),
                    arguments=arguments,
                )
                goals.append(str(sum(drive.success for drive in drives)))
            table.append((name, str(one), *goals))
    Console().print(plain_table(table))


if __name__ == "__main__":
    typer.run(ablations)
