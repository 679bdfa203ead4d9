"""Albot0 led out and home: its beliefs at every stop, compared with the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Points
from albot_core.mappers.albot0.localisation import CUES as CUE_MAPS
from albot_core.mappers.albot0.localisation import (
    Confidences,
    DemocraticIntegration,
    is_sure,
    most_confident,
)
from albot_core.mappers.albot0.mapper import Albot0
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading

CUES: Mapping[str, tuple[str, ...]] = {
    "distance": ("distance",),
    "orientation": ("orientation",),
    "paper": ("distance", "orientation"),
    "way": ("way",),
    "default": ("way", "orientation"),
}
"""The single cues, and the choices that are fused: the paper's, and the default of `albot0`."""
MAPPERS: Mapping[str, str] = {"albot0-paper": "paper", "albot0": "default"}
"""The mappers that are judged, the letter first, each with the name of its own cues in `CUES`."""
SONAR_CONDITIONS: Mapping[str, tuple[str, str]] = {
    "robot": ("Pioneer 3 by sonar, until an obstacle", "simulated Pioneer 3, led along waypoints"),
    "sensors": (
        "eight sonars of about 4 m",
        "eight sonars of 4 m, with specular loss and cross-talk",
    ),
    "odometer": ("the Pioneer's, not corrected", "`pioneer`: systematic and random errors"),
    "speed": ("not told", "0.5 m/s"),
    "stops": ("at obstacles", "at turns of 20°, and after 3 m"),
}
"""The paper's conditions and ours that are the same in its experiments."""
BOTH_SONARS = "eight sonars of about 4 m", "eight sonars of 4 m, with and without specular loss"
"""The sensors in the experiments that are run with ideal sonars, too."""
BORDER = 1.0
"""The robot is at a border if the other ASR is at most this much farther away (m)."""


@dataclass(frozen=True, kw_only=True)
class Stop:
    """The robot's belief at a stop, and its true place."""

    believed: int
    """The ASR with the greatest confidence."""
    true: int
    """The ASR of the way out's nearest reading."""
    is_near: bool
    """Whether the way out passes within `BORDER` in the believed ASR: it is then the true one, or
    its neighbour at a border."""
    is_sure: bool
    """Whether the robot was sure of its ASR."""


def is_at(
    out: Points, places: Int64[np.ndarray, "readings"], place: Float64[np.ndarray, "2"], asr: int
) -> bool:
    """Return whether a position (m) is in an ASR of the way out, or at its border.

    Args:
        out: The true positions on the way out (m).
        places: The ASR of each.
        place: The position (m).
        asr: The ASR.
    """
    away = np.hypot(*(out - place).T)
    return bool((places[away < away.min() + BORDER] == asr).any())


class Tracked:
    """A mapper on its way out and home, compared with the truth.

    The beliefs with each choice of cues are computed beside the mapper, on the same maps.

    Attributes:
        mapper: The mapper.
        cues: The choices of cues that the mapper can fuse: without a trail those without `way`.
        stops: The beliefs at every stop on the way home, by the names of `CUES`.
        confidences: The latest confidences, by the names of `CUES`.
        out: (readings, 2): the robot's true positions on its way out (m).
        places: The ASR of each of these readings.
    """

    def __init__(self, name: str = "albot0") -> None:
        mapper = make_mapper(name)
        assert isinstance(mapper, Albot0)
        self.mapper = mapper
        self.cues = {
            choice: cues
            for choice, cues in CUES.items()
            if mapper.config.trail is not None or "way" not in cues
        }
        self.stops: dict[str, list[Stop]] = {choice: [] for choice in self.cues}
        self.confidences: dict[str, Confidences] = {}
        self.out: Points = np.empty((0, 2))
        self.places: Int64[np.ndarray, "readings"] = np.empty(0, np.int64)
        self._fusions = {
            name: DemocraticIntegration.of(len(cues)) for name, cues in self.cues.items()
        }

    def go_out(self, readings: tuple[Reading, ...], truth: Points) -> None:
        """Process the way out, at whose end the robot turns round.

        Args:
            readings: The readings of the way out.
            truth: (readings, 2): the robot's true positions (m).
        """
        for reading in readings:
            self.mapper.update(reading)
        self.mapper.begin_return()
        self.out = truth
        self.places = np.array([self.mapper.place_at(k) for k in range(len(readings))])
        self.confidences = dict.fromkeys(self.cues, self.mapper.confidences)

    def go_home(self, reading: Reading, place: Points) -> None:
        """Process a reading of the way home, taken at a true position (m)."""
        if self.mapper.update(reading):
            self._judge(place)

    def end(self, place: Points) -> None:
        """End the robot path at a true position (m)."""
        events = len(self.mapper.events)
        self.mapper.end_path()
        if len(self.mapper.events) > events:
            self._judge(place)

    def believes_in(self, cues: str) -> int:
        """Return the most confident ASR with a choice of cues."""
        return most_confident(self.confidences[cues])

    def is_at(self, place: Points, asr: int) -> bool:
        """Return whether a position (m) is in an ASR or at its border.

        It is if the way out passes the position in that ASR at most `BORDER` farther away than in
        any.
        """
        return is_at(self.out, self.places, place, asr)

    def true_asr(self, place: Points) -> int:
        """Return the ASR of the way out's reading that is nearest to a position (m)."""
        return int(self.places[np.hypot(*(self.out - place).T).argmin()])

    def _judge(self, place: Points) -> None:
        stop, config = self.mapper.last_stop, self.mapper.config.localisation
        for name, cues in self.cues.items():
            maps = np.stack([CUE_MAPS[cue](stop, config) for cue in cues])
            self.confidences[name] = self._fusions[name].fuse(maps)
            believed = self.believes_in(name)
            self.stops[name].append(
                Stop(
                    believed=believed,
                    true=self.true_asr(place),
                    is_near=self.is_at(place, believed),
                    is_sure=is_sure(self.confidences[name], config),
                )
            )
