"""Mapping by landmark association: surfaces enter the global map by means of recognised ones.

Yeap and others, Autonomous robot mapping by landmark association (2015). A *landmark* is a surface
that is seen in two successive views. The *frame of reference* holds these two views, in the
coordinates of the later one. Landmarks there and in the *global map* have the same IDs; new
surfaces are carried over by their positions relative to the landmarks near them. Surfaces in the
map are never moved: errors are not corrected. The odometer is used only for the motion from one
view to the next.

`LandmarkAssociation.update` is the paper's algorithm. `AssociationPaper` (`paper.py`) takes its two
steps to the letter. `Association` matches scans in the paper's spirit: all landmarks of a view
together tell the motion, and where a new surface lies. Its files: `landmarks.py` is the frame of
reference, `global_map.py` the map, `odometer.py` a model of the odometer's turns. `surfaces.py` is
the geometry of both mappers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.poses import compose, inverse, transform_segments
from albot_core.geometry.types import Pose, Segments
from albot_core.mappers.association.global_map import UNKNOWN, MapLimits, carry_over, normalise
from albot_core.mappers.association.landmarks import ExpectedMotion, identify_landmarks
from albot_core.mappers.association.odometer import OdometerModel
from albot_core.mappers.association.surfaces import Surfaces
from albot_core.mappers.mapper import Estimate
from albot_core.mappers.schema import (
    LONGEST,
    Arrays,
    Field,
    Pack,
    Schema,
    Sizes,
    refuse_unless,
)
from albot_core.mappers.stored import StoredMapper
from albot_core.maps.layers import MapSnapshot, SegmentsLayer
from albot_core.ranges import NOT_NEGATIVE, Range, check_fields
from albot_core.sensing.reading import Reading
from albot_core.sensing.view import ViewConfig, construct_view

_TOLERANCE = Range("a number from 0.001 to 100", 1e-3, 100.0)


def _view() -> ViewConfig:
    return ViewConfig(
        cluster_gap=1.2, surface_length=0.5, break_height=0.05, surface_points=4, fit_lines=True
    )


@dataclass(frozen=True, kw_only=True)
class LandmarkConfig:
    """Thresholds that both mappers have."""

    view: ViewConfig = field(default_factory=_view)
    """How surfaces are found in a scan. As in the paper, points over 1.2 m apart begin a new
    cluster, and surfaces below 0.5 m are ignored. The paper follows the slope from point to point;
    here a line is fitted to all points of a surface."""
    spacing: float = 1.0
    """A reading is a view if the robot has moved at least this far since the last view (m)…"""
    turn: float = np.radians(15.0)
    """…or turned at least this far (rad). The paper's robot stops after 3 m or 30° at most, and
    moved 1.3 m from view to view."""
    angle: float = np.radians(10.0)
    """Largest angle between two matching surfaces (rad), as in the paper. In `association` half of
    it is the minimum standard deviation of the odometer's turn from view to view; that is ours."""
    closeness: float = 0.4
    """Largest distance between two matching surfaces (m). The paper says "close"; the value is
    ours. In `association` half of it is the standard deviation of the odometer's x and y from view
    to view; that is ours, too."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "spacing", "turn")
        check_fields(self, _TOLERANCE, "angle", "closeness")


@dataclass(frozen=True, kw_only=True)
class AssociationConfig(LandmarkConfig):
    """Thresholds of `association`."""

    corner: float = 0.2
    """Two crossing surfaces meet at a corner, and both are kept, if one of them ends within this
    distance beyond the crossing (m). Ours: the paper leaves out any surface that intersects
    another."""
    map_turn: float = np.radians(2.0)
    """Standard deviation of a surface's direction in the map relative to those near it (rad), and
    of the direction of the robot's expected pose. Ours."""
    map_shift: float = 0.1
    """Standard deviation of a surface's position in the map relative to those near it (m), and of
    x and y of the robot's expected pose. Ours."""
    map_slope: float = 0.05
    """Additional standard deviation of a surface's position relative to a distant one, as a share
    of the distance (m/m). The larger it is, the larger the weight of the nearest landmarks.
    Ours."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, NOT_NEGATIVE, "corner", "map_slope")
        check_fields(self, _TOLERANCE, "map_turn", "map_shift")

    @property
    def map_limits(self) -> MapLimits:
        """The thresholds that `carry_over` takes."""
        return MapLimits(*(float(getattr(self, name)) for name in MapLimits._fields))


_NO_MOTION = 1e-9
"""The odometer reports no motion if its motion is below this (m, rad). Ours."""
_SURE_TURN = np.radians(1.0)
"""The odometer's model learns from turns with a smaller standard deviation than this (rad).
Ours."""
_SOME_LENGTH = (1e-300, LONGEST)
"""Valid lengths of line segments, which exclude points (m)."""
_FIELDS = (
    Field("pose", "3"),
    Field("view_pose", "3"),
    Field("motion", "3"),
    Pack("counts", int, Field("views", least=0), Field("is_lost", "", bool)),
    Field("surfaces", "surfaces 4", at="_store", used="_count", lengths=_SOME_LENGTH),
    Field("lengths", "surfaces", used="_count", above=0),
    Field("view.surfaces", "seen 4", at="_view", lengths=_SOME_LENGTH),
    Field("view.lengths", "seen", at="_view_lengths", above=0),
    Field("view.ids", "seen", int, at="_ids", least=UNKNOWN, below="surfaces"),
)
"""The arrays of a state."""


def _check_ids(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless each surface of the map is at most one surface of the latest view."""
    known = state["view.ids"][state["view.ids"] != UNKNOWN]
    refuse_unless(len(np.unique(known)) == len(known), "view.ids", "each surface once", known)


class LandmarkAssociation(StoredMapper, ABC):
    """Mapping by landmark association; how landmarks tell a position is up to the mapper.

    Args:
        config: All thresholds.
        name: The name under which the mapper is registered.
    """

    config: LandmarkConfig
    SCHEMA = Schema(*_FIELDS, rules=(_check_ids,))

    @property
    def estimate(self) -> Estimate:
        """The robot's pose by the landmarks. The robot is lost if it saw no known surface."""
        return Estimate(
            pose=self._pose.copy(),
            home=np.zeros(3),
            localised=not self._is_lost,
            updates=self._views,
            map_version=self._views,
            segments=self._count,
        )

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        self._pose = np.zeros(3)
        self._view_pose = np.zeros(3)
        self._motion = np.zeros(3)
        self._views = 0
        self._is_lost = False
        self._view: Segments = np.empty((0, 4))
        self._view_lengths: Float64[np.ndarray, "seen"] = np.empty(0)
        self._ids: Int64[np.ndarray, "seen"] = np.empty(0, np.int64)
        self._store: Segments = np.empty((64, 4))
        self._lengths: Float64[np.ndarray, "room"] = np.empty(64)
        self._count = 0

    def update(self, reading: Reading) -> bool:
        """Process a reading; return whether it was a view, which the map then holds.

        If two successive views share no landmark, a case that the paper does not mention, the later
        view is carried over by the motion between them, and the robot is lost until it sees a
        landmark.

        Raises:
            InputError: The reading lacks a laser scan.
        """
        laser = reading.required_laser(self._name)
        if self._views:
            self._motion = compose(self._motion, reading.motion)
            self._pose = compose(self._view_pose, self._expected_motion())
            if not self._is_view_due():
                return False
        seen = construct_view(laser, self.config.view).surfaces
        lengths = np.hypot(*(seen[:, 2:] - seen[:, :2]).T)

        matched, previous = self._identify_landmarks(seen, lengths)
        landmarks = np.full(len(seen), UNKNOWN, np.int64)
        if (matched >= 0).any():
            landmarks = np.where(matched >= 0, self._ids[matched], UNKNOWN)
        self._is_lost = self._views > 0 and not (landmarks != UNKNOWN).any()
        view = seen.copy()
        normalise(previous, view, matched, landmarks, self._store)
        ids = self._associate(seen, lengths, landmarks, view)
        self._bring_forward(view, lengths, ids)
        return True

    def _is_view_due(self) -> bool:
        """Return whether the robot has moved or turned far enough for a new view.

        No motion at all may mean that the odometer fails; then each reading is a view. This
        is ours.
        """
        x, y, heading = self._motion.tolist()
        if np.abs(self._motion).max() < _NO_MOTION:
            return True
        return bool(np.hypot(x, y) >= self.config.spacing or abs(heading) >= self.config.turn)

    def _expected_motion(self) -> Pose:
        """Return the motion since the last view (m, m, rad)."""
        return self._motion

    @abstractmethod
    def _identify_landmarks(
        self, seen: Segments, lengths: Float64[np.ndarray, "segments"]
    ) -> tuple[Int64[np.ndarray, "segments"], Float64[np.ndarray, "before 4"]]:
        """Match the current view with the previous one; move the pose by the motion between them.

        Returns the surface of the previous view that each of the current one is, or -1, and the
        previous view in the coordinates of the current one: the two views of the frame of
        reference.
        """

    @abstractmethod
    def _associate(
        self,
        seen: Segments,
        lengths: Float64[np.ndarray, "segments"],
        landmarks: Int64[np.ndarray, "segments"],
        view: Segments,
    ) -> Int64[np.ndarray, "segments"]:
        """Update the map by the unknown surfaces, and the robot's pose.

        Args:
            seen: The surfaces as they are seen (robot's frame).
            lengths: Their lengths (m).
            landmarks: The ID of each landmark; `UNKNOWN` for other surfaces.
            view: The surfaces, the landmarks normalised; the others are normalised here.

        Returns:
            The IDs of the surfaces.
        """

    def _bring_forward(
        self,
        view: Segments,
        lengths: Float64[np.ndarray, "segments"],
        ids: Int64[np.ndarray, "segments"],
    ) -> None:
        """Keep the current view as the previous one of the next step.

        Of two surfaces that are one in the map, the one of which more was seen keeps the ID.
        Surfaces that are not in the map help to find the robot's motion, but are no landmarks.
        """
        order = np.argsort(-lengths, kind="stable")
        _, first = np.unique(ids[order], return_index=True)
        self._ids = np.full(len(ids), UNKNOWN, np.int64)
        self._ids[order[first]] = ids[order[first]]
        self._view, self._view_lengths = view, lengths
        self._view_pose = self._pose.copy()
        self._motion = np.zeros(3)
        self._views += 1

    def _make_room(self, more: int) -> None:
        """Make room for `more` surfaces in the map."""
        if self._count + more > len(self._store):
            surfaces, lengths = self._store, self._lengths
            room = 2 * (self._count + more)
            self._store, self._lengths = np.empty((room, 4)), np.empty(room)
            self._store[: self._count] = surfaces[: self._count]
            self._lengths[: self._count] = lengths[: self._count]

    def snapshot(self) -> MapSnapshot:
        """Return the surfaces of the global map, by their IDs."""
        surfaces = self._store[: self._count].copy()
        surfaces.flags.writeable = False
        return MapSnapshot(layers=(SegmentsLayer(segments=surfaces),))


class Association(LandmarkAssociation):
    """Matching of scans by their landmarks, in the spirit of landmark association.

    Args:
        config: All thresholds.
        name: The name under which the mapper is registered.
    """

    config: AssociationConfig
    SCHEMA = Schema(
        *_FIELDS,
        Field("odometer", "4", at="_odometer.sums", least=(-np.inf, 0, 0, 0)),
        rules=(_check_ids,),
    )

    def __init__(self, config: AssociationConfig | None = None, name: str = "association") -> None:
        super().__init__(config or AssociationConfig(), name)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything; the next reading is the first. Draws no random number."""
        super().reset(rng)
        self._odometer = OdometerModel(0.5 * self.config.angle)

    def _expected_motion(self) -> Pose:
        """Return the motion since the last view without the odometer's drift (m, m, rad)."""
        return self._odometer.expected(self._motion)

    def _identify_landmarks(
        self, seen: Segments, lengths: Float64[np.ndarray, "segments"]
    ) -> tuple[Int64[np.ndarray, "segments"], Float64[np.ndarray, "before 4"]]:
        """Match the views; the landmarks correct the odometer's motion, and are found again."""
        config, count = self.config, len(seen)
        motion, matched = np.empty(3), np.empty(count, np.int64)
        expected = ExpectedMotion(
            motion=self._expected_motion(),
            turn_sigma=self._odometer.turn_sigma,
            shift_sigma=0.5 * config.closeness,
        )
        sigma = identify_landmarks(
            Surfaces(self._view, self._view_lengths),
            Surfaces(seen, lengths),
            expected,
            config.angle,
            config.closeness,
            motion,
            matched,
        )
        if sigma < _SURE_TURN:
            self._odometer.learn(self._motion, motion)
        self._pose = compose(self._view_pose, motion)
        return matched, transform_segments(inverse(motion), self._view)

    def _associate(
        self,
        seen: Segments,
        lengths: Float64[np.ndarray, "segments"],
        landmarks: Int64[np.ndarray, "segments"],
        view: Segments,
    ) -> Int64[np.ndarray, "segments"]:
        """Update the map by the unknown surfaces, by all landmarks near each.

        The robot's own position, which the paper shows but does not define, follows from the
        landmarks, mainly from those near the robot.
        """
        ids = landmarks.copy()
        self._make_room(len(seen))
        pose = np.empty(3)
        self._count = carry_over(
            Surfaces(seen, lengths),
            landmarks,
            self._pose,
            self.config.map_limits,
            Surfaces(self._store, self._lengths),
            self._count,
            view,
            ids,
            pose,
        )
        self._pose = pose
        return ids
