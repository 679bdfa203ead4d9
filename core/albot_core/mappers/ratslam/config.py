"""Every threshold of RatSLAM. The paper gives few: each field says whose its value is."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from albot_core.errors import InputError
from albot_core.ranges import COUNT, NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

_SIDE = Range("a whole number from 16", 16.0, 4096.0, whole=True)
_FROM_ONE = Range("a whole number from 1", 1.0, whole=True)
_FROM_TWO = Range("a whole number from 2", 2.0, whole=True)
_BINS = Range("a whole number from 8 to 180", 8.0, 180.0, whole=True)
_AT_LEAST_ONE = Range("a number from 1", 1.0)
_DECAY = Range("a number within [0, 1)", 0.0, math.nextafter(1.0, 0.0))
_RATE = Range("a number within (0, 1)", 0.0, math.nextafter(1.0, 0.0), beyond=True)
_ANGLE = Range("an angle within (0, pi]", 0.0, math.pi, beyond=True)


DIRECTIONS = 180
"""Directions of a panorama."""


@dataclass(frozen=True, kw_only=True)
class PoseCellConfig:
    """The competitive attractor network of pose cells (sections 3.2 and 3.3)."""

    columns: int = 128
    """Cells along x', which wraps round. The paper gives no size: ours."""
    rows: int = 128
    """Cells along y', which wraps round: ours."""
    headings: int = 36
    """Cells along θ': 10° each, as in the paper."""
    cell: float = 0.25
    """Side of a cell (m), as in the paper."""
    excitation: float = 1.2
    """Standard deviation of a cell's excitation of its neighbours (cells): ours."""
    inhibition: float = 2.0
    """Standard deviation of its local inhibition (cells): ours."""
    global_inhibition: float = 2e-4
    """What every cell loses in each iteration, as a share of all activity: ours. The larger it is,
    the sooner the largest packet wins."""
    step: float = 0.1
    """The network takes part once the robot has moved so far (m)…: ours, so that it does the
    same at any rate of readings."""
    turn: float = math.radians(10.0)
    """…or turned so far (rad): ours."""

    def __post_init__(self) -> None:
        check_fields(self, _SIDE, "columns", "rows", "headings")
        check_fields(self, POSITIVE, "cell", "excitation", "inhibition")
        check_fields(self, NOT_NEGATIVE, "global_inhibition", "step", "turn")
        if self.excitation >= self.inhibition:
            expected = f"more than excitation, {self.excitation:g}"
            raise InputError("PoseCellConfig.inhibition", expected, f"{self.inhibition:g}")

    @property
    def cell_turn(self) -> float:
        """The angle of a cell (rad)."""
        return 2 * math.pi / self.headings


@dataclass(frozen=True, kw_only=True)
class LocalViewConfig:
    """Scenes, and the links of views to the pose cells (section 3.4). All values are ours."""

    confirmations: int = 2
    """A scene is believed when so many readings in a row show it…"""
    forget: int = 30
    """…and until it has not been shown for so many."""
    injection: float = 0.04
    """Activity that a fresh view injects in each iteration, as a share of all activity…"""
    fatigue: float = 0.9
    """…of which so much is left in the next iteration, …"""
    recovery: float = 0.05
    """…and which recovers by so much in each iteration in which the view is not seen."""
    learning_rate: float = 1.0
    """Strength of a new link, as a share of view times pose cell activity."""
    learning_delay: float = 5.0
    """A link is learned once the robot has gone so far without being re-localised (m)."""
    linked_share: float = 0.5
    """Pose cells are linked that have this share of the most active one's activity."""

    def __post_init__(self) -> None:
        check_fields(self, _FROM_ONE, "confirmations", "forget")
        check_fields(self, POSITIVE, "learning_rate")
        check_fields(self, NOT_NEGATIVE, "injection", "learning_delay")
        check_fields(self, _DECAY, "fatigue")
        check_fields(self, SHARE, "recovery", "linked_share")


@dataclass(frozen=True, kw_only=True)
class PanoramaConfig:
    """Panoramas, the local views of a laser. All values are ours."""

    reach: float = 8.0
    """Ranges count as no longer than this (m)."""
    trail: float = 5.0
    """Scans are gathered of the last part of the way (m)…"""
    between: float = 0.3
    """…about so far apart (m)…"""
    scans: int = 30
    """…and no more than so many."""
    bins: int = 36
    """Sectors of the profiles that are compared over all turns."""
    overlap: float = 0.4
    """Profiles are compared where both know at least this share of the circle."""
    candidates: int = 8
    """The views whose profiles differ least are aligned, so many at most…"""
    factor: float = 1.6
    """…and only those that differ up to so many times as much as the best."""
    least: float = 0.4
    """A view is seen where the match score is at least this…"""
    near: float = 1.6
    """…and the robot is so near to the origin of its frame (m)."""
    sure: float = 0.6
    """A view tells where the robot is in it, in place of the odometer, from this score on…"""
    slip: float = 0.1
    """…if that is no farther than this (rad, and twice as many m) from where the odometer says…"""
    slip_share: float = 0.25
    """…plus this share of the motion since the last scan."""
    elsewhere: float = 0.02
    """How likely the robot is where no view was learned, beside a match of 1 where it is expected:
    the larger, the longer views that match poorly, or far from there, take to re-localise it."""
    spread: float = 0.5
    """Standard deviation (m) of where the robot is believed to be, without any way…"""
    drift: float = 0.05
    """…and what the way since a view was last seen adds to it, as a share."""
    turn_spread: float = 0.15
    """The same of the robot's heading (rad)…"""
    turn_drift: float = 0.01
    """…and what the way adds (rad/m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "reach", "trail", "near", "elsewhere", "spread", "turn_spread")
        check_fields(self, NOT_NEGATIVE, "between", "slip", "slip_share", "drift", "turn_drift")
        check_fields(self, _FROM_TWO, "scans")
        check_fields(self, _FROM_ONE, "candidates")
        check_fields(self, _AT_LEAST_ONE, "factor")
        check_fields(self, SHARE, "overlap", "least", "sure")
        check_fields(self, _BINS, "bins")
        if DIRECTIONS % self.bins:
            expected = f"a divisor of {DIRECTIONS}, the directions of a panorama"
            raise InputError("PanoramaConfig.bins", expected, str(self.bins))


@dataclass(frozen=True, kw_only=True)
class ExperienceConfig:
    """The zones of influence of experiences (section 4.1). The paper gives no sizes: ours."""

    radius: float = 1.0
    """r_a: radius of the zone in the plane of the pose cells (m)."""
    turn: float = math.radians(45.0)
    """θ_a: half the zone's width in θ' (rad)."""
    either_zone: bool = False
    """Whether being in the zone in (x', y') or in that in θ' is enough, as eq. (9) has it to the
    letter. Then a view that is shared or false is at once an experience far away."""
    apart: float = 3.0
    """An experience is recognised when the robot went so far since it was last there (m)."""
    confirmations: int = 2
    """A re-localisation is believed once so many known experiences were entered after it without
    another one. Until then transitions to known experiences wait; those of a false one are never
    learned. 0: all are believed at once."""
    smoothing: float = 0.3
    """A scene tells to 1 m and 45° only where the robot is in an experience. So much of the
    difference from where the odometer says that it is in the map is believed, at least: all as it
    is re-localised, then half, a third… 1 believes the pose cells alone."""
    spacing: float = 0.6
    """A robot with a laser makes no new experience so near to the last (m) while it sees that…"""
    certain: float = 0.5
    """…which it does, as it does any other, where the match score is at least this."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "radius")
        check_fields(self, _ANGLE, "turn")
        check_fields(self, NOT_NEGATIVE, "apart", "spacing")
        check_fields(self, SHARE, "certain", "smoothing")
        check_fields(self, COUNT, "confirmations")


@dataclass(frozen=True, kw_only=True)
class CorrectionConfig:
    """The correction of the experience map (sections 4.3 and 4.4)."""

    form: Literal["link_by_link", "all_at_once"] = "link_by_link"
    """`link_by_link`: each link moves its two experiences, equally and oppositely, before the next
    is looked at; stable for every rate below 1. `all_at_once`: eq. (12) to (14) of all
    experiences from the same poses, as the paper writes them, which diverges where the rate is
    not below 2 / the greatest eigenvalue of the graph's Laplacian: at junctions."""
    rate: float = 0.5
    """α for positions and headings, as in the paper (table 1)."""
    passes: int = 2
    """How often all links are looked at in each iteration; 0 corrects nothing: ours."""

    def __post_init__(self) -> None:
        check_fields(self, _RATE, "rate")
        check_fields(self, COUNT, "passes")
        if self.form not in ("link_by_link", "all_at_once"):
            expected = "link_by_link or all_at_once"
            raise InputError("CorrectionConfig.form", expected, repr(self.form))


@dataclass(frozen=True, kw_only=True)
class RatSlamConfig:
    """Thresholds of RatSLAM. `RatSlamConfig.scenes()` sees with a camera, by default a laser."""

    sees: Literal["laser", "scenes"] = "laser"
    """Where views come from: panoramas of laser scans, or numbers of visual scenes."""
    pose_cells: PoseCellConfig = field(
        default_factory=lambda: PoseCellConfig(step=0.25, turn=math.radians(20.0))
    )
    """The network of pose cells."""
    views: LocalViewConfig = field(default_factory=lambda: LocalViewConfig(injection=0.2))
    """Scenes, and the links of views."""
    panoramas: PanoramaConfig = field(default_factory=PanoramaConfig)
    """The views of a laser."""
    experiences: ExperienceConfig = field(
        default_factory=lambda: ExperienceConfig(radius=1.5, confirmations=0)
    )
    """When an experience is active."""
    correction: CorrectionConfig = field(default_factory=lambda: CorrectionConfig(passes=10))
    """How the map is corrected."""
    ahead: float = 2.0
    """How far ahead the point lies that is shown on the way home (m): ours."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "ahead")
        if self.sees not in ("laser", "scenes"):
            raise InputError("RatSlamConfig.sees", "laser or scenes", repr(self.sees))

    @classmethod
    def scenes(cls) -> RatSlamConfig:
        """The default values for a camera, whose scenes are looked at more often.

        A scene is in sight for a metre, and links lead to where it came into sight. So it injects
        most at once: later it would pull the packet back.
        """
        return cls(
            sees="scenes",
            pose_cells=PoseCellConfig(),
            views=LocalViewConfig(injection=0.1, fatigue=0.7, learning_delay=3.0),
            experiences=ExperienceConfig(),
            correction=CorrectionConfig(),
        )
