"""Mosaics: several episodes in one picture, a tile for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pygame
from jaxtyping import UInt8

from albot_env.rendering.canvas import (
    BACKGROUND,
    FAINT,
    PALETTE,
    PANEL,
    TEXT,
    paint_shapes,
    pixels_of,
    text_picture,
)
from albot_env.rendering.frame import Frame, clock_time
from albot_env.rendering.scene import lay_out

WIDTH = 1280
"""Width that a mosaic has about, however many tiles are side by side (pixels)."""
NARROWEST, WIDEST = 240, 640
"""Limits of a tile's width (pixels)."""
_FORM = 5, 3
"""Width to height of a tile: two panels side by side, below a line of text."""
_GAP = 4
"""Distance between panels, and around them (pixels)."""
_LINE = 20
"""Height of the line of text (pixels)."""
_SIZE = 18
"""Size of its letters."""
_PEN = 0.6
"""Size of lines and marks (see `View`)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tile:
    """One episode of a mosaic at one of its moments."""

    frame: Frame
    """What is drawn."""
    label: str = ""
    """Which episode it is, such as its seed."""
    outcome: str = ""
    """How it ended; empty while it runs."""
    is_success: bool | None = None
    """Whether it has succeeded, which frames the tile in a colour; None while it runs, or if its
    task knows no success."""


def tile_size(columns: int) -> tuple[int, int]:
    """Return width and height of the tiles of a mosaic with so many columns (pixels, even)."""
    width = min(max(WIDTH // columns, NARROWEST), WIDEST)
    width -= width % (2 * _FORM[0])
    return width, width * _FORM[1] // _FORM[0] // 2 * 2


def paint_mosaic(
    tiles: Sequence[Tile], columns: int, size: tuple[int, int] | None = None
) -> UInt8[np.ndarray, "h w 3"]:
    """Paint tiles in rows, from left to right and from top to bottom.

    In each tile, the truth is on the left and the robot's belief on the right.

    Args:
        tiles: One tile per episode.
        columns: Number of tiles in a row; the last row may have fewer.
        size: Width and height of a tile (pixels); by default `tile_size`.

    Returns:
        Rows of RGB pixels.
    """
    width, height = size or tile_size(columns)
    rows = -(-len(tiles) // columns)
    canvas = pygame.Surface((width * columns, height * rows), depth=32)
    canvas.fill(BACKGROUND)
    for k, tile in enumerate(tiles):
        # On a part of a canvas, pygame draws smooth lines with gaps.
        painted = pygame.Surface((width, height), depth=32)
        _paint_tile(tile, painted)
        canvas.blit(painted, (k % columns * width, k // columns * height))
    return pixels_of(canvas)


def _paint_tile(tile: Tile, canvas: pygame.Surface) -> None:
    canvas.fill(BACKGROUND)
    width, height = canvas.get_size()
    scene = lay_out(tile.frame)
    colour = _outcome_colour(tile)
    label = text_picture(tile.label, _SIZE, TEXT)
    canvas.blit(label, (2 * _GAP, _GAP + 2))
    says = tile.outcome or clock_time(tile.frame.time)
    outcome = text_picture(says, _SIZE, colour if tile.outcome else FAINT)
    room = width - 4 * _GAP - label.get_width()
    if outcome.get_width() < room:
        canvas.blit(outcome, (width - 2 * _GAP - outcome.get_width(), _GAP + 2))
    panels = scene.truth, scene.map
    panel_width = (width - _GAP) // len(panels) - _GAP
    for k, panel in enumerate(panels):
        left, top = _GAP + k * (panel_width + _GAP), _GAP + _LINE
        area = pygame.Rect(left, top, panel_width, height - top - _GAP)
        pygame.draw.rect(canvas, PANEL, area, border_radius=4)
        paint_shapes(panel, canvas, area, clip=area, pen=_PEN)
    if tile.outcome:
        pygame.draw.rect(canvas, colour, canvas.get_rect(), width=2, border_radius=4)


def _outcome_colour(tile: Tile) -> tuple[int, int, int]:
    if tile.is_success is None:
        return FAINT
    return PALETTE["home"] if tile.is_success else PALETTE["doorway"]
