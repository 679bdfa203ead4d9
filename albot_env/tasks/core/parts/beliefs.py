"""The parts that come from what the mapper believes, and from the time that is left."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from albot_core.geometry.pose_kernels import length_of, rotate_back, wrap_angle
from albot_core.geometry.types import Points
from albot_core.kernels.compiled import kernel
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL
from albot_env.tasks.core.parts.part import Need, ObservationPart, Sources
from albot_env.tasks.core.parts.scales import LogScale, Scales, scaled, unscaled

Numbers = Float[np.ndarray, "numbers"]


def towards(numbers: Numbers, scales: Scales) -> Points:
    """Return the point in a direction (cosine, sine), at a distance (m, robot's frame)."""
    distance = float(unscaled(float(numbers[2]), scales.home))
    return np.asarray(distance * np.asarray(numbers[:2], np.float64))


def all_towards(rows: Float[np.ndarray, "n 3"], scales: Scales) -> Points:
    """Return the points (n, 2) in some directions, at some distances (m, robot's frame)."""
    return np.reshape([towards(row, scales) for row in rows], (-1, 2)).astype(np.float64)


def point_ahead(numbers: Numbers, scales: Scales) -> Points | None:
    """Return the point ahead on a way (m, robot's frame); None if there is no way."""
    return towards(numbers, scales) if numbers[3] > 0 else None


@kernel()
def locate_home(
    belief: np.ndarray, turn: tuple[float, float], where: np.ndarray, home: np.ndarray
) -> None:
    """Write home's pose x, y, heading (3,) relative to a belief; `where` is its map-frame pose.

    `turn` is the cosine and sine of the believed heading.
    """
    cos, sin = turn
    east, north = where[0] - belief[0], where[1] - belief[1]
    home[0], home[1] = rotate_back(cos, sin, east, north)
    home[2] = wrap_angle(where[2] - belief[2])


@kernel()
def observe_point(ahead: float, left: float, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (3,) with direction (cosine, sine) and distance of a point (m, robot's frame)."""
    distance = length_of(ahead, left)
    row[0], row[1] = 1.0, 0.0
    if distance > 0.0:
        row[0] = min(max(ahead / distance, -1.0), 1.0)
        row[1] = min(max(left / distance, -1.0), 1.0)
    row[2] = scaled(distance, scale)


@kernel()
def direct(east: float, north: float, cos: float, sin: float, row: np.ndarray) -> None:
    """Write the direction of a map-frame vector relative to a heading."""
    length = max(length_of(east, north), 1e-9)
    ahead, left = rotate_back(cos, sin, east, north)
    row[0] = min(max(ahead / length, -1.0), 1.0)
    row[1] = min(max(left / length, -1.0), 1.0)


# Heading


def _decode_heading(numbers: Numbers, _: Scales) -> float:
    """Return the believed heading, relative to the start heading (rad)."""
    return math.atan2(numbers[1], numbers[0])


HEADING = ObservationPart(
    name="heading",
    numbers="2",
    meaning="cosine and sine of the believed heading, relative to the start heading",
    shape=lambda _: (2,),
    decode=_decode_heading,
)


@kernel()
def fill_heading(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in robot i's believed heading."""
    home = sources.state.homes_in_robot[i]
    row[0], row[1] = math.cos(home[2]), -math.sin(home[2])


# Home


HOME = ObservationPart(
    name="home",
    numbers="3",
    meaning="believed direction of home (cosine, sine) and its distance",
    shape=lambda _: (3,),
    decode=towards,
)


@kernel()
def fill_home(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in where robot i believes home."""
    observe_home(sources.state.homes_in_robot[i], sources.scales.home, row)


@kernel()
def observe_home(home: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (3,) with the part home: direction and distance of home (robot frame)."""
    observe_point(home[0], home[1], scale, row)


# Confidence


def _decode_confidence(numbers: Numbers, scales: Scales) -> float:
    """Return the travel that the belief in home rests on (m); infinite at -1."""
    outside = max((1.0 - float(numbers[0])) / 2, 1e-9)
    deviations = math.sqrt(max(-2 * math.log(outside), 1e-12))
    return scales.home_near / scales.home_drift / deviations


CONFIDENCE = ObservationPart(
    name="confidence",
    numbers="1",
    meaning=(
        "in homing, and with `hints=True`; elsewhere on request: confidence in `home`, from 1 to "
        "-1, and -1 if the mapper is lost. It is the probability, scaled to [-1, 1], that "
        "home is within 1 m of its believed position (`home_near`) if the standard deviation of "
        "the belief is 5 % of the travel that it rests on (`home_drift`)"
    ),
    shape=lambda _: (1,),
    needs=frozenset((Need.WAY_HOME,)),
    decode=_decode_confidence,
)


@kernel()
def fill_confidence(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in how sure robot i is of home."""
    scales = sources.scales
    travel = sources.state.ways_home[i, TRAVEL]
    row[0] = observe_confidence(travel, scales.home_drift, scales.home_near)


@kernel()
def observe_confidence(travel: float, drift: float, near: float) -> float:
    """Return the part confidence: from 1 if home is certain to -1.

    It is the probability that a point drawn from a normal distribution in the plane, of standard
    deviation σ = drift × `travel` (m) along each axis, is within r = `near` (m) of the mean:
    1 - exp(-r² / 2σ²), scaled to [-1, 1].
    """
    deviation = drift * travel
    return 1.0 - 2.0 * math.exp(-0.5 * (near / max(deviation, 1e-9)) ** 2)


# Place


class PlaceBelief(NamedTuple):
    """What the mapper believes of the place around the robot."""

    is_recognised: bool
    """Whether it knows the place from before."""
    is_lost: bool
    """Whether it does not know where the robot is."""


def _decode_place(numbers: Numbers, _: Scales) -> PlaceBelief:
    return PlaceBelief(bool(numbers[0] > 0), bool(numbers[1] > 0))


PLACE = ObservationPart(
    name="place",
    numbers="2",
    meaning=(
        "whether the robot is in a place that it knows from before; whether it is lost (1 or -1)"
    ),
    shape=lambda _: (2,),
    decode=_decode_place,
)


@kernel()
def fill_place(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in whether robot i knows the place, and whether it is lost."""
    row[0] = 1.0 if sources.state.is_recognised[i] else -1.0
    row[1] = 1.0 if sources.state.is_lost[i] else -1.0


# Exit


def _decode_exit(numbers: Numbers, scales: Scales) -> Points | None:
    """Return the next exit on the way home (m, robot's frame); None if there is none."""
    return towards(numbers, scales) if numbers[5] > 0 else None


EXIT_HOME = ObservationPart(
    name="exit",
    numbers="6",
    meaning=(
        "in homing, and with `hints=True`; in exploring on request: direction and distance "
        "of the next exit on the way home over the network of places, the direction in which to "
        "pass it, and 1; without an exit ahead, or near home, 0, 0, -1, 0, 0, -1"
    ),
    shape=lambda _: (6,),
    needs=frozenset((Need.WAY_HOME,)),
    decode=_decode_exit,
)


@kernel()
def fill_exit(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in robot i's next exit on the way home."""
    state = sources.state
    observe_exit(state.beliefs[i], state.ways_home[i][EXIT], sources.scales.home, row)


@kernel()
def observe_exit(belief: np.ndarray, line: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (6,) with the part exit.

    `line` (4,) is the next exit home (map frame), with the present place to its left; NaN for
    none. `scale` is that of home's distance.
    """
    for k in range(6):
        row[k] = 0.0
    row[2] = row[5] = -1.0
    if math.isnan(line[0]):
        return
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east = 0.5 * (line[0] + line[2]) - belief[0]
    north = 0.5 * (line[1] + line[3]) - belief[1]
    row[2] = scaled(length_of(east, north), scale)
    direct(east, north, cos, sin, row)
    direct(line[3] - line[1], line[0] - line[2], cos, sin, row[3:])
    row[5] = 1.0


# Way


WAY = ObservationPart(
    name="way",
    numbers="4",
    meaning=(
        "the same: direction and distance of a point some two metres ahead on the remembered way"
        " home, and 1; without a way 0, 0, -1, -1"
    ),
    shape=lambda _: (4,),
    needs=frozenset((Need.WAY_HOME,)),
    decode=point_ahead,
)


@kernel()
def fill_way(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the point ahead on robot i's remembered way home."""
    state = sources.state
    observe_way(state.beliefs[i], state.ways_home[i][POINT], sources.scales.home, row)


@kernel()
def observe_way(belief: np.ndarray, point: np.ndarray, scale: LogScale, row: np.ndarray) -> None:
    """Fill `row` (4,) with the part way.

    `point` (2,) is a point ahead on a way (map frame); NaN for none. `scale` is that of home's
    distance.
    """
    row[0] = row[1] = 0.0
    row[2] = row[3] = -1.0
    if math.isnan(point[0]):
        return
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    east, north = point[0] - belief[0], point[1] - belief[1]
    row[2] = scaled(length_of(east, north), scale)
    direct(east, north, cos, sin, row)
    row[3] = 1.0


# Time left


def _decode_time_left(numbers: Numbers, scales: Scales) -> float:
    """Return the time left (s), at most the scale's longest."""
    return float(unscaled(float(numbers[0]), scales.time))


TIME_LEFT = ObservationPart(
    name="time_left",
    numbers="1",
    meaning=(
        "`Albot/ExploreAndHome-v1` only: remaining time, 1 at ten minutes and more, -1 when it "
        "is up, logarithmic in between"
    ),
    shape=lambda _: (1,),
    needs=frozenset((Need.TIME_BUDGET,)),
    decode=_decode_time_left,
)


@kernel()
def fill_time_left(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in robot i's time left."""
    row[0] = observe_time(sources.state.time_left[i], sources.scales.time)


@kernel()
def observe_time(left: float, scale: LogScale) -> float:
    """Return the time left (s) as a number from -1 (none) to 1 (the scale's longest, or more)."""
    return scaled(max(left, 0.0), scale)
