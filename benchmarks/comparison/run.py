"""Runs one engine through one scene and times it."""

import time

import numpy as np

from comparison.peers import Variant
from comparison.scene import RoverScene, Trace, steps_in


def timed(variant: Variant, scene: RoverScene, time_step: float, cap: float, short: float, times: int) -> Trace:
    """A run with the least CPU time of so many more where it took less than `short`, s."""
    trace = run(variant, scene, time_step, cap)
    for _ in range(times if trace.cpu < short and not trace.failure else 0):
        again = run(variant, scene, time_step, cap)
        trace.cpu = min(trace.cpu, again.cpu * trace.simulated / again.simulated)
    return trace


def run(variant: Variant, scene: RoverScene, time_step: float, cap: float = 20.0) -> Trace:
    """One run, stopped where it takes more CPU time than `cap` (s), turns infinite or fails."""
    runner = variant.build(scene, time_step)
    samples = [runner.position()]
    cpu, simulated, failure = 0.0, 0.0, ""
    chunk = steps_in(scene.sample, time_step)
    for phase in scene.phases:
        runner.command(phase)
        for _ in range(steps_in(phase.duration, scene.sample)):
            begin = time.process_time()
            try:
                runner.advance(chunk)
            except (RuntimeError, ArithmeticError) as error:  # an engine's own word that it cannot go on
                failure = f"{type(error).__name__}: {str(error).splitlines()[0][:120]}"
            # an engine in a separate process reports its own time
            cpu = runner.cpu if hasattr(runner, "cpu") else cpu + time.process_time() - begin
            simulated += scene.sample
            samples.append(runner.position())
            if not failure and not np.all(np.isfinite(samples[-1])):
                failure = "the state is not finite"
            if not failure and cpu > cap:
                failure = f"stopped after {cap:g} s of CPU time"
            if failure:
                return Trace(np.array(samples), cpu, simulated, failure)
    return Trace(np.array(samples), cpu, simulated)
