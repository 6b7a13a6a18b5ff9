"""A model from the side, from the front and from above, with its wheels, joints and mass centre."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.core import RoverModel
from rover_gym.core.extras import require
from rover_gym.models.lookup import ModelLike, as_model
from rover_gym.show.figures.style import DARK, QUANTITY_COLOURS, check_format, plain, save_figures
from rover_gym.show.frames.appearance import part_mesh, rover_parts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Views: title, axis to the right, axis upwards, axis towards the viewer; signs and indices of x, y, z.
VIEWS = (
    ("from the right", (1.0, 0), (1.0, 1), (1.0, 2), ("forward", "up")),
    ("from the front", (-1.0, 2), (1.0, 1), (1.0, 0), ("to the left", "up")),
    ("from above", (1.0, 0), (-1.0, 2), (1.0, 1), ("forward", "to the left")),
)


def write_model_picture(model: ModelLike, path: str | Path) -> Path:
    """Draws a model with all joints at zero.

    Args:
        model: The model, its name in the gallery or its file.
        path: Picture file; its ending is the format, .png, .svg or .pdf.

    Returns:
        The path.

    Raises:
        OptionError: The ending is none of these.
        MissingExtraError: matplotlib is not installed.
    """
    model, path = as_model("model", model), Path(path)
    check_format(path.suffix.removeprefix("."))
    (written,) = save_figures(
        {path.stem: drawing_of(model)}, path.parent, height=7.0, file_format=path.suffix.removeprefix(".")
    )
    return written


def drawing_of(model: RoverModel) -> Callable[[Figure], None]:
    """The function that fills a figure with the three views of a model."""
    q = np.zeros(model.nq)
    poses, tags = model.poses(q), model.tags(q)
    triangles, colours = [], []
    for part in rover_parts(model):
        origin, rotation = poses[part.solid]
        vertices, faces = part_mesh(part)
        placed = (vertices @ part.rotation.T + part.position) @ rotation.T + origin
        triangles.append(placed[faces])
        colours.append(np.broadcast_to(np.array(part.colour), (len(faces), 3)))
    shown = np.concatenate(triangles) if triangles else np.zeros((0, 3, 3))
    tints = np.concatenate(colours) if colours else np.zeros((0, 3))
    points = {name: poses[name][0] for name in model.solid_names}

    def fill(figure: Figure) -> None:
        figure.suptitle(plain(f"{model.name}: {model.mass:.4g} kg, {model.nv} degrees of freedom"))
        grid = figure.subplots(2, 2)
        for axes, view in zip(grid.flat, VIEWS, strict=False):
            _draw(axes, shown, tints, points, tags["centre_of_mass"], view)
        _list(grid.flat[3], model)

    return fill


def _draw(
    axes: Axes,
    triangles: npt.NDArray[np.float64],
    tints: npt.NDArray[np.float64],
    points: dict[str, npt.NDArray[np.float64]],
    centre: npt.NDArray[np.float64],
    view: tuple[str, tuple[float, int], tuple[float, int], tuple[float, int], tuple[str, str]],
) -> None:
    collections = require("matplotlib.collections", "demo")
    title, (right, i), (up, j), (near, k), labels = view
    order = np.argsort(near * triangles[:, :, k].mean(axis=1))
    seen = triangles[order]
    flat = np.stack([right * seen[:, :, i], up * seen[:, :, j]], axis=2)
    normals = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    facing = np.abs(normals[:, k]) / np.where(lengths > 0.0, lengths, 1.0)
    shades = tints[order] * (0.65 + 0.35 * facing[:, None])
    axes.add_collection(collections.PolyCollection(flat, facecolors=shades, edgecolors=shades, linewidths=0.2))
    joints = np.array([(right * p[i], up * p[j]) for p in points.values()])
    axes.plot(joints[:, 0], joints[:, 1], "o", color=QUANTITY_COLOURS[1], markersize=2.5)
    axes.plot([right * centre[i]], [up * centre[j]], "P", color=QUANTITY_COLOURS[2], markersize=7.0)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(title)
    axes.set_xlabel(f"{labels[0]}, m")
    axes.set_ylabel(f"{labels[1]}, m")


def _list(axes: Axes, model: RoverModel) -> None:
    axes.set_axis_off()
    steered = sum(index >= 0 for index in model.steering_joint_indices)
    radii = sorted({f"{radius:.4g}" for radius in model.wheel_radii})
    lines = [f"{len(model.wheel_names)} wheels, {steered} steered", f"radius {', '.join(radii) or '-'} m", ""]
    lines += ["dots: origins of the solids", "cross: mass centre"]
    axes.text(0.0, 0.95, plain("\n".join(lines)), va="top", color=DARK)
