"""Place labels so that they lie neither on each other nor on what they are not to cover.

The placement is greedy, as in Christensen, Marks & Shieber, *An empirical study of algorithms for
point-feature label placement*, 1995: each label in turn takes its cheapest position.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.drawing.palette import PAPER, TEXT
from albot_core.geometry.types import Points, Segments

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LINE_HEIGHT = 1.15
"""Height of a line, relative to the size of its text."""
_RINGS = (0.0, 6.0, 14.0, 24.0, 36.0)
"""Distances of a label from its mark (points)."""
_LEADER = 10.0
"""Distance from which on a thin line joins a label and its mark (points)."""
_COVERED, _OUTSIDE, _CROSSED = 50.0, 100.0, 2.0
"""Costs: of an area covered twice or beyond the axes, for each square point; and of a crossed line,
for each point of its length. A label's distance from its mark costs 1 a point."""
_SIZES = (1.0, 0.85, 0.7, 0.55)
"""Sizes that a label within an outline may take, relative to its own."""


@dataclass(frozen=True, kw_only=True)
class Label:
    """A text to place."""

    text: str
    at: tuple[float, float]
    """What it labels, in the coordinates of the axes."""
    colour: str = TEXT
    size: float = 8.0
    """Size of the text (points)."""
    radius: float = 0.0
    """Radius of the mark at `at` (points), which no label covers."""
    within: shapely.Polygon | None = None
    """The outline in which the text must lie, smaller, turned or in several lines if need be; it is
    left out if it does not fit. None for a text beside its mark."""
    weight: str = "normal"


@dataclass(frozen=True)
class _Position:
    """A way to write a label."""

    text: str
    size: float
    turned: bool
    middle: Float64[np.ndarray, "2"]
    """Middle of the text (points from the figure's corner)."""
    box: shapely.Polygon


def place_labels(
    axes: Axes,
    labels: Sequence[Label],
    *,
    segments: Segments | None = None,
    points: Points | None = None,
) -> None:
    """Write labels into axes that are otherwise complete; the same labels get the same places.

    Args:
        axes: The axes, with all else drawn and their limits set.
        labels: The labels; those that come first get the better places.
        segments: (n, 4): lines that labels should not cross, in the coordinates of the axes.
        points: (m, 2): further marks that they should not cover.
    """
    if not labels:
        return
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # The layout must be known.
    points_per_pixel = 72.0 / figure.dpi

    def laid(places: Any) -> Float64[np.ndarray, "..."]:
        return np.asarray(axes.transData.transform(np.asarray(places, float))) * points_per_pixel

    ends = np.zeros((0, 4)) if segments is None else segments
    lines = shapely.STRtree(shapely.linestrings(laid(ends.reshape(-1, 2)).reshape(-1, 2, 2)))
    marks = [shapely.Point(laid(each.at)).buffer(each.radius) for each in labels if each.radius]
    marks += [shapely.Point(at).buffer(3.0) for at in ([] if points is None else laid(points))]
    frame = shapely.box(*np.ravel(axes.bbox.extents) * points_per_pixel)
    taken: list[shapely.Polygon] = []
    for label in labels:
        if label.within is None:
            best = _beside(label, laid(label.at), lines, [*marks, *taken], frame)
        else:
            outline = shapely.Polygon(laid(label.within.exterior.coords))
            found = _inside(label, outline, [*marks, *taken])
            if found is None:
                continue
            best = found
        taken.append(best.box)
        _write(axes, label, best, laid(label.at))


def _beside(
    label: Label,
    at: Float64[np.ndarray, "2"],
    lines: shapely.STRtree,
    taken: Sequence[shapely.Polygon],
    frame: shapely.Polygon,
) -> _Position:
    """Return the cheapest position around a mark."""
    width, height = _measured(label.text, label.size, label.weight)
    tree = shapely.STRtree(taken)
    best, least = None, np.inf
    for ring in _RINGS:
        for turn in np.deg2rad((45, 0, 135, 180, 315, 225, 90, 270)):
            # The text touches a circle around the mark.
            reach = label.radius + 1.0 + ring
            side = np.array((np.cos(turn), np.sin(turn)))
            middle = at + side * reach + np.sign(np.round(side, 6)) * (width / 2, height / 2)
            box = _box(middle, width, height)
            covered = sum(box.intersection(taken[k]).area for k in tree.query(box))
            crossed = sum(box.intersection(lines.geometries[k]).length for k in lines.query(box))
            outside = box.area - box.intersection(frame).area
            cost = ring + _COVERED * covered + _OUTSIDE * outside + _CROSSED * crossed
            if cost < least - 1e-9:
                best, least = _Position(label.text, label.size, False, middle, box), cost
    assert best is not None
    return best


def _inside(
    label: Label, outline: shapely.Polygon, taken: Sequence[shapely.Polygon]
) -> _Position | None:
    """Return the first position within an outline, preferring large, level, single lines."""
    tree = shapely.STRtree(taken)
    middles = list(_middles(outline))
    shapely.prepare(outline)
    for scale, turned in itertools.product(_SIZES, (False, True)):
        size = scale * label.size
        for text in _broken(label.text):
            width, height = _measured(text, size, label.weight)
            if turned:
                width, height = height, width
            for middle in middles:
                box = _box(middle, width + 2.0, height)
                if outline.contains(box) and not len(tree.query(box, "intersects")):
                    return _Position(text, size, turned, middle, box)
    return None


def _middles(outline: shapely.Polygon) -> Iterator[Float64[np.ndarray, "2"]]:
    """Yield where a text may lie: the middle of the largest circle, then a raster, inwards out."""
    centre = np.array(shapely.maximum_inscribed_circle(outline, tolerance=1.0).coords[0])
    yield centre
    low, high = np.reshape(outline.bounds, (2, 2))
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 13)[1:-1].T), axis=-1).reshape(-1, 2)
    yield from grid[np.argsort(np.hypot(*(grid - centre).T), kind="stable")]


def _broken(text: str) -> Iterator[str]:
    """Yield a text in one line, then broken at its spaces into ever more lines."""
    words = text.split()
    for lines in range(1, len(words) + 1):
        ways = itertools.combinations(range(1, len(words)), lines - 1)
        pieces = [
            [" ".join(words[i:j]) for i, j in itertools.pairwise((0, *way, len(words)))]
            for way in ways
        ]
        yield "\n".join(min(pieces, key=lambda each: max(map(len, each))))


def _measured(text: str, size: float, weight: str) -> tuple[float, float]:
    """Return the width and height of a text (points)."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size, weight=weight)
    lines = text.split("\n")
    widths = [text_to_path.get_text_width_height_descent(each, font, False)[0] for each in lines]
    return float(max(widths)), _LINE_HEIGHT * size * len(lines)


def _box(middle: Float64[np.ndarray, "2"], width: float, height: float) -> shapely.Polygon:
    x, y = middle
    return shapely.box(x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def _write(axes: Axes, label: Label, position: _Position, at: Float64[np.ndarray, "2"]) -> None:
    offset = position.middle - at
    x0, y0, x1, y1 = position.box.bounds
    gap = np.hypot(*(np.clip(at, (x0, y0), (x1, y1)) - at)) - label.radius
    leads = label.within is None and gap > _LEADER
    text = axes.annotate(
        position.text,
        label.at,
        xytext=tuple(offset),
        textcoords="offset points",
        ha="center",
        va="center",
        rotation=90 if position.turned else 0,
        fontsize=position.size,
        color=label.colour,
        weight=label.weight,
        linespacing=1.0,
        zorder=10,
        arrowprops={"arrowstyle": "-", "color": label.colour, "lw": 0.5} if leads else None,
        # A stroke around the letters would turn them into paths.
        bbox=None if label.within else {"fc": PAPER, "ec": "none", "alpha": 0.75, "pad": 0.4},
    )
    text.set_in_layout(False)  # The layout stays as it was when the places were found.
