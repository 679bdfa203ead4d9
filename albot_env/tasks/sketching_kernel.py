"""The compiled loops of sketching: what robots see of the ground, drawn as they go.

What the cells of a sketch are, see `albot_core.planning.sketch_kernels`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.directions import length_of
from albot_core.kernels.compiled import kernel
from albot_core.planning.sketch_kernels import draw_scan
from albot_env.tasks.ground_kernels import Sight, is_time_to_look

POINT, LENGTH = slice(0, 2), 2
"""What `Sketches` holds of a way: a point ahead on it, and how long it is."""


class Pencil(NamedTuple):
    """How sketches are drawn."""

    cell: float
    """Side of a cell (m)."""
    reach: float
    """What lies farther away is not drawn (m)."""
    jump: float
    """A belief that moves farther than this (m) from what the odometer says begins a new sheet."""
    spacing: float
    """How far the robot comes between two looks (m)…"""
    turn: float
    """…unless it turns by this much before (rad)."""
    every: int
    """Steps from each search for ways to the next."""


class Sketches(NamedTuple):
    """The sketches of robots, in their maps' frames, and the ways found on them; a row each."""

    grids: np.ndarray
    """(n, cells) int8: what each cell is, row by row, x along a row."""
    sides: np.ndarray
    """(n,) int64: cells along each side; the map's origin is in the middle."""
    ages: np.ndarray
    """(n,) int64: steps since each was begun."""
    moved: np.ndarray
    """(n, 2) float64: way and turning since each was drawn on last (m, rad)."""
    beliefs: np.ndarray
    """(n, 3) float64: where each robot believed to be at the last step (map frame)."""
    homewards: np.ndarray
    """(n, 3) float64: the point ahead on the shortest way home that is not known to be barred
    (map frame, m), and how long that way is, close to things twice as long (m); NaN and
    infinite where there is none."""
    onwards: np.ndarray
    """(n, 3) float64: the same of the shortest way, over ground seen to be free, to ground that
    is not covered."""


@kernel()
def begin_sketch(sketches: Sketches, i: int) -> None:
    """Let robot i know nothing of the ground."""
    side = sketches.sides[i]
    sketches.grids[i, : side * side] = 0
    sketches.ages[i] = 0
    sketches.moved[i] = math.inf
    forget_way(sketches.homewards[i])
    forget_way(sketches.onwards[i])


@kernel(arrays=True)
def follow_sketch(
    sketches: Sketches,
    i: int,
    pencil: Pencil,
    sight: Sight,
    motion: np.ndarray,
    belief: np.ndarray,
    ranges: np.ndarray,
) -> bool:
    """Draw what robot i sees; return whether it is time to search for ways.

    A belief that has jumped begins a new sheet: what is drawn is not where it was.
    """
    if sketches.ages[i] and _has_jumped(sketches.beliefs[i], motion, belief, pencil.jump):
        begin_sketch(sketches, i)
    sketches.beliefs[i] = belief
    if is_time_to_look(motion, pencil.spacing, pencil.turn, sketches.moved[i]):
        _draw(grid_of(sketches, i), pencil, sight, belief, ranges)
    is_time = sketches.ages[i] % pencil.every == 0
    sketches.ages[i] += 1
    return bool(is_time)


@kernel()
def forget_way(way: np.ndarray) -> None:
    """There is no such way."""
    way[POINT] = math.nan
    way[LENGTH] = math.inf


@kernel(arrays=True)
def grid_of(sketches: Sketches, i: int) -> np.ndarray:
    """Robot i's cells (side, side), to be read and written."""
    side = sketches.sides[i]
    return sketches.grids[i, : side * side].reshape((side, side))


@kernel()
def _has_jumped(before: np.ndarray, motion: np.ndarray, now: np.ndarray, jump: float) -> bool:
    """Whether a belief is elsewhere than the odometer's motion leads to."""
    cos, sin = math.cos(before[2]), math.sin(before[2])
    x = before[0] + cos * motion[0] - sin * motion[1]
    y = before[1] + sin * motion[0] + cos * motion[1]
    return length_of(now[0] - x, now[1] - y) > jump


@kernel(arrays=True)
def _draw(
    grid: np.ndarray, pencil: Pencil, sight: Sight, belief: np.ndarray, ranges: np.ndarray
) -> None:
    """Draw a scan, where all of it is on the sheet."""
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    eye = np.array(
        (
            belief[0] + cos * sight.x - sin * sight.y,
            belief[1] + sin * sight.x + cos * sight.y,
            belief[2] + sight.first,
        )
    )
    farthest = max(abs(eye[0]), abs(eye[1])) + pencil.reach + pencil.cell
    if farthest < (grid.shape[0] // 2) * pencil.cell:
        bearings = np.arange(ranges.shape[0]) * sight.spacing
        draw_scan(grid, pencil.cell, eye, ranges, bearings, pencil.reach)
