"""Split and merge over a journey, compiled (Schmidt, Wong and Yeap, sections 2.1 and 2.2).

A journey is a row of steps; a region is a run of them, from `first` to before `last`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.pose_kernels import length_of
from albot_core.kernels.compiled import kernel

_LEAST_AREA = 1e-6
"""A region whose ground is nothing but slivers has this area (m²), so that all have a width."""
_GAIN = 1e-9
"""A split point is shifted only for more than rounding errors."""


class Constants(NamedTuple):
    """The constants of equations (1) and (2); see `RegionConfig`."""

    threshold: float
    """θ_r."""
    weight: float
    """s_r = s · θ_r."""
    centre: float
    """n."""
    smallest_area: float
    """A_max (m²)."""
    shortest: float
    """Least length of a region (m)."""


class Journey(NamedTuple):
    """What the areas and the lengths of all regions of a journey are worked out from."""

    lines: np.ndarray
    """(steps, 4): where each step begins and ends (m)."""
    begins: np.ndarray
    """(steps,): whether a robot path begins with it."""
    starts: np.ndarray
    """(steps + 1,): where in `faces` those begin that each step covers."""
    faces: np.ndarray
    """(pairs,): the faces of the ground, by the steps that cover them."""
    areas: np.ndarray
    """(faces,): areas of the faces (m²)."""
    seen: np.ndarray
    """(faces + 1,) int64: in which sum each face was counted last; at the end the latest sum."""


@kernel(arrays=True)
def split_and_merge(journey: Journey, constants: Constants) -> np.ndarray:
    """The steps at which regions begin, and the number of all steps (regions + 1,)."""
    steps = journey.lines.shape[0]
    is_split = np.zeros(steps + 1, np.bool_)
    before, after = np.empty(steps), np.empty(steps)
    split(journey, constants, is_split, before, after)
    splits = np.flatnonzero(is_split)
    count = merge(journey, constants, splits, before, after)
    shift(journey, constants, splits[: count + 1], before, after)
    return splits[: count + 1].copy()


@kernel()
def homogeneity(
    area: float, length: float, other_area: float, other_length: float, constants: Constants
) -> float:
    """h(P_i, P_j) of equation (1): low where two regions are alike."""
    area, other_area = max(area, _LEAST_AREA), max(other_area, _LEAST_AREA)
    width = area / max(length, constants.shortest)
    other = other_area / max(other_length, constants.shortest)
    ratio = max(width, other) / min(width, other)
    return float(ratio + constants.weight * regularisation(min(area, other_area), constants))


@kernel()
def regularisation(smaller: float, constants: Constants) -> float:
    """r(P_i, P_j) of equation (2), from the smaller region's area: from -1 for small ones to 0."""
    ratio = smaller / constants.smallest_area - constants.centre
    # The sigmoid by tanh, which does not overflow.
    return 0.5 * (1.0 + math.tanh(0.5 * ratio)) - 1.0


@kernel()
def split(
    journey: Journey,
    constants: Constants,
    is_split: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> None:
    """Split each robot path where h is greatest, and its parts again, while it is above θ_r."""
    steps = journey.lines.shape[0]
    for step in range(steps):
        is_split[step] = journey.begins[step]
    is_split[0] = is_split[steps] = True
    first = 0
    while first < steps:
        last = first + 1
        while not is_split[last]:
            last += 1
        areas_from(journey, first, last, before)
        areas_until(journey, first, last, after)
        best, greatest = -1, constants.threshold
        for middle in range(first + 1, last):
            h = homogeneity(
                before[middle - 1],
                length(journey, first, middle),
                after[middle],
                length(journey, middle, last),
                constants,
            )
            if h > greatest:
                best, greatest = middle, h
        if best < 0:
            first = last
        else:
            is_split[best] = True


@kernel()
def merge(
    journey: Journey,
    constants: Constants,
    splits: np.ndarray,
    areas: np.ndarray,
    h: np.ndarray,
) -> int:
    """Merge the two neighbours that are most alike, while their h is not above θ_r.

    Returns how many regions are left. `areas` and `h` are room to work in.
    """
    count = int(splits.shape[0]) - 1
    for k in range(count):
        areas[k] = area_of(journey, splits[k], splits[k + 1])
    for k in range(count - 1):
        h[k] = compare(journey, constants, splits, areas, k)
    while count > 1:
        k = int(np.argmin(h[: count - 1]))
        if h[k] > constants.threshold:
            break
        areas[k] = area_of(journey, splits[k], splits[k + 2])
        for other in range(k + 1, count):
            splits[other] = splits[other + 1]
        count -= 1
        for other in range(k + 1, count):
            areas[other] = areas[other + 1]
        for other in range(k, count - 1):
            h[other] = h[other + 1]
        if k > 0:
            h[k - 1] = compare(journey, constants, splits, areas, k - 1)
        if k < count - 1:
            h[k] = compare(journey, constants, splits, areas, k)
    return count


@kernel()
def compare(
    journey: Journey, constants: Constants, splits: np.ndarray, areas: np.ndarray, k: int
) -> float:
    """H of region k and the one after it."""
    one = length(journey, splits[k], splits[k + 1])
    other = length(journey, splits[k + 1], splits[k + 2])
    return homogeneity(areas[k], one, areas[k + 1], other, constants)


@kernel()
def shift(
    journey: Journey,
    constants: Constants,
    splits: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> None:
    """Shift each split point to where the sum of h over all neighbours is greatest.

    The paper keeps the split that reduces the overall error. Regions are to differ, so the error is
    less where h is greater. The sum grows with each shift, so that there is an end.
    """
    moved = True
    while moved:
        moved = False
        for k in range(1, splits.shape[0] - 1):
            best = best_split(journey, constants, splits, k, before, after)
            if best != splits[k]:
                splits[k], moved = best, True


@kernel()
def best_split(
    journey: Journey,
    constants: Constants,
    splits: np.ndarray,
    k: int,
    before: np.ndarray,
    after: np.ndarray,
) -> int:
    """Where split point k had best be, between the two beside it."""
    first, last = splits[k - 1], splits[k + 1]
    has_earlier, has_later = k > 1, k + 2 < splits.shape[0]
    areas_from(journey, first, last, before)
    areas_until(journey, first, last, after)
    earlier = area_of(journey, splits[k - 2], first) if has_earlier else 0.0
    later = area_of(journey, last, splits[k + 2]) if has_later else 0.0
    here = int(splits[k])
    best, greatest, present = here, -np.inf, 0.0
    for middle in range(first + 1, last):
        area, other = before[middle - 1], after[middle]
        one, two = length(journey, first, middle), length(journey, middle, last)
        total = homogeneity(area, one, other, two, constants)
        if has_earlier:
            other_length = length(journey, splits[k - 2], first)
            total += homogeneity(earlier, other_length, area, one, constants)
        if has_later:
            other_length = length(journey, last, splits[k + 2])
            total += homogeneity(other, two, later, other_length, constants)
        if middle == here:
            present = total
        if total > greatest:
            best, greatest = middle, total
    return best if greatest > present + _GAIN else here


@kernel()
def length(journey: Journey, first: int, last: int) -> float:
    """The straight line from a region's entry to its exit (m)."""
    lines = journey.lines
    return length_of(lines[last - 1, 2] - lines[first, 0], lines[last - 1, 3] - lines[first, 1])


@kernel()
def areas_from(journey: Journey, first: int, last: int, areas: np.ndarray) -> None:
    """Set `areas[k]` to the area of the region from `first` to step k with it, for each k."""
    total, latest = 0.0, next_sum(journey)
    for step in range(first, last):
        total += not_counted(journey, step, latest)
        areas[step] = total


@kernel()
def areas_until(journey: Journey, first: int, last: int, areas: np.ndarray) -> None:
    """Set `areas[k]` to the area of the region from step k to before `last`, for each k."""
    total, latest = 0.0, next_sum(journey)
    for step in range(last - 1, first - 1, -1):
        total += not_counted(journey, step, latest)
        areas[step] = total


@kernel()
def area_of(journey: Journey, first: int, last: int) -> float:
    """The area of a region (m²)."""
    total, latest = 0.0, next_sum(journey)
    for step in range(first, last):
        total += not_counted(journey, step, latest)
    return total


@kernel()
def next_sum(journey: Journey) -> int:
    """The number of a sum over faces that begins now."""
    latest = int(journey.seen[-1]) + 1
    journey.seen[-1] = latest
    return latest


@kernel()
def not_counted(journey: Journey, step: int, latest: int) -> float:
    """The area of a step's faces that the latest sum has not counted yet, and counts now (m²)."""
    area = 0.0
    for pair in range(journey.starts[step], journey.starts[step + 1]):
        face = journey.faces[pair]
        if journey.seen[face] != latest:
            journey.seen[face] = latest
            area += journey.areas[face]
    return area
