"""The likelihood field: how likely a beam is to end at each point, at several resolutions.

It is a square of cells around the robot. The likelihood of a cell is a Gaussian of its distance
from the nearest point of the scans that were added (S. Thrun, W. Burgard and D. Fox, Probabilistic
Robotics, 2005, section 6.4; E. Olson, Real-time correlative scan matching, ICRA 2009, section III).
A cell of level h holds the maximum of the 2^h by 2^h finest cells that begin at it: an upper bound
for all of them (W. Hess et al., Real-time loop closure in 2D LIDAR SLAM, ICRA 2016, eq. 15). Here
the coarse levels are built again, when needed, after points were added.

All data are arrays, which the kernels of `correlation` and `refinement` use directly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, UInt8, UInt16

from albot_core.errors import InputError
from albot_core.geometry.types import Points, Pose
from albot_core.kernels.byte_tables import BYTES_RAISED, raise_bytes
from albot_core.kernels.compiled import kernel
from albot_core.ranges import POSITIVE, Range, check_fields

CERTAIN = 255
"""The likelihood of a cell with a point at its centre."""
_PARTS = 4
"""The position of a point in its cell is rounded to one of this many parts, in each of x and y."""
_LEVELS = Range("a whole number from 1 to 8", 1.0, 8.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class FieldConfig:
    """Resolution and size of a likelihood field."""

    cell: float = 0.05
    """Side of a cell (m)."""
    sigma: float = 0.05
    """Standard deviation of the distance between a beam's end and the surface (m)."""
    half: float = 12.0
    """Half the side of the field (m)."""
    levels: int = 4
    """Number of resolutions: the coarsest cell is 2^(levels - 1) of the finest."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "cell", "sigma", "half")
        check_fields(self, _LEVELS, "levels")
        if not 2 * self.half / self.cell <= 8192:
            expected = f"at most 4096 cells of {self.cell:g} m"
            raise InputError("FieldConfig.half", expected, f"{self.half:g}")

    @property
    def side(self) -> int:
        """Cells along each side of the field."""
        return 2 * int(np.ceil(self.half / self.cell))


class LikelihoodField:
    """A square likelihood field, to which scans are added; it can be cleared and moved.

    Args:
        config: The field's parameters.
    """

    def __init__(self, config: FieldConfig) -> None:
        self.config = config
        self.corner: Float64[np.ndarray, "2"] = np.zeros(2)
        """x, y of the outer corner of cell [0, 0] (m); a multiple of the cell's side."""
        self._levels = np.zeros((config.levels, config.side, config.side), np.uint8)
        self._seen: UInt16[np.ndarray, "side side"] = np.zeros(self._levels.shape[1:], np.uint16)
        self._beside = np.empty_like(self._levels[0])
        self._stamps = _make_stamps(config)
        # First and last (excluded) row, then column, that may be non-zero.
        self._used = np.array((config.side, 0, config.side, 0))
        self._built = 0

    @property
    def levels(self) -> UInt8[np.ndarray, "levels side side"]:
        """Likelihoods by level, row (y) and column (x), of at most `CERTAIN`.

        Level 0 is the finest. Always the same array; coarse levels are built when it is read.
        """
        return self.levels_for(self.config.side)

    def levels_for(self, across: int) -> UInt8[np.ndarray, "few side side"]:
        """Return the levels with cells at most half as wide as a window of `across` cells."""
        wanted = 1
        while wanted < self.config.levels and 1 << (wanted + 1) <= across:
            wanted += 1
        if self._built < wanted:
            _build_coarse(self._levels[:wanted], self._beside, self._used.tolist(), self._built)
            self._built = wanted
        return self._levels[:wanted]

    @property
    def finest(self) -> UInt8[np.ndarray, "side side"]:
        """Level 0, without building the coarse levels."""
        finest: UInt8[np.ndarray, "side side"] = self._levels[0]
        return finest

    def clear(self, centre: Points) -> None:
        """Remove all points, and centre the field at a point (m)."""
        cell = self.config.cell
        top, bottom, left, right = self._used.tolist()
        self._levels[:, top:bottom, left:right] = 0
        self._seen[top:bottom, left:right] = 0
        self._used[:] = self.config.side, 0, self.config.side, 0
        self.corner[:] = (np.round(centre / cell) - self.config.side // 2) * cell
        self._built = 0

    def add(self, pose: Pose, points: Float64[np.ndarray, "points 2"]) -> None:
        """Add the points of a scan, given in the frame of `pose`; points outside are dropped."""
        cell = self.config.cell
        ahead = (1 << (self.config.levels - 1)) - 1
        add_points(
            self.finest,
            self._seen,
            self._stamps,
            self.corner,
            cell,
            pose,
            points,
            self._used,
            ahead,
        )
        self._built = 0


def _make_stamps(config: FieldConfig) -> UInt8[np.ndarray, "parts rows columns"]:
    """Return the likelihoods around one point, for each part of the cell that it may lie in.

    Rows are padded with zeros to a multiple of the bytes that `raise_bytes` processes.
    """
    reach = int(np.ceil(3.0 * config.sigma / config.cell))
    along = (np.arange(2 * reach + 1) - reach) * config.cell
    width = -(-len(along) // BYTES_RAISED) * BYTES_RAISED
    stamps = np.zeros((_PARTS * _PARTS, len(along), width), np.uint8)
    for part in range(_PARTS * _PARTS):
        off = ((np.array(divmod(part, _PARTS)) + 0.5) / _PARTS - 0.5) * config.cell
        squared = (along - off[0])[:, None] ** 2 + (along - off[1]) ** 2
        near = CERTAIN * np.exp(-0.5 * squared / config.sigma**2)
        stamps[part, :, : len(along)] = np.round(near)
    return stamps


@kernel()
def add_points(
    finest: np.ndarray,
    seen: np.ndarray,
    stamps: np.ndarray,
    corner: np.ndarray,
    cell: float,
    pose: np.ndarray,
    points: np.ndarray,
    used: np.ndarray,
    ahead: int,
) -> None:
    """Add points to level 0.

    Args:
        finest: Level 0 of a field (side, side), changed in place.
        seen: Bits of the parts of each cell that have a point (side, side), changed in place.
        stamps: The likelihoods around a point, by its part of the cell (parts, rows, columns):
            see `_make_stamps`.
        corner: x, y of the outer corner of the first cell (m).
        cell: Side of a cell (m).
        pose: x, y, heading of the points' frame.
        points: x, y of the points (points, 2).
        used: First and last (excluded) row, then column, that may be non-zero (4,), changed in
            place.
        ahead: Number of rows and columns before the first ones that coarse levels change.
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    side, rows, columns = len(finest), stamps.shape[1], stamps.shape[2]
    reach, border = rows // 2, stamps.shape[1] // 2 + ahead
    flat, values = finest.reshape(side * side), stamps.reshape(stamps.size)
    for k in range(len(points)):
        x = (pose[0] + cos * points[k, 0] - sin * points[k, 1] - corner[0]) / cell
        y = (pose[1] + sin * points[k, 0] + cos * points[k, 1] - corner[1]) / cell
        # The padding of the stamps must be in the field, too.
        if not (border <= x < side - columns + reach and border <= y < side - reach):
            continue
        column, row = int(x), int(y)
        part = int((y - row) * _PARTS) * _PARTS + int((x - column) * _PARTS)
        bit = np.uint16(1 << part)
        if seen[row, column] & bit:
            continue  # An equal point has been added before.
        seen[row, column] |= bit
        used[0], used[1] = min(used[0], row - reach - ahead), max(used[1], row + reach + 1)
        used[2], used[3] = min(used[2], column - reach - ahead), max(used[3], column + reach + 1)
        for i in range(rows):
            place = (row - reach + i) * side + column - reach
            for j in range(0, columns, BYTES_RAISED):
                raise_bytes(flat, place + j, values, (part * rows + i) * columns + j)


def _build_coarse(
    levels: UInt8[np.ndarray, "levels side side"],
    beside: UInt8[np.ndarray, "side side"],
    used: list[int],
    built: int,
) -> None:
    """Build the coarse levels: each cell is the maximum of four cells of the level below.

    Cells at the last rows and columns use those of the four that exist. Written with numpy, whose
    loops over bytes are vectorised.

    Args:
        levels: The levels, changed in place.
        beside: Scratch buffer.
        used: First and last (excluded) row, then column, that may be non-zero in any level.
        built: Number of levels that are up to date.
    """
    top, bottom, left, right = used
    if top >= bottom:
        return
    levels, beside = levels[:, top:bottom, left:right], beside[top:bottom, left:right]
    for level in range(max(built, 1), len(levels)):
        below, here, step = levels[level - 1], levels[level], 1 << (level - 1)
        np.maximum(below[:, :-step], below[:, step:], out=beside[:, :-step])
        beside[:, -step:] = below[:, -step:]
        np.maximum(beside[:-step], beside[step:], out=here[:-step])
        here[-step:] = beside[-step:]
