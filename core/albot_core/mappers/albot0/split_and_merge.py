"""Split and merge over a journey, compiled (Schmidt, Wong and Yeap, sections 2.1 and 2.2).

A journey is a sequence of steps; a region is a run of steps, from `first` to before `last`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel

_ROUNDING = 1e-9
"""Values of h that differ by less than this are equal: of equal splits and merges the first is
taken, independently of the journey's frame."""
_SHORTEST = 0.05
"""Minimum length by which an area is divided (m): a region may end where it began."""
_SMALLEST = 0.01
"""Minimum area that is divided by a length (m²); smaller faces of the ground are left out."""
_CORRIDOR = 3.0
"""A piece of the way leads along a corridor if it is this many times as long as wide…"""
_STRAIGHT = 0.9
"""…and its ends are at least this share of its length apart."""


class Constants(NamedTuple):
    """The constants of equations (1) and (2), and our own; see `RegionConfig`."""

    threshold: float
    """θ_r."""
    weight: float
    """s_r = s · θ_r."""
    centre: float
    """n."""
    smallest_area: float
    """A_max (m²)."""
    bend: float
    """The smallest turn between two corridors at which they are split (rad)."""
    by_area: bool
    """Whether a region's width is its area by its length, not the mean width of its steps."""
    by_neighbours: bool
    """Whether two regions are merged by their h alone, not by the h inside the merged region."""
    least_area: float
    """The area of the smallest region (m²)."""


class StepMeasures(NamedTuple):
    """The data from which the areas and lengths of all regions of a journey are computed."""

    lines: np.ndarray
    """(steps, 4): the robot's position at the beginning and at the end of each step (m)."""
    lengths: np.ndarray
    """(steps,): the length of each step (m)."""
    widths: np.ndarray
    """(steps,): the width of the ground beside each step (m)."""
    begins: np.ndarray
    """(steps,): whether a robot path begins with the step."""
    starts: np.ndarray
    """(steps + 1,): the index in `faces` at which the faces of each step begin."""
    faces: np.ndarray
    """(pairs,): the faces of the ground, ordered by the steps that cover them."""
    areas: np.ndarray
    """(faces,): areas of the faces (m²)."""
    seen: np.ndarray
    """(faces + 1,) int64: the sum in which each face was last counted; at the end the latest
    sum."""


@kernel(arrays=True)
def split_and_merge(measures: StepMeasures, constants: Constants) -> np.ndarray:
    """Return the steps at which regions begin, and the number of all steps (regions + 1,)."""
    steps = measures.lengths.shape[0]
    is_bend = np.zeros(steps + 1, np.bool_)
    find_bends(measures, constants, is_bend)
    is_split = is_bend.copy()
    before, after, residuals = np.empty((2, steps)), np.empty((2, steps)), np.empty(steps)
    split(measures, constants, is_split, before, after)
    splits, is_small = np.flatnonzero(is_split), np.empty(steps, np.bool_)
    count = steps + 1
    # A shift may make two neighbours homogeneous, so what is shifted is merged again.
    while splits.shape[0] - 1 < count:
        count = splits.shape[0] - 1
        left = merge(measures, constants, is_bend, splits, before, after, residuals, is_small)
        splits = splits[: left + 1].copy()
        shift(measures, constants, is_bend, splits, before, after)
    return splits


@kernel()
def homogeneity(
    area: float, width: float, other_area: float, other_width: float, constants: Constants
) -> float:
    """Return h(P_i, P_j) of equation (1): low for similar regions."""
    ratio = max(width, other_width) / min(width, other_width)
    return float(ratio + constants.weight * regularisation(min(area, other_area), constants))


@kernel()
def regularisation(smaller: float, constants: Constants) -> float:
    """Return r(P_i, P_j) of equation (2) for the smaller region's area: from -1, if small, to 0."""
    ratio = smaller / constants.smallest_area - constants.centre
    # The sigmoid is computed by tanh, which does not overflow.
    return 0.5 * (1.0 + math.tanh(0.5 * ratio)) - 1.0


@kernel()
def find_bends(measures: StepMeasures, constants: Constants, is_bend: np.ndarray) -> None:
    """Find the steps at which one corridor bends into another, where regions are always split.

    The paper names the overall direction beside the width ("a corridor is separated from another
    one by a sharp bend in the wall"), but its equations contain widths alone. This is ours. A robot
    that turns round in a corridor also makes a bend: the paper's lengths, from entry to exit, need
    a split there as well. Of neighbouring steps the one with the sharpest turn is taken.
    """
    sharpest, at = 0.0, 0
    for step in range(1, measures.lengths.shape[0] + 1):
        turn = 0.0
        if step < measures.lengths.shape[0]:
            came, x, y = corridor(measures, step - 1, -1)
            goes, u, v = corridor(measures, step, 1)
            if came and goes:
                turn = abs(math.atan2(x * v - y * u, x * u + y * v))
        if turn < constants.bend:
            if sharpest > 0.0:
                is_bend[at] = True
            sharpest = 0.0
        elif turn > sharpest + _ROUNDING:
            sharpest, at = turn, step


@kernel()
def corridor(measures: StepMeasures, first: int, onward: int) -> tuple[bool, float, float]:
    """Return whether the way leads along a corridor from a step, and in which direction (m, m).

    Args:
        measures: What is measured of the journey.
        first: The step.
        onward: 1 for forwards, -1 for backwards.
    """
    length = swaths = east = north = 0.0
    step = first
    while 0 <= step < measures.lengths.shape[0]:
        length += measures.lengths[step]
        swaths += measures.lengths[step] * measures.widths[step]
        east += measures.lines[step, 2] - measures.lines[step, 0]
        north += measures.lines[step, 3] - measures.lines[step, 1]
        if length * length >= _CORRIDOR * swaths:
            return math.hypot(east, north) >= _STRAIGHT * length, east, north
        step += onward
    return False, east, north


@kernel()
def split(
    measures: StepMeasures,
    constants: Constants,
    is_split: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> None:
    """Split each robot path where h is greatest, and its parts again, while h is above θ_r."""
    steps = measures.lengths.shape[0]
    for step in range(steps):
        is_split[step] |= measures.begins[step]
    is_split[0] = is_split[steps] = True
    first = 0
    while first < steps:
        last = first + 1
        while not is_split[last]:
            last += 1
        best, greatest = residual(measures, constants, first, last, before, after)
        if greatest > constants.threshold:
            is_split[best] = True
        else:
            first = last


@kernel()
def merge(
    measures: StepMeasures,
    constants: Constants,
    is_bend: np.ndarray,
    splits: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
    residuals: np.ndarray,
    is_small: np.ndarray,
) -> int:
    """Merge the two neighbours that form the most homogeneous region, while its h is at most θ_r.

    A region smaller than the smallest one is merged whatever its h, and first. Corridors round a
    bend are not merged. Returns the number of regions left.
    """
    count = int(splits.shape[0]) - 1
    for k in range(count):
        is_small[k] = area_of(measures, splits[k], splits[k + 1]) < constants.least_area
    for k in range(count - 1):
        three = splits[k : k + 3]
        residuals[k] = merged(measures, constants, is_bend, three, before, after)
    while count > 1:
        k, holds_small = next_pair(residuals[: count - 1], is_small)
        if residuals[k] == math.inf or (residuals[k] > constants.threshold and not holds_small):
            break
        is_small[k] = area_of(measures, splits[k], splits[k + 2]) < constants.least_area
        for other in range(k + 1, count):
            splits[other] = splits[other + 1]
        count -= 1
        for other in range(k + 1, count):
            is_small[other] = is_small[other + 1]
        for other in range(k, count - 1):
            residuals[other] = residuals[other + 1]
        for other in range(max(k - 1, 0), min(k + 1, count - 1)):
            three = splits[other : other + 3]
            residuals[other] = merged(measures, constants, is_bend, three, before, after)
    return count


@kernel()
def next_pair(residuals: np.ndarray, is_small: np.ndarray) -> tuple[int, bool]:
    """Return the first of the two neighbours to be merged next, and whether one is too small."""
    k, holds_small = 0, False
    for other in range(residuals.shape[0]):
        if residuals[other] == math.inf:
            continue
        has_small = is_small[other] or is_small[other + 1]
        is_better = residuals[other] < residuals[k] - _ROUNDING
        if (has_small and not holds_small) or (has_small == holds_small and is_better):
            k, holds_small = other, has_small
    return k, holds_small


@kernel()
def merged(
    measures: StepMeasures,
    constants: Constants,
    is_bend: np.ndarray,
    splits: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> float:
    """Return the residual of two neighbours after merging; infinite at a bend.

    The paper merges "two adjacent parts" where the residual of the merged part is small (section
    2.1, step 3), and says of its h that it tells "whether two adjacent regions can be merged"
    (section 2.2): ours is the first, h of the best split of the merged region; the letter is the
    second, h of the two regions as they are (`RegionConfig.merging`).
    """
    if is_bend[splits[1]]:
        return math.inf
    if not constants.by_neighbours:
        return float(residual(measures, constants, splits[0], splits[2], before, after)[1])
    measure_from(measures, constants, splits[0], splits[1], before)
    measure_until(measures, constants, splits[1], splits[2], after)
    area, width = before[0, splits[1] - 1], before[1, splits[1] - 1]
    other, other_width = after[0, splits[1]], after[1, splits[1]]
    return float(homogeneity(area, width, other, other_width, constants))


@kernel()
def residual(
    measures: StepMeasures,
    constants: Constants,
    first: int,
    last: int,
    before: np.ndarray,
    after: np.ndarray,
) -> tuple[int, float]:
    """Return the step that splits a region into the most different parts, and h (0 for none).

    No part is smaller than the smallest region.
    """
    measure_from(measures, constants, first, last, before)
    measure_until(measures, constants, first, last, after)
    best, greatest = first, 0.0
    for middle in range(first + 1, last):
        area, width = before[0, middle - 1], before[1, middle - 1]
        other, other_width = after[0, middle], after[1, middle]
        if min(area, other) < constants.least_area:
            continue
        h = homogeneity(area, width, other, other_width, constants)
        if h > greatest + _ROUNDING:
            best, greatest = middle, h
    return best, greatest


@kernel()
def shift(
    measures: StepMeasures,
    constants: Constants,
    is_bend: np.ndarray,
    splits: np.ndarray,
    before: np.ndarray,
    after: np.ndarray,
) -> None:
    """Shift each split point to where the overall error is least; bends are not shifted.

    The error is the squared error (as usual, says the paper) of the average widths of the two
    regions as estimates of the widths of their steps. As in h ratios count, so widths are compared
    by their logarithms. The sum over all regions falls with each shift, so the loop ends.

    A split point is not shifted if one of the regions would then have to be split again, which is
    ours. Otherwise one that separates a narrow part from a room may move to the end of a distant
    corridor that was merged with that room, and the narrow part would become part of the room.
    """
    moved = True
    while moved:
        moved = False
        for k in range(1, splits.shape[0] - 1):
            first, last = splits[k - 1], splits[k + 1]
            best = best_split(measures, constants, first, splits[k], last, before, after)
            if best == splits[k] or is_bend[splits[k]]:
                continue
            greatest = 0.0
            if not constants.by_neighbours:
                one = residual(measures, constants, first, best, before, after)[1]
                other = residual(measures, constants, best, last, before, after)[1]
                greatest = max(one, other)
            if greatest <= constants.threshold:
                splits[k], moved = best, True


@kernel()
def best_split(
    measures: StepMeasures,
    constants: Constants,
    first: int,
    here: int,
    last: int,
    before: np.ndarray,
    after: np.ndarray,
) -> int:
    """Return the best split point of two neighbours, `here` if no other is better.

    Neither part is smaller than the smallest region.
    """
    measure_from(measures, constants, first, last, before)
    measure_until(measures, constants, first, last, after)
    whole = rest = 0.0
    for step in range(first, last):
        whole += measures.lengths[step]
        rest += measures.lengths[step] * math.log(measures.widths[step])
    # The sum of the squared values is the same for every split, so the error is least where the
    # squares of the means are greatest.
    length = summed = present = 0.0
    best, greatest = here, -np.inf
    for middle in range(first + 1, last):
        length += measures.lengths[middle - 1]
        summed += measures.lengths[middle - 1] * math.log(measures.widths[middle - 1])
        explained = summed**2 / length + (rest - summed) ** 2 / (whole - length)
        if middle == here:
            present = explained
        smaller = min(before[0, middle - 1], after[0, middle])
        if smaller >= constants.least_area and explained > greatest + _ROUNDING:
            best, greatest = middle, explained
    return best if greatest > present + _ROUNDING else here


@kernel()
def area_of(measures: StepMeasures, first: int, last: int) -> float:
    """Return the area of the region from `first` to before `last` (m²)."""
    area, latest = 0.0, next_sum(measures)
    for step in range(first, last):
        area += not_counted(measures, step, latest)
    return area


@kernel()
def measure_from(
    measures: StepMeasures, constants: Constants, first: int, last: int, measured: np.ndarray
) -> None:
    """Set `measured[:, k]` to the area and average width of the region from `first` to step k."""
    area, length, swaths, latest = 0.0, 0.0, 0.0, next_sum(measures)
    for step in range(first, last):
        area += not_counted(measures, step, latest)
        length += measures.lengths[step]
        swaths += measures.lengths[step] * measures.widths[step]
        measured[0, step] = area
        measured[1, step] = swaths / length
        if constants.by_area:
            measured[1, step] = average_width(measures, area, first, step)


@kernel()
def measure_until(
    measures: StepMeasures, constants: Constants, first: int, last: int, measured: np.ndarray
) -> None:
    """Set `measured[:, k]` to the area and width of the region from step k to before `last`."""
    area, length, swaths, latest = 0.0, 0.0, 0.0, next_sum(measures)
    for step in range(last - 1, first - 1, -1):
        area += not_counted(measures, step, latest)
        length += measures.lengths[step]
        swaths += measures.lengths[step] * measures.widths[step]
        measured[0, step] = area
        measured[1, step] = swaths / length
        if constants.by_area:
            measured[1, step] = average_width(measures, area, step, last - 1)


@kernel()
def average_width(measures: StepMeasures, area: float, first: int, last: int) -> float:
    """Return f_w = A / l of equation (1) for the region from step `first` to step `last` (m).

    l is the straight line "connecting the start point of the first robot path of a region and the
    end point of the last path", so it is shorter than the way where the region folds back.
    """
    east = measures.lines[last, 2] - measures.lines[first, 0]
    north = measures.lines[last, 3] - measures.lines[first, 1]
    return max(area, _SMALLEST) / max(math.hypot(east, north), _SHORTEST)


@kernel()
def next_sum(measures: StepMeasures) -> int:
    """Return the number of a new sum over faces."""
    latest = int(measures.seen[-1]) + 1
    measures.seen[-1] = latest
    return latest


@kernel()
def not_counted(measures: StepMeasures, step: int, latest: int) -> float:
    """Return the area of a step's faces not yet counted in the latest sum, and count them (m²)."""
    area = 0.0
    for pair in range(measures.starts[step], measures.starts[step + 1]):
        face = measures.faces[pair]
        if measures.seen[face] != latest:
            measures.seen[face] = latest
            area += measures.areas[face]
    return area
