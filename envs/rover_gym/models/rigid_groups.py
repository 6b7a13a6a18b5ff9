"""Links that are fixed to each other: what is no body by itself becomes part of what it is fixed to.

A file may give a link no mass, or an inertia that no body has, and state the rest with a link that is fixed to it. Only
the links of a rigid group together must be a body.
"""

from __future__ import annotations

import numpy as np

from rover_gym.models.file_axes import Array
from rover_gym.models.robot_tree import FileLink, RobotTree

#: Smallest mass of a solid of a model, kg.
LEAST_MASS = 1e-9


def join_rigid_groups(tree: RobotTree, *, free_base: bool) -> None:
    """Joins links that are no bodies to what they are fixed to. Their origins stay as named points.

    A link that moves and is no body takes over the links that are fixed to it. If a root without mass has none and the
    base is fixed to the world, its links hang on the world.

    Raises:
        ModelError: A link that moves has no mass, and nothing with a mass is fixed to it.
    """
    for name in reversed(list(tree.links)):
        link = tree.links[name]
        if link.parent is not None and link.joint.kind == "fixed" and not _is_body(link):
            _join(tree, link, tree.links[link.parent])
    for link in [one for one in tree.links.values() if one.parent is None or one.joint.kind != "fixed"]:
        while not _is_body(link):
            fixed = [child for child in tree.children(link.name) if child.joint.kind == "fixed"]
            if not fixed:
                break
            for child in fixed:
                _join(tree, child, link)
    for root in [link for link in tree.links.values() if link.parent is None]:
        if root.mass == 0.0 and root.joint.kind == "fixed":
            children = tree.children(root.name)
            is_carriage = [child.joint.kind for child in children] == ["free"]
            if is_carriage or (not free_base and children):
                _hang_on_world(tree, root, children)
    for link in tree.links.values():
        if link.mass == 0.0:
            hint = ", or the base must be fixed: free_base=False" if link.parent is None else ""
            reason = "a link that moves, or what is fixed to it, must have a mass"
            tree.refuse(f"link[{link.name}].mass", link.mass, f"{reason}{hint}")


def _is_body(link: FileLink) -> bool:
    """Whether mass and inertia of a link are those of a body, by the rule of a model's solids."""
    if not (link.mass >= LEAST_MASS and np.all(np.isfinite(link.inertia))):
        return False
    principal = np.linalg.eigvalsh((link.inertia + link.inertia.T) / 2.0)
    return bool(principal[0] > 0.0 and principal[2] <= (principal[0] + principal[1]) * (1.0 + 1e-9))


def _join(tree: RobotTree, link: FileLink, other: FileLink) -> None:
    if link.mass > 0.0:
        tree.assumed.append(f"link[{link.name}]: joined with {other.name}, since one of the two is no body by itself")
    R, p = link.rotation, link.position
    other.inertia = other.inertia + R @ link.inertia @ R.T  # a file may state an inertia without a mass
    if link.mass > 0.0:
        centre = p + R @ link.centre
        mass = other.mass + link.mass
        together = (other.mass * other.centre + link.mass * centre) / mass
        for m, c in ((other.mass, other.centre), (link.mass, centre)):
            other.inertia = other.inertia + m * _steiner(c - together)
        other.mass, other.centre = mass, together
    for shape in link.shapes:
        shape.position, shape.rotation = p + R @ shape.position, R @ shape.rotation
        other.shapes.append(shape)
    other.points.append((link.name, p))
    other.points += [(name, p + R @ point) for name, point in link.points]
    for child in tree.children(link.name):
        child.parent = other.name
        child.position, child.rotation = p + R @ child.position, R @ child.rotation
    del tree.links[link.name]


def _hang_on_world(tree: RobotTree, root: FileLink, children: list[FileLink]) -> None:
    for child in children:
        child.parent = None
        child.position = root.position + root.rotation @ child.position
        child.rotation = root.rotation @ child.rotation
    tree.left_out.append(f"link[{root.name}]: has no mass; what it carries hangs on the world")
    del tree.links[root.name]


def _steiner(r: Array) -> Array:
    return np.asarray(float(r @ r) * np.eye(3) - np.outer(r, r))
