"""What an import understood, what it assumed, and what it left out."""

from __future__ import annotations

from dataclasses import dataclass, field

from rover_gym.mechanics import RoverModel


class RobotFileWarning(UserWarning):
    """A robot's file was read, and the model is probably not what its reader wants."""


@dataclass(frozen=True)
class ImportReport:
    """What was read from a robot's file; `str` gives it as text.

    Attributes:
        path: The file.
        assumed: What the file does not state and was chosen, with the value.
        left_out: What the file holds and the model does not simulate.
        solids: A row for each solid: name, joint, what carries it, mass (kg) and role.
        warnings: What is probably not as the reader wants it, such as a robot without wheels. Each is also a Python
            warning of the category `RobotFileWarning`.
    """

    path: str
    assumed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    solids: tuple[tuple[str, str, str, float, str], ...] = field(default=(), repr=False)
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The report as lines of text."""
        lines = [f"{self.path}: {len(self.solids)} solids", *(f"warning: {warning}" for warning in self.warnings)]
        for name, joint, parent, mass, role in self.solids:
            lines.append(f"  {name}: {joint} on {parent}, {mass:g} kg{role and f', {role}'}")
        for title, entries in (("assumed", self.assumed), ("not simulated", self.left_out)):
            if entries:
                lines += [f"{title}:", *(f"  {entry}" for entry in entries)]
        return "\n".join(lines)


def together(entries: list[str]) -> tuple[str, ...]:
    """Entries "where: what" with all places of the same thing in one."""
    places: dict[str, list[str]] = {}
    for entry in entries:
        where, _, what = entry.partition(": ")
        places.setdefault(what or where, []).extend([where] if what else [])
    return tuple(f"{what}: {', '.join(dict.fromkeys(where))}" if where else what for what, where in places.items())


def solid_rows(model: RoverModel) -> tuple[tuple[str, str, str, float, str], ...]:
    """Name, joint, carrier, mass (kg) and role of every solid of a model."""
    description = model.to_dict()
    wheels = {wheel["solid"]: wheel for wheel in description["wheels"]}
    steered: dict[str, list[str]] = {}
    for wheel in description["wheels"]:
        if wheel.get("steering"):
            steered.setdefault(wheel["steering"], []).append(wheel["name"])
    rows = []
    for solid in description["solids"]:
        role = ""
        if solid["name"] in wheels:
            wheel = wheels[solid["name"]]
            width = f", {wheel['width']:g} m wide" if wheel.get("width") else ""
            radius = wheel.get("contact_radius") or wheel["radius"]
            yields = f", {wheel['stiffness']:.2g} N/m" if wheel.get("stiffness") else ""
            role = f"wheel of radius {radius:g} m{width}{yields}, {wheel['torque_limit']:.4g} N m"
        elif solid["name"] in steered:
            role = f"steers {', '.join(steered[solid['name']])}"
        elif solid.get("drive"):
            role = f"driven, {solid['drive']['torque_limit']:.4g} N m"
        elif solid.get("coupled"):
            role = f"follows {solid['coupled']['joint']} by {solid['coupled']['ratio']:g}"
        kind = solid.get("joint") or ("revolute" if solid.get("parent") else "free")
        kind = "locked" if solid.get("locked") is not None else kind
        rows.append((solid["name"], kind, solid.get("parent") or "world", float(solid["mass"]), role))
    return tuple(rows)
