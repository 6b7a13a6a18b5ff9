"""Co-simulation units: a simulation in a file that FMI 3.0 importers step."""

from __future__ import annotations

import platform
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

from rover_gym.exports.axes import AXES, Axes
from rover_gym.exports.fmu_description import description_text
from rover_gym.exports.fmu_scene import scene_text
from rover_gym.exports.fmu_variables import unit_variables
from rover_gym.mechanics import OptionError
from rover_gym.validation import checked, refuse

if TYPE_CHECKING:
    from rover_gym.mechanics import Simulation

#: Name of the library, without its ending.
IDENTIFIER = "rover_fmu"
#: Where the library is looked for.
LIBRARIES = Path(__file__).parents[1] / "_fmu"
#: Endings of libraries and names of platforms, as the standard has them, by system.
ENDINGS = {"Linux": (".so", "linux"), "Darwin": (".dylib", "darwin"), "Windows": (".dll", "windows")}
MACHINES = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}
#: Of every file in a unit, so that equal scenes make equal units.
STAMP = (1980, 1, 1, 0, 0, 0)

HOW_TO_BUILD = (
    "is not built: in a checkout with a Rust toolchain, `make` builds it with the core, and by hand it is"
    f" `cargo build --release --locked -p rover-fmu`, copied to {LIBRARIES.parent.name}/{LIBRARIES.name}"
)


def fmu_library() -> Path:
    """The library of this package's units.

    Raises:
        OptionError: It has not been built, or there is none for this system; the message says how to build it.
    """
    ending, _ = ENDINGS.get(platform.system(), ENDINGS["Linux"])
    path = LIBRARIES / f"{IDENTIFIER}{ending}"
    if not path.is_file():
        refuse(OptionError, "library", str(path), HOW_TO_BUILD)
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

    The unit begins in this state, with this command, and gives bit for bit what the simulation gives with the same
    inputs and steps.

    Args:
        simulation: The simulation; it is not changed.
        path: The file to write, usually .fmu, with its folder.
        name: Name of the model.
        description: In words.
        axes: Of vectors and poses: "world", the simulator's own with y up, or "rep103", x forward, y left, z up, for
            world and trunk alike.

    Raises:
        OptionError: The library has not been built, or `axes` is none of the two.
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
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for place, data in files.items():
            entry = zipfile.ZipInfo(place, STAMP)
            entry.external_attr, entry.compress_type = 0o644 << 16, zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return path
