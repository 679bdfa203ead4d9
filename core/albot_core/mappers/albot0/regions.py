"""Regions of a journey by split and merge (Schmidt, Wong and Yeap, sections 2.1 and 2.2).

A journey is a row of steps, each with the ground beside it. A region is a run of steps. Two regions
that follow each other are told apart by their average widths: that is what makes a room of a part
of the way, and a corridor of another. Each region is an absolute space representation (ASR).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.types import Segments
from albot_core.mappers.albot0.ground import Ground
from albot_core.mappers.albot0.split_and_merge import Constants, StepMeasures, split_and_merge
from albot_core.ranges import NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

_ABOVE_ONE = Range("a number from 1", 1.0)
_SHORT = 1e-9
"""A region ends where it began if it is no longer (m)."""


@dataclass(frozen=True, kw_only=True)
class RegionConfig:
    """When a journey is split into regions, by equations (1) and (2)."""

    threshold: float = 1.7
    """θ_r: two regions are told apart where h is above it. One is then so many times as wide as
    the other."""
    regularisation: float = 0.2
    """s: the share of θ_r by which r is weighed."""
    centre: float = 3.0
    """n, where the sigmoid of equation (2) has its centre; the paper gives no value."""
    smallest_area: float = 4.0
    """A_max, by which areas are measured in equation (2) (m²); the paper gives no value. With n = 3
    regions of 12 m², the size of a small office, are half held together."""

    bend: float = math.radians(60.0)
    """Corridors that turn by so much (rad) from one into the next are parted. Above π none are."""

    def __post_init__(self) -> None:
        check_fields(self, _ABOVE_ONE, "threshold")
        check_fields(self, SHARE, "regularisation")
        check_fields(self, NOT_NEGATIVE, "centre")
        check_fields(self, POSITIVE, "smallest_area", "bend")

    @property
    def constants(self) -> Constants:
        """What the compiled split and merge computes with."""
        return Constants(
            threshold=float(self.threshold),
            weight=float(self.regularisation * self.threshold),
            centre=float(self.centre),
            smallest_area=float(self.smallest_area),
            bend=float(self.bend),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Regions:
    """The regions of a journey, in the order in which the robot came through them."""

    splits: Int64[np.ndarray, "bounds"]
    """The steps at which they begin; and the number of all steps."""
    steps: Segments
    """The steps of the journey, from the first to the last (m)."""

    @property
    def count(self) -> int:
        """How many regions there are."""
        return len(self.splits) - 1

    @cached_property
    def lines(self) -> Segments:
        """From the entry to the exit of each (m)."""
        entries, exits = self.steps[self.splits[:-1], :2], self.steps[self.splits[1:] - 1, 2:]
        return np.concatenate((entries, exits), axis=1)

    @cached_property
    def lengths(self) -> Float64[np.ndarray, "regions"]:
        """Distances from entry to exit (m)."""
        return np.asarray(np.hypot(*(self.lines[:, 2:] - self.lines[:, :2]).T))

    @cached_property
    def ways(self) -> Float64[np.ndarray, "regions"]:
        """Distances from entry to exit along the robot paths (m)."""
        lengths = np.hypot(*(self.steps[:, 2:] - self.steps[:, :2]).T)
        return np.asarray(np.add.reduceat(lengths, self.splits[:-1]))

    @cached_property
    def directions(self) -> Float64[np.ndarray, "regions"]:
        """Directions from entry to exit (rad).

        Of a region that ends where it began it is the direction in which it was entered.
        """
        ways = self.lines[:, 2:] - self.lines[:, :2]
        first = self.steps[self.splits[:-1]]
        entered = first[:, 2:] - first[:, :2]
        ways = np.where((self.lengths > _SHORT)[:, None], ways, entered)
        return np.asarray(np.arctan2(ways[:, 1], ways[:, 0]))

    def of_step(self, step: int) -> int:
        """The region that a step belongs to."""
        return int(np.searchsorted(self.splits[1:-1], step, side="right"))


def split_journey(
    lines: Segments,
    widths: Float64[np.ndarray, "segments"],
    begins: Bool[np.ndarray, "segments"],
    ground: Ground,
    config: RegionConfig,
) -> Regions:
    """The regions of a journey.

    Args:
        lines: Its steps, from the first to the last (m).
        widths: How wide the ground beside each is (m).
        begins: Whether a robot path begins with each. The first split is by robot paths.
        ground: The ground beside each step.
        config: When regions are split.
    """
    if not len(lines):
        return Regions(splits=np.zeros(1, np.int64), steps=lines)
    starts, faces, areas = ground.index
    seen = np.zeros(len(areas) + 1, np.int64)
    ways = lines[:, 2:] - lines[:, :2]
    lengths = np.hypot(*ways.T)
    measures = StepMeasures(ways, lengths, widths, begins, starts, faces, areas, seen)
    bounds = split_and_merge(measures, config.constants)
    return Regions(splits=bounds, steps=lines)
