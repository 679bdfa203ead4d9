"""Scenes painted with pygame on a surface in memory, without a display or window."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from io import BytesIO

import numpy as np
import pygame
from jaxtyping import Float64, UInt8

from albot_core.drawing.figure import round_length
from albot_core.drawing.palette import DARK, DARK_FREE, DARK_GROUND, rgb
from albot_core.geometry.poses import inverse, transform_points
from albot_env.rendering.scene import Panel, Scene
from albot_env.rendering.shapes import Shape
from albot_env.rendering.viewer import Footer

Colour = tuple[int, int, int]

BACKGROUND: Colour = (22, 24, 29)
PANEL: Colour = rgb(DARK_GROUND)
TEXT: Colour = (222, 226, 233)
FAINT: Colour = (128, 136, 150)
ACCENT: Colour = (120, 190, 255)
FREE: Colour = rgb(DARK_FREE)
OCCUPIED: Colour = (236, 239, 244)
PALETTE: dict[str, Colour] = {style: rgb(colour) for style, colour in DARK.items()}

MARGIN = 12
TITLE_HEIGHT = 30
LINE_HEIGHT = 20
LEGEND_HEIGHT = 18
BAR_HEIGHT = 4
SWATCH = 18
"""Width of the colour patches in a legend (pixels)."""
_LEAST_STEP = 4.0
"""Least length of the pieces of a line, about (pixels)."""
_PIXELS = np.array(((0.5, 0.5), (1.5, 0.5), (0.5, 1.5)))
"""The middle of the first pixel, of the one on its right and of the one below."""
_RAMP = np.linspace(FREE, OCCUPIED, 256).astype(np.uint32)
"""Colours of the cells of a grid, from free to occupied."""


@lru_cache(maxsize=1024)
def text_picture(text: str, size: int, colour: Colour) -> pygame.Surface:
    """Return a line of text as a picture, which must not be changed: others draw it again.

    Titles, legends and most names of places are the same in each frame of an episode. The pictures
    are kept and not the font, which `pygame.quit()` would invalidate.
    """
    pygame.font.init()
    return pygame.font.Font(None, size).render(text, True, colour)


class View:
    """Transform from metres to a panel's pixels.

    Args:
        bounds: What is seen (see `Panel.bounds`).
        area: Where it is seen (pixels).
        pen: Size of lines, dots and marks, which do not grow with the picture; 1 as usual.
    """

    def __init__(
        self, bounds: tuple[float, float, float, float], area: pygame.Rect, pen: float = 1.0
    ) -> None:
        x0, y0, x1, y1 = bounds
        self.scale = min(area.width / (x1 - x0), area.height / (y1 - y0))
        self.pen = pen
        self._middle = np.array(((x0 + x1) / 2, (y0 + y1) / 2))
        self._centre = np.array(area.center, float)

    def stroke(self, size: int) -> int:
        """Return a width or radius (pixels) for the present pen."""
        return max(1, round(size * self.pen))

    def metres(self, pixels: Float64[np.ndarray, "*points 2"]) -> Float64[np.ndarray, "..."]:
        """Return the positions of pixels (m)."""
        return np.asarray(self._middle + (pixels - self._centre) / (self.scale, -self.scale))

    def __call__(self, points: Float64[np.ndarray, "*points 2"]) -> Float64[np.ndarray, "..."]:
        """Return the pixels of positions (m)."""
        return np.asarray(self._centre + (points - self._middle) * (self.scale, -self.scale))


def paint(scene: Scene, canvas: pygame.Surface, footer: Footer | None = None) -> None:
    """Paint a scene over the whole of `canvas`, and the footer, if given, below it."""
    canvas.fill(BACKGROUND)
    width, height = canvas.get_size()
    texts = [(text, TEXT) for text in scene.captions]
    if footer is not None:
        texts += [(footer.status, ACCENT), (footer.keys, FAINT)]
    bottom = height - MARGIN - LINE_HEIGHT * len(texts)
    for k, (text, colour) in enumerate(texts):
        _write(canvas, text, (MARGIN + 4, bottom + LINE_HEIGHT * k), colour, width - 2 * MARGIN)
    if footer is not None:
        bottom -= BAR_HEIGHT + MARGIN // 2
        bar = pygame.Rect(MARGIN, bottom, width - 2 * MARGIN, BAR_HEIGHT)
        pygame.draw.rect(canvas, FREE, bar)
        pygame.draw.rect(canvas, ACCENT, (*bar.topleft, bar.width * footer.share, BAR_HEIGHT))
    _write(canvas, scene.heading, (MARGIN + 4, MARGIN // 2), TEXT, width - 2 * MARGIN)
    top = MARGIN // 2 + LINE_HEIGHT
    left, shares = MARGIN, sum(panel.share for panel in scene.panels)
    for panel in scene.panels:
        panel_width = int((width - MARGIN * (len(scene.panels) + 1)) * panel.share / shares)
        area = pygame.Rect(left, top, panel_width, bottom - MARGIN // 2 - top)
        _paint_panel(panel, canvas, area)
        left += panel_width + MARGIN
    if footer is not None and footer.help:
        _paint_help(canvas, footer.help)


def _paint_help(canvas: pygame.Surface, lines: tuple[str, ...]) -> None:
    """Paint lines about the keys in a box in the middle."""
    box = pygame.Rect(0, 0, 340, LINE_HEIGHT * len(lines) + 2 * MARGIN)
    box.center = canvas.get_rect().center
    pygame.draw.rect(canvas, BACKGROUND, box, border_radius=6)
    pygame.draw.rect(canvas, FAINT, box, width=1, border_radius=6)
    for k, line in enumerate(lines):
        at = box.left + MARGIN, box.top + MARGIN + LINE_HEIGHT * k
        _write(canvas, line, at, TEXT, box.width - 2 * MARGIN)


def _write(
    canvas: pygame.Surface, text: str, at: tuple[int, int], colour: Colour, width: int
) -> None:
    """Write a line of text, in a smaller font if it is wider than `width` (pixels)."""
    written = (text_picture(text, size, colour) for size in (20, 18, 16, 14))
    fitting = next((line for line in written if line.get_width() <= width), None)
    canvas.blit(text_picture(text, 14, colour) if fitting is None else fitting, at)


def _paint_panel(panel: Panel, canvas: pygame.Surface, area: pygame.Rect) -> None:
    pygame.draw.rect(canvas, PANEL, area, border_radius=6)
    canvas.blit(text_picture(panel.title, 22, TEXT), (area.x + 12, area.y + 8))
    entries = legend_places(panel, area)
    drawn = area.inflate(-2 * MARGIN, 0)
    drawn.top, drawn.height = area.top + TITLE_HEIGHT, area.height - TITLE_HEIGHT - MARGIN // 2
    if entries:
        drawn.height = entries[0][1].top - 4 - drawn.top
    drawn.width, drawn.height = max(1, drawn.width), max(1, drawn.height)
    view = paint_shapes(panel, canvas, drawn, clip=area)
    canvas.set_clip(area)
    for shape, place in entries:
        colour = _colour(shape)
        swatch = pygame.Rect(place.left, place.top + 3, SWATCH, place.height - 8)
        if shape.kind in ("segments", "line"):
            swatch = swatch.inflate(0, 3 - swatch.height)
        elif shape.kind not in ("grid", "cells"):
            swatch = swatch.inflate(swatch.height - swatch.width, 0)
        ring, corner = 2 if shape.kind == "home" else 0, 0 if shape.kind in ("grid", "cells") else 5
        pygame.draw.rect(canvas, colour, swatch, ring, corner)
        canvas.blit(text_picture(shape.label, 18, TEXT), (place.left + SWATCH + 5, place.top + 1))
    canvas.set_clip(None)
    _paint_scale(canvas, panel, view, area)


def paint_shapes(
    panel: Panel,
    canvas: pygame.Surface,
    area: pygame.Rect,
    *,
    clip: pygame.Rect,
    pen: float = 1.0,
) -> View:
    """Paint the shapes of a panel; return the transform by which they were placed.

    Args:
        panel: The panel.
        canvas: What is painted on.
        area: The area into which the panel's bounds are fitted (pixels).
        clip: The area outside of which nothing is painted (pixels).
        pen: See `View`; with less than 1, marks have no names.
    """
    view = View(panel.bounds, area, pen)
    canvas.set_clip(clip)
    for shape in panel.shapes:
        PAINTERS[shape.kind](canvas, shape, view)
    canvas.set_clip(None)
    return view


def legend_places(panel: Panel, area: pygame.Rect) -> list[tuple[Shape, pygame.Rect]]:
    """Return the place of each shape in the legend: rows, left to right, at a panel's foot."""
    rows: list[list[tuple[Shape, int]]] = [[]]
    left = room = area.width - 2 * MARGIN
    for shape in panel.shapes:
        width = SWATCH + 5 + text_picture(shape.label, 18, TEXT).get_width() + 14
        if width > left and rows[-1]:
            rows.append([])
            left = room
        rows[-1].append((shape, width))
        left -= width
    places = []
    for k, row in enumerate(rows):
        x, y = area.left + MARGIN, area.bottom - 6 - LEGEND_HEIGHT * (len(rows) - k)
        for shape, width in row:
            places.append((shape, pygame.Rect(x, y, width, LEGEND_HEIGHT)))
            x += width
    return places


def _paint_scale(canvas: pygame.Surface, panel: Panel, view: View, area: pygame.Rect) -> None:
    length = round_length(panel.bounds[2] - panel.bounds[0])
    pixels = round(length * view.scale)
    right, y = area.right - 14, area.y + 20
    pygame.draw.line(canvas, FAINT, (right - pixels, y), (right, y), 2)
    text = text_picture(f"{length:g} m", 18, FAINT)
    canvas.blit(text, (right - pixels - text.get_width() - 6, y - text.get_height() // 2))


def _segments(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    colour, width = PALETTE[shape.style], view.stroke(4 if shape.style == "doorway" else 2)
    for x1, y1, x2, y2 in view(shape.data.reshape(-1, 2)).reshape(-1, 4).tolist():
        pygame.draw.line(canvas, colour, (x1, y1), (x2, y2), width)


def _colour(shape: Shape) -> Colour:
    """Return a shape's colour; of a thin line, one half as bright."""
    red, green, blue = PALETTE[shape.style]
    return (red // 2, green // 2, blue // 2) if shape.is_thin else (red, green, blue)


def _line(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    """Draw a line in pieces that are not too short: a path has many points to a pixel."""
    if len(shape.data) > 1:
        points = view(shape.data)
        lengths = np.hypot(*np.diff(points, axis=0).T).cumsum() // _LEAST_STEP
        kept = np.concatenate(([True], np.diff(lengths, prepend=0.0) > 0))
        kept[-1] = True
        pygame.draw.aalines(canvas, _colour(shape), False, points[kept].tolist())


def _dots(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    for x, y in view(shape.data).tolist():
        pygame.draw.circle(canvas, PALETTE[shape.style], (x, y), view.stroke(2))


def _marks(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    places = view(shape.data).tolist()
    for x, y in places:
        pygame.draw.circle(canvas, PALETTE[shape.style], (x, y), view.stroke(5))
    for (x, y), name in zip(places, shape.names if view.pen >= 1.0 else (), strict=False):
        label = text_picture(name, 18, PALETTE[shape.style])
        canvas.blit(label, (x + 6, y - label.get_height()))


def _grid(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    """Paint occupied cells light and free ones dark; unknown cells keep what is beneath.

    Each pixel of the box around the grid looks up the cell at its position.
    """
    grid = shape.placed_grid
    corners = view(grid.corners)
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), canvas.get_clip().topleft)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int), canvas.get_clip().bottomright)
    if (high <= low).any():
        return
    # The cell of a pixel is linear in its column and row, so that two sums give all.
    towards = inverse(grid.origin)
    corner, right, down = transform_points(towards, view.metres(low + _PIXELS)) / grid.resolution
    columns, rows = (np.arange(count)[:, None] for count in high - low)
    steps = columns * (right - corner), rows * (down - corner) + corner
    x, y = (
        np.floor(across[:, None] + along[None]).astype(np.int64)
        for across, along in zip(*(step.T for step in steps), strict=True)
    )
    height, width = grid.occupancy.shape
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    chances = grid.occupancy[np.where(inside, y, 0), np.where(inside, x, 0)]
    known = inside & ~np.isnan(chances)
    levels = np.rint((len(_RAMP) - 1) * np.where(known, chances, 0.0)).astype(np.int64)
    red, green, blue = (_RAMP << np.array(canvas.get_shifts()[:3], np.uint32)).T
    area = pygame.surfarray.pixels2d(canvas)[low[0] : high[0], low[1] : high[1]]
    np.copyto(area, (red | green | blue)[levels], where=known)


def _cells(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    """Paint squares: the stronger a square, the more its colour differs from the panel's."""
    corners = view(shape.data[:, :2] + shape.data[:, 2:3] * (-0.5, 0.5))
    panel, colour = np.array(PANEL, float), np.array(PALETTE[shape.style], float)
    colours = (panel + shape.data[:, 3:] * (colour - panel)).astype(int).tolist()
    for (x, y), side, shade in zip(
        corners.tolist(), (view.scale * shape.data[:, 2]).tolist(), colours, strict=True
    ):
        square = round(x), round(y), round(x + side) - round(x), round(y + side) - round(y)
        pygame.draw.rect(canvas, shade, square)


def _home(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    x, y = view(shape.data[:2]).tolist()
    pygame.draw.circle(canvas, PALETTE[shape.style], (x, y), view.stroke(8), view.stroke(2))
    pygame.draw.circle(canvas, PALETTE[shape.style], (x, y), view.stroke(2))


def _robot(canvas: pygame.Surface, shape: Shape, view: View) -> None:
    """Draw an arrow of the body's size, or a larger one that can be seen, and the body's edge."""
    x, y, heading = shape.data
    radius = max(shape.radius, view.stroke(6) / view.scale)
    angles = heading + np.array((0.0, 2.5, np.pi, -2.5))
    reach = radius * np.array((1.5, 1.1, 0.4, 1.1))
    corners = np.stack((x + reach * np.cos(angles), y + reach * np.sin(angles)), axis=-1)
    pygame.draw.polygon(canvas, PALETTE[shape.style], view(corners).tolist())
    if shape.radius:
        middle = view(shape.data[:2]).tolist()
        pygame.draw.circle(canvas, PALETTE[shape.style], middle, view.scale * shape.radius, 1)


PAINTERS: dict[str, Callable[[pygame.Surface, Shape, View], None]] = {
    "segments": _segments,
    "line": _line,
    "dots": _dots,
    "marks": _marks,
    "grid": _grid,
    "cells": _cells,
    "home": _home,
    "robot": _robot,
}


def paint_array(scene: Scene, size: tuple[int, int] = (1200, 640)) -> UInt8[np.ndarray, "h w 3"]:
    """Paint a scene in memory; return the image as rows of RGB pixels.

    Args:
        scene: What to paint.
        size: Width and height of the image (pixels).
    """
    canvas = pygame.Surface(size, depth=32)
    paint(scene, canvas)
    return pixels_of(canvas)


def pixels_of(canvas: pygame.Surface) -> UInt8[np.ndarray, "h w 3"]:
    """Return a canvas as rows of RGB pixels."""
    width, height = canvas.get_size()
    pixels = np.frombuffer(bytearray(pygame.image.tobytes(canvas, "RGB")), np.uint8)
    return pixels.reshape(height, width, 3)


def png_bytes(picture: UInt8[np.ndarray, "h w 3"]) -> bytes:
    """Return rows of RGB pixels as the content of a PNG file."""
    from PIL import Image  # slow to load

    content = BytesIO()
    Image.fromarray(picture).save(content, "PNG")
    return content.getvalue()
