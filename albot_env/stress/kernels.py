"""Compiled checks of many robots at once: they find the few that the exact checks must look at.

Everything is worked out by brute force over all surfaces, without the simulator's wall index, its
lists of visible walls, or its physics. A robot is a suspect if its step may be wrong; `checks`
then decides, and says what is wrong. Whatever `checks` finds wrong is a suspect here (tested).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.parts.scales import LogScale, unscaled

ROUNDING = 1e-9
"""What rounding may add to a distance (m): a robot that is nearer than this to a limit is a
suspect."""
DIRECTIONS = 31
"""Number of directions in which the farthest surface in a cone is searched."""
SHOWN_ERROR = 1e-3
"""Largest difference between a range and the same range in an observation (m)."""


class Surroundings(NamedTuple):
    """What stands around the robots of a batch (world frame, m)."""

    walls: np.ndarray
    """(n, 4) float64: the walls of all robots' worlds."""
    wall_rows: np.ndarray
    """(robots, 2) int64: first row and end row of each robot's walls."""
    opaque: np.ndarray
    """(n, 4) float64: the walls that stop light."""
    opaque_rows: np.ndarray
    """(robots, 2) int64: first row and end row of each robot's opaque walls."""
    outlines: np.ndarray
    """(n, 4) float64: the outlines of doors, boxes and people, in this order."""
    outline_rows: np.ndarray
    """(robots, 2) int64: first row and end row of each robot's outlines."""
    movables: np.ndarray
    """(robots, 3) int64: number of doors, boxes and people."""
    sides: int
    """Number of sides of a person's outline."""


class Motion(NamedTuple):
    """Where robots and obstacles were after the last step, and where they are."""

    before: np.ndarray
    """(robots, 2) float64: positions after the last step (m)."""
    poses: np.ndarray
    """(robots, 3) float64: present poses."""
    outlines: np.ndarray
    """(n, 4) float64: outlines after the last step, in the rows of `Surroundings.outlines`."""


class Scans(NamedTuple):
    """The lasers' ranges."""

    mount: tuple[float, float, float]
    """Pose of the lasers in the robots' frames."""
    directions: np.ndarray
    """(beams, 2) float64: unit vector of every beam in the laser's frame."""
    ranges: np.ndarray
    """(robots, beams) float64: ranges (m), infinite for no return; (robots, 0) without lasers."""
    shown: np.ndarray
    """(robots, length) float32: the observations."""
    first: int
    """Place of the ranges in an observation; -1 if it does not have them."""
    scale: LogScale
    """The scale of the observed ranges."""


class Echoes(NamedTuple):
    """The sonars' ranges."""

    mounts: np.ndarray
    """(sonars, 3) float64: pose of every sonar in the robots' frames."""
    half_angle: float
    """Angle (rad) from a cone's axis to its edge."""
    min_range: float
    """Nearest echo that is reported (m)."""
    max_range: float
    """Farthest echo that is reported (m)."""
    ranges: np.ndarray
    """(robots, sonars) float64: ranges (m), infinite for none; (robots, 0) without sonars."""


class Tolerances(NamedTuple):
    """The fields of `checks.Limits`, and what follows from them."""

    radius: float
    overlap: float
    obstacle_overlap: float
    box_overlap: float
    range_error: float
    max_range: float
    echo_noise: float
    echo_share: float
    echo_deviations: float
    reach: float
    """Distance from the robot's centre beyond which no surface is heard (m)."""
    slack: float
    """Relative allowance for a surface between two directions of a cone."""
    most_lost: np.ndarray
    """(beams + 1,) int64: how many of so many beams may be lost by chance."""


@kernel(arrays=True, nogil=True)
def find_suspects(
    turn: int,
    stride: int,
    surroundings: Surroundings,
    motion: Motion,
    truthful: np.ndarray,
    scans: Scans,
    echoes: Echoes,
    tolerances: Tolerances,
    suspect: np.ndarray,
) -> None:
    """Set `suspect` (robots,) for the robots whose step may be wrong; it is never unset.

    Of the beams, and of the sonars, of a `truthful` robot (robots,) every `stride`-th is compared
    with the surfaces: another one each `turn`.
    """
    robots = motion.poses.shape[0]
    most = 0
    for i in range(robots):
        walls = surroundings.wall_rows[i, 1] - surroundings.wall_rows[i, 0]
        outlines = surroundings.outline_rows[i, 1] - surroundings.outline_rows[i, 0]
        most = max(most, walls + outlines)
    near = np.empty((4, most))
    for i in range(robots):
        x, y, heading = motion.poses[i, 0], motion.poses[i, 1], motion.poses[i, 2]
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(heading)):
            suspect[i] = True
        if suspect[i]:
            continue
        suspect[i] = _body_is_suspect(i, surroundings, motion, tolerances) or _movables_are_suspect(
            i, surroundings, motion, tolerances
        )
        if truthful[i] and not suspect[i]:
            at = turn + i
            suspect[i] = _scan_is_suspect(
                i, at, stride, surroundings, motion, scans, tolerances, near
            ) or _echoes_are_suspect(i, at, stride, surroundings, motion, echoes, tolerances, near)


@kernel()
def _distance(surface: np.ndarray, x: float, y: float) -> float:
    """Return the distance (m) from a point to a surface (4,)."""
    ax, ay = surface[0] - x, surface[1] - y
    ux, uy = surface[2] - surface[0], surface[3] - surface[1]
    along = min(max(-(ax * ux + ay * uy) / (ux * ux + uy * uy), 0.0), 1.0)
    return length_of(ax + along * ux, ay + along * uy)


@kernel()
def _nearest(surfaces: np.ndarray, rows: np.ndarray, x: float, y: float) -> float:
    """Return the distance (m) from a point to the nearest of some surfaces."""
    nearest = np.inf
    for k in range(rows[0], rows[1]):
        nearest = min(nearest, _distance(surfaces[k], x, y))
    return nearest


@kernel()
def _body_is_suspect(
    i: int, surroundings: Surroundings, motion: Motion, tolerances: Tolerances
) -> bool:
    """Return whether the robot may be in a wall or an obstacle, or may have crossed a wall.

    A motion that is shorter than the distance from its end to the nearest wall crosses none.
    """
    x, y = motion.poses[i, 0], motion.poses[i, 1]
    wall = _nearest(surroundings.walls, surroundings.wall_rows[i], x, y)
    driven = length_of(x - motion.before[i, 0], y - motion.before[i, 1])
    if not driven < wall - ROUNDING:
        return True
    if tolerances.radius - wall > tolerances.overlap - ROUNDING:
        return True
    obstacle = _nearest(surroundings.outlines, surroundings.outline_rows[i], x, y)
    return tolerances.radius - obstacle > tolerances.obstacle_overlap - ROUNDING


@kernel()
def _movables_are_suspect(
    i: int, surroundings: Surroundings, motion: Motion, tolerances: Tolerances
) -> bool:
    """Return whether a box or a person may be in or behind a wall, or the robot within it."""
    doors, boxes, people = surroundings.movables[i]
    first = surroundings.outline_rows[i, 0] + doors
    for k in range(boxes):
        if _polygon_is_suspect(i, first + 4 * k, 4, surroundings, motion, tolerances):
            return True
    first += 4 * boxes
    sides = surroundings.sides
    for k in range(people):
        if _polygon_is_suspect(i, first + sides * k, sides, surroundings, motion, tolerances):
            return True
    return False


@kernel()
def _polygon_is_suspect(
    i: int,
    first: int,
    sides: int,
    surroundings: Surroundings,
    motion: Motion,
    tolerances: Tolerances,
) -> bool:
    """Return whether a convex outline may be in or behind a wall, or the robot's centre within it.

    A wall that is deep in the outline comes nearer to its centre than the farthest corner.
    """
    x = y = old_x = old_y = 0.0
    for k in range(first, first + sides):
        x, y = x + surroundings.outlines[k, 0] / sides, y + surroundings.outlines[k, 1] / sides
        old_x, old_y = old_x + motion.outlines[k, 0] / sides, old_y + motion.outlines[k, 1] / sides
    farthest = 0.0
    for k in range(first, first + sides):
        corner = surroundings.outlines[k]
        farthest = max(farthest, length_of(corner[0] - x, corner[1] - y))
    moved = length_of(x - old_x, y - old_y)
    corners = surroundings.outlines[first : first + sides]
    if _is_within(corners, motion.poses[i, 0], motion.poses[i, 1]):
        return True
    for k in range(surroundings.wall_rows[i, 0], surroundings.wall_rows[i, 1]):
        distance = _distance(surroundings.walls[k], x, y)
        if not moved < distance - ROUNDING:
            return True
        if distance < farthest + ROUNDING and _is_deep(
            surroundings.walls[k], corners, tolerances.box_overlap - ROUNDING
        ):
            return True
    return False


@kernel()
def _is_within(sides: np.ndarray, x: float, y: float) -> bool:
    """Return whether a point is within a convex polygon with counter-clockwise sides (n, 4)."""
    for k in range(sides.shape[0]):
        ux, uy = sides[k, 2] - sides[k, 0], sides[k, 3] - sides[k, 1]
        if ux * (y - sides[k, 1]) - uy * (x - sides[k, 0]) < -ROUNDING:
            return False
    return True


@kernel()
def _is_deep(wall: np.ndarray, sides: np.ndarray, depth: float) -> bool:
    """Return whether a wall comes deeper than `depth` (m) into a convex polygon.

    Of the wall, what is not so far inside is cut off by one side after the other.

    Args:
        wall: The wall (4,).
        sides: The polygon's sides (n, 4), counter-clockwise.
        depth: The depth (m).
    """
    begin, end = 0.0, 1.0
    for k in range(sides.shape[0]):
        ux, uy = sides[k, 2] - sides[k, 0], sides[k, 3] - sides[k, 1]
        length = length_of(ux, uy)
        start = (ux * (wall[1] - sides[k, 1]) - uy * (wall[0] - sides[k, 0])) / length - depth
        stop = (ux * (wall[3] - sides[k, 1]) - uy * (wall[2] - sides[k, 0])) / length - depth
        if start < 0 and stop < 0:
            return False
        if start < 0:
            begin = max(begin, start / (start - stop))
        elif stop < 0:
            end = min(end, start / (start - stop))
    return begin <= end


@kernel()
def _gather(
    surfaces: np.ndarray, first: int, end: int, x: float, y: float, near: np.ndarray, count: int
) -> int:
    """Append surfaces, as seen from a point, to the columns of `near` (4, n); return the number."""
    for k in range(first, end):
        near[0, count], near[1, count] = surfaces[k, 0] - x, surfaces[k, 1] - y
        near[2, count], near[3, count] = surfaces[k, 2] - x, surfaces[k, 3] - y
        count += 1
    return count


@kernel()
def _cast(near: np.ndarray, count: int, dx: float, dy: float) -> float:
    """Return the distance (m) along a direction to the nearest of `near`; infinite for none.

    The ends of a surface lie on two sides of the ray that meets it: d × a and d × b differ in
    sign. The ray meets it at the distance a × b / (d × b - d × a).
    """
    nearest = np.inf
    for k in range(count):
        of_start = dx * near[1, k] - dy * near[0, k]
        of_end = dx * near[3, k] - dy * near[2, k]
        if of_start * of_end <= 0.0:
            cross = near[0, k] * near[3, k] - near[1, k] * near[2, k]
            distance = cross / (of_end - of_start)
            if 0.0 <= distance < nearest:
                nearest = distance
    return nearest


@kernel()
def _scan_is_suspect(
    i: int,
    turn: int,
    stride: int,
    surroundings: Surroundings,
    motion: Motion,
    scans: Scans,
    tolerances: Tolerances,
    near: np.ndarray,
) -> bool:
    """Return whether a range may not be that of the nearest surface, or too many may be lost."""
    beams = scans.ranges.shape[1]
    if beams == 0:
        return False
    x, y, heading = motion.poses[i, 0], motion.poses[i, 1], motion.poses[i, 2]
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = (
        x + cos * scans.mount[0] - sin * scans.mount[1],
        y + sin * scans.mount[0] + cos * scans.mount[1],
    )
    cos, sin = math.cos(heading + scans.mount[2]), math.sin(heading + scans.mount[2])
    walls, outlines = surroundings.opaque_rows[i], surroundings.outline_rows[i]
    count = _gather(surroundings.opaque, walls[0], walls[1], x, y, near, 0)
    count = _gather(surroundings.outlines, outlines[0], outlines[1], x, y, near, count)
    silent_from = tolerances.max_range * (1 - 1e-6)
    in_reach = lost = 0
    for beam in range(turn % stride, beams, stride):
        u, v = scans.directions[beam, 0], scans.directions[beam, 1]
        distance = _cast(near, count, cos * u - sin * v, sin * u + cos * v)
        said = scans.ranges[i, beam]
        if scans.first >= 0:
            shown = unscaled(-np.float64(scans.shown[i, scans.first + beam]), scans.scale)
            if not abs(shown - min(said, scans.scale.longest)) < SHOWN_ERROR:
                return True
        is_silent = said >= silent_from
        if distance < tolerances.max_range - tolerances.range_error + ROUNDING:
            in_reach += 1
            lost += is_silent
        if not is_silent and not abs(said - distance) < tolerances.range_error - ROUNDING:
            return True
    # With grazing beams, one less may be in reach.
    return lost > 0 and lost >= tolerances.most_lost[in_reach]


@kernel()
def _echoes_are_suspect(
    i: int,
    turn: int,
    stride: int,
    surroundings: Surroundings,
    motion: Motion,
    echoes: Echoes,
    tolerances: Tolerances,
    near: np.ndarray,
) -> bool:
    """Return whether an echo may come from nearer, or from farther, than any surface."""
    sonars = echoes.ranges.shape[1]
    if sonars == 0:
        return False
    pose, reach = motion.poses[i], tolerances.reach + ROUNDING
    count = 0
    for k in range(surroundings.wall_rows[i, 0], surroundings.wall_rows[i, 1]):
        if _distance(surroundings.walls[k], pose[0], pose[1]) < reach:
            count = _gather(surroundings.walls, k, k + 1, pose[0], pose[1], near, count)
    for k in range(surroundings.outline_rows[i, 0], surroundings.outline_rows[i, 1]):
        if _distance(surroundings.outlines[k], pose[0], pose[1]) < reach:
            count = _gather(surroundings.outlines, k, k + 1, pose[0], pose[1], near, count)
    stride = min(stride, sonars)
    for sonar in range(turn % stride, sonars, stride):
        said = echoes.ranges[i, sonar]
        if said < np.inf and (
            not echoes.min_range <= said <= echoes.max_range
            or _is_too_near(sonar, said, pose[2], echoes, tolerances, near, count)
            or not _is_heard(sonar, said, pose[2], echoes, tolerances, near, count)
        ):
            return True
    return False


@kernel()
def _is_too_near(
    sonar: int,
    said: float,
    heading: float,
    echoes: Echoes,
    tolerances: Tolerances,
    near: np.ndarray,
    count: int,
) -> bool:
    """Return whether an echo may be nearer than all surfaces that the sonar or a neighbour hears.

    A neighbour's echo may be nearer by half the distance between both (see `checks.check_sonar`).
    """
    cos, sin = math.cos(heading), math.sin(heading)
    own, nearest = echoes.mounts[sonar], np.inf
    for other in range(max(sonar - 1, 0), min(sonar + 2, echoes.mounts.shape[0])):
        x, y, bearing = echoes.mounts[other]
        apart = length_of(x - own[0], y - own[1])
        at_x, at_y = cos * x - sin * y, sin * x + cos * y
        bound = _nearest_in_cone(near, count, at_x, at_y, heading + bearing, echoes.half_angle)
        nearest = min(nearest, bound - apart / 2)
    return said < nearest - _echo_error(nearest, tolerances) - ROUNDING


@kernel()
def _is_heard(
    sonar: int,
    said: float,
    heading: float,
    echoes: Echoes,
    tolerances: Tolerances,
    near: np.ndarray,
    count: int,
) -> bool:
    """Return whether the nearest surface in some direction is as far as an echo.

    The directions are those of the sonar's cone and its neighbours'; for a neighbour, half the
    distance between both is added.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    own = echoes.mounts[sonar]
    for other in range(max(sonar - 1, 0), min(sonar + 2, echoes.mounts.shape[0])):
        x, y, bearing = echoes.mounts[other]
        apart = length_of(x - own[0], y - own[1])
        at_x, at_y = cos * x - sin * y, sin * x + cos * y
        for k in range(DIRECTIONS):
            share = 2.0 * k / (DIRECTIONS - 1) - 1.0
            angle = heading + bearing + echoes.half_angle * share
            dx, dy = math.cos(angle), math.sin(angle)
            farthest = _cast_from(near, count, at_x, at_y, dx, dy) + apart / 2
            most = farthest * (1 + tolerances.slack) + _echo_error(farthest, tolerances)
            if said < most - ROUNDING:
                return True
    return said < echoes.min_range + ROUNDING


@kernel()
def _echo_error(distance: float, tolerances: Tolerances) -> float:
    """Return the maximum error (m) of an echo from a distance (m); see `Limits.echo_error`."""
    share = tolerances.echo_share * distance if distance < np.inf else 0.0
    return tolerances.echo_deviations * length_of(tolerances.echo_noise, share)


@kernel()
def _cast_from(near: np.ndarray, count: int, x: float, y: float, dx: float, dy: float) -> float:
    """Return the distance (m) from x, y along a direction to the nearest of `near`."""
    nearest = np.inf
    for k in range(count):
        ax, ay, bx, by = near[0, k] - x, near[1, k] - y, near[2, k] - x, near[3, k] - y
        of_start, of_end = dx * ay - dy * ax, dx * by - dy * bx
        if of_start * of_end <= 0.0:
            distance = (ax * by - ay * bx) / (of_end - of_start)
            if 0.0 <= distance < nearest:
                nearest = distance
    return nearest


@kernel()
def _nearest_in_cone(
    near: np.ndarray, count: int, x: float, y: float, axis: float, half_angle: float
) -> float:
    """Return the distance (m) from x, y to the nearest part of `near` in a cone; or infinity.

    The cone is where sin h · u ± cos h · v >= 0, with u ahead and v to the left. Along a surface
    both are linear, and the share of its length inside runs from `first` to `last`.
    """
    cos, sin = math.cos(axis), math.sin(axis)
    wide, narrow = math.sin(half_angle), math.cos(half_angle)
    nearest = np.inf
    for k in range(count):
        ax, ay, bx, by = near[0, k] - x, near[1, k] - y, near[2, k] - x, near[3, k] - y
        u, v = cos * ax + sin * ay, cos * ay - sin * ax
        du, dv = cos * bx + sin * by - u, cos * by - sin * bx - v
        first, last = 0.0, 1.0
        for side in (-1.0, 1.0):
            height, slope = wide * u + side * narrow * v, wide * du + side * narrow * dv
            if slope > 0:
                first = max(first, -height / slope)
            elif slope < 0:
                last = min(last, -height / slope)
            elif height < 0:
                last = -1.0
        if first <= last:
            along = min(max(-(u * du + v * dv) / (du * du + dv * dv), first), last)
            nearest = min(nearest, length_of(u + along * du, v + along * dv))
    return nearest
