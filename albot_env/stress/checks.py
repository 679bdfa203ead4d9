"""Checks of the state after a step. Each check returns its findings, one line for each.

An empty list means that nothing is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses, Ranges, Segments
from albot_core.ranges import NOT_NEGATIVE, check_fields
from albot_core.robot import PIONEER_3DX
from albot_core.sensing.reading import SonarScan
from albot_env.stress.geometry import (
    Point,
    depths_in,
    nearest_in_cones,
    ray_ranges,
    wall_distances,
    walls_crossed,
)

_TURN_ASIDE = 1e-4
"""A beam that misses a surface when turned by this angle (rad) only grazes the surface."""
_DIRECTIONS = (31, 1001, 20_001)
"""Number of directions in which the farthest surface in a cone is searched: at first, and again
while a doubt remains. Gaps of 0.1 mm at 4 m are missed; people leave some of 2 mm."""
SLACK = 0.01
"""Relative allowance for a surface between two directions: at most 0.8 % on a wall that is hit
within 25° of its perpendicular."""
REACH = 1.1
"""Surfaces beyond this multiple of the sonars' range, from the robot's centre, are not heard."""
_ROUNDING = 1e-6
"""Tolerance for the simulator's rounding errors (m)."""


INVARIANTS = (
    "reward", "observation", "info", "readings", "body", "obstacles", "movables", "laser", "sonar",
    "map", "places", "beliefs", "replay", "error",
)  # fmt: skip
"""Names of what must hold; `error`: no exception is raised, no process dies."""
ERROR = "error"


class Finding(NamedTuple):
    """Something that is wrong."""

    invariant: str
    """Name of what does not hold; one of `INVARIANTS`."""
    what: str
    """What is wrong, in one line."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of the checks. The defaults are those of the default robot and its laser."""

    radius: float = PIONEER_3DX.radius
    """Radius of the robot's body (m)."""
    overlap: float = 0.055
    """Maximum overlap of the body with a wall (m). Chipmunk finds a contact only once bodies
    overlap: at the maximum speed of actions, 1 m/s, by up to 5 cm after one step of 0.05 s."""
    obstacle_overlap: float = 0.06
    """Maximum overlap of the body with a dynamic obstacle (m): with a door's leaf 5 cm, as with a
    wall. Boxes and people are met in shorter steps, and people stop before the robot."""
    box_overlap: float = 0.06
    """Maximum depth of a wall in a box or a person (m): 5 cm with the lightest boxes at the maximum
    speed of actions."""
    range_error: float = 0.04
    """Maximum error of a range (m): the largest of the laser's 4096 errors of 1 cm standard
    deviation is 3.7 cm."""
    max_range: float = 30.0
    """Range reported for no return (m)."""
    dropout: float = 0.001
    """Probability that a beam that meets a wall returns nothing."""
    echo_noise: float = 0.005
    """Standard deviation of the constant part of a sonar's range error (m)."""
    echo_share: float = 0.01
    """Standard deviation of the proportional part, as a share of the range."""
    echo_deviations: float = 3.7
    """Maximum error of a sonar's range, in standard deviations: the largest of 4096."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, *vars(self))
        if self.dropout >= 1:
            raise InputError("Limits.dropout", "below 1", str(self.dropout))

    def echo_error(self, ranges: Ranges) -> Ranges:
        """Return the maximum error (m) of echoes from these distances (m)."""
        finite = np.where(np.isfinite(ranges), ranges, 0.0)
        return self.echo_deviations * np.hypot(self.echo_noise, self.echo_share * finite)

    def most_lost(self, beams: int) -> int:
        """Return how many beams may be lost by chance; the probability of more is below 1e-12."""
        odds = self.dropout / (1 - self.dropout)
        share = (1 - self.dropout) ** beams
        beyond, lost = 1 - share, 0
        while beyond > 1e-12 and lost < beams:
            share *= odds * (beams - lost) / (lost + 1)
            beyond, lost = beyond - share, lost + 1
        return lost


def check_observation(observation: Any, space: spaces.Space[Any]) -> list[str]:
    """Check that the observation lies in its space."""
    wrong = [f"observation {line}" for line in _not_finite(observation)]
    if not wrong and not space.contains(observation):
        wrong.append("the observation lies outside its space")
    return wrong


def check_info(info: Mapping[str, Any], keys: frozenset[str]) -> list[str]:
    """Check that the info is finite and has the keys of the reset (see `all_keys`)."""
    wrong = [f"info {line}" for line in _not_finite(info)]
    found = all_keys(info)
    wrong += [f"info lacks the key {key} of the reset" for key in sorted(keys - found)]
    wrong += [f"info has the key {key}, which the reset lacks" for key in sorted(found - keys)]
    return wrong


def all_keys(info: Mapping[str, Any]) -> frozenset[str]:
    """Return the keys of an info and of the mappings in it, such as `reward_terms.room`."""
    inner = (
        f"{key}.{name}"
        for key, value in info.items()
        if isinstance(value, Mapping)
        for name in all_keys(value)
    )
    return frozenset((*info, *inner))


def check_reward(reward: Any, terms: Mapping[str, Any]) -> list[str]:
    """Check that the reward is finite and the sum of its terms."""
    number, total = float(reward), float(sum(terms.values()))
    if not np.isfinite(number):
        return [f"the reward is {number}"]
    if not np.isclose(number, total, rtol=1e-9, atol=1e-9):
        return [f"the reward is {number:.9g}, its terms add up to {total:.9g}"]
    return []


def check_readings(
    motion: Pose,
    ranges: Float64[np.ndarray, "beams"] | None = None,
    echoes: Float64[np.ndarray, "sonars"] | None = None,
) -> list[str]:
    """Check that a reading's motion is finite, and that its ranges are distances or infinity.

    Args:
        motion: The odometer's motion (m, m, rad).
        ranges: The laser's ranges (m); None without a laser.
        echoes: The sonars' ranges (m); None without sonars.
    """
    wrong = [] if np.isfinite(motion).all() else [f"the odometer says {motion.tolist()}"]
    for name, values in (("beam", ranges), ("sonar", echoes)):
        if values is not None:
            bad = np.flatnonzero(~(values >= 0)).tolist()
            wrong += [f"{name} {k} says {values[k]:g} m" for k in bad]
    return wrong


def check_body(walls: Segments, before: Point, after: Point, limits: Limits) -> list[str]:
    """Check that the robot overlaps no wall by more than allowed, and has crossed none.

    Args:
        walls: The walls.
        before: Position after the previous step (m).
        after: Position now (m).
        limits: Maximum errors and overlaps.
    """
    if not np.isfinite(after).all():
        return []  # There is no position to check; `check_info` reports it.
    wrong = [
        f"went through {_named(walls, wall)}, from {_position(before)} to {_position(after)}"
        for wall in np.flatnonzero(walls_crossed(walls, before, after)).tolist()
    ]
    depths = limits.radius - wall_distances(walls, after)
    deepest = int(depths.argmax())
    if depths[deepest] > limits.overlap:
        wall = _named(walls, deepest)
        wrong.append(f"stands {depths[deepest]:.3f} m deep in {wall}, at {_position(after)}")
    return wrong


def check_obstacles(obstacles: Segments, place: Point, limits: Limits) -> list[str]:
    """Check that the robot overlaps no dynamic obstacle by more than allowed.

    Args:
        obstacles: Current outlines of the dynamic obstacles.
        place: Position of the robot (m).
        limits: Maximum errors and overlaps.
    """
    if not len(obstacles) or not np.isfinite(place).all():
        return []
    depth = float(limits.radius - wall_distances(obstacles, place).min())
    if depth <= limits.obstacle_overlap:
        return []
    return [f"stands {depth:.3f} m deep in something that moves, at {_position(place)}"]


def check_inside(
    kind: str, corners: Float64[np.ndarray, "movables corners 2"], place: Point
) -> list[str]:
    """Check that the robot's centre is not within a movable, far from all of its sides.

    Args:
        kind: What they are: `box` or `person`.
        corners: Corners of the movables now, counter-clockwise (m).
        place: Position of the robot (m).
    """
    sides, away = np.roll(corners, -1, axis=1) - corners, place - corners
    left = sides[..., 0] * away[..., 1] - sides[..., 1] * away[..., 0] > 0
    inside = np.flatnonzero(left.all(axis=1)).tolist()
    return [f"stands inside {kind} {k}, at {_position(place)}" for k in inside]


def check_movables(
    kind: str,
    walls: Segments,
    before: Float64[np.ndarray, "movables corners 2"],
    after: Float64[np.ndarray, "movables corners 2"],
    limits: Limits,
) -> list[str]:
    """Check that no wall is deeper in a movable than allowed, and that no centre has crossed one.

    Args:
        kind: What they are: `box` or `person`.
        walls: The walls.
        before: Corners of the movables after the previous step, counter-clockwise (m).
        after: Their corners now (m).
        limits: Maximum errors and overlaps.
    """
    wrong: list[str] = []
    for k, (corners, centre) in enumerate(zip(after, after.mean(axis=1), strict=True)):
        crossed = np.flatnonzero(walls_crossed(walls, before[k].mean(axis=0), centre)).tolist()
        wrong += [f"{kind} {k} went through {_named(walls, wall)}" for wall in crossed]
        depths = depths_in(walls, corners)
        deepest = int(depths.argmax())
        if depths[deepest] > limits.box_overlap:
            wall = _named(walls, deepest)
            wrong.append(f"{kind} {k} stands {depths[deepest]:.3f} m deep in {wall}")
    return wrong


def check_laser(
    surfaces: Segments, pose: Pose, bearings: Ranges, ranges: Ranges, limits: Limits
) -> list[str]:
    """Check that every range is that of the nearest surface, within errors and drop-outs.

    Args:
        surfaces: The walls and the outlines of dynamic obstacles.
        pose: True pose of the laser (world frame).
        bearings: Bearings of the beams (rad).
        ranges: Reported ranges (m); `limits.max_range` for no return.
        limits: Maximum errors and overlaps.
    """
    if not np.isfinite(pose).all():
        return []  # There is no position to check; `check_info` reports it.
    ways = ray_ranges(surfaces, pose, bearings)
    silent = ranges >= limits.max_range * (1 - 1e-6)
    least, most = _ranges_beside(surfaces, pose, bearings, ranges, ways, limits)
    wrong = [
        f"beam {beam} sees {ranges[beam]:.3f} m, through a surface at {most[beam]:.3f} m"
        for beam in np.flatnonzero(~silent & (ranges > most + limits.range_error)).tolist()
    ]
    wrong += [
        f"beam {beam} sees {ranges[beam]:.3f} m, nothing is before {least[beam]:.3f} m"
        for beam in np.flatnonzero(~silent & (ranges < least - limits.range_error)).tolist()
    ]
    in_reach = most < limits.max_range - limits.range_error
    lost, chance = int((silent & in_reach).sum()), limits.most_lost(int(in_reach.sum()))
    if lost > chance:
        wrong.append(f"{lost} beams see nothing where surfaces are; {chance} may be lost by chance")
    return wrong


def _ranges_beside(
    surfaces: Segments, pose: Pose, bearings: Ranges, ranges: Ranges, ways: Ranges, limits: Limits
) -> tuple[Ranges, Ranges]:
    """Return minimum and maximum ranges of the beams; beams that are off are turned slightly."""
    least, most = ways.copy(), ways.copy()
    off = np.flatnonzero(~(np.abs(ranges - ways) <= limits.range_error))
    for turn in (-_TURN_ASIDE, _TURN_ASIDE) if len(off) else ():
        beside = ray_ranges(surfaces, pose, bearings[off] + turn)
        least[off], most[off] = np.minimum(least[off], beside), np.maximum(most[off], beside)
    return least, most


def check_sonar(surfaces: Segments, pose: Pose, scan: SonarScan, limits: Limits) -> list[str]:
    """Check that every echo is from a surface that the sonar or a neighbour may hear.

    A sonar hears a surface that lies in its cone and is not hidden. So its echo is no nearer than
    the nearest surface in the cone, and no farther than the farthest visible one. With cross-talk
    it may hear its neighbour's echo instead, at half the path from the neighbour to a point within
    the neighbour's bounds and on to this sonar. By the triangle inequality, the return path equals
    the outward path up to the distance between both sonars, so the reported range equals the
    neighbour's up to half of that distance.

    Args:
        surfaces: The walls and the outlines of dynamic obstacles (world frame).
        pose: True pose of the robot (world frame).
        scan: The sonars' ranges.
        limits: Maximum errors and overlaps.
    """
    if not np.isfinite(pose).all():
        return []  # There is no position to check; `check_info` reports it.
    geometry, echoes = scan.geometry, scan.ranges
    near = surfaces[wall_distances(surfaces, pose[:2]) < REACH * geometry.max_range]
    sonars = compose(pose, np.column_stack((np.array(geometry.places), geometry.bearings)))
    heard, half = np.flatnonzero(echoes < np.inf), geometry.cone / 2
    nearest = _with_neighbours(sonars, nearest_in_cones(near, sonars, half), -1.0)
    least = nearest - limits.echo_error(nearest) - _ROUNDING
    wrong = [
        f"sonar {k} hears {echoes[k]:.3f} m, nothing is before {nearest[k]:.3f} m"
        for k in heard[echoes[heard] < least[heard]].tolist()
    ]
    for directions in _DIRECTIONS:  # Few need the finer search.
        farthest = _with_neighbours(sonars, _farthest_in_cones(near, sonars, half, directions), 1.0)
        most = np.maximum(farthest * (1 + SLACK) + limits.echo_error(farthest), geometry.min_range)
        beyond = heard[echoes[heard] > np.minimum(most, geometry.max_range)[heard]]
        if not len(beyond):
            return wrong
    return wrong + [
        f"sonar {k} hears {echoes[k]:.3f} m, through a surface at {farthest[k]:.3f} m"
        for k in beyond.tolist()
    ]


def _with_neighbours(sonars: Poses, own: Ranges, sign: float) -> Ranges:
    """Return each sonar's bound combined with its neighbours': minimum (sign -1) or maximum (1)."""
    apart = np.hypot(*np.diff(sonars[:, :2], axis=0).T)
    bounds = sign * own
    bounds[:-1] = np.maximum(bounds[:-1], sign * own[1:] + apart / 2)
    bounds[1:] = np.maximum(bounds[1:], sign * own[:-1] + apart / 2)
    return sign * bounds


def _farthest_in_cones(
    surfaces: Segments, sonars: Poses, half_angle: float, directions: int
) -> Float64[np.ndarray, "sonars"]:
    """Return the distance (m) of the farthest surface visible in each cone, by ray casting."""
    bearings = np.linspace(-half_angle, half_angle, directions)
    return np.array([ray_ranges(surfaces, sonar, bearings).max() for sonar in sonars])


def _not_finite(value: Any, name: str = "") -> Iterator[str]:
    """Yield the names of values, however nested, that are not finite."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _not_finite(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, np.ndarray | np.number | float):
        numbers = np.asarray(value)
        if numbers.dtype.kind == "f" and not np.isfinite(numbers).all():
            bad = numbers[~np.isfinite(numbers)]
            yield f"{name + ' ' if name else ''}holds {bad.flat[0]}"


def _named(walls: Segments, wall: int) -> str:
    x1, y1, x2, y2 = walls[wall]
    return f"wall {wall}, ({x1:.2f}, {y1:.2f}) to ({x2:.2f}, {y2:.2f})"


def _position(point: Point) -> str:
    return f"({point[0]:.3f}, {point[1]:.3f})"
