"""`rover live`: it says where its page is, ends by Ctrl-C with its recordings kept, and refuses by one line."""

import json
import re
import signal
import socket
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from urllib.request import urlopen

import commands
import pytest

from rover_gym.record import read_run

client = pytest.importorskip("websockets.sync.client")

RUN = "from rover_gym.cli import main; main()"


rover = partial(commands.rover, "live")


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is another thing there")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM], ids=["ctrl-c", "sigterm"])
def test_it_serves_its_page_and_keeps_the_recording_when_it_is_ended(ending: signal.Signals, tmp_path: Path) -> None:
    """SIGTERM left a recording without rows."""
    options = ["--port", "0", "--no-open", "--output", str(tmp_path), "--policy", "pd"]
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, "live", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A suite that a shell started in the background ignores Ctrl-C, and so would its children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509 - no threads run yet
    )
    try:
        line = process.stdout.readline()
        found = re.fullmatch(r"live: (http://127\.0\.0\.1:\d+) \(Ctrl-C ends the drive\)\n", line)
        assert found, line
        with urlopen(found[1], timeout=20.0) as page:  # noqa: S310 - our own
            assert b"rover live" in page.read()
        with client.connect(f"{found[1].replace('http', 'ws')}/live") as page:
            page.send(json.dumps({"do": "record"}))
            end = time.monotonic() + 30.0
            while json.loads(page.recv(timeout=20.0)).get("state", {}).get("rows", 0) < 10:
                assert time.monotonic() < end
        process.send_signal(ending)
        output, errors = process.communicate(timeout=30.0)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0, errors
    path = tmp_path / "live-1.h5"
    assert output.splitlines() == [f"recorded: {path}", f"watch it: rover replay {path}"]
    assert errors == ""
    run = read_run(tmp_path / "live-1.h5")
    assert run.n_frames >= 10
    assert run.trajectory.attributes["complete"]
    assert run.trajectory.attributes["scene"]["driver"] == "pd"


def test_a_port_in_use_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as busy:
        result = rover("--no-open", "--port", busy.getsockname()[1])
    assert result.exit_code == 2
    assert result.stderr.startswith("error: --port: is in use by another program")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--terrain", "moon"), "--terrain: must be one of plane, rocks, hills"),
        (("--terrain", "moon.tif"), "moon.tif"),
        (("--policy", "nobody"), "policy"),
        (("--friction", "-1"), "--friction: must be at least 0"),
        (("--gravity", "nan"), "--gravity: must be finite"),
        (("--model", "tank"), "model: must be a name"),
        (("--host", "no.such.host.invalid"), "--host: must be a name or an address of this computer"),
        (("--output", "/dev/null"), "--output: cannot be written"),
    ],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], message: str) -> None:
    result = rover("--no-open", "--port", "0", *arguments)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1
