"""Localisation of the robot on its way home, by the map of its way out.

Schmidt, Wong and Yeap, section 3. The map of the way out and that of the way home have different
frames and different ASRs. Each cue compares what both maps have in common, and assigns a confidence
to every ASR of the way out. The cues are fused by Democratic Integration (Triesch and von der
Malsburg, Democratic Integration: self-organized integration of adaptive cues, Neural Computation
13, 2001): cues that agree with the common result gain weight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError, did_you_mean
from albot_core.geometry.poses import wrap_angle
from albot_core.mappers.albot0.regions import Regions
from albot_core.ranges import POSITIVE, SHARE, check_fields

Confidences = Float64[np.ndarray, "regions"]
"""A confidence within [0, 1] for every ASR of the way out, the robot's home first."""
_STANDING = 1e-6
"""With a smaller σ (m) the robot has not left the position where it turned round."""
Cue = Callable[["Stop", "LocalisationConfig"], Confidences]
"""Function that returns a confidence map from the data of a stop on the way home."""


@dataclass(frozen=True, kw_only=True)
class LocalisationConfig:
    """Thresholds of the localisation on the way home."""

    cues: tuple[str, ...] = ("way", "orientation")
    """The cues that are fused, by their names in `CUES`. The paper's are "distance" and
    "orientation". Here "way" replaces the distance, because the way home may differ from the way
    out, and be split differently."""
    spread: float = 0.05
    """σ of the distance cue as a share of the distance travelled."""
    reduction: float = 0.5
    """Factor of the confidences of the orientation cue. The paper reduces them "by a constant
    factor" and gives no value."""
    border: float = 0.9
    """The robot is not sure of its ASR if another ASR has at least this share of its confidence. If
    the two are neighbours, the robot is at the border between them."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "spread")
        check_fields(self, SHARE, "reduction", "border")
        for name in self.cues:
            if name not in CUES:
                found = f"{name!r}{did_you_mean(name, CUES)}"
                raise InputError("LocalisationConfig.cues", f"some of {', '.join(CUES)}", found)
        if not self.cues or len(set(self.cues)) < len(self.cues):
            expected = f"one or more of {', '.join(CUES)}, each once"
            raise InputError("LocalisationConfig.cues", expected, ", ".join(self.cues) or "none")


@dataclass(frozen=True, kw_only=True, eq=False)
class Stop:
    """The data of a stop on the way home."""

    out: Regions
    """The ASRs of the way out, at least one."""
    home: Regions
    """The ASRs of the way home so far."""
    beside: Confidences | None
    """How well each ASR of the way out fits where the way home lies beside it (see `WayBack`); None
    if the robot keeps no trail."""


def distance_map(stop: Stop, config: LocalisationConfig) -> Confidences:
    """Return how well the distance travelled on the way home fits each ASR (section 3.1).

    Both distances are sums of ASR lengths. As in the paper, the Gaussian is sampled where an ASR
    ends on the way home, so an ASR is the likeliest one from its middle to the middle of the next.
    """
    ends = _ends(stop.out.lengths)
    travelled = float(stop.home.lengths.sum())
    return _fit(np.abs(ends - travelled), travelled, config)


def extent_map(stop: Stop, config: LocalisationConfig) -> Confidences:
    """Return the distance cue with the Gaussian sampled at the point of each ASR that fits best.

    So the ASR that holds the distance has the greatest confidence. This cue is ours.
    """
    travelled = float(stop.home.lengths.sum())
    return _fit(_beyond(stop.out.lengths, travelled), travelled, config)


def way_map(stop: Stop, config: LocalisationConfig) -> Confidences:
    """Return how well each ASR fits where the way home lies beside the way out.

    The fit compares the surfaces beside the two ways. This cue is ours.

    Raises:
        InputError: The robot keeps no trail.
    """
    if stop.beside is None:
        raise InputError("cue way", "a robot that keeps a trail", "one that keeps none")
    return stop.beside


def _ends(lengths: Confidences) -> Confidences:
    """Return the distance from the turning point to the end of each ASR on the way home (m)."""
    return np.asarray(np.cumsum(lengths[::-1])[::-1])


def _beyond(lengths: Confidences, travelled: float) -> Confidences:
    """Return the distance of a robot that has travelled so far from each ASR, 0 inside (m)."""
    ends = _ends(lengths)
    beyond = np.maximum(ends - lengths - travelled, travelled - ends)
    return np.asarray(np.maximum(beyond, 0.0))


def _fit(off: Confidences, travelled: float, config: LocalisationConfig) -> Confidences:
    """Return a Gaussian with σ = `spread` · travelled, scaled so that the best ASR has 1."""
    spread = config.spread * travelled
    if spread < _STANDING:  # The robot is where it turned round.
        return np.where(off == off.min(), 1.0, 0.0)
    # The best value is subtracted in the exponent, as all would be 0 far from all ASRs.
    fit = off / spread
    fitted: Confidences = np.exp(-0.5 * (fit - fit.min()) * (fit + fit.min()))
    return fitted


def orientation_map(stop: Stop, config: LocalisationConfig) -> Confidences:
    """Return how well the turn into the present ASR fits the turns of the way out (section 3.2).

    On the way home the robot comes from ASR i + 1 into ASR i, so the turn is that from i to i + 1
    with the opposite sign. No turn leads into the ASR in which the robot turned round, nor into any
    ASR before the robot is in the second one of its way home: they get the mean value of a random
    angle.
    """
    out, home = stop.out, stop.home
    confidences = np.full(out.count, 0.5)
    if home.count >= 2:
        turn = home.directions[-1] - home.directions[-2]
        turns = -np.diff(out.directions)
        off = np.abs(wrap_angle(turn - turns))
        confidences[:-1] = 1.0 - off / np.pi  # Eq. (3)
    return config.reduction * confidences


CUES: dict[str, Cue] = {
    "distance": distance_map,
    "extent": extent_map,
    "orientation": orientation_map,
    "way": way_map,
}
"""All cues by name."""


def register_cue(name: str, cue: Cue) -> None:
    """Register a cue under a name, so that a `LocalisationConfig` can name it.

    Raises:
        InputError: Another cue has this name.
    """
    if CUES.setdefault(name, cue) is not cue:
        raise InputError("register_cue", "a name that no other cue has", repr(name))


@dataclass(kw_only=True, eq=False)
class DemocraticIntegration:
    """The weights of the cues, which change with every localisation (section 3.3)."""

    weights: Float64[np.ndarray, "cues"]
    """w_i(t), with sum 1. The paper does not give their initial values; here all are equal."""
    time: int = 0
    """t: number of times that the cues were fused."""

    @classmethod
    def of(cls, cues: int) -> DemocraticIntegration:
        """Return the initial weights of a number of cues."""
        return cls(weights=np.full(cues, 1.0 / cues))

    def fuse(self, maps: Float64[np.ndarray, "cues regions"]) -> Confidences:
        """Return the fused confidences of the maps of all cues, each of at least one ASR.

        A map of zeros favours no ASR; if all maps are zero, the weights move towards being equal.
        """
        fused: Confidences = self.weights @ maps  # Eq. (4)
        believed = most_confident(fused)
        sums = maps.sum(axis=1, keepdims=True)
        uniform = np.full_like(maps, 1.0 / maps.shape[1])
        shares = np.divide(maps, sums, out=uniform, where=sums > 0)  # Eq. (5)
        qualities = shares[:, believed]
        total = qualities.sum()
        even = np.full(len(maps), 1.0 / len(maps))
        qualities = qualities / total if total > 0 else even  # Eq. (6)
        self.time += 1
        self.weights = self.weights + (qualities - self.weights) / self.time  # Eq. (7)
        return fused


def most_confident(confidences: Confidences) -> int:
    """Return the ASR with the greatest confidence; of equal ones the last on the way out."""
    return len(confidences) - 1 - int(confidences[::-1].argmax())


def is_sure(confidences: Confidences, config: LocalisationConfig) -> bool:
    """Return whether one ASR is clearly the most confident; if not, it may be a border."""
    if len(confidences) < 2:
        return True
    second, first = np.sort(confidences)[-2:].tolist()
    return bool(second < config.border * first)


@dataclass(frozen=True, kw_only=True)
class Belief:
    """The ASR in which the robot believed to be at a stop on its way home."""

    reading: int
    """The number of the reading."""
    place: int
    """The ASR with the greatest confidence."""
    confidence: float
    """The confidence of that ASR."""
    rival: int
    """The ASR with the second greatest confidence; -1 if there is only one ASR."""
    rival_confidence: float
    """The confidence of the rival."""
    is_sure: bool
    """Whether the first confidence is clearly greater."""
    kept: float | None = None
    """The probability that the odometer kept its frame where the robot turned round, which is found
    by the trail; None if the robot keeps no trail, and so needs no frame."""

    @classmethod
    def of(
        cls,
        reading: int,
        confidences: Confidences,
        config: LocalisationConfig,
        kept: float | None = None,
    ) -> Belief:
        """Return the belief at a reading, given the confidences of all ASRs."""
        place = most_confident(confidences)
        others = np.where(np.arange(len(confidences)) == place, -1.0, confidences)
        rival = most_confident(others) if len(others) > 1 else -1
        return cls(
            reading=reading,
            place=place,
            confidence=float(confidences[place]),
            rival=rival,
            rival_confidence=float(confidences[rival]) if rival >= 0 else 0.0,
            is_sure=is_sure(confidences, config),
            kept=kept,
        )

    def __str__(self) -> str:
        """Return the belief as one line."""
        here = f"reading {self.reading}: in A{self.place} ({self.confidence:.2f})"
        if self.kept is not None and self.kept < 0.5:
            here += ", in a frame found anew"
        if self.is_sure:
            return here
        between = "at the border of" if abs(self.place - self.rival) == 1 else "or in"
        return f"{here}, {between} A{self.rival} ({self.rival_confidence:.2f})"
