"""What lies over something else in a figure, by the bounding boxes of its artists."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

SLACK = 1.0  # pixels by which boxes may meet


def covered(figure: Figure) -> list[str]:
    """Pairs of texts that overlap, and texts that lie over a curve, a bar or the frame's edge of their axes."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    # Of an annotation the text alone, without its arrow.
    texts = [(text, inner(Text.get_window_extent(text, canvas.get_renderer()))) for text in shown(figure)]
    found = [
        f"{a.get_text()!r} and {b.get_text()!r}"
        for (a, one), (b, other) in combinations(texts, 2)
        if one.overlaps(other) and a.get_text() != b.get_text()
    ]
    for axes in figure.findobj(Axes):
        free = [(text, box) for text, box in texts if text not in labels_of(axes)]
        for line in axes.lines:
            if not line.get_visible() or not len(line.get_xdata()):
                continue
            points = visible_points(axes, line.get_transform().transform(line.get_xydata()))
            found += [
                f"{text.get_text()!r} over the curve {line.get_label()!r}"
                for text, box in free
                if ((points >= box.min) & (points <= box.max)).all(axis=1).any()
            ]
    return found


def inner(box: Bbox) -> Bbox:
    return Bbox([box.min + SLACK, np.maximum(box.max - SLACK, box.min + SLACK)])


def shown(figure: Figure) -> Iterator[Text]:
    """The figure's texts that can be read, those of tick marks within the view among them."""
    hidden = set()
    for axes in figure.findobj(Axes):
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
                if (
                    not low - 1e-9 * (high - low) <= tick.get_loc() <= high + 1e-9 * (high - low)
                    or not axis.get_visible()
                ):
                    hidden |= {tick.label1, tick.label2}
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().strip() and text not in hidden:
            yield text


def labels_of(axes: Axes) -> set[Text]:
    """Texts that stand outside the axes by themselves."""
    ticks = [*axes.xaxis.get_ticklabels(which="both"), *axes.yaxis.get_ticklabels(which="both")]
    return {*ticks, axes.title, axes.xaxis.label, axes.yaxis.label}


def visible_points(axes: Axes, points: np.ndarray) -> np.ndarray:
    """Points of a curve in pixels, with some between each two, as far as they lie within the axes."""
    between = [points[:-1] + share * np.diff(points, axis=0) for share in np.linspace(0.0, 1.0, 9)]
    points = np.concatenate([*between, points[-1:]])
    box = axes.bbox
    points = points[np.isfinite(points).all(axis=1)]
    return points[((points >= box.min) & (points <= box.max)).all(axis=1)]
