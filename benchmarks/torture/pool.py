"""Cases in worker processes, so that a hang, an abort or a segmentation fault is a finding and not the end."""

import multiprocessing
import os
import resource
import signal
import time
import traceback
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from rover_gym import RoverGymError
from torture.ledger import Ledger
from torture.regimes import BY_NAME

Task = tuple[str, int]
#: Address space of a worker, bytes.
MEMORY = 8 * 2**30
_SPAWN = multiprocessing.get_context("spawn")


def play(name: str, case: int) -> Ledger:
    """One case; an exception that leaves it is a finding."""
    try:
        return BY_NAME[name].play(case)
    except Exception as error:
        ledger = Ledger()
        last = traceback.extract_tb(error.__traceback__)[-1]
        kind = "unexpected" if isinstance(error, RoverGymError) else "foreign"
        text = f"{kind} {type(error).__name__}: {str(error)[:200]} ({last.filename.rsplit('/', 1)[-1]}:{last.lineno})"
        ledger.find(text)
        return ledger
    except BaseException as error:
        if "Panic" not in type(error).__name__:
            raise
        ledger = Ledger()
        ledger.find(f"panic: {str(error)[:200]}")
        return ledger


def _work(pipe: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to stop
    os.environ["RUST_BACKTRACE"] = "0"  # a finding is one line
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))  # what asks for more fails here and not in the machine
    while (task := pipe.recv()) is not None:
        pipe.send(play(*task))


@dataclass
class _Worker:
    """A process, the case that it plays, and until when."""

    task: Task | None = None
    deadline: float = 0.0
    pipe: Connection = field(init=False)
    process: BaseProcess = field(init=False)

    def __post_init__(self) -> None:
        self.pipe, theirs = _SPAWN.Pipe()
        self.process = _SPAWN.Process(target=_work, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()

    def give(self, task: Task) -> None:
        self.task = task
        self.deadline = time.monotonic() + BY_NAME[task[0]].limit
        self.pipe.send(task)

    def take(self) -> Ledger | None:
        """What its case came to, or how it died or hung; None while it is at work."""
        if self.pipe.poll():
            try:
                return self.pipe.recv()  # type: ignore[no-any-return]
            except EOFError:
                self.process.join()
                return self._lost(f"the process died: exit code {self.process.exitcode}")
        if time.monotonic() > self.deadline:
            return self._lost(f"hangs: not done within {BY_NAME[self.task[0]].limit:g} s" if self.task else "")
        return None

    def _lost(self, how: str) -> Ledger:
        ledger = Ledger()
        ledger.find(how)
        self.stop()
        self.__post_init__()
        return ledger

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def side_by_side(tasks: Iterable[Task], workers: int) -> Iterator[tuple[Task, Ledger]]:
    """Plays cases on so many processes and yields what each came to, as they finish."""
    waiting = iter(tasks)
    team = [_Worker() for _ in range(workers)]
    try:
        for worker in team:
            if (task := next(waiting, None)) is not None:
                worker.give(task)
        while busy := [worker for worker in team if worker.task is not None]:
            wait([worker.pipe for worker in busy], timeout=0.5)
            for worker in busy:
                ledger = worker.take()
                if ledger is None or worker.task is None:
                    continue
                done, worker.task = worker.task, None
                if (task := next(waiting, None)) is not None:
                    worker.give(task)
                yield done, ledger
    finally:
        for worker in team:
            worker.stop()
