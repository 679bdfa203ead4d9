"""What is wrong after a step: each check is a function of numbers, and says it in a line.

An empty list says that nothing is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses, Ranges, Segments
from albot_core.ranges import NOT_NEGATIVE, check_fields
from albot_core.sensing.reading import SonarScan
from albot_env.stress.geometry import (
    Point,
    nearest_in_cones,
    ray_ranges,
    wall_distances,
    walls_crossed,
)
from albot_maps.world import ROBOT_RADIUS

_TURN_ASIDE = 1e-4
"""A beam that meets a surface, and none when turned by so little (rad), only grazes it."""
_DIRECTIONS = (31, 1001)
"""In how many directions the farthest surface in a cone is looked for, at first, and where
that leaves a doubt: gaps of 2 mm at 4 m are missed."""
_SLACK = 0.01
"""How much farther a surface may be between two directions, as a share: at most 0.8 % on a
wall that is hit within 25° of its perpendicular."""
_REACH = 1.1
"""Surfaces this many times as far from the robot's middle as sonars reach are not heard."""
_ROUNDING = 1e-6
"""How far off the simulator's arithmetic may be (m)."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a step may show. The defaults are those of the default robot and its laser."""

    radius: float = ROBOT_RADIUS
    """Radius of the robot's body (m)."""
    overlap: float = 0.055
    """How deep the body may be in a wall (m). Chipmunk finds a contact only once bodies
    overlap: at the 1 m/s that actions ask for at most, 5 cm after one step of 0.05 s."""
    obstacle_overlap: float = 0.125
    """How deep the body may be in something that moves (m). Both come at each other: a robot
    at 1 m/s and a person at 1.4 m/s, 12 cm in one step of 0.05 s."""
    range_error: float = 0.04
    """Greatest error of a range (m): the outermost of the laser's 4096 errors of 1 cm
    standard deviation is 3.7 cm."""
    max_range: float = 30.0
    """Range shown where nothing came back (m)."""
    dropout: float = 0.001
    """Probability that a beam which meets a wall brings nothing back."""
    echo_noise: float = 0.005
    """Standard deviation of a sonar's range (m)…"""
    echo_share: float = 0.01
    """…and of a further error of it, as a share of the range."""
    echo_deviations: float = 3.7
    """Greatest error of a sonar's range, in standard deviations: the outermost of 4096."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, *vars(self))
        if self.dropout >= 1:
            raise InputError("Limits.dropout", "below 1", str(self.dropout))

    def echo_error(self, ranges: Ranges) -> Ranges:
        """Greatest error (m) of echoes from these distances (m)."""
        finite = np.where(np.isfinite(ranges), ranges, 0.0)
        return self.echo_deviations * np.hypot(self.echo_noise, self.echo_share * finite)

    def most_lost(self, beams: int) -> int:
        """How many of so many beams may be lost by chance: more is less likely than 1e-12."""
        odds = self.dropout / (1 - self.dropout)
        share = (1 - self.dropout) ** beams
        beyond, lost = 1 - share, 0
        while beyond > 1e-12 and lost < beams:
            share *= odds * (beams - lost) / (lost + 1)
            beyond, lost = beyond - share, lost + 1
        return lost


def check_observation(observation: Any, space: spaces.Space[Any]) -> list[str]:
    """The observation lies in its space."""
    wrong = [f"observation {line}" for line in _not_finite(observation)]
    if not wrong and not space.contains(observation):
        wrong.append("the observation lies outside its space")
    return wrong


def check_info(info: Mapping[str, Any], keys: frozenset[str]) -> list[str]:
    """The info is finite, and its keys are those of the reset (see `all_keys`)."""
    wrong = [f"info {line}" for line in _not_finite(info)]
    found = all_keys(info)
    wrong += [f"info lacks the key {key} of the reset" for key in sorted(keys - found)]
    wrong += [f"info has the key {key}, which the reset lacks" for key in sorted(found - keys)]
    return wrong


def all_keys(info: Mapping[str, Any]) -> frozenset[str]:
    """The keys of an info and of the mappings in it, as `reward_terms.room`."""
    inner = (
        f"{key}.{name}"
        for key, value in info.items()
        if isinstance(value, Mapping)
        for name in all_keys(value)
    )
    return frozenset((*info, *inner))


def check_reward(reward: Any, terms: Mapping[str, Any]) -> list[str]:
    """The reward is finite, and the sum of its terms."""
    number, total = float(reward), float(sum(terms.values()))
    if not np.isfinite(number):
        return [f"the reward is {number}"]
    if not np.isclose(number, total, rtol=1e-9, atol=1e-9):
        return [f"the reward is {number:.9g}, its terms add up to {total:.9g}"]
    return []


def check_body(walls: Segments, before: Point, after: Point, limits: Limits) -> list[str]:
    """The robot overlaps no wall by more than it may, and has crossed none.

    Args:
        walls: The walls.
        before: Where it was after the step before (m).
        after: Where it is (m).
        limits: Greatest errors and overlaps.
    """
    if not np.isfinite(after).all():
        return []  # There is no such place; the check of the info tells it.
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
    """The robot overlaps nothing that moves by more than it may.

    Args:
        obstacles: Outlines of what moves, where it is.
        place: Where the robot is (m).
        limits: Greatest errors and overlaps.
    """
    if not len(obstacles) or not np.isfinite(place).all():
        return []
    depth = float(limits.radius - wall_distances(obstacles, place).min())
    if depth <= limits.obstacle_overlap:
        return []
    return [f"stands {depth:.3f} m deep in something that moves, at {_position(place)}"]


def check_laser(
    surfaces: Segments, pose: Pose, bearings: Ranges, ranges: Ranges, limits: Limits
) -> list[str]:
    """Every range is the way to the nearest surface, but for its error and drop-outs.

    Args:
        surfaces: The walls, and what moves.
        pose: True pose of the laser (world frame).
        bearings: Where the beams point (rad).
        ranges: What the laser says (m); `limits.max_range` where nothing came back.
        limits: Greatest errors and overlaps.
    """
    if not np.isfinite(pose).all():
        return []  # There is no such place; the check of the info tells it.
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
    """The least and the most that beams may see: those that are off are turned a little."""
    least, most = ways.copy(), ways.copy()
    off = np.flatnonzero(~(np.abs(ranges - ways) <= limits.range_error))
    for turn in (-_TURN_ASIDE, _TURN_ASIDE) if len(off) else ():
        beside = ray_ranges(surfaces, pose, bearings[off] + turn)
        least[off], most[off] = np.minimum(least[off], beside), np.maximum(most[off], beside)
    return least, most


def check_sonar(surfaces: Segments, pose: Pose, scan: SonarScan, limits: Limits) -> list[str]:
    """Every echo comes from a surface that the sonar or a neighbour may hear, or from none.

    A sonar hears a surface that lies in its cone and is not hidden. So its echo is no nearer
    than the nearest surface in the cone, and no farther than the farthest that is to be seen in
    it. With cross-talk it may hear its neighbour's echo instead: half the way from the
    neighbour to a point that the neighbour's bounds hold for, and on to this sonar. By the
    triangle's inequality the way on is the way out, give or take the distance between both
    sonars; half the way is the neighbour's range, give or take half of it.

    Args:
        surfaces: The walls, and what moves (world frame).
        pose: True pose of the robot (world frame).
        scan: What the sonars say.
        limits: Greatest errors and overlaps.
    """
    if not np.isfinite(pose).all():
        return []  # There is no such place; the check of the info tells it.
    geometry, echoes = scan.geometry, scan.ranges
    near = surfaces[wall_distances(surfaces, pose[:2]) < _REACH * geometry.max_range]
    sonars = compose(pose, np.column_stack((np.array(geometry.places), geometry.bearings)))
    heard, half = np.flatnonzero(echoes < np.inf), geometry.cone / 2
    nearest = _with_neighbours(sonars, nearest_in_cones(near, sonars, half), -1.0)
    least = nearest - limits.echo_error(nearest) - _ROUNDING
    wrong = [
        f"sonar {k} hears {echoes[k]:.3f} m, nothing is before {nearest[k]:.3f} m"
        for k in heard[echoes[heard] < least[heard]].tolist()
    ]
    for directions in _DIRECTIONS:  # Most need not be looked at closely.
        farthest = _with_neighbours(sonars, _farthest_in_cones(near, sonars, half, directions), 1.0)
        most = np.maximum(farthest * (1 + _SLACK) + limits.echo_error(farthest), geometry.min_range)
        beyond = heard[echoes[heard] > np.minimum(most, geometry.max_range)[heard]]
        if not len(beyond):
            return wrong
    return wrong + [
        f"sonar {k} hears {echoes[k]:.3f} m, through a surface at {farthest[k]:.3f} m"
        for k in beyond.tolist()
    ]


def _with_neighbours(sonars: Poses, own: Ranges, sign: float) -> Ranges:
    """The bound of every sonar and its neighbours: the least with sign -1, the most with 1."""
    apart = np.hypot(*np.diff(sonars[:, :2], axis=0).T)
    bounds = sign * own
    bounds[:-1] = np.maximum(bounds[:-1], sign * own[1:] + apart / 2)
    bounds[1:] = np.maximum(bounds[1:], sign * own[:-1] + apart / 2)
    return sign * bounds


def _farthest_in_cones(
    surfaces: Segments, sonars: Poses, half_angle: float, directions: int
) -> Float64[np.ndarray, "sonars"]:
    """Distance (m) to the farthest surface to be seen in every cone, in so many directions."""
    bearings = np.linspace(-half_angle, half_angle, directions)
    return np.array([ray_ranges(surfaces, sonar, bearings).max() for sonar in sonars])


def _not_finite(value: Any, name: str = "") -> Iterator[str]:
    """What in a value, however nested, is not finite."""
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
