"""Doors to other programs: states of co-simulation units, messages to a live drive, commands whose paths clash."""

import json
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym import RoverModel, Simulation
from rover_gym.exports import write_fmu
from rover_gym.exports.fmu import LIBRARIES
from rover_gym.record.saved_runs import record_run
from rover_gym.show.live import LiveChoices, LiveLoop, LiveRover, LiveScene, LiveServer
from rover_gym.show.live.live_commands import COMMANDS
from torture.hostile import NUMBERS, TEXTS
from torture.ledger import Bounds, Ledger, Regime
from torture.mutate import mutate_bytes, mutate_json

Random = np.random.Generator


@cache
def _unit() -> tuple[Any, str]:
    """A unit on a plane: what it says of itself, and where it is unpacked."""
    from fmpy import extract, read_model_description  # noqa: PLC0415 - optional

    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    sim = Simulation(RoverModel())
    sim.step(5)
    path = write_fmu(sim, folder / "a.fmu")
    return read_model_description(str(path)), extract(str(path), str(folder / "unit"))


@contextmanager
def _instance(folder: str) -> Iterator[Any]:
    """An instance of the unit that is unpacked in a folder, whose messages nobody reads."""
    from fmpy.fmi3 import FMU3Slave  # noqa: PLC0415 - optional

    description, _ = _unit()
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    fmu.instantiate(logMessage=lambda *_: None)
    try:
        yield fmu
    finally:
        fmu.freeInstance()


def _damaged(random: Random, sound: bytes, times: int) -> Iterator[bytes]:
    """Damaged copies, without those that are as sound as before."""
    yield from (copy for _ in range(times) if (copy := mutate_bytes(random, sound)) != sound)


def states(random: Random, ledger: Ledger) -> None:
    """Saved states of a unit with bytes changed: each is refused, and the unit goes on as if nothing had been asked."""
    if not LIBRARIES.exists():
        return
    from fmpy.fmi1 import FMICallException  # noqa: PLC0415 - optional

    with _instance(_unit()[1]) as fmu:
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.doStep(0.0, 0.05)
        state = fmu.getFMUState()
        data = bytes(fmu.serializeFMUState(state))
        for damaged in _damaged(random, data, 15):
            ledger.steps += 1
            try:
                fmu.deserializeFMUState(damaged)
            except FMICallException as error:
                ledger.refused += 1
                if error.status != 3:
                    ledger.find(f"a damaged state gives the status {error.status}")
            else:
                ledger.find("a damaged state of a unit is taken")
        if bytes(fmu.serializeFMUState(fmu.getFMUState())) != data:
            ledger.find("a refused state changed the unit")


def scenes(random: Random, ledger: Ledger) -> None:
    """The scene of an unpacked unit with bytes changed: it is not instantiated."""
    if not LIBRARIES.exists():
        return
    folder = _unit()[1]
    path = Path(folder) / "resources" / "scene.json"
    sound = path.read_bytes()
    try:
        for damaged in _damaged(random, sound, 8):
            path.write_bytes(damaged)
            ledger.steps += 1
            try:
                with _instance(folder):
                    ledger.find("a unit with a damaged scene is instantiated")
            except Exception as error:  # FMPy raises a plain one
                ledger.refused += 1
                if "Failed to instantiate" not in str(error):
                    ledger.find(f"a damaged scene gives {type(error).__name__}")
    finally:
        path.write_bytes(sound)


def _message(random: Random) -> str | bytes:
    """A message to a live drive: a command, one with odd values, one that is damaged, or nonsense."""
    names = [*COMMANDS, "take", "watch", "fly", ""]
    entries: dict[str, Any] = {"do": names[random.integers(len(names))]}
    for key in ("forward", "turn", "on", "seconds", "name", "value", "radius", "more"):
        if random.random() < 0.3:
            odd = (*NUMBERS, *TEXTS, True, None, "friction", "driver", 0.5)
            entries[key] = odd[random.integers(len(odd))]
    text = json.dumps(entries, default=str, indent=random.choice([None, 1]))  # type: ignore[arg-type]
    kind = random.integers(4)
    if kind == 0:
        return mutate_bytes(random, text.encode())
    return mutate_json(random, text) if kind == 1 else text


def messages(random: Random, ledger: Ledger) -> None:
    """Messages of any kind to a live drive: it answers what it refuses, and goes on."""
    from websockets.sync.client import connect  # noqa: PLC0415 - optional

    with tempfile.TemporaryDirectory() as folder:
        choices = LiveChoices()
        loop = LiveLoop(LiveRover(LiveScene(), choices), Path(folder))
        server = LiveServer(loop, choices, port=0)
        loop.start()
        try:
            address = server.address.replace("http", "ws")
            with connect(f"{address}/live", origin=server.address, close_timeout=0.5) as page:
                for _ in range(20):
                    page.send(_message(random))
                    ledger.steps += 1
                page.send(json.dumps({"do": "fly", "at": "the end"}))
                end = time.monotonic() + 20.0
                while time.monotonic() < end:
                    answer = page.recv(timeout=20.0)
                    error = json.loads(answer).get("error", "") if isinstance(answer, str) else ""
                    ledger.refused += bool(error)
                    if error.startswith("do: must be one of") and "fly" in error:
                        break
                else:
                    ledger.find("the drive does not answer any more")
            if loop.failure is not None:
                ledger.find(f"the drive has stopped: {type(loop.failure).__name__}: {loop.failure}")
        finally:
            loop.stop()
            server.stop()


@cache
def _sound() -> bytes:
    """A short run."""
    with tempfile.TemporaryDirectory() as folder:
        record_run(Simulation(RoverModel.named("skid-steered")), 0.05, Path(folder) / "run.h5")
        return (Path(folder) / "run.h5").read_bytes()


#: How a file begins, by option.
BEGINNINGS = {"html": b"<!DOCTYPE html>", "vrml": b"#VRML V2.0"}


def paths(random: Random, ledger: Ledger) -> None:
    """`rover replay` with names drawn from a few that are linked with each other: nothing is lost."""
    from typer.testing import CliRunner  # noqa: PLC0415 - only here

    from rover_gym.cli import app  # noqa: PLC0415 - only here

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for run in ("run.h5", "ghost.h5"):
            (folder / run).write_bytes(_sound())
        (folder / "soft").symlink_to("run.h5")
        os.link(folder / "ghost.h5", folder / "hard")
        (folder / "dangling").symlink_to("new")
        (folder / "sub").mkdir()
        recordings = ["run.h5", "ghost.h5", "soft", "hard"]
        names = [*recordings, "dangling", "new", "sub/../new", "other", "./other", "third", "sub/x", "sub/y"]

        def drawn(among: list[str]) -> Path:
            return folder / among[random.integers(len(among))]

        wanted = {option: drawn(names) for option in BEGINNINGS if random.random() < 0.8}
        read = [drawn(recordings) for _ in range(random.integers(1, 3))]
        before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        line = ["replay", str(read[0]), "--no-open"]
        line += ["--ghost", str(read[1])] if len(read) > 1 else []
        for option, path in wanted.items():
            line += [f"--{option}", str(path)]
        ledger.steps += 1
        result = CliRunner().invoke(app, line)
        shown = " ".join(line).replace(name, "")
        if result.exit_code not in (0, 2):
            ledger.find(f"{shown}: exit code {result.exit_code}")
        ledger.refused += result.exit_code == 2
        after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        if result.exit_code == 2 and after != before:
            ledger.find(f"{shown}: is refused, and something has changed")
        if any(after.get(path) != before[path] for path in read):
            ledger.find(f"{shown}: a run is lost")
        for option, path in wanted.items() if result.exit_code == 0 else ():
            if not path.read_bytes().startswith(BEGINNINGS[option]):
                ledger.find(f"{shown}: --{option} is lost")


DOORS = Bounds(refused=1.0, slowest=5.0)

REGIMES = [
    Regime("damaged states of units", states, 10, DOORS),
    Regime("damaged scenes of units", scenes, 4, DOORS),
    Regime("messages to a live drive", messages, 4, DOORS),
    Regime("clashing paths", paths, 20, DOORS),
]
