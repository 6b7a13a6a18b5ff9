"""Reads an MJCF into a `RobotTree`. MuJoCo compiles it, so defaults, includes, angles and inertias are MuJoCo's.

In MuJoCo, time grows with the square of the number of copies and memory with the size of height fields, and compilation
cannot be interrupted. Files that are too large are therefore rejected before compilation.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from rover_gym.core.extras import require
from rover_gym.core.rotations import from_quaternion
from rover_gym.models.import_report import Array
from rover_gym.models.loops import FileLoop, LoopEnd
from rover_gym.models.model_paths import is_urdf
from rover_gym.models.robot_tree import (
    MAX_LINKS,
    FileJoint,
    FileLink,
    FileShape,
    RobotTree,
    check_size,
    refuse_in,
    right_angle,
)


def complete_right_angles(mujoco: Any, spec: Any) -> list[str]:
    """Replaces rounded right angles by exact ones in the orientations of bodies, frames, shapes and inertias.

    Args:
        mujoco: The module.
        spec: A specification (`mujoco.MjSpec`) that is not compiled yet; its angles are changed.

    Returns:
        A line for each angle that changed.
    """
    if spec.compiler.degree:
        return []
    kinds, listed = mujoco.mjtOrientation, []
    for where, orientation in _orientations(spec):
        if orientation.type == kinds.mjORIENTATION_EULER:
            angles, places = orientation.euler, range(3)
        elif orientation.type == kinds.mjORIENTATION_AXISANGLE:
            angles, places = orientation.axisangle, range(3, 4)
        else:
            continue
        for place in places:
            # The shortest decimals of a number are those of the file, less zeros at the end.
            written = repr(float(angles[place]))
            if (meant := right_angle(written)) is not None:
                angles[place] = meant[0]
                listed.append(f"{where}: {written} rad is read as {meant[1]}")
    return listed


def _orientations(spec: Any) -> Iterator[tuple[str, Any]]:
    """Orientations that a file may state by angles, each with the element and the line that hold it."""
    for kind, elements in (("body", spec.bodies), ("frame", spec.frames), ("geom", spec.geoms)):
        for element in elements:
            at = f"{element.info or 'default'}, {kind}[{element.name}]"
            yield at, element.alt
            if kind == "body":
                yield f"{at}.inertial", element.ialt


#: Attributes of the elements that are made many times, and that hold many numbers; their product counts.
COPIES = {"replicate": ("count",), "composite": ("count",), "flexcomp": ("count",)}

NUMBERS = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}

#: Most numbers of one element, and most files that include one another.
MAX_NUMBERS = 10**7

MAX_FILES = 100


def check_sizes(path: Path) -> dict[str, Path]:
    """Rejects a file whose compiled model would be too large.

    A file that is not XML is left to MuJoCo, whose error gives the line.

    Args:
        path: The file; included files are checked too.

    Returns:
        The included files, by the names in the file.

    Raises:
        ModelError: An element makes too many copies, or holds too many numbers.
        MissingExtraError: lxml is not installed.
    """
    etree = require("lxml.etree", "models")
    waiting, seen = [path], {path.resolve()}
    names: dict[str, Path] = {}
    while waiting:
        file = waiting.pop()
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
        try:
            root = etree.parse(str(file), parser).getroot()
        except (etree.XMLSyntaxError, OSError):
            continue
        for element in root.iter(*COPIES, *NUMBERS, "include"):
            if element.tag == "include":
                name = element.get("file", "")
                included = names[name] = path.parent / name
                if included.resolve() not in seen and len(seen) < MAX_FILES:
                    seen.add(included.resolve())
                    waiting.append(included)
                continue
            _check(file, element)
    return names


def _check(file: Path, element: Any) -> None:
    """Checks the size of one element, including the copies that its parents make."""
    where = f"line {element.sourceline}, {element.tag}"
    if element.tag in NUMBERS:
        names = NUMBERS[element.tag]
        numbers = _product(element, names)
        if numbers > MAX_NUMBERS:
            refuse_in(file, f"{where}.{names[0]}", numbers, f"must hold at most {MAX_NUMBERS} numbers")
        return
    around = [element, *(one for one in element.iterancestors() if one.tag in COPIES)]
    copies = math.prod(_product(one, COPIES[one.tag]) for one in around)
    if copies > MAX_LINKS:
        refuse_in(file, f"{where}.count", copies, f"must make at most {MAX_LINKS} copies")


def _product(element: Any, names: tuple[str, ...]) -> int:
    """The product of the numbers in some attributes. Anything else counts as 1; MuJoCo rejects it later."""
    return math.prod(_whole(word) for name in names for word in element.get(name, "").split())


def _whole(word: str) -> int:
    try:
        return max(int(min(float(word), 1e18)), 1)
    except ValueError:
        return 1


#: Mass, kg, and inertia, kg m², of a link between two joints of one body: the least that a solid may have.
BETWEEN = 1e-9


def read_mjcf_tree(path: Path, *, ignore: Collection[str]) -> RobotTree:
    """Reads the bodies and joints of an MJCF.

    Args:
        path: The file.
        ignore: Kinds of elements to leave out although they change the motion.

    Raises:
        ModelError: MuJoCo rejects the file, or it contains elements that are not supported.
        MissingExtraError: MuJoCo is not installed.
        OSError: The file cannot be read.
    """
    mujoco = require("mujoco", "models")
    check_size(path)
    if is_urdf(path):
        refuse_in(path, "root", "robot", "is a URDF: read it with from_urdf")
    included = check_sizes(path)
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)  # else they go to a file in the current folder
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
        spec = _specification(mujoco, path, included)
        if assumed := complete_right_angles(mujoco, spec):
            model = spec.compile()
        bytes(model.names).decode("utf-8")
    except UnicodeDecodeError as error:
        _refuse_encoding(path, error)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        refuse_in(path, "MuJoCo", path.name, f"refuses the file ({' '.join(str(error).split())})")
    finally:
        mujoco.set_mju_user_warning(before)
    if model.nbody > MAX_LINKS:
        refuse_in(path, "worldbody", int(model.nbody), f"must have at most {MAX_LINKS} bodies")
    for warning in warnings:
        if "nan" in warning.lower():
            refuse_in(path, "MuJoCo", path.name, f"warns of the file ({' '.join(warning.split())})")
    reader = _Reader(mujoco, model, path, ignore)
    reader.tree.assumed += assumed
    reader.tree.left_out += [f"MuJoCo warns: {' '.join(warning.split())}" for warning in warnings]
    reader.check_numbers()
    reader.check_options()
    reader.add_links()
    reader.add_equalities()
    reader.check_tendons()
    reader.add_actuators()
    return reader.tree


def _specification(mujoco: Any, path: Path, included: Mapping[str, Path]) -> Any:
    """The file before it is compiled, read as text because MuJoCo accepts only names that end in .xml."""
    files = {name: file.read_bytes() for name, file in included.items() if file.is_file()}
    spec = mujoco.MjSpec.from_string(path.read_bytes().decode("utf-8"), include=files)
    spec.modelfiledir = str(path.parent)
    return spec


def _refuse_encoding(path: Path, error: UnicodeDecodeError) -> NoReturn:
    """Refuses a file with names that are not UTF-8. The error gives the line, unless it is in an included file."""
    reason = "holds a name that is not UTF-8 text: save the file as UTF-8"
    for number, line in enumerate(path.read_bytes().splitlines(), 1):
        text = line.decode("utf-8", "backslashreplace").strip()
        if text != line.decode("utf-8", "replace").strip():
            refuse_in(path, f"line {number}", text, reason)
    raw = error.object[: error.start].rpartition(b"\0")[2] + error.object[error.start :].partition(b"\0")[0]
    refuse_in(path, "include", raw.decode("utf-8", "backslashreplace"), reason)


class _Reader:
    """Converts one compiled model to a tree."""

    def __init__(self, mujoco: Any, model: Any, path: Path, ignore: Collection[str]) -> None:
        self.mujoco, self.model = mujoco, model
        self.tree = RobotTree(path, self._text(0) or path.stem, {}, ignore)
        self.joints: dict[int, FileJoint] = {}

    def check_numbers(self) -> None:
        """Rejects masses, positions and quaternions that are not finite, which MuJoCo accepts in some files."""
        m = self.model
        for kind, fields in (("body", ("mass", "inertia", "pos", "quat", "ipos", "iquat")), ("geom", ("pos", "quat"))):
            for field in fields:
                values = getattr(m, f"{kind}_{field}")
                rows = values[:, None] if values.ndim == 1 else values
                is_sound = np.isfinite(rows).all(axis=1)
                if field.endswith("quat"):
                    is_sound &= np.linalg.norm(rows, axis=1) > 0.0
                for index in map(int, np.flatnonzero(~is_sound)):
                    body = index if kind == "body" else int(m.geom_bodyid[index])
                    at = f"body[{self._body(body)}].{'' if kind == 'body' else 'geom.'}{field}"
                    self.tree.refuse(at, rows[index].tolist(), "must be finite and, if a quaternion, not zero")

    def check_options(self) -> None:
        """Rejects global options that are not supported."""
        m = self.model
        option = m.opt
        if option.density != 0.0 or option.viscosity != 0.0:
            value = [float(option.density), float(option.viscosity)]
            self.tree.leave_out(
                "fluid", "option.density", value, "forces of a fluid are not simulated", row="option density"
            )
        for count, where in ((m.nflex, "flex"), (m.nplugin, "plugin"), (m.nmocap, "mocap")):
            if count:
                self.tree.refuse(where, int(count), "is not supported", row=where)
        if np.any(m.body_gravcomp):
            self.tree.refuse(
                "body.gravcomp", float(m.body_gravcomp.max()), "gravity compensation is not supported", row="gravcomp"
            )
        gravity = [float(x) for x in option.gravity]
        self.tree.left_out.append(f"option: gravity {gravity} and contact parameters, which a Simulation is given")
        if m.nsensor:
            self.tree.left_out.append(f"sensor: {m.nsensor} of them")

    def add_links(self) -> None:
        """Adds the bodies of machines. Bodies that are fixed to the world are scenery and left out."""
        m = self.model
        moves = np.zeros(m.nbody, dtype=bool)
        for body in range(m.nbody - 1, 0, -1):
            moves[body] |= m.body_jntnum[body] > 0
            moves[m.body_parentid[body]] |= moves[body]
        scenery = [self._body(b) for b in range(1, m.nbody) if m.body_rootid[b] == b and not moves[b]]
        if scenery or m.body_geomnum[0]:
            self.tree.left_out.append(f"fixed to the world: {', '.join(scenery) or 'shapes of the worldbody'}")
        for body in range(1, m.nbody):
            if not moves[m.body_rootid[body]]:
                continue
            link = self._chain(body)
            link.mass, link.centre = float(m.body_mass[body]), np.array(m.body_ipos[body])
            R = from_quaternion(m.body_iquat[body])
            link.inertia = R @ np.diag(m.body_inertia[body]) @ R.T
            first = int(m.body_geomadr[body])
            link.shapes = [self._shape(geom) for geom in range(first, first + int(m.body_geomnum[body]))]
            self.tree.links[link.name] = link
        if not self.tree.links:
            self.tree.refuse("worldbody", self.model.nbody - 1, "has no movable body")

    def _chain(self, body: int) -> FileLink:
        """The link of a body; if it has several joints, adds a nearly massless link for each but the last."""
        m = self.model
        parent = self._body(int(m.body_parentid[body])) if m.body_parentid[body] else None
        position, rotation = np.array(m.body_pos[body]), from_quaternion(m.body_quat[body])
        first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
        for index in range(first, first + count - 1):
            joint = self._joint(body, index)
            name = f"{self._body(body)}_{joint.name}"
            while self.mujoco.mj_name2id(m, self.mujoco.mjtObj.mjOBJ_BODY, name) >= 0 or name in self.tree.links:
                name += "_"
            between = FileLink(name, parent, joint, position, rotation, BETWEEN, inertia=BETWEEN * np.eye(3))
            self.tree.links[name] = between
            self.tree.assumed.append(f"link {name}: {BETWEEN:g} kg, because it is between two joints of one body")
            parent, position, rotation = name, np.zeros(3), np.eye(3)
        return FileLink(self._body(body), parent, self._joint(body, first + count - 1), position, rotation)

    def add_equalities(self) -> None:
        """Adds couplings of joints, connections and welds. Rejects other equality constraints."""
        m, kinds = self.model, self.mujoco.mjtEq
        for eq in range(m.neq):
            if not m.eq_active0[eq]:
                continue
            kind = int(m.eq_type[eq])
            name = self.mujoco.mj_id2name(m, self.mujoco.mjtObj.mjOBJ_EQUALITY, eq) or f"equality{eq}"
            if kind == kinds.mjEQ_JOINT:
                self._add_coupling(eq, name)
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                is_weld = kind == kinds.mjEQ_WELD
                ends = self._ends(eq, is_weld=is_weld)
                self.tree.close(f"equality[{eq}]", FileLoop(name, "weld" if is_weld else "connect", ends))
            else:
                reason = "of equality constraints only connect, weld and joint are simulated"
                self.tree.leave_out("closed loops", f"equality[{eq}]", kinds(kind).name, reason, row="equality tendon")
        if self.tree.loops:
            self.tree.left_out.append("equality: solref and solimp, since loops are rigid here")

    def _add_coupling(self, eq: int, name: str) -> None:
        m = self.model
        first, second = int(m.eq_obj1id[eq]), int(m.eq_obj2id[eq])
        terms = [float(x) for x in m.eq_data[eq, :5]]
        joint = self.joints[first]
        if second >= 0 and joint.follows is None and not any(terms[2:]):
            joint.follows = (self.joints[second].name, terms[1], terms[0])
            return
        other = self.joints[second].name if second >= 0 else None
        while len(terms) > 1 and (other is None or terms[-1] == 0.0):
            terms.pop()
        self.tree.close(f"equality[{eq}]", FileLoop(name, "joint", (), (joint.name, other), tuple(terms)))

    def _ends(self, eq: int, *, is_weld: bool) -> tuple[LoopEnd, LoopEnd]:
        """Both ends of a connection or a weld, with the common point and axes in the frames of the bodies."""
        m, mj = self.model, self.mujoco
        first, second = int(m.eq_obj1id[eq]), int(m.eq_obj2id[eq])
        data = np.array(m.eq_data[eq])
        if int(m.eq_objtype[eq]) == mj.mjtObj.mjOBJ_SITE:
            return self._end_at_site(first), self._end_at_site(second)
        # MuJoCo lists a weld's point in the second body before that in the first.
        points = (data[3:6], data[:3]) if is_weld else (data[:3], data[3:6])
        turn = from_quaternion(data[6:10]) if is_weld else np.eye(3)
        return self._end(first, points[0], turn), self._end(second, points[1], np.eye(3))

    def _end_at_site(self, site: int) -> LoopEnd:
        m = self.model
        return self._end(int(m.site_bodyid[site]), m.site_pos[site], from_quaternion(m.site_quat[site]))

    def _end(self, body: int, point: Array, axes: Array) -> LoopEnd:
        """An end on a body; one that stands on the world is the world's."""
        m = self.model
        end = LoopEnd(self._body(body), np.array(point), np.array(axes))
        while body and self._body(body) not in self.tree.links:
            R, p = from_quaternion(m.body_quat[body]), np.array(m.body_pos[body])
            body = int(m.body_parentid[body])
            end.carried_by(self._body(body), R, p)
        if not body:
            end.link = None
        return end

    def check_tendons(self) -> None:
        """Rejects tendons that exert forces; others only measure."""
        m = self.model
        for tendon in range(m.ntendon):
            if np.any(m.tendon_stiffness[tendon]) or np.any(m.tendon_damping[tendon]) or m.tendon_limited[tendon]:
                name = self._name(self.mujoco.mjtObj.mjOBJ_TENDON, tendon)
                self.tree.leave_out("tendons", f"tendon[{name}]", name, "tendons are not simulated", row="tendon")

    def add_actuators(self) -> None:
        """Converts motors to torque limits and position servos to gains. Rejects other actuators."""
        m, mj = self.model, self.mujoco
        joint_kinds = (int(mj.mjtTrn.mjTRN_JOINT), int(mj.mjtTrn.mjTRN_JOINTINPARENT))
        for actuator in range(m.nu):
            name = self._name(mj.mjtObj.mjOBJ_ACTUATOR, actuator)
            where = f"actuator[{name}]"
            target = int(m.actuator_trnid[actuator, 0])
            is_plain = m.actuator_dyntype[actuator] == mj.mjtDyn.mjDYN_NONE
            is_plain = is_plain and m.actuator_gaintype[actuator] == mj.mjtGain.mjGAIN_FIXED
            is_plain = is_plain and not np.any(getattr(m, "actuator_dampingpoly", np.zeros((m.nu, 1)))[actuator])
            if int(m.actuator_trntype[actuator]) not in joint_kinds or not is_plain or target not in self.joints:
                self.tree.leave_out(
                    "actuators", where, name, "only motors and position servos of joints are simulated", row="actuator"
                )
                continue
            joint, gear = self.joints[target], float(m.actuator_gear[actuator, 0])
            gain, bias = float(m.actuator_gainprm[actuator, 0]), [float(x) for x in m.actuator_biasprm[actuator, :3]]
            limits = []
            if m.actuator_forcelimited[actuator]:
                limits.append(abs(gear) * float(np.abs(m.actuator_forcerange[actuator]).max()))
            if m.actuator_biastype[actuator] == mj.mjtBias.mjBIAS_NONE:
                if m.actuator_ctrllimited[actuator]:
                    limits.append(abs(gear * gain) * float(np.abs(m.actuator_ctrlrange[actuator]).max()))
                joint.is_driven = True
                joint.torque_limit = min(limits, default=None)
            elif m.actuator_biastype[actuator] == mj.mjtBias.mjBIAS_AFFINE and bias[0] == 0.0 and bias[1] == -gain:
                joint.hold = (gain * gear**2, -bias[2] * gear**2)
            else:
                self.tree.leave_out(
                    "actuators", where, [gain, *bias], "only motors and position servos are simulated", row="actuator"
                )

    def _joint(self, body: int, index: int) -> FileJoint:
        """A joint of a body; fixed if it has none."""
        m, kinds = self.model, self.mujoco.mjtJoint
        if m.body_jntnum[body] == 0:
            return FileJoint(f"{self._body(body)}_fixed", "fixed")
        place = index - int(m.body_jntadr[body])
        unnamed = f"{self._body(body)}_joint{place + 1 if place else ''}"
        name = self.mujoco.mj_id2name(m, self.mujoco.mjtObj.mjOBJ_JOINT, index) or unnamed
        kind, dof = int(m.jnt_type[index]), int(m.jnt_dofadr[index])
        n_dofs = {kinds.mjJNT_FREE: 6, kinds.mjJNT_BALL: 3}.get(kind, 1)
        dofs = slice(dof, dof + n_dofs)
        at = f"joint[{name}]"
        friction = float(m.dof_frictionloss[dofs].max())
        if friction != 0.0 and n_dofs > 1:
            reason = "dry friction of free and ball joints is not simulated"
            self.tree.leave_out("friction", f"{at}.frictionloss", friction, reason, row="joint frictionloss")
        elif friction != 0.0 and "friction" in self.tree.ignore:
            self.tree.left_out.append(f"{at}.frictionloss: {friction:g} (left out because of `ignore`)")
            friction = 0.0
        damping, armature = np.array(m.dof_damping[dofs]), np.array(m.dof_armature[dofs])
        stiffness = float(np.ravel(m.jnt_stiffness[index])[0])
        for field in ("dof_dampingpoly", "jnt_stiffnesspoly"):
            if np.any(getattr(m, field, np.zeros((m.nv + 1, 1)))[dof if "dof" in field else index]):
                self.tree.leave_out(
                    "springs", f"{at}.{field[4:]}", None, "springs and dampers must be linear", row="joint stiffness"
                )
        if n_dofs > 1:
            if np.any(damping) or np.any(armature):
                values = [float(damping.max()), float(armature.max())]
                reason = "damping and armature of free and ball joints are not simulated"
                self.tree.leave_out("friction", at, values, reason, row="joint damping")
            if stiffness != 0.0:
                self.tree.leave_out(
                    "springs",
                    f"{at}.stiffness",
                    stiffness,
                    "springs of ball joints are not simulated",
                    row="joint stiffness",
                )
            if m.jnt_limited[index]:
                self.tree.refuse(
                    f"{at}.range",
                    m.jnt_range[index].tolist(),
                    "limits of ball joints are not supported",
                    row="joint range",
                )
            joint = FileJoint(name, "free" if n_dofs == 6 else "spherical", np.array(m.jnt_pos[index]))
            self.joints[index] = joint
            return joint
        zero = float(m.qpos0[m.jnt_qposadr[index]])
        joint = FileJoint(
            name,
            "revolute" if kind == kinds.mjJNT_HINGE else "prismatic",
            np.array(m.jnt_pos[index]),
            np.array(m.jnt_axis[index]),
            damping=float(damping[0]),
            friction=friction,
            armature=float(armature[0]),
            stiffness=stiffness,
            rest=float(m.qpos_spring[m.jnt_qposadr[index]]) - zero,
        )
        if m.jnt_limited[index]:
            joint.limits = (float(m.jnt_range[index, 0]) - zero, float(m.jnt_range[index, 1]) - zero)
        if zero != 0.0:
            self.tree.assumed.append(f"joint {name}: its coordinate counts from the file's ref {zero:g}")
        self.joints[index] = joint
        return joint

    def _shape(self, geom: int) -> FileShape:
        m, kinds = self.model, self.mujoco.mjtGeom
        R, p = from_quaternion(m.geom_quat[geom]), np.array(m.geom_pos[geom])
        size = [float(x) for x in m.geom_size[geom]]
        collides = bool(m.geom_contype[geom] or m.geom_conaffinity[geom])
        name = self.mujoco.mj_id2name(m, self.mujoco.mjtObj.mjOBJ_GEOM, geom) or ""
        made = FileShape("mesh", (), p, R, collides, bool(m.geom_rgba[geom, 3] > 0.0), name)
        made.colour = self._colour(geom)
        match int(m.geom_type[geom]):
            case kinds.mjGEOM_BOX:
                made.kind, made.size = "box", (2.0 * size[0], 2.0 * size[1], 2.0 * size[2])
            case kinds.mjGEOM_CYLINDER:
                made.kind, made.size = "cylinder", (size[0], 2.0 * size[1])
            case kinds.mjGEOM_CAPSULE:
                made.kind, made.size = "capsule", (size[0], 2.0 * size[1])
            case kinds.mjGEOM_SPHERE:
                made.kind, made.size = "sphere", (size[0],)
            case kinds.mjGEOM_ELLIPSOID:
                made.kind, made.size = "ellipsoid", (size[0], size[1], size[2])
            case kinds.mjGEOM_MESH:
                mesh = int(m.geom_dataid[geom])
                first = int(m.mesh_vertadr[mesh])
                made.mesh = np.array(m.mesh_vert[first : first + int(m.mesh_vertnum[mesh])], dtype=np.float64)
                first = int(m.mesh_faceadr[mesh])
                made.faces = np.array(m.mesh_face[first : first + int(m.mesh_facenum[mesh])], dtype=np.int64)
            case other:
                made.kind = kinds(other).name.removeprefix("mjGEOM_").lower()
        return made

    def _colour(self, geom: int) -> tuple[float, float, float] | None:
        """Colour of a shape: that of its material or its own; None for MuJoCo's default."""
        m = self.model
        material = int(m.geom_matid[geom])
        rgba = m.mat_rgba[material] if material >= 0 else m.geom_rgba[geom]
        if material < 0 and np.allclose(rgba, (0.5, 0.5, 0.5, 1.0)):
            return None
        red, green, blue = (float(np.clip(x, 0.0, 1.0)) for x in rgba[:3])
        return red, green, blue

    def _name(self, kind: Any, index: int) -> str:
        return self.mujoco.mj_id2name(self.model, kind, index) or str(index)

    def _body(self, body: int) -> str:
        return self.mujoco.mj_id2name(self.model, self.mujoco.mjtObj.mjOBJ_BODY, body) or f"body{body}"

    def _text(self, address: int) -> str:
        return str(bytes(self.model.names[address:]).split(b"\0")[0].decode("utf-8"))
