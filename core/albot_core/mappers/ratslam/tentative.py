"""Known views seen where no experience has them: tentative until the robot sees them there again.

At random times a camera recognises a familiar scene in another part of the environment, and for a
few seconds (section 5.1). By eq. (11) each such look makes an experience, and a link that later
injects activity there, so the map never stops growing. A second place that truly looks the same
looks so at the next visit, too. This is our addition; the paper does not cover it.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import ExperienceConfig, PoseCellConfig
from albot_core.mappers.ratslam.pose_cells import Packet
from albot_core.mappers.schema import Field, Schema
from albot_core.mappers.stored import Stored

_CORE = 0.5
"""A visit passes a place if the packet comes within this share of its zone."""


class Tentative(Stored):
    """The views that were seen where no experience has them, with the packet then.

    Args:
        config: The zones of influence, and how many visits make an experience.
        cells: Parameters of the pose cells, to convert the zones to cells.
    """

    SCHEMA = Schema(parts=("_rows",))

    def __init__(self, config: ExperienceConfig, cells: PoseCellConfig) -> None:
        self._visits = config.visits
        self._shape = cells.columns, cells.rows, cells.headings
        self._zone = config.radius / cells.cell, config.turn / cells.cell_turn
        self._rows = Table(
            "tentative",
            Field("view", "", int, least=0, below="views"),
            Field("cell", "3"),
            # Visits in a row at which it was seen; 0 for a row that is free.
            Field("visits", "", int, least=0),
            # Of the present visit: whether the robot is in the zone, was in its core, and saw it.
            Field("visit", "3", int, least=0, most=1),
        )

    def reset(self) -> None:
        """Forget all of them."""
        self._rows.clear()

    def move(self, packet: Packet) -> None:
        """Follow the packet; forget a view that was not seen when the robot passed its place."""
        rows = self._rows
        follow(
            (packet.x, packet.y, packet.heading),
            (rows.rows("cell"), rows.rows("visits"), rows.rows("visit")),
            self._shape,
            self._zone,
        )

    def see(self, view: int, packet: Packet) -> None:
        """Note that a view came into sight where no experience has it."""
        rows, near = self._rows, self._near(view, packet)
        if near < 0:
            free = np.flatnonzero(rows.rows("visits") == 0)
            near = int(free[0]) if len(free) else rows.append(visits=0)
            for name, value in (("view", view), ("cell", packet[:3]), ("visit", (1, 1, 0))):
                rows[name][near] = value
        if not rows["visit"][near, 2]:
            rows["visits"][near] += 1
            rows["visit"][near, 2] = 1

    def is_confirmed(self, view: int, packet: Packet) -> bool:
        """Return whether a view was seen near here at as many visits as make an experience."""
        near = self._near(view, packet) if self._visits > 1 else -1
        return self._visits <= 1 or (near >= 0 and bool(self._rows["visits"][near] >= self._visits))

    def _near(self, view: int, packet: Packet) -> int:
        """Return the row of a view nearest to the packet within its zone; -1 if there is none."""
        rows = self._rows
        return nearest(
            view,
            (packet.x, packet.y, packet.heading),
            (rows.rows("view"), rows.rows("cell"), rows.rows("visits")),
            self._shape,
            self._zone,
        )


@kernel()
def apart(
    one: tuple[float, float, float], other: np.ndarray, shape: tuple[int, int, int]
) -> tuple[float, float]:
    """Return the distances of two positions in cells: in the plane (x', y'), and in θ'."""
    x, y, turn = abs(one[0] - other[0]), abs(one[1] - other[1]), abs(one[2] - other[2])
    x, y, turn = min(x, shape[0] - x), min(y, shape[1] - y), min(turn, shape[2] - turn)
    return math.sqrt(x * x + y * y), turn


@kernel()
def follow(
    packet: tuple[float, float, float],
    rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    shape: tuple[int, int, int],
    zone: tuple[float, float],
) -> None:
    """Update the visits of all rows, see `Tentative.move`."""
    cells, visits, visit = rows
    for k in range(cells.shape[0]):
        if visits[k] == 0:
            continue
        away, turned = apart(packet, cells[k], shape)
        if away <= zone[0] and turned <= zone[1]:
            visit[k, 0] = 1
            if away <= _CORE * zone[0] and turned <= _CORE * zone[1]:
                visit[k, 1] = 1
        elif visit[k, 0] == 1:  # The robot leaves.
            if visit[k, 1] == 1 and visit[k, 2] == 0:
                visits[k] = 0
            visit[k, :] = 0


@kernel()
def nearest(
    view: int,
    packet: tuple[float, float, float],
    rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    shape: tuple[int, int, int],
    zone: tuple[float, float],
) -> int:
    """Return the row of a view nearest to the packet within its zone; -1 if there is none."""
    views, cells, visits = rows
    found, least = -1, zone[0]
    for k in range(cells.shape[0]):
        if views[k] == view and visits[k] > 0:
            away, turned = apart(packet, cells[k], shape)
            if away <= least and turned <= zone[1]:
                found, least = k, away
    return found
