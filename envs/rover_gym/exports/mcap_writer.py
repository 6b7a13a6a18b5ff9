"""Writes a rover's run as MCAP, the log format of robotics viewers, row by row as `Recorder` writes HDF5."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverModel, Simulation, Terrain
from rover_gym.core.extras import require
from rover_gym.core.validation import TERRAINS, array, checked, number, refuse, vector
from rover_gym.envs.sensors import Camera, DepthCamera
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.exports import mcap_messages as messages
from rover_gym.exports.axes import MAP_FROM_WORLD
from rover_gym.exports.mcap_messages import McapFile
from rover_gym.record.channels import RecordingError, RoverSampler, storable, versions
from rover_gym.record.rover_run import RoverRun
from rover_gym.record.run import film_rows
from rover_gym.record.trajectory import Trajectory
from rover_gym.show.frames.appearance import ROCK_COLOUR
from rover_gym.show.replay import scenery
from rover_gym.show.replay.overlays import SENSORS, hits, sensor_of

if TYPE_CHECKING:
    from types import TracebackType


Array = npt.NDArray[np.float64]

#: Half width of the ground shown around the first row if the way of a run is unknown, m.
REACH = 15.0

#: Rows' channels that become columns of `/wheels`: the channel, and the names of its columns.
WHEEL_CHANNELS = {
    "wheel_gaps": ("gap",),
    "wheel_forces": ("normal_force", "rolling_force", "lateral_force"),
    "wheel_torques": ("torque",),
    "wheel_speed_set_points": ("speed_set_point",),
    "motor_torques": ("motor_torque",),
    "steering_set_points": ("steering_set_point",),
}

EARTH = (0.0, -9.81, 0.0)  # m/s², of runs whose attributes name none

LATEST = 1.8e10  # s after 1970: what nanoseconds of 64 bits hold


class McapWriter:
    """Appends rows to an MCAP file; a context manager.

    The file is readable after every commit, also if the process is killed: at most the last 64 KiB of messages are
    lost, and none before `flush`. A full disk ends the log with an error and leaves the file as committed. Topics:

    | topic | schema | content |
    |---|---|---|
    | `/tf` | `foxglove.FrameTransforms` | `map` (z up) to `world` (y up), `world` to every solid |
    | `/joint_states` | `foxglove.JointStates` | every joint; the effort of driven wheels |
    | `/imu` | `sensor_msgs/msg/Imu` | see `imu` |
    | `/scene` | `foxglove.SceneUpdate` | the rover's shapes, ground, rocks and goal; once |
    | `/wheels` | JSON | by wheel: gap, forces, torques, set-point |
    | `/signals` | JSON | every other channel of the rows |
    | `/laser/points`, `/depth/points` | `foxglove.PointCloud` | of a run with these sensors, by `write_mcap` |
    | `/NAME/image` | `foxglove.CompressedImage` or `foxglove.RawImage` | see `camera` |
    | `/NAME/calibration` | `foxglove.CameraCalibration` | once for each camera |
    | `/points`, `/camera` | `foxglove.PointCloud`, `foxglove.CompressedImage` | see `points` and `image` |

    Args:
        path: The file to create, with its folder. An existing file is replaced when the log is closed, unless it is
            being written.
        model: The rover.
        terrain: The ground.
        goal: Goal on the map (x, z), m.
        attributes: Metadata of the run, as `describe` returns them.
        way: (n, 2) places (x, z), m, about which a map or a plane is shown; about the first row by default.
        epoch: Time of time 0, s after 1970; 0 puts the run there.

    Raises:
        RecordingError: An argument is out of range, or the file is in use.
        OSError: The file cannot be created.
        MissingExtraError: The extra `logs` is not installed.
    """

    @checked(
        path=Path,
        model="RoverModel",
        terrain=TERRAINS,
        attributes=(Mapping, None),
        way=(np.ndarray, None),
        epoch=float,
    )
    def __init__(
        self,
        path: str | Path,
        model: RoverModel,
        terrain: Terrain,
        *,
        goal: tuple[float, float] | None = None,
        attributes: Mapping[str, Any] | None = None,
        way: npt.ArrayLike | None = None,
        epoch: float = 0.0,
    ) -> None:
        self._epoch = number("epoch", epoch, at_least=0.0, at_most=LATEST / 2, error=RecordingError)
        self._goal = None if goal is None else _pair("goal", goal)
        self._way = None if way is None else array("way", way, error=RecordingError)
        if self._way is not None and (
            self._way.ndim != 2 or self._way.shape[1] != 2 or not np.isfinite(self._way).all()
        ):
            refuse(RecordingError, "way", self._way.shape, "must be finite and have the shape (n, 2)")
        solver = (attributes or {}).get("solver")
        gravity = solver.get("gravity", EARTH) if isinstance(solver, dict) else EARTH
        self._gravity = np.array(vector("solver.gravity", gravity, 3, error=RecordingError))
        facts = storable({**versions(), **(attributes or {})})
        self._model, self._terrain = model, terrain
        self._shapes = {channel.name: channel.shape for channel in RoverSampler(model).channels}
        self._frames = scenery.identifiers(model.solid_names, taken=(messages.MAP, messages.WORLD))
        self._signs = _drive_signs(model)
        self._last: tuple[float, Array] | None = None  # time and velocity of the last row, for the IMU
        self._topics: dict[str, int] = {}
        self._file = McapFile(path)
        try:
            self._file.describe("rover_gym", {name: _text(value) for name, value in facts.items()})
        except RecordingError:
            self._file.discard()
            raise

    @property
    def path(self) -> Path:
        """The file."""
        return self._file.path

    def append(self, row: Mapping[str, npt.ArrayLike]) -> None:
        """Writes one row, as `RoverSampler.row` returns it; further channels go to `/signals`.

        The IMU is an ideal one at the trunk's origin: its acceleration is the mean since the last row.

        Args:
            row: Channels by name, with at least `time`, `q` and `v`.

        Raises:
            RecordingError: A channel is missing, not numeric, of a wrong shape or not finite; nothing is written. Or
                the file is closed or cannot be written; it is then closed.
        """
        values = self._checked(row)
        time, q, v = float(values.pop("time")), values.pop("q"), values.pop("v")
        stamp = self._stamp(time)
        if "scene" not in self._topics:
            self._topics["scene"] = 0
            self._file.write("/scene", stamp, self._scene(stamp, q))
        poses = self._model.poses(q, "state")
        frames = [(messages.MAP, messages.WORLD, np.zeros(3), MAP_FROM_WORLD)]
        for name in self._model.solid_names:
            place, turn = poses[name]
            frames.append((messages.WORLD, self._frames[name], place, turn @ messages.SOLID_FROM_LOGGED))
        self._file.write("/tf", stamp, messages.transforms(stamp, frames))
        efforts = {
            joint - 6: float(sign * torque)
            for (joint, sign), torque in zip(self._signs, values.get("motor_torques", np.empty(0)), strict=False)
        }
        names = self._model.dof_names[6:]
        self._file.write("/joint_states", stamp, messages.joint_states(stamp, names, q[6:], v[6:], efforts))
        self._own_imu(time, poses[self._model.solid_names[0]][1], v)
        wheels = {name: values.pop(name) for name in WHEEL_CHANNELS if name in values}
        if wheels:
            self._json("/wheels", stamp, self._by_wheel(wheels))
        values.pop("wheel_centres", None)  # they are in /tf
        if values:
            self._json("/signals", stamp, {name: _plain(value) for name, value in values.items()})

    def imu(
        self,
        time: float,
        rotation: npt.ArrayLike,
        angular_velocity: npt.ArrayLike,
        acceleration: npt.ArrayLike,
        *,
        frame: str | None = None,
        topic: str = "/imu/sensor",
    ) -> None:
        """Writes the reading of an IMU.

        Args:
            time: s.
            rotation: From the sensor's axes to the world, (3, 3).
            angular_velocity: In the sensor's axes, rad/s, (3,).
            acceleration: Acceleration minus gravity in the sensor's axes, m/s², (3,); at rest it points up.
            frame: The sensor's frame. By default the sensor has the trunk's axes, and the data are logged in the axes
                of REP 103.
            topic: The topic.

        Raises:
            RecordingError: An argument is out of range, or the file is closed or cannot be written.
        """
        stamp, turn = self._stamp(time), _finite("rotation", rotation, (3, 3))
        rates = _finite("angular_velocity", angular_velocity, (3,))
        felt = _finite("acceleration", acceleration, (3,))
        if topic not in self._topics:
            schema = self._topics.get("imu")
            if schema is None:
                schema = self._file.schema(messages.IMU_NAME, "ros2msg", messages.IMU_SCHEMA.encode())
                self._topics["imu"] = schema
            self._file.add_channel(topic, messages.IMU_NAME, "cdr", schema)
            self._topics[topic] = schema
        seen_from = frame
        if seen_from is None:
            seen_from, axes = self._frames[self._model.solid_names[0]], messages.SOLID_FROM_LOGGED
            turn, rates, felt = turn @ axes, axes.T @ rates, axes.T @ felt
        data = messages.imu(stamp, seen_from, MAP_FROM_WORLD @ turn, rates, felt)
        self._file.write_bytes(topic, stamp, data)

    def points(
        self, time: float, points: npt.ArrayLike, *, frame: str = messages.WORLD, topic: str = "/points"
    ) -> None:
        """Writes a point cloud, such as a scan or balls.

        Args:
            time: s.
            points: (n, 3), m; rows that are not finite, from rays without a hit, are left out.
            frame: The frame of the points: `world`, or a solid's or its name, y up. Those of a solid are logged in the
                axes of REP 103.
            topic: The topic.

        Raises:
            RecordingError: An argument is out of range, or the file is closed or cannot be written.
        """
        given = array("points", points, error=RecordingError)
        if given.ndim != 2 or given.shape[1] != 3:
            refuse(RecordingError, "points", given.shape, "must have the shape (n, 3)")
        stamp = self._stamp(time)
        seen = given[np.isfinite(given).all(axis=1)]
        frame = self._frames.get(frame, frame)
        if frame in self._frames.values():
            seen = seen @ messages.SOLID_FROM_LOGGED
        self._file.write(topic, stamp, messages.point_cloud(stamp, frame, seen))

    def image(
        self, time: float, pixels: npt.NDArray[np.uint8], *, frame: str = "camera", topic: str = "/camera"
    ) -> None:
        """Writes a rendered image.

        Args:
            time: s.
            pixels: (height, width, 3) uint8, top row first.
            frame: The camera's frame.
            topic: The topic.

        Raises:
            RecordingError: An argument is out of range, or the file is closed or cannot be written.
        """
        given = np.asarray(pixels)
        if given.dtype != np.uint8 or given.ndim != 3 or given.shape[2] != 3 or 0 in given.shape:
            refuse(RecordingError, "pixels", (given.shape, str(given.dtype)), "must be (height, width, 3) of uint8")
        stamp = self._stamp(time)
        self._file.write(topic, stamp, messages.image(stamp, frame, given))

    def camera(self, time: float, camera: Camera, reading: npt.ArrayLike) -> None:
        """Writes a picture of a camera, and with its first the camera's calibration and frame, which has its name.

        A colour image is compressed; labels and depths are not.

        Args:
            time: s.
            camera: The sensor.
            reading: What it reads, of the shape and the type that observations have.

        Raises:
            RecordingError: The camera is on a solid that the model lacks or reads images that are scaled, the reading
                is not one of its, or the file is closed or cannot be written.
        """
        stamp, given, shape = self._stamp(time), np.asarray(reading), (camera.height, camera.width)
        if camera.image not in (None, "uint8") or (isinstance(camera, DepthCamera) and camera.image is not None):
            refuse(RecordingError, "camera.image", camera.image, "must be uint8 colours, labels, or depths in m")
        if given.shape != (shape if camera.image is None else (*shape, 3)) or given.dtype != camera.reading_type:
            refuse(RecordingError, "reading", (given.shape, str(given.dtype)), f"must be of the camera {camera.name!r}")
        frame, topic = camera.name, f"/{camera.name}/calibration"
        if topic not in self._topics:
            solid = self._frames[camera.mount.solid_of(self._model)]
            place, turn = camera.mount.pose_on(self._model)
            own = messages.SOLID_FROM_LOGGED.T
            at = (solid, frame, own @ place, own @ turn @ messages.CAMERA_FROM_LOGGED)
            self._file.write("/tf", stamp, messages.transforms(stamp, [at]))
            self._file.write(topic, stamp, messages.calibration(stamp, frame, camera))
            self._topics[topic] = 0
        write = messages.image if given.ndim == 3 else messages.raw_image
        self._file.write(f"/{camera.name}/image", stamp, write(stamp, frame, given))

    def flush(self) -> None:
        """Writes all messages to the disk.

        Raises:
            RecordingError: The file is closed or cannot be written; it is then closed.
        """
        self._file.flush()

    def close(self) -> None:
        """Writes the remaining messages and the index. A second call does nothing.

        Raises:
            RecordingError: The disk is full; committed messages stay readable.
        """
        self._file.close()

    def discard(self) -> None:
        """Ends the log and removes it. A file that it was to replace stays."""
        self._file.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _checked(self, row: Mapping[str, npt.ArrayLike]) -> dict[str, Array]:
        """Copies of a row's values, checked."""
        values = {name: array(name, value, error=RecordingError) for name, value in row.items()}
        for name in ("time", "q", "v"):
            if name not in values:
                refuse(RecordingError, "row", sorted(values), f"must hold {name}")
        for name, value in values.items():
            shape = self._shapes.get(name, value.shape)
            if value.shape != shape:
                refuse(RecordingError, name, value.shape, f"must have the shape {shape}")
        for name in ("time", "q", "v"):
            if not np.isfinite(values[name]).all():
                refuse(RecordingError, name, values[name], "must be finite")
        return values

    def _stamp(self, time: object) -> int:
        seconds = self._epoch + number("time", time, error=RecordingError)
        if not 0.0 <= seconds <= LATEST:
            refuse(RecordingError, "time", time, f"must be from {-self._epoch:g} to {LATEST - self._epoch:g} s")
        return round(seconds * 1e9)

    def _own_imu(self, time: float, rotation: Array, v: Array) -> None:
        """Reading of an ideal IMU at the trunk's origin."""
        before, self._last = self._last, (time, v[:3].copy())
        if before is None or not time > before[0]:
            return
        felt = (v[:3] - before[1]) / (time - before[0]) - self._gravity
        self.imu(time, rotation, rotation.T @ v[3:6], rotation.T @ felt, topic="/imu")

    def _by_wheel(self, values: Mapping[str, Array]) -> dict[str, dict[str, float | None]]:
        found: dict[str, dict[str, float | None]] = {name: {} for name in self._model.wheel_names}
        for channel, rows in values.items():
            for name, row in zip(self._model.wheel_names, rows.reshape(len(rows), -1), strict=True):
                found[name] |= zip(WHEEL_CHANNELS[channel], map(_plain, row), strict=True)
        return found

    def _json(self, topic: str, stamp: int, content: Mapping[str, Any]) -> None:
        if topic not in self._topics:
            name = f"rover_gym.{topic[1:].title()}"
            shape = {"type": "object", "properties": {key: _schema_of(value) for key, value in content.items()}}
            self._topics[topic] = self._file.schema(name, "jsonschema", json.dumps(shape).encode())
            self._file.add_channel(topic, name, "json", self._topics[topic])
        self._file.write_bytes(topic, stamp, json.dumps(content, allow_nan=False).encode())

    def _scene(self, stamp: int, q: Array) -> Any:
        """The rover's shapes in its solids' frames, and the ground near the path, world."""
        way = self._way
        if way is None:
            way = q[[0, 2]] + REACH * np.array([[-1.0, -1.0], [1.0, 1.0]])
        rows = np.tile(q, (len(way), 1))
        rows[:, [0, 2]] = way
        run = RoverRun(Trajectory({"q": rows}, {}, {}), self._model, self._terrain, self._goal)
        found = messages.scene(stamp)
        for name, parts in scenery.parts_by_solid(run).items():
            if parts:
                meshes = [
                    (colour, vertices @ messages.SOLID_FROM_LOGGED, faces)
                    for colour, vertices, faces in scenery.coloured_meshes(parts)
                ]
                messages.add_meshes(found, stamp, f"rover/{name}", self._frames[name], meshes)
        tiles = scenery.ground_tiles(run)
        if tiles is not None:
            vertices, light, dark = tiles
            first, second = scenery.ground_colours(run)
            colours = ((first, vertices, light), (second, vertices, dark))
            messages.add_meshes(found, stamp, "ground", messages.WORLD, colours)
        for i, (vertices, faces) in enumerate(scenery.surfaces(run)):
            coloured = [(colour, vertices, triangles) for colour, triangles in faces]
            messages.add_meshes(found, stamp, f"surface/{i}", messages.WORLD, coloured)
        centres, radii = scenery.spheres(run)
        if len(radii):
            messages.add_spheres(found, stamp, "rocks", centres, radii, ROCK_COLOUR)
        if self._goal is not None:
            goal = scenery.coloured_meshes(scenery.goal_parts(run))
            messages.add_meshes(found, stamp, "goal", messages.WORLD, goal)
        return found


def _drive_signs(model: RoverModel) -> list[tuple[int, float]]:
    """The index of each wheel's joint in `dof_names`, and the sign of a torque that drives it forward."""
    wheels = model.to_dict()["wheels"]
    joints = {name: i for i, name in enumerate(model.dof_names)}
    return [(joints.get(wheel["solid"], 0), wheel.get("drive_sign", 1.0)) for wheel in wheels]


def _pair(field: str, value: object) -> tuple[float, float]:
    x, z = vector(field, value, 2, error=RecordingError)
    return x, z


def _finite(field: str, value: npt.ArrayLike, shape: tuple[int, ...]) -> Array:
    given = array(field, value, error=RecordingError)
    if given.shape != shape or not np.isfinite(given).all():
        refuse(RecordingError, field, value, f"must be finite and have the shape {shape}")
    return given


def _plain(value: Any) -> Any:
    """A number, or nested lists of numbers, for JSON; None for values that are not finite."""
    if np.ndim(value):
        return [_plain(entry) for entry in value]
    return float(value) if np.isfinite(value) else None


def _schema_of(value: Any) -> dict[str, Any]:
    if isinstance(value, dict):
        return {"type": "object", "properties": {key: _schema_of(entry) for key, entry in value.items()}}
    if isinstance(value, list):
        return {"type": "array", "items": {"type": ["number", "null"]}}
    return {"type": ["number", "null"]}


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(np.asarray(value).tolist())


#: Images a second.
FPS = 10.0


@checked(run="RoverRun", path=Path, images=bool, cameras=["Camera"], fps=float, progress=callable)
def write_mcap(
    run: RoverRun,
    path: str | Path,
    *,
    images: bool = False,
    cameras: Sequence[Camera] = (),
    fps: float = FPS,
    progress: Callable[[int], None] = lambda _rows: None,
) -> Path:
    """Writes a recorded run as MCAP, every sample of it. Its laser and depth are point clouds.

    Args:
        run: The run.
        path: The file to write, with its folder.
        images: Whether to render it, as the environments render their frames (extra `render`).
        cameras: Cameras of the rover, which see it drive again, without ruts. They need no renderer.
        fps: Images a second.
        progress: Called with the number of rows that are written.

    Raises:
        RecordingError: The run lacks `q` or `v`, the file is in use, or it cannot be written.
        OptionError: `fps` is not a positive number, or `cameras` are none.
        OSError: The file cannot be created, or no OpenGL library works.
        MissingExtraError: An extra is not installed.
    """
    data = run.trajectory.data
    if "v" not in data:
        refuse(RecordingError, "run", sorted(data), "must hold v")
    pictured = frozenset(film_rows(run.time, fps).tolist()) if images or cameras else frozenset()
    if not isinstance(cameras, (list, tuple)) or not all(isinstance(camera, Camera) for camera in cameras):
        refuse(OptionError, "cameras", cameras, "must be a list of cameras")
    for camera in cameras:
        camera.check(run.model)
    simulation = Simulation(run.model, run.terrain)
    with ExitStack() as stack:
        renderer = None
        if images:
            require("vtkmodules", "render")
            from rover_gym.show.frames.frame_renderer import FrameRenderer  # noqa: PLC0415 - VTK is slow to load

            renderer = stack.enter_context(FrameRenderer(run.model, run.terrain, goal=run.goal))
        way, attributes = data["q"][:, [0, 2]], run.trajectory.attributes
        make = partial(McapWriter, path, run.model, run.terrain, goal=run.goal, attributes=attributes, way=way)
        writer = stack.enter_context(_whole_log(make))
        scans = {name: (sensor_of(name, run.model), data[name]) for name in SENSORS if name in data}
        rows = {name: values for name, values in data.items() if name not in scans}
        generators = [np.random.default_rng(k) for k in range(len(cameras))]
        drawing = [
            (camera, camera.draw(run.model, generator), generator)
            for camera, generator in zip(cameras, generators, strict=True)
        ]
        for i in range(run.n_frames):
            writer.append({name: values[i] for name, values in rows.items()})
            for name, (sensor, readings) in scans.items():
                solid = sensor.mount.solid_of(run.model)
                writer.points(
                    float(run.time[i]), hits(sensor, run.model, readings[i]), frame=solid, topic=f"/{name}/points"
                )
            if i in pictured:
                time = float(run.time[i])
                simulation.set_state(data["q"][i])
                if renderer is not None:
                    writer.image(time, renderer.render(simulation))
                moment = Moment(simulation, time)
                for camera, drawn, generator in drawing:
                    reading, _ = camera.measure(moment, {}, 0.0, drawn, generator)
                    writer.camera(time, camera, reading.astype(camera.reading_type))
            progress(i + 1)
    return writer.path


@contextmanager
def _whole_log(make: Callable[[], McapWriter]) -> Iterator[McapWriter]:
    """A log that is removed if the block does not finish it; a full disk is an `OSError` that names the file."""
    writer = None
    try:
        writer = make()
        yield writer
        writer.close()
    except BaseException as error:
        if writer is not None:
            writer.discard()
        if isinstance(error, RecordingError) and isinstance(reason := error.__cause__, OSError):
            raise OSError(reason.errno, reason.strerror, error.value) from error
        raise
