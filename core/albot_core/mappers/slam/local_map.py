"""Matching a scan with the latest ones: where the robot is, and how sure that is.

The local map is the likelihood field of the latest scans that were kept. A new scan is matched with
it in a window around what the odometer says. How wide the window is follows from how far off the
odometer has been so far; where the best pose lies at its border, or is a poor one, a wide window is
searched. So an odometer that is good costs little, and one that is bad is found out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import relative, wrap_angle
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.slam.correlation import Window, correlate
from albot_core.mappers.slam.likelihood_field import FieldConfig, LikelihoodField
from albot_core.mappers.slam.points import matched_points, surface_points
from albot_core.mappers.slam.refinement import refine
from albot_core.mappers.stored_arrays import check_finite, check_shapes
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields
from albot_core.sensing.reading import LaserScan

_FROM_ONE = Range("a whole number from 1", 1.0, whole=True)
_AT_LEAST_ONE = Range("a number from 1", 1.0)


@dataclass(frozen=True, kw_only=True)
class MatchingConfig:
    """How scans are matched with the latest ones. Where no source is named, the values are ours."""

    field: FieldConfig = field(default_factory=lambda: FieldConfig(half=20.0))
    """The likelihood field. Cells of 5 cm as Hess et al. (2016)."""
    reach: float = 15.0
    """Points farther away than this (m) are not matched."""
    spacing: float = 0.05
    """Least distance between two successive points that are matched (m)."""
    scans: int = 20
    """The local map is laid out anew with so many of the latest scans…"""
    more: int = 10
    """…and grows by so many before it is laid out again."""
    step: float = 0.2
    """A scan is kept once the robot has gone so far since the last one that was (m), as OpenKarto's
    minimum travel distance…"""
    turn: float = math.radians(10.0)
    """…or has turned so far (rad), as its minimum travel heading."""
    heading_step: float = math.radians(1.0)
    """Between two headings that are tried (rad): half of OpenKarto's coarse angle resolution."""
    slip: float = 0.05
    """Standard deviation of the odometer's position at first (m); later it is measured…"""
    turn_error: float = math.radians(5.0)
    """…and of its heading (rad)."""
    least_slip: float = 0.02
    """However good the odometer was, its errors are not taken for smaller (m)…"""
    least_turn_error: float = math.radians(1.0)
    """…than this (rad)."""
    memory: float = 0.05
    """How fast a measured error is forgotten: the share of a new one in the mean."""
    deviations: float = 3.0
    """The window reaches so many standard deviations to each side…"""
    wide_reach: float = 1.0
    """…and, where nothing good is found within, so far (m)…"""
    wide_turn: float = math.radians(50.0)
    """…and so far in heading (rad)."""
    sure: float = 0.5
    """A mean likelihood of the points from this on is a good match…"""
    poor: float = 0.25
    """…and below this it is none: then the odometer alone is followed."""
    gain: float = 0.05
    """A pose of the wide window is taken if its mean likelihood is so much better."""
    correlated: float = 10.0
    """So many neighbouring points tell no more of the pose's covariance than one that is
    independent of all others. Against the odometer, whose errors are no more independent, each
    counts as one."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "reach", "heading_step", "slip", "turn_error", "least_slip",
            "least_turn_error", "deviations", "wide_reach", "wide_turn",
        )  # fmt: skip
        check_fields(self, NOT_NEGATIVE, "spacing", "step", "turn")
        check_fields(self, SHARE, "memory", "sure", "poor", "gain")
        check_fields(self, _FROM_ONE, "scans", "more")
        check_fields(self, _AT_LEAST_ONE, "correlated")
        if self.wide_turn > math.pi:
            raise InputError("MatchingConfig.wide_turn", "at most pi", f"{self.wide_turn:g}")


class ScanPoints(NamedTuple):
    """What is kept of a scan, in the robot's frame."""

    points: Float64[np.ndarray, "points 2"]
    """The points by which it is matched (m)."""
    normals: Float64[np.ndarray, "points 2"]
    """The unit normals there; (0, 0) where not known."""
    surface: Float64[np.ndarray, "filled 2"]
    """The points with which later ones are matched (m)."""


class Match(NamedTuple):
    """Where a scan was taken."""

    pose: Pose
    """The robot's pose in the map's frame."""
    information: Float64[np.ndarray, "3 3"]
    """The inverse of the pose's covariance, by the scan alone, along the map's axes."""
    response: float
    """The mean likelihood of the scan's points, within [0, 1]."""
    is_good: bool
    """Whether it is to be believed; else the pose is the odometer's."""


def scan_points(scan: LaserScan, config: MatchingConfig) -> ScanPoints:
    """What is kept of a scan."""
    points, normals = matched_points(scan, config.reach, config.spacing)
    return ScanPoints(points, normals, surface_points(scan, config.reach, config.field.cell))


class OdometerErrors:
    """How far the odometer is off from reading to reading, as measured by the scans."""

    def __init__(self, config: MatchingConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Know nothing yet."""
        config = self._config
        self.variances: Float64[np.ndarray, "2"] = np.array((config.slip, config.turn_error)) ** 2
        """Of the position along each axis (m²) and of the heading (rad²)."""

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of position (m) and heading (rad)."""
        slip, turn = np.sqrt(self.variances).tolist()
        return max(slip, self._config.least_slip), max(turn, self._config.least_turn_error)

    def measure(self, guess: Pose, matched: Pose) -> None:
        """Take in where a reading was taken after all.

        A great error is believed at once, so that the next is searched for widely enough; small
        ones make it less by and by.
        """
        x, y, turn = (matched - guess).tolist()
        found = np.array((0.5 * (x * x + y * y), float(wrap_angle(turn)) ** 2))
        self.variances += self._config.memory * (found - self.variances)
        # One standard deviation, were the error found twice that.
        np.maximum(self.variances, 0.25 * found, out=self.variances)


class LocalMap:
    """The latest scans that were kept, and the matching with them.

    Args:
        config: All thresholds.
    """

    def __init__(self, config: MatchingConfig) -> None:
        self.config = config
        self.errors = OdometerErrors(config)
        self._field = LikelihoodField(config.field)
        self.reset()

    def reset(self) -> None:
        """Forget all scans."""
        self.errors.reset()
        self._kept: list[tuple[Pose, Points]] = []
        self._field.clear(np.zeros(2))

    def match(self, scan: ScanPoints, guess: Pose) -> Match:
        """Where a scan was taken.

        Args:
            scan: The scan.
            guess: Where it was taken by the odometer (map frame).
        """
        config = self.config
        slip, turn = self.errors.deviations
        prior = 0.5 / np.array((slip, slip, turn)) ** 2
        window = Window(
            min(config.deviations * slip, config.wide_reach),
            min(config.deviations * turn, config.wide_turn),
            config.heading_step,
        )
        best = correlate(self._field, scan.points, guess, window, prior)
        if best.at_border or best.response < config.sure:
            widest = Window(config.wide_reach, config.wide_turn, config.heading_step)
            loose = 0.5 / np.array((config.wide_reach, config.wide_reach, config.wide_turn)) ** 2
            wide = correlate(self._field, scan.points, guess, widest, loose)
            if wide.response > best.response + config.gain:
                best, prior = wide, loose
        if best.response < config.poor:
            return Match(guess, np.zeros((3, 3)), best.response, False)
        found = refine(self._field, scan.points, scan.normals, best.pose, guess, prior)
        self.errors.measure(guess, found.pose)
        pose = found.pose
        pose[2] = wrap_angle(pose[2])
        return Match(pose, found.information / config.correlated, found.response, True)

    def is_due(self, pose: Pose) -> bool:
        """Whether the robot has gone or turned so far that its scan should be kept."""
        if not self._kept:
            return True
        x, y, turn = relative(self._kept[-1][0], pose).tolist()
        return math.hypot(x, y) >= self.config.step or abs(turn) >= self.config.turn

    def keep(self, pose: Pose, surface: Points) -> None:
        """Add the points of a scan that was taken at a pose."""
        config = self.config
        self._kept.append((pose.copy(), surface))
        away = pose[:2] - self._field.corner - config.field.half
        too_far = max(abs(away[0]), abs(away[1])) > max(config.field.half - config.reach, 1.0)
        if too_far or len(self._kept) > config.scans + config.more:
            self._lay_out()
        else:
            self._field.add(pose, surface)

    def _lay_out(self) -> None:
        """Make the local map anew, of the latest scans, around the last of them."""
        self._kept = self._kept[-self.config.scans :]
        self._field.clear(self._kept[-1][0][:2])
        for pose, surface in self._kept:
            self._field.add(pose, surface)

    def move(self, poses: Poses) -> None:
        """Take in that the latest scans were taken elsewhere, and forget all before them."""
        self._kept = [
            (pose.copy(), surface)
            for pose, (_, surface) in zip(poses, self._kept[-len(poses) :], strict=True)
        ]
        self._lay_out()

    def state(self) -> dict[str, np.ndarray]:
        """Everything that is remembered, as arrays by name."""
        return {
            "local.errors": self.errors.variances.copy(),
            "local.corner": self._field.corner.copy(),
            "local.poses": np.array([pose for pose, _ in self._kept]).reshape(-1, 3),
            "local.counts": np.array([len(surface) for _, surface in self._kept], np.int64),
            "local.points": np.concatenate(
                [np.empty((0, 2)), *(surface for _, surface in self._kept)]
            ),
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become the local map that returned `state`.

        Raises:
            InputError: The arrays are none that a state holds.
        """
        shapes = {
            "local.errors": (2,),
            "local.corner": (2,),
            "local.poses": ("scans", 3),
            "local.counts": ("scans",),
            "local.points": ("points", 2),
        }
        check_shapes(state, shapes)
        check_finite(state, "local.errors", "local.corner", "local.poses", "local.points")
        counts, points = state["local.counts"], state["local.points"]
        if (counts < 0).any() or counts.sum() != len(points):
            raise InputError("local.counts", f"counts of {len(points)} points", str(counts.sum()))
        if (state["local.errors"] < 0).any():
            raise InputError("local.errors", "no negative numbers", str(state["local.errors"]))
        self.errors.variances = state["local.errors"].copy()
        surfaces = np.split(points.copy(), np.cumsum(counts)[:-1]) if len(counts) else []
        self._kept = list(zip(state["local.poses"].copy(), surfaces, strict=True))
        self._field.clear(np.zeros(2))
        self._field.corner[:] = state["local.corner"]
        for pose, surface in self._kept:
            self._field.add(pose, surface)
