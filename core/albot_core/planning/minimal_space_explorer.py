"""The explorer of landmark association: short moves to gaps of the minimal bounded space.

Source: Yeap and others, Autonomous robot mapping by landmark association (2015), section
"Autonomous exploration". It has no memory: at each stop it searches for gaps again. Its moves are
short so that successive views overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from albot_core.errors import InputError
from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Points, Segments
from albot_core.planning.gap_explorer import Gap, find_gaps
from albot_core.planning.percept import Percept
from albot_core.planning.steering import Command, SteeringConfig, admissible_command, steer
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, check_fields
from albot_core.sensing.reading import LaserScan
from albot_core.sensing.view import ViewConfig, construct_view

GapKind = Literal["ranges", "surfaces"]
"""What a gap lies between (see `MinimalSpaceConfig.gaps`)."""
_KINDS: tuple[GapKind, ...] = get_args(GapKind)


def _view() -> ViewConfig:
    return ViewConfig(
        cluster_gap=1.2, surface_length=0.5, break_height=0.05, surface_points=4, fit_lines=True
    )


@dataclass(frozen=True, kw_only=True)
class MinimalSpaceConfig:
    """Parameters of the explorer: choice of gaps and length of moves."""

    gaps: GapKind = "ranges"
    """`surfaces`, the paper's: a gap lies "between two adjacent surfaces in view". `ranges`, ours:
    it lies where the range jumps from beam to beam, between the edge and the point nearest to it on
    the farther side, so that the robot passes it straight, and things too small for a surface
    bound it too."""
    view: ViewConfig = field(default_factory=_view)
    """How surfaces are found in a scan: as landmark association does."""
    gap_width: float = 0.6
    """Gaps must be wider than this (m), as in the paper, and wider than the robot."""
    turn: float = np.radians(30.0)
    """Largest turn per move (rad), as in the paper."""
    drive: float = 3.0
    """Longest drive per move (m), as in the paper."""
    nearest: float = 1.0
    """A gap is drawn from the nearest one and those at most this much farther away (m). The paper
    says "a random gap closest to the robot"; the value is ours."""
    steering: SteeringConfig = field(default_factory=SteeringConfig)
    """The steering parameters; these are ours."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "gap_width", "turn", "drive")
        check_fields(self, NOT_NEGATIVE, "nearest")
        if self.gaps not in _KINDS:
            expected = f"one of {', '.join(_KINDS)}"
            raise InputError("MinimalSpaceConfig.gaps", expected, repr(self.gaps))


class MinimalSpaceExplorer:
    """Turns to a gap and drives towards it in short moves.

    Args:
        config: The parameters.
    """

    _REACH = 30.0
    """Largest distance of gaps: the laser's range (m)."""
    _RATE, _GAIN = 1.0, 4.0
    """Largest turn rate on the spot (rad/s), and turn rate per radian left (1/s)."""
    _TURNED = np.radians(2.0)
    """Remaining angle at which a turn is complete (rad)."""
    _ARRIVED = 0.2
    """Distance to the centre of a gap at which it stops (m)."""
    _BLOCKED_STEPS = 10
    """Steps without progress after which a move ends because the way is blocked."""
    _TURNS = 6
    """Largest number of turns by which it turns away from where it is barred again: half a turn."""
    _MIN_PROGRESS = 0.005
    """Least progress of a step (m or rad)."""

    def __init__(self, config: MinimalSpaceConfig = MinimalSpaceConfig()) -> None:
        self._config = config

    def reset(self, rng: np.random.Generator) -> None:
        """Reset all state."""
        self._rng = rng
        self._target = np.zeros(2)
        self._turn_left, self._way_left, self._turned_by = 0.0, 0.0, 0.0
        self._steps_without_progress = 0
        self._side = 0.0
        self._barred, self._turns = 0, 0
        self.moves = 0
        """Number of moves begun. The robot stands and scans before each."""

    def command(self, percept: Percept) -> Command:
        """Return the next drive command for the current percept."""
        self._note_motion(percept)
        if abs(self._turn_left) <= self._TURNED and self._way_left <= 0.0:
            self._begin_move(percept)
        if abs(self._turn_left) > self._TURNED:
            rate = float(np.clip(self._GAIN * self._turn_left, -self._RATE, self._RATE))
            wanted = np.array((0.0, rate))
        else:
            wanted = steer(percept.points, self._target, self._config.steering)
        return admissible_command(wanted, percept.points, percept.motion, self._config.steering)

    def gaps_in_view(self, percept: Percept) -> list[Gap]:
        """Return the gaps wide enough for the robot, the paper's step (b)."""
        config = self._config
        narrowest = max(config.gap_width, 2 * config.steering.radius)
        if config.gaps == "ranges":
            return find_gaps(percept.points, narrowest=narrowest, reach=self._REACH)
        scan = LaserScan(ranges=percept.ranges, geometry=percept.laser)
        surfaces = construct_view(scan, config.view).surfaces
        hits = percept.points[percept.ranges < percept.laser.max_range]
        return gaps_between(surfaces, hits, narrowest, config.steering.radius)

    def _note_motion(self, percept: Percept) -> None:
        """Subtract the last step from the current move; end the move if it is complete."""
        motion = percept.motion
        self._target = transform_points(inverse(motion), self._target)
        way, turn = float(np.hypot(*motion[:2])), float(motion[2])
        self._steps_without_progress += 1
        if max(way, abs(turn)) >= self._MIN_PROGRESS:
            self._steps_without_progress = 0
        self._turned_by += turn
        is_driving = abs(self._turn_left) <= self._TURNED and self._way_left > 0.0
        if abs(self._turn_left) > self._TURNED:
            self._turn_left -= turn
            is_turned_away = False
        else:
            self._way_left -= way
            # The paper's robot drives straight, so that two views overlap; ours swerves round
            # obstacles, but not farther than a turn.
            farthest = self._config.turn + self._TURNED
            is_turned_away = is_driving and abs(self._turned_by) > farthest
        is_blocked = self._steps_without_progress >= self._BLOCKED_STEPS
        is_barred = is_blocked or is_turned_away
        if np.hypot(*self._target) < self._ARRIVED or is_barred:
            self._turn_left, self._way_left = 0.0, 0.0
        if is_barred:
            self._barred += 1
            self._turns = int(self._rng.integers(1, self._TURNS + 1)) if self._barred > 1 else 0
        elif is_driving and self._way_left <= 0.0:
            self._barred = 0

    def _begin_move(self, percept: Percept) -> None:
        """Choose a gap of the minimal bounded space and a move towards it.

        These are the paper's steps (b) to (e). Without a gap, or if the way is blocked, the robot
        turns to one side until there is one. After a way that was blocked, or led away from its
        gap, any gap may be drawn, because the nearest may be the one that it cannot reach; after
        another one it first turns by chance. The paper does not describe these cases.
        """
        self.moves += 1
        config = self._config
        seen = self.gaps_in_view(percept)
        # Leave out a gap in which the robot already stands.
        gaps = [gap for gap in minimal_space(seen) if np.hypot(*gap.centre) > 2 * self._ARRIVED]
        self._turns -= 1
        if gaps and self._turns < 0 and self._steps_without_progress < self._BLOCKED_STEPS:
            distances = np.array([np.hypot(*gap.centre) for gap in gaps])
            farthest = np.inf if self._barred else distances.min() + config.nearest
            near = np.flatnonzero(distances <= farthest)
            self._target = gaps[int(self._rng.choice(near))].centre
            self._side = 0.0
        else:
            self._side = self._side or float(self._rng.choice((-1.0, 1.0)))
            self._target = np.array((0.0, self._side))
        bearing = float(np.arctan2(self._target[1], self._target[0]))
        self._turn_left = float(np.clip(bearing, -config.turn, config.turn))
        self._way_left = config.drive if self._turn_left == bearing else 0.0
        self._turned_by = 0.0
        self._steps_without_progress = 0


def gaps_between(surfaces: Segments, hits: Points, narrowest: float, radius: float) -> list[Gap]:
    """Return the gaps between adjacent surfaces, "an empty space" from one's end to the next one.

    Things too small for a surface may stand between them: the gap is then the widest part that is
    empty.

    Args:
        surfaces: The surfaces in view, in the order of the beams (m, robot's frame).
        hits: (hits, 2) all points that the beams hit (m, robot's frame).
        narrowest: Gaps are wider than this (m).
        radius: Points nearer than this to the line across a gap stand in it (m).
    """
    gaps = []
    for end, begin in zip(surfaces[:-1, 2:], surfaces[1:, :2], strict=True):
        width = float(np.hypot(*(begin - end)))
        if width <= narrowest:
            continue
        along = (begin - end) / width
        outward = np.array((-along[1], along[0]))
        ahead, aside = (hits - end) @ along, np.abs((hits - end) @ outward)
        inside = ahead[(ahead > 0.0) & (ahead < width) & (aside < radius)]
        bounds = np.sort(np.concatenate(((0.0, width), inside)))
        widest = int(np.diff(bounds).argmax())
        first, last = bounds[widest : widest + 2].tolist()
        if last - first > narrowest:
            centre = end + 0.5 * (first + last) * along
            away = outward if outward @ centre > 0.0 else -outward
            gaps.append(Gap(centre=centre, outward=away, width=last - first))
    return gaps


def minimal_space(gaps: Sequence[Gap]) -> list[Gap]:
    """Return the gaps that bound the minimal bounded space: those that no other gap covers.

    A gap covers another one if the robot must cross it to reach the other (Yeap and Jefferies,
    Computing a representation of the local environment, Artificial Intelligence 107, 1999). Here,
    the straight line to the other's centre counts.
    """
    return [gap for gap in gaps if not any(_covers(other, gap) for other in gaps)]


def space_outline(points: Points, gaps: Sequence[Gap]) -> Points:
    """Return the outline of the minimal bounded space.

    It is where the straight line from the robot to the end of each beam first crosses a gap, or
    that end. The paper names the space, and leaves its computation to another paper; this is ours.

    Args:
        points: (beams, 2) end points of the beams (m, robot's frame).
        gaps: The gaps that bound the space (see `minimal_space`).

    Returns:
        (beams, 2) the outline, in the order of the beams (m, robot's frame).
    """
    outline = np.array(points, float)
    for gap in gaps:
        away, towards = float(gap.centre @ gap.outward), outline @ gap.outward
        is_beyond = towards > max(away, 0.0)
        share = np.divide(away, towards, out=np.ones_like(towards), where=is_beyond)
        met = share[:, None] * outline
        aside = np.hypot(*(met - gap.centre).T)
        is_cut = is_beyond & (aside <= gap.width / 2)
        outline[is_cut] = met[is_cut]
    return outline


def _covers(gap: Gap, other: Gap) -> bool:
    """Return whether the straight line from the robot to another gap's centre crosses this gap."""
    along = np.array((gap.outward[1], -gap.outward[0]))
    x, y = other.centre
    # Find where the line, from 0 at the robot to 1 at the other gap, meets the line of this gap.
    towards = float(x * gap.outward[0] + y * gap.outward[1])
    away = float(gap.centre @ gap.outward)
    if towards <= away + _OFFSET_TOLERANCE:
        return False
    aside = float((away / towards * other.centre - gap.centre) @ along)
    return abs(aside) < gap.width / 2


_OFFSET_TOLERANCE = 0.1
"""Largest distance (m) of the lines of gaps that lie beside each other or are the same."""
