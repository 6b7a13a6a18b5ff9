"""Links without mass: what is fixed to another link becomes part of it, and what moves must have a mass."""

from __future__ import annotations

import numpy as np

from rover_gym.models.file_axes import Array
from rover_gym.models.robot_tree import FileLink, RobotTree


def join_massless_links(tree: RobotTree, *, free_base: bool) -> None:
    """Joins links without mass or inertia to what they are fixed to. Their origins stay as named points.

    A root without mass takes over the links that are fixed to it. If it has none and the base is fixed to the world,
    its links hang on the world.

    Raises:
        ModelError: A link that moves has no mass.
    """
    for name in reversed(list(tree.links)):
        link = tree.links[name]
        if link.parent is not None and link.joint.kind == "fixed" and not link.has_body():
            _join(tree, link, tree.links[link.parent])
    for root in [link for link in tree.links.values() if link.parent is None]:
        while root.mass == 0.0:
            fixed = [child for child in tree.children(root.name) if child.joint.kind == "fixed"]
            if not fixed:
                break
            for child in fixed:
                _join(tree, child, root)
        if root.mass == 0.0 and root.joint.kind == "fixed":
            children = tree.children(root.name)
            is_carriage = [child.joint.kind for child in children] == ["free"]
            if is_carriage or (not free_base and children):
                _hang_on_world(tree, root, children)
    for link in tree.links.values():
        if link.mass == 0.0:
            hint = ", or the base must be fixed: free_base=False" if link.parent is None else ""
            tree.refuse(f"link[{link.name}].mass", link.mass, f"a link that moves must have a mass{hint}")


def _join(tree: RobotTree, link: FileLink, other: FileLink) -> None:
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
