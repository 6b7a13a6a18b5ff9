"""Objects created before a fork work in the child process."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")

COMMON = """
import warnings
# Python warns of forks in processes with threads; the pool's are the very threads in question.
warnings.simplefilter("ignore", DeprecationWarning)
import numpy as np
from rover_gym.envs.vector import RoverVectorEnv

env = RoverVectorEnv(4, threads=2)
env.reset(seed=0)
action = np.full((4, 12), 0.3, np.float32)
env.step(action)
"""

FORK = """
import os

child = os.fork()
if child == 0:
    seen = env.step(action)[0]
    del env
    os.write(1, seen.tobytes()[:16].hex().encode() + b"\\n")
    os._exit(0)
status = os.waitpid(child, 0)[1]
print(env.step(action)[0].tobytes()[:16].hex())
assert os.waitstatus_to_exitcode(status) == 0
"""

PROCESSES = """
import multiprocessing

def work(pipe):
    # A worker steps what it inherited, and makes one of its own.
    seen = env.step(action)[0]
    own = RoverVectorEnv(4, threads=2)
    own.reset(seed=0)
    own.step(action)
    assert own.step(action)[0].tobytes() == seen.tobytes()
    pipe.send(seen.tobytes())

context = multiprocessing.get_context("fork")
pipes = [context.Pipe() for _ in range(3)]
workers = [context.Process(target=work, args=(end,)) for _, end in pipes]
for worker in workers:
    worker.start()
seen = {pipe.recv() for pipe, _ in pipes}
for worker in workers:
    worker.join()
    assert worker.exitcode == 0
assert seen == {env.step(action)[0].tobytes()}
"""


RENDERED = """
import gc
import os
import warnings
warnings.simplefilter("ignore", DeprecationWarning)
from rover_gym import RoverEnv

env = RoverEnv(render_mode="rgb_array")
env.reset(seed=0)
env.render()
child = os.fork()
if child == 0:
    other = env
    env.close()
    del env, other
    gc.collect()
    os._exit(0)
status = os.waitpid(child, 0)[1]
assert os.waitstatus_to_exitcode(status) == 0
assert env.render().any()
"""


def test_a_forked_process_that_collected_an_open_renderer_hung() -> None:
    # Destroying the window waited for threads that only the parent had.
    pytest.importorskip("vtkmodules", reason="the extra render is not installed")
    command = [sys.executable, "-c", RENDERED]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("script", [FORK, PROCESSES], ids=["os.fork", "multiprocessing"])
def test_a_vector_environment_made_before_a_fork_hung_in_the_child(script: str) -> None:
    # The child waited for threads that only its parent had. They are made anew there.
    done = subprocess.run(
        [sys.executable, "-c", COMMON + script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(set(done.stdout.split())) <= 1
