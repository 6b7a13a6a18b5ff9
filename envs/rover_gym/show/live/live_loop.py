"""The loop of a live drive: it steps a rover in real time, takes commands and gives states. It knows no browser.

loop = LiveLoop(LiveRover())
loop.start()
loop.send(Drive(forward=1.0))
loop.state.speed
loop.stop()
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rover_gym.core import CommandError, RoverGymError
from rover_gym.core.extras import MissingExtraError
from rover_gym.core.validation import checked, refuse
from rover_gym.show.live.live_commands import (
    Change,
    Command,
    Drive,
    Pause,
    Record,
    Restart,
    Rewind,
    SingleStep,
    ThrowRock,
)
from rover_gym.show.live.live_recording import LiveRecording
from rover_gym.show.live.live_scene import BY_HAND
from rover_gym.show.live.live_state import LiveState, Past, poses_of
from rover_gym.show.replay.overlays import live_overlays

if TYPE_CHECKING:
    from rover_gym.show.live.live_rover import LiveRover

#: Most commands that wait: a page sends some ten a second.
MOST_WAITING = 1000
#: A command by hand ends after this time, so that a rover whose page has vanished comes to rest, s.
HOLD = 1.0
#: A loop that is behind by more gives the time up instead of hurrying after it, s.
MOST_DEBT = 0.25
#: Time over which the real-time factor is measured, s.
MEASURED = 2.0

#: Notices of the page where a drive has ended.
ENDINGS = {
    "roll_over": "the rover has rolled over",
    "left_field": "the rover has left the field",
    "high_centred": "the rover is high-centred: its trunk carries it",
    "step_failed": "the physics could not take a step",
    "battery_empty": "the battery is empty",
}

#: What may go wrong with a command or a file: the page reports it, and the drive goes on.
EXPECTED = (RoverGymError, MissingExtraError, OSError)


class LiveLoop:
    """Steps a rover in real time, in a thread of its own.

    `send` and `state` are for any thread. Commands are carried out between two control periods, in order. What they ask
    for in vain, and a recording that fails, is reported in `LiveState.notice`; the drive goes on.

    Args:
        rover: The rover. It belongs to the loop from here on.
        recordings: Folder of the recordings.
        mcap: Whether each recording is also written as an MCAP log.
        clock: The time that the drive keeps, s.

    Attributes:
        state: The last state.
        failure: What stopped the loop unasked; None where nothing did.
        recorded: Files that have been recorded to, in order.
    """

    @checked(rover="LiveRover", recordings=Path, mcap=bool, clock=callable)
    def __init__(
        self,
        rover: LiveRover,
        recordings: str | Path = ".",
        *,
        mcap: bool = False,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._rover, self._folder, self._mcap, self._clock = rover, Path(recordings), mcap, clock
        self._commands: queue.Queue[tuple[Command, Callable[[str], None]]] = queue.Queue(MOST_WAITING)
        self._wake, self._stopping = threading.Event(), threading.Event()
        self._past = Past()
        self._recording: LiveRecording | None = None
        self._hand, self._hand_until = Drive(), -math.inf
        self._is_paused, self._single_steps = False, 0
        self._world = self._number = self._notices = 0
        self._notice = ""
        self._pace: deque[tuple[float, float]] = deque()
        self._thread: threading.Thread | None = None
        self.failure: Exception | None = None
        self.recorded: list[Path] = []
        self._past.keep(rover)
        self._look()
        self.state = self._current()

    def send(self, command: Command, failed: Callable[[str], None] | None = None) -> None:
        """Hands in a command.

        Args:
            command: The command.
            failed: Called in the drive's thread with the reason if the command cannot be carried out; by default
                `LiveState.notice` has it.

        Raises:
            CommandError: Too many commands wait, or the loop has stopped; this one is dropped.
        """
        if self._stopping.is_set():
            refuse(CommandError, "command", command, "was not executed: the drive is over")
        try:
            self._commands.put_nowait((command, self.tell if failed is None else failed))
        except queue.Full:
            refuse(CommandError, "command", command, f"was not executed: {MOST_WAITING} commands are waiting already")
        self._wake.set()

    def tell(self, notice: str) -> None:
        """Sets the message for the user; for any thread."""
        self._notice = notice
        self._notices += 1

    def start(self) -> None:
        """Starts the thread."""
        self._thread = threading.Thread(target=self._run, name="live drive", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread and the recording, whose rows are all kept."""
        self._stopping.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join()
        else:
            self._finish()

    def wait(self, timeout: float) -> bool:
        """Waits until the loop has ended, or for a time, s; returns whether it has."""
        return self._stopping.wait(timeout)

    def advance(self) -> None:
        """Carries out the commands that wait and, unless the time stands still, takes one control period."""
        self._obey()
        if self._is_paused and self._single_steps == 0:
            self.state = self._current()
            return
        self._single_steps = max(0, self._single_steps - 1)
        hand = self._hand if self._clock() < self._hand_until else Drive()
        goals = self._rover.goals_reached
        self._rover.step(hand.forward, hand.turn)
        if self._rover.goals_reached > goals:
            self._world += 1
            self.tell("the goal is reached: back to where it came from")
        self._past.keep(self._rover)
        self._look()
        self._guard(lambda recording: recording.append(self._rover, self._overlays))
        if self._rover.ended:
            self._is_paused = True
            self.tell(f"{ENDINGS.get(self._rover.ended, self._rover.ended)}: rewind or restart")
        self.state = self._current()

    def _run(self) -> None:
        due = self._clock()
        try:
            while not self._stopping.is_set():
                self._measure()
                self.advance()
                if self._is_paused and self._single_steps == 0:
                    self._pace.clear()
                    self._wake.wait(self._rover.dt)
                    self._wake.clear()
                    due = self._clock()
                    continue
                due += self._rover.dt
                left = due - self._clock()
                if left > 0.0:
                    self._stopping.wait(left)
                elif left < -MOST_DEBT:
                    due = self._clock()
        except Exception as error:  # the user must learn of it, and the recording must be closed
            self.failure = error
            self.tell(f"the drive has stopped: {type(error).__name__}: {error}")
        finally:
            self._stopping.set()
            self._finish()

    def _finish(self) -> None:
        self._end_recording()
        self.state = self._current()

    def _obey(self) -> None:
        while True:
            try:
                command, failed = self._commands.get_nowait()
            except queue.Empty:
                return
            try:
                self._carry_out(command)
            except EXPECTED as error:
                failed(str(error))

    def _carry_out(self, command: Command) -> None:
        match command:
            case Drive():
                self._hand, self._hand_until = command, self._clock() + HOLD
                if self._rover.scene.driver != BY_HAND and (command.forward or command.turn):
                    self._change("driver", BY_HAND)
            case Pause(on):
                self._is_paused = on or bool(self._rover.ended)
            case SingleStep():
                self._is_paused = True
                self._single_steps += 0 if self._rover.ended else 1
            case Rewind(seconds):
                self._past.rewind(self._rover, seconds)
                self._is_paused = True
                self._next_world()
            case ThrowRock(radius):
                self._rover.throw_rock(radius)
                self._next_world()
            case Change(name, value):
                self._change(name, value)
            case Restart():
                self._rover.restart()
                self._new_drive()
            case Record(on):
                self._record(on=on)

    def _change(self, name: str, value: object) -> None:
        drives, driver = self._rover.drives, self._rover.driver
        self._rover.change(name, value)
        if self._rover.drives > drives:
            self._new_drive()
        elif self._rover.driver is not driver:  # another one sees and intends other things
            self._next_file()

    def _new_drive(self) -> None:
        self._past.forget()
        self._past.keep(self._rover)
        self._is_paused = False
        self._next_world()

    def _next_world(self) -> None:
        """The ground, the rover, or the time has changed: views are built anew, and so is the recording's file."""
        self._world += 1
        self._pace.clear()
        self._next_file()

    def _next_file(self) -> None:
        self._look()
        self._guard(lambda recording: recording.next_file(self._rover, self._overlays))
        self._note_file()

    def _record(self, *, on: bool) -> None:
        if not on:
            self._end_recording()
        elif self._recording is None:
            self._recording = LiveRecording(self._folder, self._rover, self._overlays, mcap=self._mcap)
            self._note_file()
            self.tell(f"recording {self._recording.path.name}")

    def _note_file(self) -> None:
        if self._recording is not None:
            self.recorded += self._recording.paths

    def _end_recording(self) -> None:
        if self._recording is not None:
            path, rows = self._recording.path, self._recording.rows
            self._guard(lambda recording: recording.close())
            if self._recording is not None:
                self._recording = None
                self.tell(f"recorded {path.name}: {rows} rows")

    def _guard(self, work: Callable[[LiveRecording], None]) -> None:
        """Works on the recording, if there is one; where that fails, the recording ends and the drive goes on."""
        if self._recording is not None:
            try:
                work(self._recording)
            except EXPECTED as error:
                self._recording = None
                self.tell(str(error))

    def _look(self) -> None:
        """Notes what the rover sees now, and what its driver intends."""
        self._overlays = live_overlays(self._rover.env, self._rover.driver, self._rover.driver_state)

    def _measure(self) -> None:
        """Keeps pairs of wall and simulated time, of the last seconds."""
        now = self._clock()
        self._pace.append((now, self._rover.time))
        while now - self._pace[0][0] > MEASURED:
            self._pace.popleft()

    def _current(self) -> LiveState:
        rover = self._rover
        env, info = rover.env, rover.info
        simulation, solver = env.simulation, info["solver"]
        positions, rotations = poses_of(rover)
        velocity, forces, sand = simulation.v, simulation.wheel_forces, simulation.sand()
        factor = math.nan
        if len(self._pace) > 1:
            (first, begin), (last, end) = self._pace[0], self._pace[-1]
            factor = (end - begin) / (last - first) if last > first else math.nan
        self._number += 1
        return LiveState(
            number=self._number,
            world=self._world,
            scene=rover.scene,
            model=env.model,
            terrain=simulation.terrain,
            goal=env.goal,
            time=simulation.time,
            period=env.dt,
            positions=positions,
            rotations=rotations,
            heading=float(simulation.q[4]),
            speed=math.hypot(velocity[0], velocity[2]),
            wheel_forces=forces,
            mass_centre=simulation.centre_of_mass(),
            overlays=self._overlays,
            ruts=np.zeros((0, 3)) if sand is None else sand["ruts"],
            loads=forces[:, 0],
            slip=info["slip_ratio"],
            energy=info["energy"],
            tilt=info["tilt"],
            distance_to_goal=info["distance_to_goal"],
            goals_reached=rover.goals_reached,
            solver_status=solver["status"],
            solver_iterations=solver["iterations"],
            contacts=solver["n_contacts"],
            ended=rover.ended,
            is_paused=self._is_paused,
            reach=self._past.reach(rover.time),
            real_time_factor=factor,
            recording="" if self._recording is None else str(self._recording.path),
            recorded_rows=0 if self._recording is None else self._recording.rows,
            notice=self._notice,
            notices=self._notices,
            is_over=self._stopping.is_set(),
        )
