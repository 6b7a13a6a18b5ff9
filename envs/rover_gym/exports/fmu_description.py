"""`modelDescription.xml` of a unit, FMI 3.0."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

from rover_gym.mechanics import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rover_gym.exports.fmu_variables import UnitVariable

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
