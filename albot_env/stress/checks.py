"""What is wrong after a step: each check is a function of numbers, and says it in a line.

An empty list says that nothing is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from albot_core.geometry.types import Pose, Ranges, Segments
from albot_env.stress.geometry import Point, free_ways, wall_distances, walls_crossed
from albot_env.stress.limits import Limits

_SIDEWAYS = 1e-4
"""A beam that meets a surface, and none when turned by so little (rad), only grazes it."""


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
        limits: What may be.
    """
    if not np.isfinite(after).all():
        return []  # There is no such place; the check of the info tells it.
    wrong = [
        f"went through {_named(walls, wall)}, from {_spot(before)} to {_spot(after)}"
        for wall in np.flatnonzero(walls_crossed(walls, before, after)).tolist()
    ]
    depths = limits.radius - wall_distances(walls, after)
    deepest = int(depths.argmax())
    if depths[deepest] > limits.overlap:
        wall = _named(walls, deepest)
        wrong.append(f"stands {depths[deepest]:.3f} m deep in {wall}, at {_spot(after)}")
    return wrong


def check_things(things: Segments, place: Point, limits: Limits) -> list[str]:
    """The robot overlaps nothing that moves by more than it may.

    Args:
        things: Outlines of what moves, where it is.
        place: Where the robot is (m).
        limits: What may be.
    """
    if not len(things) or not np.isfinite(place).all():
        return []
    depth = float(limits.radius - wall_distances(things, place).min())
    if depth <= limits.thing_overlap:
        return []
    return [f"stands {depth:.3f} m deep in something that moves, at {_spot(place)}"]


def check_laser(
    surfaces: Segments, pose: Pose, bearings: Ranges, ranges: Ranges, limits: Limits
) -> list[str]:
    """Every range is the way to the nearest surface, but for its error and drop-outs.

    Args:
        surfaces: The walls, and what moves.
        pose: True pose of the laser (world frame).
        bearings: Where the beams point (rad).
        ranges: What the laser says (m); `limits.max_range` where nothing came back.
        limits: What may be.
    """
    if not np.isfinite(pose).all():
        return []  # There is no such place; the check of the info tells it.
    ways = free_ways(surfaces, pose, bearings)
    silent = ranges >= limits.max_range * (1 - 1e-6)
    least, most = _ways_beside(surfaces, pose, bearings, ranges, ways, limits)
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


def _ways_beside(
    surfaces: Segments,
    pose: Pose,
    bearings: Ranges,
    ranges: Ranges,
    ways: Ranges,
    limits: Limits,
) -> tuple[Ranges, Ranges]:
    """The least and the most that beams may see: those that are off are turned a little."""
    least, most = ways.copy(), ways.copy()
    off = np.flatnonzero(~(np.abs(ranges - ways) <= limits.range_error))
    for turn in (-_SIDEWAYS, _SIDEWAYS) if len(off) else ():
        beside = free_ways(surfaces, pose, bearings[off] + turn)
        least[off], most[off] = np.minimum(least[off], beside), np.maximum(most[off], beside)
    return least, most


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


def _spot(point: Point) -> str:
    return f"({point[0]:.3f}, {point[1]:.3f})"
