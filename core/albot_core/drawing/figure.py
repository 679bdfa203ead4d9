"""Save figures: PNG, PDF or SVG, the same bytes for the same figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from albot_core.drawing.palette import TEXT
from albot_core.errors import InputError
from albot_core.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SCREEN_DPI, PRINT_DPI = 110, 300
"""Dots an inch of a picture for the screen, and of a figure for a paper."""
_BELOW = 8.0
"""Distance of a scale bar from the axes above it (points)."""
_METADATA: dict[str, dict[str, str | None]] = {
    ".png": {"Software": "albot-env"},
    ".pdf": {"Creator": "albot-env", "Producer": "albot-env", "CreationDate": None},
    ".svg": {"Creator": "albot-env", "Date": None},
}
SUFFIXES = tuple(_METADATA)
"""Endings of the names of figures: their formats."""
_STYLE: dict[Any, Any] = {"svg.fonttype": "none", "pdf.fonttype": 42, "svg.hashsalt": "albot-env"}
"""Text stays text, and the names inside an SVG do not change."""


def save_figure(figure: Figure, path: Path, dpi: int = SCREEN_DPI) -> None:
    """Save a figure completely or not at all; its name tells the format.

    PDF and SVG are vector graphics, in which only occupancy grids are pixels.

    Args:
        figure: The figure.
        path: The file, with one of `SUFFIXES` in small or capital letters.
        dpi: Dots an inch of a PNG, and of the grids in the others.

    Raises:
        InputError: The name has another ending, or the file cannot be written.
    """
    from matplotlib import rc_context  # slow to load, as all that draws

    suffix = check_figure_name(path)
    with rc_context(_STYLE), atomic_write(path) as stream:
        figure.savefig(
            stream, format=suffix[1:], dpi=dpi, bbox_inches="tight", metadata=_METADATA[suffix]
        )


def check_figure_name(path: Path, source: object = None) -> str:
    """Return the ending of a figure's name, in small letters.

    Raises:
        InputError: It is none of `SUFFIXES`; `source`, or else the path, is named as the place.
    """
    suffix = path.suffix.lower()
    if suffix not in _METADATA:
        expected = f"a name that ends in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        raise InputError(path if source is None else source, expected, str(path))
    return suffix


def round_length(width: float) -> float:
    """Return a length for the scale bar of a picture: 1, 2 or 5 times a power of ten.

    Args:
        width: The picture's width (m), of which the bar takes a fifth at most.
    """
    wanted = width / 5 * 1.001
    return max(
        factor * 10.0**power
        for power in range(-6, 7)
        for factor in (1, 2, 5)
        if factor * 10.0**power <= wanted
    )


def draw_scale_bar(axes: Axes, length: float, colour: str = TEXT) -> None:
    """Draw a scale bar of `length` (m) below the right end of the axes, with its length."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    right = axes.get_xlim()[1]
    figure = axes.get_figure(root=True)
    assert figure is not None
    # Points below the frame, however high the axes are.
    down = ScaledTranslation(0.0, -_BELOW / 72, figure.dpi_scale_trans)
    below = blended_transform_factory(axes.transData, axes.transAxes) + down
    (bar,) = axes.plot(
        [right - length, right],
        [0.0, 0.0],
        transform=below,
        color=colour,
        lw=3.0,
        solid_capstyle="butt",
        clip_on=False,
        zorder=9,
    )
    text = axes.annotate(
        f"{length:g} m",
        (right - length, 0.0),
        xycoords=below,
        xytext=(-4, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=8,
        color=colour,
        annotation_clip=False,
    )
    bar.set_in_layout(False)
    text.set_in_layout(False)
    if not axes.get_xlabel():
        axes.set_xlabel(" ", fontsize=8)  # Keeps the room for both.
