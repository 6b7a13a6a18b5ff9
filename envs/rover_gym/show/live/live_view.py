"""The scene of a live drive for the player: ground, rocks and rover once a world, then a frame each control period."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import sin_cos
from rover_gym.ground.terrain_parts import sand_of
from rover_gym.record.rover_run import RoverRun
from rover_gym.record.trajectory import Trajectory
from rover_gym.show.replay.page_scene import FrameChannel, PageScene
from rover_gym.show.replay.rover_scene import bare_scene, poses_of
from rover_gym.show.replay.wheel_marks import RUT_CELL, DrawnWheel, RutMap, feet, world_forces

if TYPE_CHECKING:
    from rover_gym.show.live.live_state import LiveState

REACH = 25.0  # m of ground around start and goal
NEAR_EDGE = 8.0  # m from the edge of that ground, where it is laid anew

#: What a binary message is: its kind, the number of its scene, and the simulated time, s.
HEAD = struct.Struct("<IId")
SCENE, FRAME = 1, 2
#: A cell that a wheel presses down, after the frame's channels: its number and its level.
RUT = np.dtype([("cell", "<u4"), ("level", "<u4")])
DEEPEST = 0.25  # m, of a rut
TITLE = {"title": "a live drive"}

Array = npt.NDArray[np.float64]


class LiveView:
    """Turns states into messages for the pages.

    Attributes:
        number: Number of the scene; another one is another ground or rover.
        scene: The scene as a message.
        pressed: The cells of sand that became deeper, in order: cell and level of 255, each as `RUT` has them.
    """

    def __init__(self) -> None:
        self.number, self.scene, self.pressed = 0, b"", bytearray()
        self._ruts: RutMap | None = None
        self._drawn = 0
        self._world = -1
        self._middle: Array = np.zeros(3)
        self._wheels: list[DrawnWheel] = []
        self._shape: list[tuple[str, tuple[int, ...]]] = []

    def follow(self, state: LiveState) -> None:
        """Builds the scene of a state, if it is another one or the rover has come near its edge."""
        away = np.abs(state.positions[0] - self._middle).max()
        shape = [(channel.name, channel.values.shape) for channel in state.overlays.channels()]
        if state.world == self._world and away <= REACH - NEAR_EDGE and shape == self._shape:
            return
        self._shape = shape
        scene, self._wheels = bare_scene(_standing(state))
        scene.channels = self._channels(state)
        scene.facts |= {"period": state.period}
        state.overlays.describe(scene, state.model)
        self._ruts, self._drawn, self.pressed = None, 0, bytearray()
        if sand_of(state.terrain) is not None:
            middle = state.positions[0][[0, 2]]
            self._ruts = RutMap(middle - REACH, middle + REACH, RUT_CELL, DEEPEST)
            scene.facts["ruts"] = self._ruts.header()
        self._world, self._middle = state.world, state.positions[0].copy()
        self.number += 1
        self.scene = HEAD.pack(SCENE, self.number, state.time) + scene.message()

    def frame(self, state: LiveState) -> bytes:
        """A state as a frame of the scene; the cells that it presses down go to `pressed`."""
        if self._ruts is not None and len(state.ruts) > self._drawn:
            cells, levels = self._ruts.press(state.ruts[:, :2], state.ruts[:, 2])
            self.pressed += np.array(list(zip(cells, levels, strict=True)), dtype=RUT).tobytes()
            self._drawn = len(state.ruts)
        moved = PageScene("rover", {}, 1.0, channels=self._channels(state))
        return HEAD.pack(FRAME, self.number, state.time) + moved.whole()

    def _channels(self, state: LiveState) -> list[FrameChannel]:
        run = _Moment(state)
        points, normals, across = feet(run, self._wheels)
        share = state.model.mass * state.scene.gravity / max(1, len(self._wheels))
        forces = np.clip(world_forces(run.trajectory["wheel_forces"], normals, across) / share, -1e4, 1e4)
        return [
            *poses_of(run.positions, run.rotations),
            FrameChannel.fine("centre", run.positions[:, :1]),
            FrameChannel.fine("forces", np.concatenate((points, forces), axis=2)),
            FrameChannel.turns("normals", normals),
            FrameChannel.fine("mass", state.mass_centre[None, None]),
            FrameChannel.fine("friction", np.full((1, 1, 1), state.scene.friction)),
            *state.overlays.channels(),
        ]


class _Moment(RoverRun):
    """A state as a run of one sample."""

    def __init__(self, state: LiveState) -> None:
        data = {"time": np.zeros(1), "wheel_forces": state.wheel_forces[None]}
        super().__init__(Trajectory(data, {}, TITLE, state.terrain), state.model, state.terrain, state.goal)
        self.__dict__["_poses"] = state.positions[None], state.rotations[None]


def _standing(state: LiveState) -> RoverRun:
    """A state as a run of rover and ground, whose path spans the ground that is shown."""
    x, _, z = state.positions[0]
    sine, cosine = sin_cos(state.heading)
    corners = [(x, z), *((x + dx, z + dz) for dx in (-REACH, REACH) for dz in (-REACH, REACH)), (x + cosine, z - sine)]
    q = np.zeros((len(corners), state.model.nq))
    q[:, 0], q[:, 2] = np.array(corners).T
    q[:, 1], q[:, 4] = state.positions[0][1], state.heading
    trajectory = Trajectory({"q": q, "time": np.zeros(len(q))}, {}, TITLE, state.terrain)
    return RoverRun(trajectory, state.model, state.terrain, state.goal)
