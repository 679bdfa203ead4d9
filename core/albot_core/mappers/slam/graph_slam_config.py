"""The parameters of graph SLAM. Values without a named source are ours: see docs/slam.md."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from albot_core.mappers.slam.grid import GridConfig
from albot_core.mappers.slam.local_map import MatchingConfig
from albot_core.mappers.slam.way_home import WayHomeConfig
from albot_core.matching.likelihood_field import FieldConfig
from albot_core.ranges import FROM_ONE, POSITIVE, SHARE, check_fields


@dataclass(frozen=True, kw_only=True)
class ClosureConfig:
    """When and how loops are closed. The values are ours, tuned on Intel and Wean only."""

    field: FieldConfig = field(default_factory=lambda: FieldConfig(half=12.0))
    """The likelihood field of the earlier keyframes."""
    near: float = 4.0
    """Keyframes are compared if they may be nearer than this, given their uncertainty (m)."""
    behind: int = 40
    """Number of latest keyframes that are not compared, since the local map holds them."""
    chain: int = 3
    """Number of keyframes before and after an earlier one that are matched together with it."""
    together: int = 3
    """Number of latest keyframes that are matched together."""
    tries: int = 1
    """Number of earlier parts of the path that are tried at each keyframe."""
    deviations: float = 3.0
    """Half-width of the search window, in standard deviations of the relative pose."""
    least_reach: float = 0.2
    """Smallest half-width of the window in position (m)."""
    most_reach: float = 6.0
    """Largest half-width of the window in position (m)."""
    least_turn: float = math.radians(4.0)
    """Smallest half-width of the window in heading (rad)."""
    most_turn: float = math.radians(40.0)
    """Largest half-width of the window in heading (rad)."""
    response: float = 0.6
    """Smallest mean likelihood of the points at which a closure is accepted, in a narrow window."""
    wide_response: float = 0.7
    """The same threshold in the widest window; it is interpolated in between."""
    unrefined: float = 0.6
    """The share of the threshold that the best pose of the window's grid reaches before it is
    refined. Where no pose does, most of a wide window is never searched. Of the closures that are
    accepted on the logs of indoor robots, the grid's pose has at least 0.94 of it."""
    same_place: float = 0.5
    """Largest distance between a keyframe and the earlier one with which it closed a loop (m) at
    which both count as the same place. A robot cannot be this close to a point behind a wall."""

    def __post_init__(self) -> None:
        check_fields(
            self, POSITIVE, "near", "deviations", "least_reach", "most_reach", "least_turn",
            "most_turn", "same_place",
        )  # fmt: skip
        check_fields(self, FROM_ONE, "behind", "chain", "together", "tries")
        check_fields(self, SHARE, "response", "wide_response", "unrefined")


@dataclass(frozen=True, kw_only=True)
class GraphSlamConfig:
    """Parameters of graph SLAM."""

    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Matching with the latest scans, and the choice of keyframes."""
    closures: ClosureConfig = field(default_factory=ClosureConfig)
    """Loop closure."""
    grid: GridConfig = field(default_factory=GridConfig)
    """The occupancy grid."""
    way_home: WayHomeConfig = field(default_factory=WayHomeConfig)
    """Parameters of the search for the way home."""
    cauchy: float = 1.0
    """Width of the Cauchy kernel of closures in the first optimisation (standard deviations)."""
    dcs: float = 5.0
    """Width of the DCS kernel of closures in the second (squared standard deviations)."""
    floor: float = 0.005
    """Smallest standard deviation of an edge's position (m), such as the roughness of surfaces."""
    turn_floor: float = math.radians(0.15)
    """Smallest standard deviation of an edge's heading (rad)."""
    surprise: float = 3.0
    """Error of a new closure at which the graph is optimised at once (standard deviations)."""
    most_waiting: int = 40
    """Number of waiting closures at which the graph is optimised in any case."""
    waiting_share: float = 0.1
    """Share of all closures that replaces `most_waiting` if it is more, so that a closure costs no
    more in a large graph than in a small one."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "cauchy", "dcs", "floor", "turn_floor", "surprise")
        check_fields(self, FROM_ONE, "most_waiting")
        check_fields(self, SHARE, "waiting_share")
