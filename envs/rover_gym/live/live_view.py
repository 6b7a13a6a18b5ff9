"""The scene of a live drive in viser: rocks and ground are sent once, then what moves, thirty times a second.

Between two control periods the poses are interpolated, so that the picture is one period behind and does not jerk.
"""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import sin_cos
from rover_gym.record.rover_run import RoverRun
from rover_gym.record.trajectory import Trajectory
from rover_gym.replay.player import add_surroundings, quaternions, shortened
from rover_gym.replay.scenery import first_view
from rover_gym.replay.vrml import add_ground, add_rover

if TYPE_CHECKING:
    from rover_gym.live.live_loop import LiveLoop
    from rover_gym.live.live_state import LiveState

REACH = 25.0  # m of ground around start and goal
NEAR_EDGE = 8.0  # m from the edge of that ground, where it is laid anew
#: The eye comes after the rover with this time constant, s.
FOLLOW_TIME = 0.4
#: Movement that nobody sees, m and parts of a turn: such poses are not sent.
STILL = 2e-4

Array = npt.NDArray[np.float64]


class LiveView:
    """Shows the states of a loop in a viser server, from a thread of its own.

    Args:
        server: The viser server.
        loop: The drive.
        fps: Pictures a second, at most.

    Attributes:
        frames: How many pictures have been sent.
    """

    def __init__(self, server: Any, loop: LiveLoop, fps: float) -> None:
        self._server, self._loop, self._fps = server, loop, fps
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self._world_shown = -1
        self._frame: Any = None
        self._solids: list[Any] = []
        self._shown: tuple[Array, Array] | None = None
        self._centre: Array = np.zeros(3)
        self._middle: Array = self._centre
        self.frames = 0
        add_surroundings(server.scene)

    def start(self) -> None:
        """Shows the present state and starts the thread."""
        self.show(self._loop.state, None, 1.0)
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            self._follow()
        except Exception as error:  # the drive goes on without its picture, and the user must learn of it
            self._loop.tell(f"the scene is shown no further: {type(error).__name__}: {error}")

    def _follow(self) -> None:
        before = now = self._loop.state
        since = due = time.perf_counter()
        while not self._stopping.is_set():
            state = self._loop.state
            at = time.perf_counter()
            if state.number != now.number:
                before, now, since = now, state, at
            share = min(1.0, (at - since) / now.period)
            self.show(now, before if before.world == now.world else None, share)
            due = max(due + 1.0 / self._fps, at)
            self._stopping.wait(max(0.0, due - time.perf_counter()))

    def show(self, state: LiveState, before: LiveState | None, share: float) -> None:
        """Sends a picture.

        Args:
            state: The present state.
            before: The one before it, of the same world; None to show the present one.
            share: How far between the two, 0 to 1.
        """
        places, turns = state.positions, quaternions(state.rotations)
        if before is not None:
            places = before.positions + share * (places - before.positions)
            turns = _between(quaternions(before.rotations), turns, share)
        with self._server.atomic():
            away = np.abs(state.positions[0] - self._middle).max()
            if state.world != self._world_shown or away > REACH - NEAR_EDGE:
                self._build(state)
            self._place(places, turns)
        self.frames += 1

    def _place(self, places: Array, turns: Array) -> None:
        """Sends the poses that have changed."""
        centre = places[0]
        gap = centre - self._centre
        if np.abs(gap).max() > STILL:
            share = 1.0 if np.abs(gap).max() > 3.0 else 1.0 - np.exp(-1.0 / (self._fps * FOLLOW_TIME))
            self._centre = self._centre + share * gap
            self._frame.position = shortened(-self._centre)
        if self._shown is None:
            moved = turned = np.ones(len(places), dtype=bool)
            self._shown = places.copy(), turns.copy()
        else:
            moved = np.abs(places - self._shown[0]).max(axis=1) > STILL
            apart = [np.abs(turns + sign * self._shown[1]).max(axis=1) for sign in (-1.0, 1.0)]
            turned = np.minimum(*apart) > STILL
        for i in np.flatnonzero(moved):
            self._solids[i].position = shortened(places[i])
            self._shown[0][i] = places[i]
        for i in np.flatnonzero(turned):
            self._solids[i].wxyz = shortened(turns[i])
            self._shown[1][i] = turns[i]

    def _build(self, state: LiveState) -> None:
        """Builds the scene of a world anew."""
        scene = self._server.scene
        if self._frame is not None:
            self._frame.remove()
        run = _standing(state)
        self._frame = scene.add_frame("/world", show_axes=False)
        self._solids = add_rover(scene, run)
        add_ground(scene, run)
        self._shown, self._centre = None, state.positions[0].copy()
        self._middle = self._centre
        self._frame.position = shortened(-self._centre)
        if self._world_shown < 0:
            view = first_view(run)
            self._server.initial_camera.position = view.eye - state.positions[0]
            self._server.initial_camera.look_at = view.target - state.positions[0]
            self._server.initial_camera.fov = view.field_of_view
        self._world_shown = state.world


def _standing(state: LiveState) -> RoverRun:
    """A state as a run of rover and ground, whose path spans the ground that is shown."""
    x, _, z = state.positions[0]
    sine, cosine = sin_cos(state.heading)
    corners = [(x, z), *((x + dx, z + dz) for dx in (-REACH, REACH) for dz in (-REACH, REACH)), (x + cosine, z - sine)]
    q = np.zeros((len(corners), state.model.nq))
    q[:, 0], q[:, 2] = np.array(corners).T
    q[:, 1], q[:, 4] = state.positions[0][1], state.heading
    trajectory = Trajectory({"q": q, "time": np.zeros(len(q))}, {}, {}, state.terrain)
    return RoverRun(trajectory, state.model, state.terrain, state.goal, "a live drive")


def _between(first: Array, last: Array, share: float) -> Array:
    """Quaternions `(n, 4)` between two close ones."""
    near = np.where((first * last).sum(axis=1, keepdims=True) < 0.0, -first, first)
    mixed = near + share * (last - near)
    result: Array = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return result
