"""The visits to places, and whether two of them can be to one place."""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.poses import transform_points
from albot_core.geometry.types import Pose
from albot_core.mappers.hssh.alignment import Alignment, align, paired_ends, rigid_fit
from albot_core.mappers.hssh.config import HsshConfig
from albot_core.mappers.hssh.star import Star
from albot_core.mappers.hssh.topological_map import Common, Travel
from albot_core.mappers.hssh.visit import Visit
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.stored import Stored

_DIFFERS = 0.6
"""Overlap below which two local maps are not of one place."""


class Visits(Stored):
    """All visits in order; the last one is the present one, or the last before the present way.

    Args:
        config: All parameters.
    """

    SCHEMA = Schema(parts=("_table", "_gateways", "_arms", "_surfaces", "_open"))

    def __init__(self, config: HsshConfig) -> None:
        self._config = config
        self._table = Table(
            "visits",
            Field("entered", "", int, least=0),
            Field("way", "", least=0),
            Field("arrived", "", int, least=-1),
            Field("left", "", int, least=-1),
            Field("middle", "2"),
            Field("gateways", "", int, least=0, sums="gateways"),
            Field("arms", "", int, least=0, sums="arms"),
            Field("surface", "", int, least=0, sums="surfaces"),
            Field("free", "", int, least=0, sums="open"),
        )
        self._gateways = Table("gateways", Field("line", "4"))
        self._arms = Table("arms", Field("before", "", int, least=0))
        self._surfaces = Table("surfaces", Field("point", "2"))
        self._open = Table("open", Field("point", "2"))
        self.clear()

    def clear(self) -> None:
        """Forget all visits."""
        for table in (self._table, self._gateways, self._arms, self._surfaces, self._open):
            table.clear()
        self._visits: list[Visit] = []
        self._stars: list[Star] = []
        self._alignments: dict[tuple[int, int, Common], Alignment] = {}

    def __len__(self) -> int:
        return len(self._visits)

    def __getitem__(self, number: int) -> Visit:
        return self._visits[number]

    @property
    def last(self) -> Visit:
        """The last visit."""
        return self._visits[-1]

    @property
    def is_away(self) -> bool:
        """Whether the robot has left the place of the last visit."""
        return self.last.left >= 0

    def star(self, number: int) -> Star:
        """Return the star of a visit."""
        return self._stars[number]

    def travel(self, number: int) -> Travel:
        """Return the travel that led to a visit."""
        visit = self._visits[number]
        return Travel(self._visits[number - 1].left, self._stars[number], visit.arrived)

    def begin(self, visit: Visit) -> None:
        """Begin a visit."""
        self._visits.append(visit)
        self._stars.append(visit.star(self._config.gateways.straight))

    def cancel(self) -> None:
        """Forget the present visit: it was to no place."""
        self._visits.pop()
        self._stars.pop()
        self._alignments = {k: v for k, v in self._alignments.items() if len(self) not in k[:2]}

    def amend(self, visit: Visit) -> bool:
        """Replace what is known of the present visit; return whether its star has changed."""
        before = self._stars[-1], self._visits[-1].arrived
        number = len(self._visits) - 1
        self._alignments = {k: v for k, v in self._alignments.items() if number not in k[:2]}
        self._visits[-1] = visit
        self._stars[-1] = visit.star(self._config.gateways.straight)
        return before != (self._stars[-1], visit.arrived)

    def alignment(self, later: int, earlier: int, common: Common) -> Alignment:
        """Return how a visit's local map lies on that of an earlier visit."""
        key = later, earlier, common
        if key not in self._alignments:
            reach = self._config.places.surface_error
            self._alignments[key] = align(self[later], self[earlier], common, reach)
        return self._alignments[key]

    def is_alike(self, found: Alignment) -> bool:
        """Return whether two visits' gateways and local maps lie on one another."""
        places = self._config.places
        return found.error <= places.gateway_error and found.overlap >= places.overlap

    def judge(self, first: int, common: Common, closes_loop: bool) -> bool:
        """Return whether the last visit can be to the place that was first visited at `first`.

        Between places that were not seen whole, one common gateway is too little evidence to close
        a loop, and so is a small common part of the local maps (ours). Where no loop is closed,
        only local maps that differ widely, or lie too far from one another, tell that it cannot: a
        gateway was taken for another one, or a place was passed without being perceived (ours).
        """
        places, last = self._config.places, len(self) - 1
        is_seen = self._stars[last].is_whole and self._stars[first].is_whole
        needs_more = places.overlap > 0.0 and not is_seen
        least = places.evidence if needs_more else 0
        if not closes_loop:
            found = self.alignment(last, first, common)
            is_like = found.overlap >= min(places.overlap, _DIFFERS) and found.evidence >= least
            return is_like and self._drift(found.pose, first) <= 0.0
        if needs_more and len(common) < 2:
            return False
        # The gateways first: laying the local maps on one another takes far longer.
        pose, error = rigid_fit(*paired_ends(self[last], self[first], common))
        if error > places.gateway_error or self._drift(pose, first) > 1.0:
            return False
        found = self.alignment(last, first, common)
        is_close = self._drift(found.pose, first) <= 0.0
        return self.is_alike(found) and is_close and found.evidence >= least

    def _drift(self, pose: Pose, first: int) -> float:
        """Return by how much the odometry's error would be too large (m)."""
        places, last = self._config.places, self[len(self) - 1]
        if math.isinf(places.drift):
            return 0.0
        moved = transform_points(pose, last.middle) - last.middle
        most = 1.0 + places.drift * (last.way - self[first].way)
        return float(np.hypot(*moved)) - most

    def _stored(self) -> dict[str, np.ndarray]:
        for table in (self._table, self._gateways, self._arms, self._surfaces, self._open):
            table.clear()
        for visit in self._visits:
            fields = visit._asdict()
            self._table.append(
                **{k: fields[k] for k in ("entered", "way", "arrived", "left", "middle")},
                gateways=len(visit.gateways),
                arms=len(visit.unknown),
                surface=len(visit.surface),
                free=len(visit.open_ground),
            )
            for line in visit.gateways:
                self._gateways.append(line=line)
            for arm in visit.unknown:
                self._arms.append(before=arm)
            for point in visit.surface:
                self._surfaces.append(point=point)
            for point in visit.open_ground:
                self._open.append(point=point)
        return {}

    def _restored(self, state: Arrays) -> None:
        self._visits, self._stars, self._alignments = [], [], {}
        for visit in visits_of(state):
            self.begin(visit)


def visits_of(state: Arrays) -> list[Visit]:
    """Return the visits that a state holds."""

    def parts(array: str, counts: str) -> list[np.ndarray]:
        return [part.copy() for part in np.split(state[array], np.cumsum(state[counts])[:-1])]

    if not len(state["visits.entered"]):
        return []
    lines = parts("gateways.line", "visits.gateways")
    arms = parts("arms.before", "visits.arms")
    walls = parts("surfaces.point", "visits.surface")
    free = parts("open.point", "visits.free")
    return [
        Visit(
            entered=int(state["visits.entered"][k]),
            way=float(state["visits.way"][k]),
            arrived=int(state["visits.arrived"][k]),
            left=int(state["visits.left"][k]),
            middle=state["visits.middle"][k].copy(),
            gateways=lines[k],
            unknown=tuple(arms[k].tolist()),
            surface=walls[k],
            open_ground=free[k],
        )
        for k in range(len(lines))
    ]
