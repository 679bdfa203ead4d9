"""Split and merge over a journey, compiled (Schmidt, Wong and Yeap, sections 2.1 and 2.2).

A journey is a row of steps; a region is a run of them, from `first` to before `last`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

_ROUNDING = 1e-9
"""Values of h that differ by less are equal: of equal splits and merges the first one counts,
however the journey's frame lies."""


_CORRIDOR = 3.0
"""A region is a corridor if it is more than so many times as long as wide…"""
_STRAIGHT = 0.9
"""…and its exits are at least this share of the way between them apart."""


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
    bends: bool
    """Whether corridors are parted where they bend."""


class Journey(NamedTuple):
    """What the areas and the lengths of all regions of a journey are worked out from."""

    ways: np.ndarray
    """(steps, 2): from where each step begins to where it ends (m)."""
    lengths: np.ndarray
    """(steps,): how long each is (m)."""
    widths: np.ndarray
    """(steps,): how wide the ground beside it is (m)."""
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
    steps = journey.lengths.shape[0]
    is_split = np.zeros(steps + 1, np.bool_)
    before, after, residuals = np.empty((5, steps)), np.empty((5, steps)), np.empty(steps)
    split(journey, constants, is_split, before, after)
    splits = np.flatnonzero(is_split)
    count = merge(journey, constants, splits, before, after, residuals)
    shift(journey, constants, splits[: count + 1], before, after)
    return splits[: count + 1].copy()


@kernel()
def homogeneity(
    before: np.ndarray, one: int, after: np.ndarray, other: int, constants: Constants
) -> float:
    """h(P_i, P_j) of equation (1), or what their bend says: low where two regions are alike.

    Args:
        before: Measures of regions (see `measure_from`).
        one: Which of these is P_i.
        after: Likewise.
        other: Which of these is P_j.
        constants: The constants of the equations.
    """
    width, other_width = before[1, one], after[1, other]
    ratio = max(width, other_width) / min(width, other_width)
    ratio = max(ratio, bend(before, one, after, other, constants))
    smaller = min(before[0, one], after[0, other])
    return float(ratio + constants.weight * regularisation(smaller, constants))


@kernel()
def bend(
    before: np.ndarray, one: int, after: np.ndarray, other: int, constants: Constants
) -> float:
    """How sharply one corridor bends into another: 1 straight on, 2 at a right angle.

    It is 1 where one of the two is no corridor. The paper names the overall direction beside the
    width ("a corridor is separated from another one by a sharp bend in the wall"), and has no
    equation for it: a right angle counting as much as twice the width is ours.
    """
    if not (constants.bends and is_corridor(before, one) and is_corridor(after, other)):
        return 1.0
    x, y, u, v = before[2, one], before[3, one], after[2, other], after[3, other]
    return float(1.0 + abs(math.atan2(x * v - y * u, x * u + y * v)) / (0.5 * math.pi))


@kernel()
def is_corridor(measured: np.ndarray, k: int) -> bool:
    """Whether a measured region is long, narrow and straight."""
    straight = math.hypot(measured[2, k], measured[3, k])
    return bool(straight > _CORRIDOR * measured[1, k] and straight > _STRAIGHT * measured[4, k])


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
    steps = journey.lengths.shape[0]
    for step in range(steps):
        is_split[step] = journey.begins[step]
    is_split[0] = is_split[steps] = True
    first = 0
    while first < steps:
        last = first + 1
        while not is_split[last]:
            last += 1
        best, greatest = residual(journey, constants, first, last, before, after)
        if greatest > constants.threshold:
            is_split[best] = True
        else:
            first = last


@kernel()
def merge(
    journey: Journey,
    constants: Constants,
    splits: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    residuals: np.ndarray,
) -> int:
    """Merge the two neighbours that make the most homogeneous region, while it is not above θ_r.

    Returns how many regions are left.
    """
    count = int(splits.shape[0]) - 1
    for k in range(count - 1):
        residuals[k] = residual(journey, constants, splits[k], splits[k + 2], before, after)[1]
    while count > 1:
        k = 0
        for other in range(1, count - 1):
            if residuals[other] < residuals[k] - _ROUNDING:
                k = other
        if residuals[k] > constants.threshold:
            break
        for other in range(k + 1, count):
            splits[other] = splits[other + 1]
        count -= 1
        for other in range(k, count - 1):
            residuals[other] = residuals[other + 1]
        for other in range(max(k - 1, 0), min(k + 1, count - 1)):
            first, last = splits[other], splits[other + 2]
            residuals[other] = residual(journey, constants, first, last, before, after)[1]
    return count


@kernel()
def residual(
    journey: Journey,
    constants: Constants,
    first: int,
    last: int,
    before: np.ndarray,
    after: np.ndarray,
) -> tuple[int, float]:
    """Where two parts of a region are most unlike each other, and their h; 0 of a single step."""
    measure_from(journey, first, last, before)
    measure_until(journey, first, last, after)
    best, greatest = first, 0.0
    for middle in range(first + 1, last):
        h = homogeneity(before, middle - 1, after, middle, constants)
        if h > greatest + _ROUNDING:
            best, greatest = middle, h
    return best, greatest


@kernel()
def shift(
    journey: Journey,
    constants: Constants,
    splits: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> None:
    """Shift each split point to where the overall error is least.

    It is the squared error (as usual, says the paper) with which the average widths of the two
    regions stand for the widths of their steps. As in h ratios count, so that widths are compared
    by their logarithms. The sum over all regions falls with each shift, so that there is an end.

    A split point stays where it is if one of the regions would have to be split again: else one
    that parts a doorway from a room may leave for the end of a corridor far away, which was merged
    with that room, and the doorway would be part of the room.
    """
    moved = True
    while moved:
        moved = False
        for k in range(1, splits.shape[0] - 1):
            first, last = splits[k - 1], splits[k + 1]
            measure_from(journey, first, last, before)
            measure_until(journey, first, last, after)
            best = sharpest_bend(first, splits[k], last, before, after)
            if bend(before, best - 1, after, best, constants) <= constants.threshold:
                best = best_split(journey, first, splits[k], last)
            if best == splits[k]:
                continue
            h = residual(journey, constants, first, best, before, after)[1]
            h = max(h, residual(journey, constants, best, last, before, after)[1])
            if h <= constants.threshold:
                splits[k], moved = best, True


@kernel()
def best_split(journey: Journey, first: int, here: int, last: int) -> int:
    """Where the split point of two neighbours had best be; here, unless another is better."""
    whole = rest = 0.0
    for step in range(first, last):
        whole += journey.lengths[step]
        rest += journey.lengths[step] * math.log(journey.widths[step])
    # The squares of the values themselves add up to the same, wherever they are split: the error is
    # least where the squares of the means are greatest.
    length = summed = present = 0.0
    best, greatest = here, -np.inf
    for middle in range(first + 1, last):
        length += journey.lengths[middle - 1]
        summed += journey.lengths[middle - 1] * math.log(journey.widths[middle - 1])
        explained = summed**2 / length + (rest - summed) ** 2 / (whole - length)
        if middle == here:
            present = explained
        if explained > greatest + _ROUNDING:
            best, greatest = middle, explained
    return best if greatest > present + _ROUNDING else here


@kernel()
def sharpest_bend(first: int, here: int, last: int, before: np.ndarray, after: np.ndarray) -> int:
    """Where the split point of two corridors had best be: where both are straightest."""
    best, greatest = here, -np.inf
    for middle in range(first + 1, last):
        straight = math.hypot(before[2, middle - 1], before[3, middle - 1])
        straight += math.hypot(after[2, middle], after[3, middle])
        if straight > greatest + _ROUNDING:
            best, greatest = middle, straight
    return best


@kernel()
def measure_from(journey: Journey, first: int, last: int, measured: np.ndarray) -> None:
    """Set `measured[:, k]` to the measures of the region from `first` to step k.

    They are its area (m²), its average width (m), the line from its entry to its exit (m, m), and
    how long its way is (m).
    """
    area, length, swaths, latest = 0.0, 0.0, 0.0, next_sum(journey)
    east = north = 0.0
    for step in range(first, last):
        area += not_counted(journey, step, latest)
        length += journey.lengths[step]
        swaths += journey.lengths[step] * journey.widths[step]
        east += journey.ways[step, 0]
        north += journey.ways[step, 1]
        measured[0, step], measured[1, step] = area, swaths / length
        measured[2, step], measured[3, step], measured[4, step] = east, north, length


@kernel()
def measure_until(journey: Journey, first: int, last: int, measured: np.ndarray) -> None:
    """Set `measured[:, k]` to the measures of the region from step k to before `last`."""
    area, length, swaths, latest = 0.0, 0.0, 0.0, next_sum(journey)
    east = north = 0.0
    for step in range(last - 1, first - 1, -1):
        area += not_counted(journey, step, latest)
        length += journey.lengths[step]
        swaths += journey.lengths[step] * journey.widths[step]
        east += journey.ways[step, 0]
        north += journey.ways[step, 1]
        measured[0, step], measured[1, step] = area, swaths / length
        measured[2, step], measured[3, step], measured[4, step] = east, north, length


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
