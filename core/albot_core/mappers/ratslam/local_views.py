"""Local views: numbers for what is seen, and their links to the pose cells (section 3.4).

A view is a scene that the camera recognises, or a panorama of the laser (`panoramas`). A view tires
while it is seen, and recovers while it is not; a rested view is fresh. Links grow between a fresh
view and the pose cells that are active at the same time. So they lead to where the view came into
sight, and inject activity there when it comes into sight again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.kernels.compiled import kernel
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import LocalViewConfig
from albot_core.mappers.ratslam.motions import Motion, before
from albot_core.mappers.ratslam.pose_cells import PoseCells
from albot_core.mappers.schema import Arrays, Field, Pack, Schema, Sizes, refuse_unless
from albot_core.mappers.stored import Stored

NO_VIEW = -1
"""The view of a robot that recognises nothing."""
NEAR = 2
"""A view that has a link to a cell at most this far away along each axis makes no other; only the
strength of its links grows. So its links do not follow a packet that drifts."""
_NONE = np.zeros(0, np.int64), np.zeros(0)


class Scenes(Stored):
    """Numbers the scenes that a camera recognises, except those not seen several times in a row.

    Args:
        config: How often a scene must be seen.
    """

    SCHEMA = Schema(
        Field("scenes.known", "scenes", int, at=None, once=True),
        Pack(
            "scenes.counts",
            int,
            Field("candidate"),
            Field("seen", least=0),
            Field("unseen", least=0),
            Field("scene"),
        ),
    )

    def __init__(self, config: LocalViewConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Forget all scenes."""
        self._views: dict[int, int] = {}
        self._candidate, self._seen, self._unseen = NO_VIEW, 0, 0
        self._scene = NO_VIEW

    def look(self, scene: int | None, view: int) -> int:
        """Return the view after a reading.

        A single reading may be wrong (section 5.1). So another scene is believed only when several
        readings in a row show it, and a scene that is not seen is forgotten after a while.

        Args:
            scene: The scene that is seen; None if none is.
            view: The view before.
        """
        if scene is None:
            self._unseen += 1
            self._seen = 0
            return NO_VIEW if self._unseen >= self._config.forget_after else view
        self._seen = self._seen + 1 if scene == self._candidate else 1
        self._candidate = scene
        self._unseen = 0 if scene == self._scene else self._unseen + 1
        if self._seen < self._config.confirmations:
            return NO_VIEW if self._unseen >= self._config.forget_after else view
        self._scene, self._unseen = scene, 0
        return self._views.setdefault(scene, len(self._views))

    def _stored(self) -> dict[str, Any]:
        return {"scenes.known": list(self._views)}

    def _restored(self, state: Arrays) -> None:
        known = state["scenes.known"].tolist()
        self._views = {scene: view for view, scene in enumerate(known)}


def _check_waiting(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless links that wait join views with cells."""
    for column, size in enumerate(("views", "cells")):
        expected = f"numbers of {sizes[size]} {size} in column {column}"
        is_right = (state["waiting"][:, column] < sizes[size]).all()
        refuse_unless(is_right, "waiting", expected)


class Links(Stored):
    """Links between views and pose cells, made by Hebbian learning.

    Args:
        config: How links are learned, and how much they inject.
    """

    SCHEMA = Schema(
        Field("waiting", "waiting 2", int, least=0),
        Field("waiting_numbers", "waiting 2"),
        parts=("_links", "_views"),
        rules=(_check_waiting,),
    )

    def __init__(self, config: LocalViewConfig) -> None:
        self._config = config
        self._waiting: Int64[np.ndarray, "waiting 2"]
        self._waiting_numbers: Float64[np.ndarray, "waiting 2"]
        # A view's links are a linked list: `first` is the first one, `next` the one after each.
        self._links = Table(
            "links",
            Field("cell", "", int, least=0, below="cells"),
            Field("strength", least=0),
            Field("next", "", int, least=-1, below="row"),
        )
        self._views = Table(
            "views",
            Field("first", "", int, least=-1, below="links"),
            Field("freshness", least=0),
            Field("tired_at", "", int),
        )
        self.forget_waiting()

    def reset(self) -> None:
        """Forget all views and links."""
        self._links.clear()
        self._views.clear()
        self.forget_waiting()

    @property
    def views(self) -> int:
        """Number of views that were seen."""
        return self._views.count

    def has_links(self, view: int) -> bool:
        """Return whether a view has links."""
        return view < self._views.count and self._views["first"][view] >= 0

    def activate(self, view: int, iteration: int) -> float:
        """Return the activity of a view that is seen, from 0 to 1; it tires by that."""
        self._know(view)
        views, config = self._views, self._config
        rest = iteration - int(views["tired_at"][view]) - 1
        fresh = min(1.0, float(views["freshness"][view]) + config.recovery * rest)
        views["freshness"][view] = fresh * config.fatigue
        views["tired_at"][view] = iteration
        return fresh

    def injection(
        self, view: int, active: float
    ) -> tuple[Int64[np.ndarray, "links"], Float64[np.ndarray, "links"]]:
        """Return the cells that a view is linked to, and the activity that it injects into each.

        Args:
            view: The view.
            active: The view's activity.
        """
        if active <= 0.0 or not self.has_links(view):
            return _NONE
        links, chosen = self._links, self._links_of(view)
        strengths = links["strength"][chosen]
        amounts = self._config.injection * active * strengths / strengths.sum()
        return links["cell"][chosen], amounts

    def _links_of(self, view: int) -> Int64[np.ndarray, "some"]:
        """Return the numbers of a view's links."""
        found = np.empty(self._links.count, np.int64)
        return found[: list_links(int(self._views["first"][view]), self._links["next"], found)]

    @property
    def strengths(self) -> Float64[np.ndarray, "links"]:
        """Strength of each link, in the order in which they were learned (a view)."""
        return self._links.rows("strength")

    def linked(self, count: int) -> Bool[np.ndarray, "views"]:
        """Return which of the first `count` views have links."""
        known = self._views.rows("first")[:count]
        linked = np.zeros(count, np.bool_)
        linked[: len(known)] = known >= 0
        return linked

    def leads_near(self, view: int, cell: int, shape: tuple[int, int, int]) -> bool:
        """Return whether a view has a link to a cell, or to one near it."""
        links = self._links
        return self.has_links(view) and leads_near(
            int(self._views["first"][view]), links["cell"], links["next"], cell, shape
        )

    def associate(
        self, view: int, active: float, offset: Motion, cells: PoseCells, way: float
    ) -> None:
        """Remember the pose cells that are active with a view, to link them later.

        Args:
            view: The view.
            active: The view's activity.
            offset: The robot's pose in the view's frame; the links lead to the origin of that
                frame.
            cells: The pose cells.
            way: Distance driven so far (m).
        """
        seen_from = before((0.0, 0.0, 0.0), offset)
        linked, activity = cells.top(self._config.linked_share, seen_from)
        peak = int(linked[np.argmax(activity)])
        is_known = self.leads_near(view, peak, cells.shape)
        if is_known and not self._config.links_in_sight:  # Only its own links grow.
            is_own = np.isin(linked, self._links["cell"][self._links_of(view)])
            linked, activity = linked[is_own], activity[is_own]
        self.remember(view, linked, active * activity, way)

    def remember(
        self,
        view: int,
        cells: Int64[np.ndarray, "some"],
        strengths: Float64[np.ndarray, "some"],
        way: float,
    ) -> None:
        """Remember for `learn` which cells were active with a view at a distance driven (m)."""
        self._know(view)
        added = np.column_stack((np.full(len(cells), view), cells))
        self._waiting = np.concatenate((self._waiting, added))
        numbers = np.column_stack((strengths, np.full(len(cells), way)))
        self._waiting_numbers = np.concatenate((self._waiting_numbers, numbers))

    def learn(self, way: float) -> None:
        """Strengthen the links that have waited long enough: β = max(β, λ V P).

        Links wait until the robot has driven on without being re-localised. If it is re-localised,
        its pose was wrong, and the links would lead to a place where it was not.
        """
        ripest = way - self._config.learning_delay
        ripe = int(np.searchsorted(self._waiting_numbers[:, 1], ripest, side="right"))
        if not ripe:
            return
        links = self._links
        links.reserve(ripe)
        links.count = strengthen(
            self._waiting[:ripe],
            self._config.learning_rate * self._waiting_numbers[:ripe, 0],
            self._views["first"],
            (links["cell"], links["strength"], links["next"]),
            links.count,
        )
        self._waiting = self._waiting[ripe:]
        self._waiting_numbers = self._waiting_numbers[ripe:]

    def forget_waiting(self) -> None:
        """Drop the links that wait to be learned."""
        self._waiting = np.empty((0, 2), np.int64)  # Views and cells.
        self._waiting_numbers = np.empty((0, 2))  # Strengths, and distances driven (m).

    def _know(self, view: int) -> None:
        """Add rows until a view has one."""
        while self._views.count <= view:
            self._views.append(first=-1, freshness=1.0, tired_at=0)


@kernel()
def list_links(first: int, following: np.ndarray, found: np.ndarray) -> int:
    """List the links of a view in `found`; return how many there are."""
    count, link = 0, first
    while link >= 0:
        found[count] = link
        count += 1
        link = following[link]
    return count


@kernel()
def leads_near(
    first: int, cells: np.ndarray, following: np.ndarray, cell: int, shape: tuple[int, int, int]
) -> bool:
    """Return whether a view has a link to a cell, or to one near it along each axis."""
    columns, rows, headings = shape
    link = first
    while link >= 0:
        other = cells[link]
        x = abs(other % columns - cell % columns)
        y = abs(other // columns % rows - cell // columns % rows)
        layer = abs(other // (columns * rows) - cell // (columns * rows))
        apart = max(min(x, columns - x), min(y, rows - y), min(layer, headings - layer))
        if apart <= NEAR:
            return True
        link = following[link]
    return False


@kernel()
def strengthen(
    ends: np.ndarray,
    strengths: np.ndarray,
    first: np.ndarray,
    links: tuple[np.ndarray, np.ndarray, np.ndarray],
    count: int,
) -> int:
    """Apply the maximum rule to links between views and cells; return the number of links.

    `ends` (some, 2) holds views and cells. `first` holds each view's first link; new links are put
    before it.
    """
    linked, strength, following = links
    for k in range(ends.shape[0]):
        view, cell = ends[k, 0], ends[k, 1]
        link = first[view]
        while link >= 0 and linked[link] != cell:
            link = following[link]
        if link < 0:
            linked[count], strength[count] = cell, strengths[k]
            following[count] = first[view]
            first[view] = count
            count += 1
        else:
            strength[link] = max(strength[link], strengths[k])
    return count
