"""What each extra promises: a script that needs nothing else, run in an environment that has just the wheel and it.

A script runs in an empty folder. `rover(...)` runs a command of the installed package and returns what it printed.
"""

BEGIN = """
import json
import subprocess
import sys
from pathlib import Path

import numpy as np


def rover(*arguments):
    command = [str(Path(sys.executable).with_name("rover")), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def refused(extra, *arguments):
    command = [str(Path(sys.executable).with_name("rover")), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2, done.stdout
    assert f"pip install 'rover-gym[{extra}]'" in done.stderr, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr


RECORDED = ("drive", "--time-limit", "0.5", "--output", "run")
"""

#: Scripts by extra; "" is the wheel alone.
PROMISES = {
    "": """
(episode,) = json.loads(rover("drive", "--json"))["episodes"]
assert episode["success"], episode
rover(*RECORDED)
from rover_gym.record import read_run

assert read_run("run/episode-0.h5").n_frames == 11
rover("replay", "run/episode-0.h5", "--html", "page.html")
assert Path("page.html").stat().st_size > 100_000
refused("replay", "live")
refused("demo", "plot", "run/episode-0.h5")
rover("grains", "collapse", "--balls", "60", "--tube", "0.03", "--duration", "0.05", "--output", "grains")
refused("render", "drive", "--no-record", "--film", "film.mp4")
refused("models", "model", "show", "robot.urdf") if Path("robot.urdf").exists() else None

import gymnasium as gym

env = gym.make("rover_gym:RoverRocks-v0", height_scan=True)
env.reset(seed=0)
assert env.step(env.action_space.sample())[0].dtype == np.float32
rover("export", "fmu", "--output", "rover.fmu")
assert Path("rover.fmu").stat().st_size > 100_000
envs = gym.make_vec("RoverRocks-v0", num_envs=3)
envs.reset(seed=0)
assert envs.step(envs.action_space.sample())[1].shape == (3,)
for driver in ("anywhere", "scan", "foresight"):
    rover("drive", "--difficulty", "1", "--policy", driver, "--time-limit", "1")
""",
    "replay": """
rover(*RECORDED)
rover("replay", "run/episode-0.h5", "--html", "page.html", "--vrml", "run.wrl", "--gltf", "run.glb")
assert Path("page.html").stat().st_size > 100_000
assert Path("run.wrl").read_text(encoding="utf-8").startswith("#VRML V2.0")
assert Path("run.glb").read_bytes().startswith(b"glTF")
rover("grains", "collapse", "--balls", "60", "--tube", "0.03", "--duration", "0.05", "--output", "grains")
rover("replay", "grains/collapse.h5", "--html", "grains.html")
""",
    "render": """
rover("drive", "--time-limit", "0.3", "--difficulty", "1", "--film", "film.mp4")
assert Path("film.mp4").stat().st_size > 1000

import gymnasium as gym

env = gym.make("rover_gym:Rover-v0", render_mode="rgb_array")
env.reset(seed=0)
frame = env.render()
assert frame.dtype == np.uint8 and np.ptp(frame) > 50, frame.shape
env = gym.wrappers.RecordVideo(env, "films")
env.reset(seed=0)
env.step(env.action_space.sample())
env.close()
assert list(Path("films").glob("*.mp4"))
import pygame
""",
    "demo": """
rover(*RECORDED, "--film", "film.mp4")
rover("plot", "run/episode-0.h5", "--output", "plots")
assert len(list(Path("plots").glob("*.png"))) == 7
rover("replay", "run/episode-0.h5", "--html", "page.html")
rover("planar", "rover", "--duration", "0.5", "--output", "planar")
rover("planar", "disks", "--duration", "0.05", "--output", "planar")
assert Path("planar/disks.mp4").stat().st_size > 1000
rover("report", "--duration", "1", "--figures", "--output", "report")
rover("model", "show", "mars-rover", "--picture", "rover.png")
rover("grains", "collapse", "--balls", "60", "--tube", "0.03", "--duration", "0.05", "--film", "--output", "grains")
""",
    "maps": """
import rasterio
import trimesh
from PIL import Image
from rasterio.transform import from_origin

rng = np.random.default_rng(0)
heights = np.cumsum(rng.normal(0.0, 0.01, (60, 60)), axis=1).astype(np.float32)
np.save("map.npy", heights)
Image.fromarray(np.uint16(1000 * (heights - heights.min()))).save("map.png")
about = {"driver": "GTiff", "width": 60, "height": 60, "count": 1, "dtype": "float32", "crs": "EPSG:32633"}
with rasterio.open("map.tif", "w", transform=from_origin(0.0, 30.0, 0.5, 0.5), **about) as file:
    file.write(heights, 1)
BRIEFLY = ("--goal", "4", "0", "--time-limit", "0.2")
rover("drive", "--terrain", "map.tif", *BRIEFLY)
rover("drive", "--terrain", "map.npy", "--spacing", "0.5", *BRIEFLY)
rover("drive", "--terrain", "map.png", "--spacing", "0.5", "--height-range", "0", "1", *BRIEFLY)

from rover_gym import TriangleMesh

for ending in ("obj", "ply", "stl", "off", "glb"):
    trimesh.creation.box((30.0, 1.0, 30.0)).export(f"ground.{ending}")
    TriangleMesh.from_file(f"ground.{ending}")
rover("drive", "--terrain", "ground.stl", *BRIEFLY)
""",
    "agents": """
import rover_gym

env = rover_gym.parallel_env(2)
env.reset(seed=0)
env.step({agent: env.action_space(agent).sample() for agent in env.agents})
""",
    "ros": """
from rover_gym.ros import DrivenRover, NodeOptions, RosNode, open_transport
from rover_gym.show.live import LiveRover

node = RosNode(DrivenRover(LiveRover()), open_transport("cyclonedds", "rover", "/"), options=NodeOptions(pace=0.0))
for _ in range(20):
    node.step()
node.close()
""",
    "planning": """
rover("drive", "--difficulty", "1", "--policy", "planner", "--time-limit", "0.5")
""",
    "jax": """
import jax
import numpy as np
from rover_gym import Simulation
from rover_gym.derivatives import jax_rollout

drive = jax_rollout(Simulation())
far = jax.grad(lambda commands: drive(jax.numpy.zeros(42).at[1].set(1.0), commands)[-1, 0])
assert far(jax.numpy.zeros((2, 12))).shape == (2, 12)
""",
    "models": """
from rover_gym import RoverModel

model = RoverModel.named("skid-steered")
model.to_urdf("robot.urdf")
model.to_mjcf("robot.xml")
for name in ("robot.urdf", "robot.xml"):
    rover("model", "show", name)
    rover("model", "import", name, "--output", "read.toml")
    rover("drive", "--model", "read.toml", "--time-limit", "0.2")
""",
    "data": """
rover("dataset", "rover/random-v0", "--policy", "random", "--episodes", "1", "--output", "sets")
assert list(Path("sets/rover/random-v0").rglob("*.hdf5"))
""",
    "onnx": """
rover("export", "onnx", "anywhere", "--output", "arcs.onnx")
rover("export", "onnx", "foresight", "--output", "forecast.onnx")
import onnx

onnx.checker.check_model("arcs.onnx", full_check=True)
""",
    "logs": """
rover(*RECORDED)
rover("export", "mcap", "run/episode-0.h5", "--output", "run.mcap")
(log,) = Path(".").rglob("*.mcap")
from mcap.reader import make_reader

with log.open("rb") as stream:
    assert make_reader(stream).get_summary().statistics.message_count > 10
""",
    "all": """
rover(*RECORDED, "--film", "film.mp4")
rover("plot", "run/episode-0.h5", "--output", "plots")
rover("export", "mcap", "run/episode-0.h5")
rover("export", "onnx", "anywhere", "--output", "arcs.onnx")
import jax, lxml, minari, mujoco, rasterio, stable_baselines3, websockets
""",
    "train": """
scene = "scenes: {plane: {environment: {terrain: plane, goal_distance: 2}}}"
imitation = "imitation: {rounds: 1, decisions: 100, epochs: 1}"
Path("tiny.yaml").write_text(f"{scene}\\nrovers: 4\\n{imitation}\\nppo: null\\n", encoding="utf-8")
rover("train", "tiny.yaml", "--workers", "1", "--output", "run")
rover("drive", "--policy", "run", "--time-limit", "0.2")
rover("evaluate", "run", "pd", "--terrain", "plane", "--episodes", "2", "--output", "evaluation")
""",
}

#: Extras that serve the repository and not the wheel, with the target that runs them.
OF_THE_REPOSITORY = {"test": "test", "docs": "docs", "peers": "chart"}

#: The extra whose promise is the manual's page on clusters.
CLUSTER = "rllib"
