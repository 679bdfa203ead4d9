"""The thresholds of graph SLAM. Where no source is named, the values are ours: see docs/slam.md."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from albot_core.mappers.slam.grid import GridConfig
from albot_core.mappers.slam.likelihood_field import FieldConfig
from albot_core.mappers.slam.local_map import MatchingConfig
from albot_core.mappers.slam.way_home import WayHomeConfig
from albot_core.ranges import POSITIVE, SHARE, Range, check_fields

_FROM_ONE = Range("a whole number from 1", 1.0, whole=True)


@dataclass(frozen=True, kw_only=True)
class ClosureConfig:
    """When and how loops are closed. The values are ours, tuned on Intel and Wean alone."""

    field: FieldConfig = field(default_factory=lambda: FieldConfig(half=12.0))
    """The likelihood field of the earlier part of the way."""
    near: float = 4.0
    """Keyframes are compared that may be as near as this (m)."""
    behind: int = 40
    """The latest keyframes, which the local map holds, are not compared."""
    chain: int = 3
    """So many keyframes before and after an earlier one are matched with as one."""
    together: int = 3
    """So many of the latest keyframes are matched as one."""
    tries: int = 1
    """How many earlier parts of the way are tried at each keyframe."""
    deviations: float = 3.0
    """The window reaches so many standard deviations of the relative pose to each side…"""
    least_reach: float = 0.2
    """…at least so far (m)…"""
    most_reach: float = 6.0
    """…and at most so far (m)."""
    least_turn: float = math.radians(4.0)
    """The same of the heading (rad)."""
    most_turn: float = math.radians(40.0)
    """The same (rad)."""
    response: float = 0.6
    """A closure is believed whose points have at least this mean likelihood…"""
    wide_response: float = 0.7
    """…or this, where the window is as wide as it may be."""
    same_place: float = 0.5
    """Largest distance (m) of a keyframe from the earlier one with which it closed a loop at which
    both count as taken at one place. A robot cannot be so near to a point behind a wall."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "near", "deviations", "least_reach", "most_reach", "least_turn",
            "most_turn", "same_place",
        )  # fmt: skip
        check_fields(self, _FROM_ONE, "behind", "chain", "together", "tries")
        check_fields(self, SHARE, "response", "wide_response")


@dataclass(frozen=True, kw_only=True)
class GraphSlamConfig:
    """Thresholds of graph SLAM."""

    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """How scans are matched with the latest ones, and which become keyframes."""
    closures: ClosureConfig = field(default_factory=ClosureConfig)
    """How loops are closed."""
    grid: GridConfig = field(default_factory=GridConfig)
    """The occupancy grid."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """How the way home is found."""
    cauchy: float = 1.0
    """Width of the robust function by which closures count at first, in standard deviations…"""
    dcs: float = 5.0
    """…and of that by which they count at last, in squared standard deviations."""
    floor: float = 0.005
    """Standard deviation of what no match tells (m): the roughness of surfaces…"""
    turn_floor: float = math.radians(0.15)
    """…and of the heading (rad)."""
    surprise: float = 3.0
    """The graph is optimised at once where a closure is so many standard deviations off…"""
    most_waiting: int = 40
    """…and else after so many closures…"""
    waiting_share: float = 0.1
    """…or after this share of all, where that is more: so a closure costs no more in a large graph
    than in a small one."""
    longest_step: float = 10.0
    """No robot goes farther between two readings (m): a longer motion is not believed."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "cauchy", "dcs", "floor", "turn_floor", "surprise", "longest_step"
        )
        check_fields(self, _FROM_ONE, "most_waiting")
        check_fields(self, SHARE, "waiting_share")
