"""What a rover sees and intends, recorded and shown: height scan, laser, depth camera and planned path."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.drive.scan.scan_policy import PLAN_POINTS
from rover_gym.envs.sensors import DepthCamera, LaserScanner, Mount
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.envs.start import check_scan, scan_points
from rover_gym.ground.terrain_parts import bare_heights, heights_of
from rover_gym.record.channels import Channel
from rover_gym.show.replay.page_scene import FrameChannel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rover_gym.core import RoverModel, Simulation, Terrain
    from rover_gym.drive.commands.driven import Policy
    from rover_gym.envs.rover_env import RoverEnv
    from rover_gym.show.replay.page_scene import PageScene

Array = npt.NDArray[np.float64]

#: The sensors that a drive may carry, by the names of their channels.
SENSORS = ("laser", "depth")

#: A policy's channel: its path ahead and to the right of the trunk, m.
PATH = "plan_path"

NO_SENSOR = "this run has no {}: record with `rover drive --sensor {}`"
NO_PLAN = "this policy recorded no path: drive with `--policy scan`, `foresight` or `planner`"
NO_LIVE_PLAN = "this driver plans no path: choose scan, foresight or planner"
NO_LIVE_SCAN = "this driver has no height scan: choose scan or foresight"
NO_SCAN = "this run has no height scan: drive with `--policy scan`, or set `height_scan`"


def sensor_of(name: str, model: RoverModel) -> LaserScanner | DepthCamera:
    """The sensor of a name, mounted as high on a rover as its size asks for."""
    reach = float(model.clear_radius)
    if name == "laser":
        mount = Mount(position=(0.0, 0.6 * reach, 0.0))
        return LaserScanner(
            name=name, mount=mount, rays=120, elevations_deg=(-14.0, -7.0), max_range=8.0 * reach, sees_rover=False
        )
    mount = Mount(position=(0.4 * reach, 0.6 * reach, 0.0), pitch_deg=-25.0)
    return DepthCamera(name=name, mount=mount, width=32, height=24, max_range=6.0 * reach, sees_rover=False)


def distances(name: str, simulation: Simulation) -> Array:
    """What a sensor of `sensor_of` measures now, (n,), m."""
    sensor = sensor_of(name, simulation.model)
    generator = np.random.default_rng(0)  # without noise it draws nothing
    moment = Moment(simulation, simulation.time)
    reading, _ = sensor.measure(moment, {}, 0.0, sensor.draw(simulation.model, generator), generator)
    return np.asarray(reading, dtype=np.float64).ravel()


def hits(sensor: LaserScanner | DepthCamera, model: RoverModel, reading: Array) -> Array:
    """(n, 3) places, m, that the rays of a reading (n,) hit, in the frame of the solid; nan where they hit nothing."""
    place, rotation = sensor.mount.pose_on(model)
    distance = np.where((reading > 0.0) & (reading < sensor.max_range), reading, np.nan)
    return np.asarray(place + distance[:, None] * (sensor.directions.reshape(-1, 3) @ rotation.T))


@dataclass
class Overlays:
    """What there is to show of n samples.

    Attributes:
        scan: (n_points, 2) the height scan's points, ahead and to the right of the trunk, m.
        heights: (n, n_points) heights of the ground at its points, m; nan where it is unknown.
        readings: (n, n_rays) distances by sensor, m.
        path: (n, n_points, 2) the planned path, ahead and to the right of the trunk, m; nan without.
        arcs: (n_arcs, n_points, 2) what the planner chooses from, in the same frame.
        path_heights: (n, n_points) heights of the ground under the path, m.
        arc_heights: (n, n_arcs, n_points) under the arcs, m.
        missing: Why an overlay has nothing to show, by its name.
    """

    scan: Array | None = None
    heights: Array | None = None
    readings: dict[str, Array] = field(default_factory=dict)
    path: Array | None = None
    arcs: Array | None = None
    path_heights: Array | None = None
    arc_heights: Array | None = None
    missing: dict[str, str] = field(default_factory=dict)

    def channels(self) -> list[FrameChannel]:
        """The channels of a scene's frames."""
        found = []
        if self.heights is not None:
            found.append(FrameChannel.fine("scan", np.nan_to_num(self.heights, nan=-1e5)[..., None]))
        for name, values in self.readings.items():
            found.append(FrameChannel.within(name, values[..., None], np.zeros(1), np.full(1, 65.535)))
        if self.path is not None and self.path_heights is not None:
            path = np.concatenate((self.path, self.path_heights[..., None]), axis=2)
            found.append(FrameChannel.coarse("path", np.nan_to_num(path, nan=-1e5)))
        if self.arc_heights is not None:
            flat = self.arc_heights.reshape(len(self.arc_heights), -1, 1)
            found.append(FrameChannel.coarse("arc-heights", flat))
        return found

    def lay(self, terrain: Terrain, q: Array) -> None:
        """Lays path and arcs on the ground, for coordinates (n, nq)."""
        if self.path is not None:
            self.path_heights = draped(self.path, terrain, q)
        if self.arcs is not None:
            flat = draped(self.arcs.reshape(1, -1, 2), terrain, q)
            self.arc_heights = flat.reshape(len(q), *self.arcs.shape[:2])

    def tracks(self) -> list[Channel]:
        """The channels of a recording. The height scan has none: it follows from ground and pose."""
        found = [
            Channel(name, "m", f"distances that the {name} sensor measures", (values.shape[1],))
            for name, values in self.readings.items()
        ]
        if self.path is not None:
            what = "planned path, ahead and to the right of the trunk"
            found.append(Channel(PATH, "m", what, (self.path[0].size,)))
        return found

    def row(self) -> dict[str, Array]:
        """The values of `tracks`, of the first sample."""
        row = {name: values[0] for name, values in self.readings.items()}
        return row if self.path is None else row | {PATH: self.path[0].ravel()}

    def facts(self) -> dict[str, Any]:
        """What does not change, for the scene of a recording."""
        return {} if self.arcs is None else {"arcs": np.round(self.arcs, 4).tolist()}

    def describe(self, scene: PageScene, model: RoverModel) -> None:
        """Adds what does not change: grid, rays and arcs, and why something is missing."""
        scene.facts["missing"] = self.missing
        if self.heights is not None and self.scan is not None:
            scene.arrays["scan-grid"] = ("f4", self.scan.ravel())
        for name in self.readings:
            sensor = sensor_of(name, model)
            place, rotation = sensor.mount.pose_on(model)
            along = sensor.directions.reshape(-1, 3) @ rotation.T
            scene.arrays[f"{name}-rays"] = ("f4", along.ravel())
            scene.facts[name] = {"origin": place.tolist(), "range": sensor.max_range}
        if self.arcs is not None:
            scene.arrays["arcs"] = ("f4", self.arcs.ravel())
            scene.facts["arcs"] = self.arcs.shape[1]


def live_overlays(env: RoverEnv, driver: Policy | None, state: Any, sensors: Sequence[str] = SENSORS) -> Overlays:
    """What a rover sees now, and what its driver intends.

    Args:
        env: The rover's environment.
        driver: Who drives; None by hand.
        state: What the driver carries from one prediction to the next.
        sensors: Names of the sensors that the rover carries.
    """
    simulation = env.simulation
    overlays = Overlays(scan=env.task.scan)
    if overlays.scan is None:
        overlays.missing["scan"] = NO_LIVE_SCAN
    else:
        overlays.heights = scan_heights(overlays.scan, simulation.terrain, simulation.q[None])
    overlays.readings = {name: distances(name, simulation)[None] for name in sensors}
    if driver is None or not hasattr(driver, "plan"):
        overlays.missing["plan"] = NO_LIVE_PLAN
    else:
        path = driver.plan(state)
        overlays.path = np.full((1, PLAN_POINTS, 2), np.nan) if path is None else path[None]
        choices = getattr(driver, "choices", None)
        overlays.arcs = None if choices is None else choices()
        overlays.lay(simulation.terrain, simulation.q[None])
    return overlays


def scan_heights(scan: Array, terrain: Terrain, q: Array) -> Array:
    """(n, n_points) heights, m, of the ground at a scan's points for coordinates (n, nq); nan where it is unknown."""
    places = [scan_points(scan, (float(row[0]), float(row[2])), float(row[4])) for row in q]
    return heights_of(terrain, np.concatenate(places)).reshape(len(q), -1)


def draped(points: Array, terrain: Terrain, q: Array) -> Array:
    """(n, k) heights of the ground, m, without its rocks, at points (n, k, 2) ahead and to the right of the trunk.

    Where the ground is unknown, they are the trunk's.
    """
    sine, cosine = np.sin(q[:, 4, None]), np.cos(q[:, 4, None])
    ahead, right = points[..., 0], points[..., 1]
    x, z = q[:, 0, None] + cosine * ahead + sine * right, q[:, 2, None] - sine * ahead + cosine * right
    heights = bare_heights(terrain, np.stack((x, z), axis=-1)).reshape(x.shape)
    return np.where(np.isfinite(heights), heights, q[:, 1, None])


def recorded_overlays(data: Mapping[str, Array], scene: Mapping[str, Any], terrain: Terrain) -> Overlays:
    """What a recording holds.

    Args:
        data: Its channels.
        scene: Its scene, as `rover drive` describes it.
        terrain: Its ground.
    """
    overlays = Overlays()
    given = scene.get("height_scan")
    scan = check_scan("height_scan", tuple(given) if isinstance(given, list) else given)
    if scan is None or "q" not in data:
        overlays.missing["scan"] = NO_SCAN
    else:
        overlays.scan, overlays.heights = scan.offsets, scan_heights(scan.offsets, terrain, data["q"])
    for name in SENSORS:
        if name in data:
            overlays.readings[name] = data[name]
        else:
            overlays.missing[name] = NO_SENSOR.format(name, name)
    if PATH in data:
        overlays.path = data[PATH].reshape(len(data[PATH]), -1, 2)
        if isinstance(scene.get("arcs"), list):
            overlays.arcs = np.asarray(scene["arcs"], dtype=np.float64)
        if "q" in data:
            overlays.lay(terrain, data["q"])
    else:
        overlays.missing["plan"] = NO_PLAN
    return overlays
