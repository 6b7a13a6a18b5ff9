"""A child process that answers each line of JSON with another, for what needs an interpreter of its own."""

import json
import select
import subprocess
from pathlib import Path
from typing import Any


def says(command: list[str]) -> str:
    """What a command prints as it fails, at its end; nothing where it succeeds."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        return str(error)
    return (done.stderr.strip().splitlines() or ["it ended without a word"])[-1] if done.returncode else ""


class Worker:
    """The process, until it is closed.

    Args:
        command: Program and arguments.
        more: Of `subprocess.Popen`.
    """

    def __init__(self, command: list[str | Path], **more: Any) -> None:
        self.child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **more)

    def hear(self, patience: float | None = None) -> str:
        """The next line; none where it takes more than so many seconds, or the process has ended."""
        assert self.child.stdout is not None
        is_there = bool(select.select([self.child.stdout], [], [], patience)[0])
        return self.child.stdout.readline() if is_there else ""

    def ask(self, message: dict[str, Any], patience: float | None = None) -> dict[str, Any] | None:
        """The answer to a message; None where `hear` hears nothing."""
        assert self.child.stdin is not None
        self.child.stdin.write(json.dumps(message) + "\n")
        self.child.stdin.flush()
        line = self.hear(patience)
        answer: dict[str, Any] | None = json.loads(line) if line else None
        return answer

    def close(self) -> None:
        """Ends the process."""
        for pipe in (self.child.stdin, self.child.stdout):
            if pipe is not None:
                pipe.close()
        self.child.kill()
        self.child.wait()
