"""Albot0 led out and home: what it believed at every stop, held against the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from albot_core.geometry.types import Points
from albot_core.mappers.albot0.config import Albot0Config
from albot_core.mappers.albot0.localisation import LocalisationConfig
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.albot0.trail import TrailConfig
from albot_core.sensing.reading import Reading

CUES: Mapping[str, tuple[str, ...]] = {
    "distance": ("distance",),
    "orientation": ("orientation",),
    "paper": ("distance", "orientation"),
    "way": ("way",),
    "default": ("way", "orientation"),
}
"""The cues by themselves, and what is fused: by the paper, and by `albot0` as it comes."""
BORDER = 1.0
"""The robot is at a border where the other ASR is no farther away than this (m)."""


@dataclass(frozen=True, kw_only=True)
class Stop:
    """What the robot believed at a stop, and where it was."""

    believed: int
    """The ASR that it believed in."""
    true: int
    """The ASR of the way out's nearest reading."""
    is_near: bool
    """Whether the way out comes by within `BORDER` in the ASR believed in: then it is the true one,
    or its neighbour at a border."""
    is_sure: bool
    """Whether the robot was sure of its ASR."""


class Tracked:
    """A mapper on its way out and home, with the truth beside it.

    Args:
        cues: The cues that it fuses.
    """

    def __init__(self, cues: tuple[str, ...]) -> None:
        # The other cues do not go by where the trail has the robot: one particle is quicker.
        trail = TrailConfig() if "way" in cues else TrailConfig(particles=1)
        localisation = LocalisationConfig(cues=cues)
        self.mapper = Albot0(Albot0Config(localisation=localisation, trail=trail))
        self.stops: list[Stop] = []
        self.out: Points = np.empty((0, 2))
        self.places: Int64[np.ndarray, "readings"] = np.empty(0, np.int64)

    def go_out(self, readings: tuple[Reading, ...], truth: Points) -> None:
        """Follow the way out, at whose end the robot turns round.

        Args:
            readings: What it sensed.
            truth: (readings, 2): where it was (m).
        """
        for reading in readings:
            self.mapper.update(reading)
        self.mapper.begin_return()
        self.out = truth
        self.places = np.array([self.mapper.place_at(k) for k in range(len(readings))])

    def go_home(self, reading: Reading, place: Points) -> None:
        """Take in a reading of the way home, at a place (m)."""
        if self.mapper.update(reading):
            self._judge(place)

    def end(self, place: Points) -> None:
        """The robot stands at a place (m)."""
        events = len(self.mapper.events)
        self.mapper.end_path()
        if len(self.mapper.events) > events:
            self._judge(place)

    def is_at(self, place: Points, asr: int) -> bool:
        """Whether a place (m) is in an ASR or at its border.

        It is where the way out comes by in that ASR no more than `BORDER` farther away than in any.
        """
        away = np.hypot(*(self.out - place).T)
        return bool((self.places[away < away.min() + BORDER] == asr).any())

    def true_asr(self, place: Points) -> int:
        """The ASR of the way out's reading that is nearest to a place (m)."""
        return int(self.places[np.hypot(*(self.out - place).T).argmin()])

    def _judge(self, place: Points) -> None:
        estimate = self.mapper.estimate
        assert estimate.place is not None
        self.stops.append(
            Stop(
                believed=estimate.place,
                true=self.true_asr(place),
                is_near=self.is_at(place, estimate.place),
                is_sure=estimate.localised,
            )
        )
