"""Drives a robot from its URDF here and in Drake: `python benchmarks/comparison/robot_file.py ROBOT.urdf --help`.

Both start at rest on level ground. A drive has a torque for the wheels of each side, and the joints that steer move
within a second to set-points about a common turning centre. Drake reads masses and joints from the file itself; of this
project it takes the radii and places of the wheels, the gains of the steering and the pose of the start. A wheel is
one sphere in Drake, or two at the ends of a tread that has a width, which on level ground touch where an upright
cylinder does. Distances are those of the root's origin.

Drake is not installed with the project: `make peers`, or `pip install drake yourdfpy` in an environment with it.
"""

import argparse
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import Box, CollisionFilterDeclaration, GeometrySet, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import PdControllerGains

sys.path += [str(Path(__file__).parents[1]), str(Path(__file__).parents[2] / "tests")]

from models.drives import FRICTION, SAMPLE, Part, commands, start

from comparison.peers.drake import DrakePlant, material
from rover_gym import RoverModel, Simulation
from rover_gym.models.robot_tree import right_angle

GRAVITY = 9.81
#: Of Drake's contacts: dissipation (Hunt and Crossley), s/m, and the speed below which its friction creeps, m/s. At
#: Drake's own, wheels that stick against each other lose what they bear in a second.
DISSIPATION, CREEP = 50.0, 1e-6
#: Edge of its ground, m.
GROUND = 200.0


@dataclass
class Drive:
    """Where a drive ended: path (n, 3) of the root's origin, x forward and z up, m, and loads of the wheels, N."""

    path: np.ndarray
    loads: np.ndarray

    def distance(self, other: "Drive") -> float:
        """Between the ends, m."""
        return float(np.linalg.norm(self.path[-1] - other.path[-1]))

    def length(self) -> float:
        """Of the path, m."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


def here(model: RoverModel, parts: tuple[Part, ...], step: float) -> Drive:
    """The drive in this project."""
    sim = Simulation(model, friction=FRICTION, time_step=step)
    sim.set_state(start(model))
    places = [sim.q[:3]]
    for torques, set_points in commands(model, parts):
        sim.set_commands(torques, set_points)
        report = sim.step(round(SAMPLE / step))
        if not report.is_converged:
            print(f"not converged at {len(places) * SAMPLE:g} s: {report}")  # noqa: T201
        places.append(sim.q[:3])
    x, y, z = np.array(places).T
    return Drive(np.column_stack([x, -z, y]), sim.wheel_forces[:, 0])


def for_drake(path: Path, *, snap: bool = True) -> str:
    """The file without what is drawn or touches, whose meshes Drake would look for.

    `snap`: whether angles such as 1.5708 become multiples of pi/2, as in the import here.
    """
    root = ET.parse(path).getroot()  # noqa: S314 - the reader's own file
    for origin in root.iter("origin") if snap else ():
        words = origin.get("rpy", "0 0 0").split()
        origin.set("rpy", " ".join(repr(meant[0]) if (meant := right_angle(word)) else word for word in words))
    for link in root.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    for child in root.findall("transmission"):
        root.remove(child)
    return ET.tostring(root, encoding="unicode")


def spheres(path: Path, model: RoverModel, *, snap: bool) -> list[list[np.ndarray]]:
    """Centres of the spheres of every wheel, one or two, in the frames of the file's links."""
    plant = MultibodyPlant(0.0)
    (robot,) = Parser(plant).AddModelsFromString(for_drake(path, snap=snap), "urdf")
    plant.Finalize()
    context, poses, found = plant.CreateDefaultContext(), model.poses(np.zeros(model.nq)), []
    plant.SetFreeBodyPose(context, plant.get_body(plant.GetBodyIndices(robot)[0]), RigidTransform())
    for wheel in model.to_dict()["wheels"]:
        position, rotation = poses[wheel["solid"]]
        axle = rotation @ wheel["axle"]
        ends = (-0.5, 0.5) if wheel.get("width") else (0.0,)
        centres = [position + end * wheel.get("width", 0.0) * axle / np.linalg.norm(axle) for end in ends]
        pose = plant.GetBodyByName(wheel["solid"]).EvalPoseInWorld(context)
        found.append([pose.inverse() @ np.array([x, -z, y]) for x, y, z in centres])
    return found


def in_drake(
    path: Path, model: RoverModel, parts: tuple[Part, ...], step: float, stiffness: float, *, snap: bool = True
) -> Drive:
    """The drive in Drake's discrete plant: contacts are springs, and its solver is that of rigid Coulomb friction."""
    own = DrakePlant((0.0, 0.0, -GRAVITY), step, DiscreteContactApproximation.kLagged)
    plant = own.plant
    plant.set_stiction_tolerance(CREEP)
    (robot,) = Parser(plant).AddModelsFromString(for_drake(path, snap=snap), "urdf")
    properties = material(FRICTION, 2.0 * stiffness, DISSIPATION)  # of each of the two sides, which act in series
    below = RigidTransform([0.0, 0.0, -5.0])
    plant.RegisterCollisionGeometry(plant.world_body(), below, Box(GROUND, GROUND, 10.0), "ground", properties)
    description = model.to_dict()
    wheels, solids = description["wheels"], {solid["name"]: solid for solid in description["solids"]}
    joint_of = {plant.get_joint(j).child_body().name(): plant.get_joint(j) for j in plant.GetJointIndices(robot)}
    for wheel, places in zip(wheels, spheres(path, model, snap=snap), strict=True):
        for k, place in enumerate(places):
            body = plant.GetBodyByName(wheel["solid"])
            name = f"{wheel['name']}_{k}"
            plant.RegisterCollisionGeometry(body, RigidTransform(place), Sphere(wheel["radius"]), name, properties)
    driven = [plant.AddJointActuator(f"drive_{w['name']}", joint_of[w["solid"]]) for w in wheels]
    steered = [name for name in dict.fromkeys(w.get("steering") for w in wheels) if name]
    held = [plant.AddJointActuator(f"steer_{name}", joint_of[name]) for name in steered]
    for name, actuator in zip(steered, held, strict=True):
        hold = solids[name]["hold"]
        actuator.set_controller_gains(PdControllerGains(p=hold["stiffness"], d=hold["damping"]))
    plant.Finalize()
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(robot)]
    touching = GeometrySet([g for body in bodies for g in plant.GetCollisionGeometriesForBody(body)])
    own.graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(touching))
    own.finish()
    context = own.context
    root = plant.GetBodyByName(description["solids"][0]["name"])
    q = start(model)
    angles = dict(zip(model.dof_names[6:], q[6:], strict=True))
    plant.SetFreeBodyPose(context, root, RigidTransform(RollPitchYaw(q[3], -q[5], q[4]), [q[0], -q[2], q[1]]))
    signs = {}
    for name, joint in joint_of.items():
        if angles.get(name):
            joint.set_angle(context, angles[name])
    for name in steered:
        axis = joint_of[name].frame_on_parent().CalcPoseInWorld(context).rotation() @ joint_of[name].revolute_axis()
        signs[name] = float(np.sign(axis[2]))
    n_desired = plant.get_desired_state_input_port(robot).size()
    places = [root.EvalPoseInWorld(context).translation()]
    for k, (torques, set_points) in enumerate(commands(model, parts), 1):
        of = {w.get("steering"): point for w, point in zip(wheels, set_points, strict=True)}
        actuation, desired = np.zeros(len(driven) + len(held)), np.zeros(n_desired)
        actuation[: len(driven)] = [w["drive_sign"] * t for w, t in zip(wheels, torques, strict=True)]
        for i, name in enumerate(steered):
            at = len(driven) + i if n_desired == 2 * len(actuation) else i
            desired[at] = signs[name] * of[name]
        plant.get_actuation_input_port(robot).FixValue(context, actuation)
        plant.get_desired_state_input_port(robot).FixValue(context, desired)
        own.simulator.AdvanceTo(k * SAMPLE)
        places.append(root.EvalPoseInWorld(context).translation())
    return Drive(np.array(places), _loads(plant, context, wheels))


def _loads(plant, context, wheels) -> np.ndarray:
    """Vertical force of the ground on each wheel in Drake, N."""
    results = plant.get_contact_results_output_port().Eval(context)
    found = {wheel["solid"]: 0.0 for wheel in wheels}
    for i in range(results.num_point_pair_contacts()):
        contact = results.point_pair_contact_info(i)
        for index in (contact.bodyA_index(), contact.bodyB_index()):
            name = plant.get_body(index).name()
            if name in found:
                found[name] += abs(float(contact.contact_force()[2]))
    return np.array([found[wheel["solid"]] for wheel in wheels])


def table(drives: Iterator[tuple[str, Drive]]) -> None:
    """Prints one line a drive; distances are from the first."""
    first = None
    for name, drive in drives:
        first = first or drive
        x, y, z = drive.path[-1]
        loads = " ".join(f"{load:.1f}" for load in drive.loads)
        away = 1e3 * drive.distance(first)
        print(  # noqa: T201
            f"{name:32} {drive.length():6.3f} m  ({x:.4f}, {y:.4f}, {z:.4f})  {away:8.2f} mm  loads {loads} N",
            flush=True,
        )


def main() -> None:
    """Drives the robots and prints where they end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--torques", nargs=2, type=float, default=(0.05, 0.05), help="left and right, N m a wheel")
    parser.add_argument("--radius", type=float, default=np.inf, help="of the turn to the left, m, if wheels steer")
    parser.add_argument("--time", type=float, default=5.0, help="s")
    parser.add_argument("--steps", nargs="+", type=float, default=[5.0], help="here, ms")
    parser.add_argument("--drake", nargs="*", type=float, default=[], help="stiffnesses of Drake's contacts, N/m")
    parser.add_argument("--drake-step", type=float, default=0.2, help="ms")
    parser.add_argument("--as-written", action="store_true", help="Drake takes angles such as 3.14159 as they are")
    parser.add_argument("--wheel-width", type=float, default=None, help="m; the file's, if not given")
    parser.add_argument("--wheel-stiffness", type=float, default=None, help="N/m; the import's, if not given")
    given = parser.parse_args()
    parts = (Part(given.time, *given.torques, given.radius),)
    options = {"wheel_width": given.wheel_width, "wheel_stiffness": given.wheel_stiffness}
    models = [(path, RoverModel.from_urdf(path, **options)) for path in given.files]

    def drives() -> Iterator[tuple[str, Drive]]:
        for path, model in models:
            for stiffness in given.drake:
                step = 1e-3 * given.drake_step
                drive = in_drake(path, model, parts, step, stiffness, snap=not given.as_written)
                yield f"{path.stem}, Drake, {stiffness:g} N/m", drive
        for path, model in models:
            for step in given.steps:
                yield f"{path.stem}, {step:g} ms", here(model, parts, 1e-3 * step)

    table(drives())


if __name__ == "__main__":
    main()
