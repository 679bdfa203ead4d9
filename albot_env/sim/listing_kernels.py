"""Finding robots in the index of walls, and listing the walls of cells where none was before."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.sim.plane_kernels import mounted, stance_at
from albot_env.sim.visibility import list_cell, list_from_all

if TYPE_CHECKING:
    from albot_env.sim.wall_index import Walls


BLOCK = 8
"""Cells along each side of a block. A cell's list is chosen from its block's, which is far shorter
than the building's."""


class Listing(NamedTuple):
    """What the lists of an index are made with."""

    walls: Walls
    """The buildings' walls and their lists."""
    reach: float
    """Walls farther away than this are not listed (m)."""
    spread: float
    """How far from the mount, in any direction, a sensor may be (m)."""
    mount: tuple[float, float]
    """Where on the robot the mount is (m)."""


@KernelDispatcher
@kernel()
def list_here(
    rows: np.ndarray,
    arguments: KernelArguments,
    done: int,
    buildings: np.ndarray,
    poses: np.ndarray,
    seeing: np.ndarray,
    hearing: np.ndarray,
) -> int:
    """Find the cells of robots, and list the walls of cells that have no list yet.

    Args:
        rows: The robots.
        arguments: A `Listing` of what is seen, and one of what is heard; either may be of no
            building at all, and is left alone then.
        done: How many of the robots are done.
        buildings: The building of each robot (n,).
        poses: Where each is (n, 3), in the building's frame (m, rad).
        seeing: Filled with the cell of each (n,) by the first listing…
        hearing: …and by the second.

    Returns:
        How many of the rows are done: fewer than all when `members` is full.
    """
    seen, heard = unpack(arguments)
    for k in range(done, rows.shape[0]):
        i = rows[k]
        if seen.walls.frames.shape[0]:
            seeing[i] = _list_about(seen, buildings[i], poses[i])
            if seeing[i] < 0:
                return k
        if heard.walls.frames.shape[0]:
            hearing[i] = _list_about(heard, buildings[i], poses[i])
            if hearing[i] < 0:
                return k
    return int(rows.shape[0])


@kernel()
def _list_about(listing: Listing, building: int, pose: np.ndarray) -> int:
    """The cell of a pose in a building, whose walls are listed now; -1 without room for them."""
    index, (ahead, aside) = listing.walls, listing.mount
    frame = index.frames[building]
    columns, lines = int(frame[3]), int(frame[4])
    x, y = pose[0], pose[1]
    if ahead != 0.0 or aside != 0.0:  # Sines and cosines cost more than all else here.
        x, y, _, _ = mounted(stance_at(pose), (ahead, aside, 1.0, 0.0))
    column, line = math.floor((x - frame[0]) / frame[2]), math.floor((y - frame[1]) / frame[2])
    inside = 0 <= column < columns and 0 <= line < lines
    cell = int(frame[5]) + int(line * columns + column if inside else lines * columns)
    if index.spans[cell, 0] >= 0:
        return cell
    first, last = int(frame[6]), int(frame[7])
    if index.members.shape[0] - index.used[0] < 2 * (last - first):
        return -1
    if inside:
        span = _list_block(listing, building, int(column) // BLOCK, int(line) // BLOCK)
        index.spans[cell, 0] = index.used[0]
        x = frame[0] + frame[2] * (column + 0.5)
        y = frame[1] + frame[2] * (line + 0.5)
        candidates = index.members[span[0] : span[1]]
        list_cell(index, candidates, x, y, frame[2], (listing.reach, listing.spread))
    else:
        index.spans[cell, 0] = index.used[0]
        for j in range(first, last):
            index.members[index.used[0]] = j
            index.used[0] += 1
    index.spans[cell, 1] = index.used[0]
    return cell


@kernel()
def _list_block(listing: Listing, building: int, column: int, line: int) -> tuple[int, int]:
    """Where in `members` the list of a block of a building's cells is, which is made if need be.

    What does not matter in all of the block does not in any of its cells.
    """
    index = listing.walls
    frame = index.frames[building]
    columns, lines = int(frame[3]), int(frame[4])
    block = int(frame[5]) + columns * lines + 1 + line * -(-columns // BLOCK) + column
    if index.spans[block, 0] < 0:
        index.spans[block, 0] = index.used[0]
        side = BLOCK * frame[2]
        x, y = frame[0] + side * (column + 0.5), frame[1] + side * (line + 0.5)
        reach = listing.reach, listing.spread
        list_from_all(index, int(frame[6]), int(frame[7]), x, y, side, reach)
        index.spans[block, 1] = index.used[0]
    return index.spans[block, 0], index.spans[block, 1]
