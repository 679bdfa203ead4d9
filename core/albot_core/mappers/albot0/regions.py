"""Regions of a journey by split and merge (Schmidt, Wong and Yeap, sections 2.1 and 2.2).

A journey is a sequence of steps, each with the ground beside it. A region is a run of steps.
Consecutive regions are distinguished by their average widths: this makes one part of the way a
room, and another a corridor. Each region is an absolute space representation (ASR).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.errors import InputError
from albot_core.geometry.types import Segments
from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.split_and_merge import Constants, StepMeasures, split_and_merge
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

Width = Literal["measured", "area"]
"""How a region's average width is measured (see `RegionConfig.width`)."""
Merging = Literal["whole", "neighbours"]
"""When two regions are merged (see `RegionConfig.merging`)."""
_ABOVE_ONE = Range("a number from 1", 1.0)
_WIDTHS: tuple[Width, ...] = get_args(Width)
_MERGING: tuple[Merging, ...] = get_args(Merging)
_SHORT = 1e-9
"""A region of at most this length ends where it began (m)."""


@dataclass(frozen=True, kw_only=True)
class RegionConfig:
    """When a journey is split into regions, by equations (1) and (2)."""

    threshold: float = 1.7
    """θ_r: two regions are distinct if h is above it; one is then more than this many times as wide
    as the other."""
    regularisation: float = 0.2
    """s: the weight of r as a share of θ_r."""
    centre: float = 3.0
    """n, the centre of the sigmoid in equation (2); the paper gives no value."""
    smallest_area: float = 4.0
    """A_max, the unit of areas in equation (2) (m²); the paper gives no value. With n = 3, r has
    half its effect for regions of 12 m², the size of a small office."""
    bend: float = math.radians(60.0)
    """Corridors are split where the way turns by at least this (rad). Above π none are, as by the
    paper's equations."""
    width: Width = "measured"
    """The average width of a region in equation (1). `area`, the paper's, is its area by the line
    from its entry to its exit. `measured`, ours, is the mean of the widths beside its steps: the
    line is short where the way folds back, so a room that is crossed to and fro would be the wider
    the more crooked the way is."""
    merging: Merging = "whole"
    """When two regions are merged: by the h of the best split of both together (`whole`), or by the
    h of the two (`neighbours`, the letter of the paper's section 2.2)."""
    keeps_small: bool = True
    """Whether regions smaller than A_max are kept. The paper's are not: its A_max is the area of
    "the smallest possible region that the algorithm is still allowed to create". Ours are held
    together by r alone, so a doorway can be a region: it parts a room from a corridor that is
    hardly narrower."""

    @classmethod
    def paper(cls) -> RegionConfig:
        """Return the thresholds of the paper's split, to the letter."""
        return cls(
            # The paper gives neither n nor A_max. A doorway of a thick wall is no region, and r has
            # half its effect for regions of 12 m², as in ours.
            centre=12.0,
            smallest_area=1.0,
            bend=2.0 * math.pi,
            width="area",
            merging="neighbours",
            keeps_small=False,
        )

    def __post_init__(self) -> None:
        check_fields(self, _ABOVE_ONE, "threshold")
        check_fields(self, SHARE, "regularisation")
        check_fields(self, NOT_NEGATIVE, "centre")
        check_fields(self, POSITIVE, "smallest_area", "bend")
        for name, known in (("width", _WIDTHS), ("merging", _MERGING)):
            if getattr(self, name) not in known:
                found = repr(getattr(self, name))
                raise InputError(f"RegionConfig.{name}", f"one of {', '.join(known)}", found)

    @property
    def constants(self) -> Constants:
        """The constants of the compiled split and merge."""
        return Constants(
            threshold=float(self.threshold),
            weight=float(self.regularisation * self.threshold),
            centre=float(self.centre),
            smallest_area=float(self.smallest_area),
            bend=float(self.bend),
            by_area=self.width == "area",
            by_neighbours=self.merging == "neighbours",
            least_area=0.0 if self.keeps_small else float(self.smallest_area),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Regions:
    """The regions of a journey, in the order in which the robot came through them."""

    splits: Int64[np.ndarray, "bounds"]
    """The step at which each region begins; and the number of all steps."""
    steps: Segments
    """The steps of the journey, from the first to the last (m)."""

    @property
    def count(self) -> int:
        """The number of regions."""
        return len(self.splits) - 1

    @cached_property
    def lines(self) -> Segments:
        """The line from the entry to the exit of each region (m)."""
        entries, exits = self.steps[self.splits[:-1], :2], self.steps[self.splits[1:] - 1, 2:]
        return np.concatenate((entries, exits), axis=1)

    @cached_property
    def lengths(self) -> Float64[np.ndarray, "regions"]:
        """The distance from entry to exit of each region (m)."""
        return np.asarray(np.hypot(*(self.lines[:, 2:] - self.lines[:, :2]).T))

    @cached_property
    def ways(self) -> Float64[np.ndarray, "regions"]:
        """The distance from entry to exit along the robot paths of each region (m)."""
        lengths = np.hypot(*(self.steps[:, 2:] - self.steps[:, :2]).T)
        return np.asarray(np.add.reduceat(lengths, self.splits[:-1]))

    @cached_property
    def directions(self) -> Float64[np.ndarray, "regions"]:
        """The direction from entry to exit of each region (rad).

        For a region that ends where it began, it is the direction in which the region was entered.
        """
        ways = self.lines[:, 2:] - self.lines[:, :2]
        first = self.steps[self.splits[:-1]]
        entered = first[:, 2:] - first[:, :2]
        ways = np.where((self.lengths > _SHORT)[:, None], ways, entered)
        return np.asarray(np.arctan2(ways[:, 1], ways[:, 0]))

    def of_step(self, step: int) -> int:
        """Return the region to which a step belongs."""
        return int(np.searchsorted(self.splits[1:-1], step, side="right"))


def split_journey(
    lines: Segments,
    widths: Float64[np.ndarray, "segments"],
    begins: Bool[np.ndarray, "segments"],
    ground: Ground,
    config: RegionConfig,
) -> Regions:
    """Split a journey into regions.

    Args:
        lines: The steps of the journey, from the first to the last (m).
        widths: The width of the ground beside each step (m).
        begins: Whether a robot path begins with each step. The first split is by robot paths.
        ground: The ground beside each step.
        config: When regions are split.
    """
    if not len(lines):
        return Regions(splits=np.zeros(1, np.int64), steps=lines)
    starts, faces, areas = ground.index
    seen = np.zeros(len(areas) + 1, np.int64)
    lengths = np.hypot(*(lines[:, 2:] - lines[:, :2]).T)
    measures = StepMeasures(lines, lengths, widths, begins, starts, faces, areas, seen)
    bounds = split_and_merge(measures, config.constants)
    return Regions(splits=bounds, steps=lines)
