"""Co-simulation units: a simulation in a file that FMI 3.0 importers step."""

from __future__ import annotations

import hashlib
import json
import platform
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from xml.etree import ElementTree

import numpy as np

from rover_gym.core import (
    HeightField,
    OptionError,
    Plane,
    Simulation,
    SoftGround,
    SphereField,
    Terrain,
    TriangleMesh,
    Union,
    __version__,
)
from rover_gym.core.files import check_xml, written_whole
from rover_gym.core.validation import checked, refuse
from rover_gym.exports.axes import AXES, Axes, pitch_sign, vector_components

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rover_gym.core import Simulation
    from rover_gym.exports.axes import Axes


#: Exponents of the base units.
UNITS: Mapping[str, Mapping[str, int]] = {
    "s": {"s": 1},
    "m": {"m": 1},
    "rad": {"rad": 1},
    "m/s": {"m": 1, "s": -1},
    "rad/s": {"rad": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "1": {},
}

#: Time of a communication step and of a run that importers take by default, s.
STEP, STOP = 0.05, 10.0


def description_text(
    name: str, identifier: str, token: str, description: str, variables: Sequence[UnitVariable], time_step: float
) -> bytes:
    """The description.

    Args:
        name: Name of the model.
        identifier: Name of the library, without its ending.
        token: Of the scene.
        description: In words.
        variables: The variables.
        time_step: s.
    """
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=token,
        description=description,
        generationTool=f"rover-gym {__version__}",
        variableNamingConvention="structured" if all(map(_is_structured, variables)) else "flat",
    )
    ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
        fixedInternalStepSize=repr(time_step),
    )
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit, exponents in UNITS.items():
        base = {base: str(exponent) for base, exponent in exponents.items()}
        ElementTree.SubElement(ElementTree.SubElement(units, "Unit", name=unit), "BaseUnit", base)
    categories = ElementTree.SubElement(root, "LogCategories")
    for category in ("logStatusWarning", "logStatusError", "logStatusFatal"):
        ElementTree.SubElement(categories, "Category", name=category)
    step = time_step * max(1, round(STEP / time_step))
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime=repr(STOP), stepSize=repr(step))
    listed = ElementTree.SubElement(root, "ModelVariables")
    for variable in variables:
        _add(listed, variable)
    structure = ElementTree.SubElement(root, "ModelStructure")
    outputs = [variable for variable in variables if variable.causality == "output"]
    for variable in outputs:  # outputs change in a step, not with the inputs
        ElementTree.SubElement(structure, "Output", valueReference=str(variable.reference), dependencies="")
    for variable in outputs:
        ElementTree.SubElement(structure, "InitialUnknown", valueReference=str(variable.reference))
    check_xml(root, OptionError)
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _add(listed: ElementTree.Element, variable: UnitVariable) -> None:
    facts = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "description": variable.description,
        "causality": variable.causality,
    }
    if isinstance(variable.start, str):
        text = ElementTree.SubElement(listed, "String", facts, variability="fixed")
        ElementTree.SubElement(text, "Start", value=variable.start)
        return
    facts["variability"] = "fixed" if variable.causality == "parameter" else "continuous"
    facts |= {"unit": variable.unit}
    if variable.start is not None:
        facts["start"] = repr(float(variable.start))
    if variable.causality == "output":
        facts["initial"] = "calculated"
    ElementTree.SubElement(listed, "Float64", facts)


def _is_structured(variable: UnitVariable) -> bool:
    """Whether a name is identifiers between dots."""
    return all(part.isascii() and part.isidentifier() for part in variable.name.split("."))


#: The version that `rust/fmu/src/scene_file.rs` reads.
FORMAT = 3


def scene_text(simulation: Simulation, variables: Sequence[UnitVariable]) -> tuple[str, str]:
    """A simulation in its present state as JSON with a checksum, and a token that identifies it."""
    scene = {
        "format": FORMAT,
        "model": simulation.model.to_text(),
        "terrain": _ground(simulation.terrain),
        "settings": simulation.settings,
        "snapshot": list(simulation.snapshot().to_bytes()),
        "variables": [
            {
                "reference": one.reference,
                "name": one.name,
                "channel": one.channel,
                "index": one.index,
                "sign": one.sign,
            }
            for one in variables
        ],
    }
    token = hashlib.sha256(json.dumps(scene, sort_keys=True).encode()).hexdigest()[:32]
    return with_checksum(json.dumps({**scene, "token": token}, allow_nan=False)), token


def with_checksum(text: str) -> str:
    """A scene's text with its checksum in a line of its own, without which the unit refuses it."""
    return f"{text}\nCRC-32 {zlib.crc32(text.encode())}"


def _ground(terrain: Terrain) -> dict[str, Any]:
    if isinstance(terrain, Union):
        return {"kind": "union", "parts": [_ground(part) for part in terrain.parts]}
    if isinstance(terrain, Plane):
        return {"kind": "plane", "normal": terrain.normal.tolist(), "offset": terrain.offset}
    if isinstance(terrain, SphereField):
        plane = terrain.ground
        return {
            "kind": "sphere_field",
            "centres": terrain.centres.tolist(),
            "radii": terrain.radii.tolist(),
            "plane": None if plane is None else [plane.normal.tolist(), plane.offset],
            "material": terrain.material,
        }
    if isinstance(terrain, HeightField):
        heights = terrain.grid.astype(np.float64).ravel()  # a float32 is a double, which JSON gives back
        return {
            "kind": "height_field",
            "heights": [float(y) if known else None for y, known in zip(heights, np.isfinite(heights), strict=True)],
            "shape": list(terrain.shape),
            "spacing": list(terrain.spacing),
            "origin": list(terrain.origin),
            "material": terrain.material,
        }
    if not isinstance(terrain, TriangleMesh):
        kind = "sand" if isinstance(terrain, SoftGround) else f"a {type(terrain).__name__}"
        refuse(OptionError, "terrain", kind, "must be rigid in a unit: a plane, rocks, maps or meshes")
    return _mesh(terrain)


def _mesh(terrain: TriangleMesh) -> dict[str, Any]:
    return {
        "kind": "triangle_mesh",
        "vertices": np.asarray(terrain.vertices).tolist(),
        "triangles": terrain.triangles.tolist(),
        "material": terrain.material,
    }


#: What a variable is to the importer.
Causality = Literal["independent", "parameter", "input", "output"]


@dataclass(frozen=True)
class UnitVariable:
    """A variable of a unit.

    Attributes:
        reference: Value reference of the importer.
        name: Its name.
        causality: Causality of FMI.
        channel: Quantity of the unit, as named in `Channel` of `rust/fmu`.
        index: Which entry of the channel.
        unit: SI unit, or "1".
        description: In words.
        start: Value at the start, of parameters and inputs.
        sign: 1 or -1: sign of the variable relative to the channel.
    """

    reference: int
    name: str
    causality: Causality
    channel: str
    index: int
    unit: str
    description: str
    start: float | str | None = None
    sign: float = 1.0


def unit_variables(simulation: Simulation, axes: Axes = "world") -> tuple[UnitVariable, ...]:
    """The variables of a simulation, in the order of their references."""
    rows = enumerate(_rows(simulation, axes))
    return tuple(UnitVariable(reference, *row) for reference, row in rows)


Row = (
    tuple[str, Causality, str, int, str, str, float | str | None]
    | tuple[str, Causality, str, int, str, str, float | str | None, float]
)

#: The world's axis that points up.
UP = {"world": "y", "rep103": "z"}


def _rows(simulation: Simulation, axes: Axes) -> Iterator[Row]:
    model, settings = simulation.model, simulation.settings
    yield "time", "independent", "time", 0, "s", "time", None
    for name, unit, what in (
        ("friction", "1", "Coulomb's coefficient of contacts whose materials have none of their own"),
        ("restitution", "1", "Newton's coefficient of the same contacts"),
        ("time_step", "s", "time step of the unit; communication steps are whole multiples of it"),
    ):
        yield name, "parameter", name, 0, unit, what, settings[name]
    what = f"gravity, world, {UP[axes]} up"
    for axis, (i, sign) in zip("xyz", vector_components(axes), strict=True):
        yield f"gravity.{axis}", "parameter", "gravity", i, "m/s2", what, sign * settings["gravity"][i], sign
    what = "text of a model's file (TOML or JSON) with the same joints and wheels; empty for the exported one"
    yield "model", "parameter", "model", 0, "1", what, ""
    wheels = list(enumerate(zip(model.wheel_names, model.to_dict()["wheels"], strict=True)))
    for i, (name, _) in wheels:
        what = "driving torque, positive forward; saturates at the motor's limit"
        yield f"wheel_torque.{name}", "input", "wheel_torque", i, "N.m", what, float(simulation.wheel_torques[i])
    for i, (name, wheel) in wheels:
        if wheel.get("steering") in model.joint_names:
            what = "set-point of the steering"
            yield f"steering.{name}", "input", "steering", i, "rad", what, float(simulation.steering[i])
    yield from _motion(simulation, axes)
    yield from _outputs(simulation, axes)


def _motion(simulation: Simulation, axes: Axes) -> Iterator[Row]:
    """Pose and velocity."""
    joints = list(enumerate(simulation.model.dof_names[6:], 6))
    vector = list(zip("xyz", vector_components(axes), strict=True))
    for axis, (i, sign) in vector:
        yield f"q.{axis}", "output", "q", i, "m", "trunk's origin, world", None, sign
    for i, (name, sign) in enumerate((("roll", 1.0), ("heading", 1.0), ("pitch", pitch_sign(axes))), 3):
        yield f"q.{name}", "output", "q", i, "rad", "trunk's attitude", None, sign
    for i, name in joints:
        yield f"q.{name}", "output", "q", i, "rad", "joint", None
    for axis, (i, sign) in vector:
        yield f"v.v_{axis}", "output", "v", i, "m/s", "trunk's origin, world", None, sign
    for axis, (i, sign) in vector:
        yield f"v.omega_{axis}", "output", "v", 3 + i, "rad/s", "trunk's angular velocity, world", None, sign
    for i, name in joints:
        yield f"v.{name}", "output", "v", i, "rad/s", "joint", None
    what = "trunk to world, unit quaternion"
    yield "attitude.w", "output", "attitude", 0, "1", what, None
    for axis, (i, sign) in vector:
        yield f"attitude.{axis}", "output", "attitude", 1 + i, "1", what, None, sign


def _outputs(simulation: Simulation, axes: Axes) -> Iterator[Row]:
    """Contacts, forces, readings and solver statistics."""
    model = simulation.model
    for i, name in enumerate(model.wheel_names):
        yield f"wheel_gap.{name}", "output", "wheel_gap", i, "m", "to the ground, negative where they overlap", None
    for i, name in enumerate(model.wheel_names):
        for k, side in enumerate(("normal", "rolling", "lateral")):
            what = "mean contact force of the last time step"
            yield f"wheel_force.{name}.{side}", "output", "wheel_force", 3 * i + k, "N", what, None
    for i, name in enumerate(model.wheel_names):
        what = "mean torque delivered by the drive in the last time step, positive forward"
        yield f"motor_torque.{name}", "output", "motor_torque", i, "N.m", what, None
    for i, name in enumerate(("specific_force", "angular_velocity")):
        what = "mean over the last communication step, at the trunk's origin, in its frame"
        for axis, (k, sign) in zip("xyz", vector_components(axes), strict=True):
            yield f"imu.{name}.{axis}", "output", "inertial", 3 * i + k, ("m/s2", "rad/s")[i], what, None, sign
    for name, unit, what in (
        ("trunk_force", "N", "mean normal force of the last time step on all solids other than wheels"),
        ("kinetic_energy", "J", "of the whole rover"),
        ("potential_energy", "J", "zero with all mass centres at the world's origin"),
        ("contacts", "1", "most contacts of a time step in the last communication step"),
        ("solver_residual", "1", "largest residual of the contact solver in the last communication step"),
        ("solver_iterations", "1", "iterations of the contact solver in the last communication step"),
    ):
        yield name, "output", name, 0, unit, what, None


#: Name of the library, without its ending.
IDENTIFIER = "rover_fmu"

#: Where the library is looked for.
LIBRARIES = Path(__file__).parents[1] / "_fmu"

#: Endings of libraries and names of platforms, as the standard has them, by system.
ENDINGS = {"Linux": (".so", "linux"), "Darwin": (".dylib", "darwin"), "Windows": (".dll", "windows")}

MACHINES = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}

#: Time stamp of every file in a unit, so that equal scenes make equal units.
STAMP = (1980, 1, 1, 0, 0, 0)


def _how_to_build(path: Path) -> str:
    """How the library is added to an installation, as a command."""
    system = platform.system()
    built = f"target/release/{'' if system == 'Windows' else 'lib'}{IDENTIFIER}{path.suffix}"
    copying = f"mkdir -p {path.parent} && cp {built} {path}"
    return (
        "is not there: `pip install .` does not build it. In the checkout, with a Rust toolchain: "
        f"cargo build --release --locked -p rover-fmu && {copying}"
    )


def fmu_library() -> Path:
    """The library of this package's units.

    Raises:
        OptionError: The library has not been built, or does not exist for this system; the message gives the command
            that adds it.
    """
    ending, _ = ENDINGS.get(platform.system(), ENDINGS["Linux"])
    path = LIBRARIES / f"{IDENTIFIER}{ending}"
    if not path.is_file():
        refuse(OptionError, "library", str(path), _how_to_build(path))
    return path


@checked(simulation="Simulation", path=Path, name=str, description=str, axes=str)
def write_fmu(
    simulation: Simulation,
    path: str | Path,
    *,
    name: str = "rover",
    description: str = "a rover on its ground",
    axes: Axes = "world",
) -> Path:
    """Writes a simulation in its present state as an FMI 3.0 co-simulation unit for this system.

    The unit starts in this state with this command. With the same inputs and steps it gives the same bits as the
    simulation.

    Args:
        simulation: The simulation; it is not changed.
        path: The file to write, usually .fmu, with its folder.
        name: Name of the model.
        description: In words.
        axes: Of vectors and poses: "world", the simulator's own with y up, or "rep103", x forward, y left, z up, for
            world and trunk alike.

    Raises:
        OptionError: The library has not been built, or `axes` is invalid.
        OSError: The file cannot be written.
    """
    if axes not in AXES:
        refuse(OptionError, "axes", axes, f"must be one of {', '.join(AXES)}")
    library = fmu_library()
    variables = unit_variables(simulation, axes)
    scene, token = scene_text(simulation, variables)
    _, system = ENDINGS.get(platform.system(), ENDINGS["Linux"])
    machine = MACHINES.get(platform.machine(), platform.machine())
    files = {
        "modelDescription.xml": description_text(name, IDENTIFIER, token, description, variables, simulation.time_step),
        f"binaries/{machine}-{system}/{library.name}": library.read_bytes(),
        "resources/scene.json": scene.encode(),
    }
    with written_whole(path) as draft, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
        for place, data in files.items():
            entry = zipfile.ZipInfo(place, STAMP)
            entry.external_attr, entry.compress_type = 0o644 << 16, zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return Path(path)
