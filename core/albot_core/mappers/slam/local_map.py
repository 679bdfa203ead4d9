"""Matching of a scan with the latest ones: the robot's pose and its uncertainty.

The local map is the likelihood field of the latest kept scans. A new scan is matched with it in a
window around the odometer's pose. The width of the window follows from the odometry errors measured
so far. A wide window is searched if the best pose is at the border or fits poorly. So a good
odometer costs little time, and a bad one is detected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import relative, wrap_angle
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.schema import Arrays, Field, Schema
from albot_core.mappers.stored import Stored
from albot_core.matching.correlation import Window, correlate
from albot_core.matching.likelihood_field import FieldConfig, LikelihoodField
from albot_core.matching.refinement import refine
from albot_core.matching.scan_points import matched_points, surface_points
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields
from albot_core.sensing.reading import LaserScan

_AT_LEAST_ONE = Range("a number from 1", 1.0)


@dataclass(frozen=True, kw_only=True)
class MatchingConfig:
    """Matching of a scan with the latest ones. Values without a named source are ours."""

    field: FieldConfig = field(default_factory=lambda: FieldConfig(half=20.0))
    """The likelihood field. Cells of 5 cm as by Hess et al. (2016)."""
    reach: float = 15.0
    """Largest distance of a point that is matched (m)."""
    spacing: float = 0.05
    """Smallest distance between two successive points that are matched (m)."""
    scans: int = 20
    """Number of latest scans from which the local map is rebuilt."""
    more: int = 10
    """Number of scans that are added before the local map is rebuilt."""
    step: float = 0.2
    """Distance since the last kept scan after which a scan is kept (m): OpenKarto's minimum travel
    distance."""
    turn: float = math.radians(10.0)
    """Turn since the last kept scan after which a scan is kept (rad): OpenKarto's minimum travel
    heading."""
    heading_step: float = math.radians(1.0)
    """Spacing of the headings that are tried (rad): half of OpenKarto's coarse angle resolution."""
    slip: float = 0.05
    """Initial standard deviation of the odometer's position (m); it is then measured."""
    turn_error: float = math.radians(5.0)
    """Initial standard deviation of the odometer's heading (rad); it is then measured."""
    least_slip: float = 0.02
    """Smallest standard deviation of the odometer's position (m)."""
    least_turn_error: float = math.radians(1.0)
    """Smallest standard deviation of the odometer's heading (rad)."""
    memory: float = 0.05
    """Weight of a new error in the running mean of the measured errors."""
    deviations: float = 3.0
    """Half-width of the window, in standard deviations of the odometer's error."""
    wide_reach: float = 1.0
    """Half-width in position of the wide window (m), searched if no good match is found."""
    wide_turn: float = math.radians(50.0)
    """Half-width in heading of the wide window (rad)."""
    sure: float = 0.5
    """Smallest mean likelihood of the points in a good match; below, the wide window is tried."""
    poor: float = 0.25
    """Smallest mean likelihood of the points in any match; below, only the odometry is used."""
    gain: float = 0.05
    """Increase in mean likelihood at which a pose of the wide window is preferred."""
    correlated: float = 10.0
    """Number of neighbouring points that carry as much information on the pose as one independent
    point. Against the odometer, whose errors are equally correlated, each point counts as one."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "reach", "heading_step", "slip", "turn_error", "least_slip",
            "least_turn_error", "deviations", "wide_reach", "wide_turn",
        )  # fmt: skip
        check_fields(self, NOT_NEGATIVE, "spacing", "step", "turn")
        check_fields(self, SHARE, "memory", "sure", "poor", "gain")
        check_fields(self, FROM_ONE, "scans", "more")
        check_fields(self, _AT_LEAST_ONE, "correlated")
        if self.wide_turn > math.pi:
            raise InputError("MatchingConfig.wide_turn", "at most pi", f"{self.wide_turn:g}")


class ScanPoints(NamedTuple):
    """The points of a scan, in the robot's frame."""

    points: Float64[np.ndarray, "points 2"]
    """The points that are matched (m)."""
    normals: Float64[np.ndarray, "points 2"]
    """The unit normals at these points; (0, 0) where unknown."""
    surface: Float64[np.ndarray, "filled 2"]
    """The points that later scans are matched with (m)."""


class Match(NamedTuple):
    """The result of matching a scan."""

    pose: Pose
    """The robot's pose in the map's frame."""
    information: Float64[np.ndarray, "3 3"]
    """The inverse of the pose's covariance from the scan alone, along the map's axes."""
    response: float
    """The mean likelihood of the scan's points, within [0, 1]."""
    is_good: bool
    """Whether the match is accepted; otherwise the pose is the odometer's."""


def scan_points(scan: LaserScan, config: MatchingConfig) -> ScanPoints:
    """Return the points of a scan, for matching and for the local map."""
    points, normals = matched_points(scan, config.reach, config.spacing)
    return ScanPoints(points, normals, surface_points(scan, config.reach, config.field.cell))


class OdometerErrors:
    """The odometer's error between two readings, as measured by scan matching."""

    def __init__(self, config: MatchingConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Reset the variances to their initial values."""
        config = self._config
        self.variances: Float64[np.ndarray, "2"] = np.array((config.slip, config.turn_error)) ** 2
        """Variances of the position along each axis (m²) and of the heading (rad²)."""

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of position (m) and heading (rad)."""
        slip, turn = np.sqrt(self.variances).tolist()
        return max(slip, self._config.least_slip), max(turn, self._config.least_turn_error)

    def measure(self, guess: Pose, matched: Pose) -> None:
        """Update the variances by the error of a guess, measured by its matched pose.

        A large error raises the variances at once, so that the next window is wide enough; small
        errors lower them gradually.
        """
        x, y, turn = (matched - guess).tolist()
        found = np.array((0.5 * (x * x + y * y), float(wrap_angle(turn)) ** 2))
        self.variances += self._config.memory * (found - self.variances)
        # A large error counts as two standard deviations.
        np.maximum(self.variances, 0.25 * found, out=self.variances)


def match_scan(
    field: LikelihoodField,
    scan: ScanPoints,
    guess: Pose,
    errors: OdometerErrors,
    config: MatchingConfig,
) -> Match:
    """Match a scan with a map.

    Args:
        field: The likelihood field of the map.
        scan: The scan.
        guess: The odometer's pose of the scan (map frame).
        errors: The errors of such guesses, which the match adds to.
        config: All parameters; those of the field and of the local map are not used.
    """
    slip, turn = errors.deviations
    prior = 0.5 / np.array((slip, slip, turn)) ** 2
    window = Window(
        min(config.deviations * slip, config.wide_reach),
        min(config.deviations * turn, config.wide_turn),
        config.heading_step,
    )
    best = correlate(field, scan.points, guess, window, prior)
    if best.at_border or best.response < config.sure:
        widest = Window(config.wide_reach, config.wide_turn, config.heading_step)
        loose = 0.5 / np.array((config.wide_reach, config.wide_reach, config.wide_turn)) ** 2
        wide = correlate(field, scan.points, guess, widest, loose)
        if wide.response > best.response + config.gain:
            best, prior = wide, loose
    if best.response < config.poor:
        return Match(guess, np.zeros((3, 3)), best.response, False)
    found = refine(field, scan.points, scan.normals, best.pose, guess, prior)
    errors.measure(guess, found.pose)
    pose = found.pose
    pose[2] = wrap_angle(pose[2])
    return Match(pose, found.information / config.correlated, found.response, True)


class LocalMap(Stored):
    """The latest kept scans, and the matching with them.

    Args:
        config: All parameters.
    """

    SCHEMA = Schema(
        Field("local.errors", "2", at="errors.variances", least=0),
        Field("local.corner", "2", at="_field.corner"),
        Field("local.poses", "scans 3", at=None),
        Field("local.counts", "scans", int, at=None, least=0, sums="points"),
        Field("local.points", "points 2", at=None),
    )

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
        """Match a scan with the latest ones (see `match_scan`)."""
        return match_scan(self._field, scan, guess, self.errors, self.config)

    def is_due(self, pose: Pose) -> bool:
        """Return whether the robot moved or turned far enough for its scan to be kept."""
        if not self._kept:
            return True
        x, y, turn = relative(self._kept[-1][0], pose).tolist()
        return math.hypot(x, y) >= self.config.step or abs(turn) >= self.config.turn

    def keep(self, pose: Pose, surface: Points) -> None:
        """Add the points of a scan at a pose."""
        config = self.config
        self._kept.append((pose.copy(), surface))
        away = pose[:2] - self._field.corner - config.field.half
        too_far = max(abs(away[0]), abs(away[1])) > max(config.field.half - config.reach, 1.0)
        if too_far or len(self._kept) > config.scans + config.more:
            self._lay_out()
        else:
            self._field.add(pose, surface)

    def _lay_out(self) -> None:
        """Rebuild the local map from the latest scans, centred at the last of them."""
        self._kept = self._kept[-self.config.scans :]
        self._field.clear(self._kept[-1][0][:2])
        for pose, surface in self._kept:
            self._field.add(pose, surface)

    def move(self, poses: Poses) -> None:
        """Set the poses of the latest scans, and forget all earlier scans."""
        self._kept = [
            (pose.copy(), surface)
            for pose, (_, surface) in zip(poses, self._kept[-len(poses) :], strict=True)
        ]
        self._lay_out()

    def _stored(self) -> dict[str, Any]:
        surfaces = [surface for _, surface in self._kept]
        return {
            "local.poses": [pose for pose, _ in self._kept],
            "local.counts": [len(surface) for surface in surfaces],
            "local.points": np.concatenate([np.empty((0, 2)), *surfaces]),
        }

    def _restored(self, state: Arrays) -> None:
        ends = np.cumsum(state["local.counts"])[:-1]
        surfaces = np.split(state["local.points"].copy(), ends)[: len(state["local.poses"])]
        self._kept = list(zip(state["local.poses"].copy(), surfaces, strict=True))
        self._field.clear(np.zeros(2))
        self._field.corner[:] = state["local.corner"]
        for pose, surface in self._kept:
            self._field.add(pose, surface)
