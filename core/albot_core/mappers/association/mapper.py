"""Mapping by landmark association: surfaces enter the global map by way of those recognised.

Yeap and others, Autonomous robot mapping by landmark association (2015). A *landmark* is a surface
that is seen in two successive views. The *frame of reference* holds these two views, in the
coordinates of the later one. Landmarks there and in the *global map* have the same IDs; what is
new is carried over by its position relative to its nearest landmark. Errors are never corrected.
The odometer says how far the robot has come from one view to the next, and nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.geometry.types import Segments
from albot_core.mappers.association.surfaces import (
    UNKNOWN,
    carry_over,
    find_landmarks,
    normalise,
)
from albot_core.mappers.mapper import Estimate, MapperSpec
from albot_core.mappers.registry import mapper_spec
from albot_core.mappers.stored_arrays import Shape, check_finite, check_lengths, check_shapes
from albot_core.maps.layers import MapSnapshot, SegmentsLayer
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view


def _view() -> ViewConfig:
    return ViewConfig(
        cluster_gap=1.2, surface_length=0.5, break_height=0.05, surface_points=4, fit_lines=True
    )


@dataclass(frozen=True, kw_only=True)
class AssociationConfig:
    """Thresholds of landmark association."""

    view: ViewConfig = field(default_factory=_view)
    """How surfaces are found in a scan. As in the paper, points over 1.2 m apart begin a new
    cluster and surfaces below 0.5 m are ignored. The paper follows the slope from point to point;
    our lines are fitted to all points of a surface."""
    spacing: float = 1.0
    """A reading is a view only this far from the last view's place (m)…"""
    turn: float = np.radians(15.0)
    """…or turned by so much from it (rad). The paper's robot stops after 3 m or 30° at the most,
    and went 1.3 m from view to view."""
    angle: float = np.radians(10.0)
    """Two surfaces are the same only if their orientations differ by no more (rad), as in the
    paper…"""
    closeness: float = 0.4
    """…and if they are no farther apart (m). The paper says "close": the value is ours."""
    corner: float = 0.2
    """A surface that crosses another one is left out, as in the paper; but where either ends so
    soon beyond the crossing (m) they meet at a corner, which is ours."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "spacing", "turn", "corner")
        check_fields(self, POSITIVE, "angle", "closeness")


_SHAPES: dict[str, Shape] = {
    "pose": (3,),
    "view_pose": (3,),
    "motion": (3,),
    "counts": (2,),
    "surfaces": ("surfaces", 4),
    "view.surfaces": ("seen", 4),
    "view.ids": ("seen",),
}
"""The arrays of a state."""


class Association:
    """Mapping by landmark association.

    Args:
        config: All thresholds.
        name: The name under which the mapper is known.
    """

    def __init__(self, config: AssociationConfig | None = None, name: str = "association") -> None:
        self._name = name
        self.config = config or AssociationConfig()
        self.reset(np.random.default_rng(0))

    @property
    def spec(self) -> MapperSpec:
        """What is known of it by its name."""
        return mapper_spec(self._name)

    @property
    def estimate(self) -> Estimate:
        """Where the landmarks say that the robot is. It is lost where it saw none that it knew."""
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3),
            localised=not self._is_lost,
            updates=self._views,
            map_version=self._views,
            segments=self._count,
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. It draws no random number."""
        self._pose = np.zeros(3)
        self._view_pose = np.zeros(3)
        self._motion = np.zeros(3)
        self._views = 0
        self._is_lost = False
        self._view: Segments = np.empty((0, 4))
        self._ids: Int64[np.ndarray, "seen"] = np.empty(0, np.int64)
        self._store: Segments = np.empty((64, 4))
        self._count = 0

    def update(self, reading: Reading) -> bool:
        """Take in a reading; true where it was a view, which the map then holds.

        Where two successive views share no landmark, of which the paper says nothing, the later one
        is carried over by the odometer's motion, and the robot is lost until it sees a landmark.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        laser = reading.required_laser(self._name)
        if self._views:
            self._motion = compose(self._motion, reading.motion)
            self._pose = compose(self._view_pose, self._motion)
            if not self._is_view_due():
                return False
        # The frame of reference: the previous view, in the coordinates of the current one.
        current = construct_view(laser, self.config.view).surfaces
        previous = transform_segments(inverse(self._motion), self._view)

        matched = self._identify_landmarks(previous, current)
        lengths = np.hypot(*(current[:, 2:] - current[:, :2]).T)
        normalise(previous, self._ids, current, matched, self._store)
        ids = self._associate(current, matched, lengths)
        self._bring_forward(current, ids, lengths)
        return True

    def _is_view_due(self) -> bool:
        """Whether the robot has gone or turned far enough to look again."""
        x, y, heading = self._motion.tolist()
        return bool(np.hypot(x, y) >= self.config.spacing or abs(heading) >= self.config.turn)

    def _identify_landmarks(
        self, previous: Float64[np.ndarray, "before 4"], current: Segments
    ) -> Int64[np.ndarray, "segments"]:
        """Which surface of the previous view each of the current one is; -1 for none."""
        config = self.config
        matched = np.empty(len(current), np.int64)
        count = find_landmarks(previous, current, config.angle, config.closeness, matched)
        self._is_lost = self._views > 0 and count == 0
        return matched

    def _associate(
        self,
        current: Segments,
        matched: Int64[np.ndarray, "segments"],
        lengths: Float64[np.ndarray, "segments"],
    ) -> Int64[np.ndarray, "segments"]:
        """Update the map by what is unknown; the IDs of all surfaces of the current view.

        The robot's own place, which the paper shows but does not define, is where that landmark
        says of which most is seen: its direction is the surest.
        """
        ids = np.full(len(current), UNKNOWN, np.int64)
        if (matched >= 0).any():
            ids = np.where(matched >= 0, self._ids[matched], UNKNOWN)
        self._make_room(len(current))
        config = self.config
        self._count = carry_over(
            current,
            ids,
            matched,
            lengths,
            self._pose,
            self._store,
            self._count,
            config.angle,
            config.closeness,
            config.corner,
        )
        return ids

    def _bring_forward(
        self,
        current: Segments,
        ids: Int64[np.ndarray, "segments"],
        lengths: Float64[np.ndarray, "segments"],
    ) -> None:
        """Keep the current view for the next, and forget the previous one.

        Of two surfaces that are one in the map, that of which more was seen is kept; what is not in
        the map can be no landmark, and is left out.
        """
        order = np.argsort(-lengths, kind="stable")
        order = order[ids[order] != UNKNOWN]
        self._ids, first = np.unique(ids[order], return_index=True)
        self._view = current[order[first]]
        self._view_pose = self._pose.copy()
        self._motion = np.zeros(3)
        self._views += 1

    def _make_room(self, more: int) -> None:
        """Have room for so many more surfaces in the map."""
        if self._count + more > len(self._store):
            larger = np.empty((2 * (self._count + more), 4))
            larger[: self._count] = self._store[: self._count]
            self._store = larger

    def snapshot(self) -> MapSnapshot:
        """The surfaces of the global map, by their IDs."""
        surfaces = self._store[: self._count].copy()
        surfaces.flags.writeable = False
        return MapSnapshot(layers=(SegmentsLayer(segments=surfaces),))

    def state(self) -> dict[str, np.ndarray]:
        """Everything the mapper remembers, as arrays by name."""
        return {
            "pose": self._pose.copy(),
            "view_pose": self._view_pose.copy(),
            "motion": self._motion.copy(),
            "counts": np.array((self._views, self._is_lost), np.int64),
            "surfaces": self._store[: self._count].copy(),
            "view.surfaces": self._view.copy(),
            "view.ids": self._ids.copy(),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the mapper that returned `state`.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        check_shapes(state, _SHAPES)
        check_finite(state, "pose", "view_pose", "motion", "surfaces", "view.surfaces")
        for name in ("surfaces", "view.surfaces"):
            check_lengths(name, state[name])
            if (state[name][:, :2] == state[name][:, 2:]).all(axis=1).any():
                raise InputError(name, "line segments of some length", "a point")
        views, lost = state["counts"].tolist()
        if views < 0 or lost not in (0, 1):
            raise InputError("counts", "a count and 0 or 1", str(state["counts"].tolist()))
        ids, count = state["view.ids"], len(state["surfaces"])
        if len(ids) and (ids.min() < 0 or ids.max() >= count or (np.diff(ids) <= 0).any()):
            raise InputError("view.ids", f"growing numbers of {count} surfaces", str(ids.tolist()))
        self._pose = state["pose"].copy()
        self._view_pose = state["view_pose"].copy()
        self._motion = state["motion"].copy()
        self._views, self._is_lost = views, bool(lost)
        self._store, self._count = state["surfaces"].copy(), count
        self._view, self._ids = state["view.surfaces"].copy(), ids.copy()
