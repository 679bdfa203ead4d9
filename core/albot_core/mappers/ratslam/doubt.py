"""Doubt after a re-localisation, until known experiences have confirmed it.

A false one would leave a transition between two far places behind, and the correction would bend
the map towards it for ever. So transitions to known experiences wait, and the odometer goes on
from the experience before, the anchor. Where the robot is re-localised again before enough known
experiences followed one another, what waits is dropped. The paper does not speak of this: ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.motions import Motion, after, motion_of


class Transition(NamedTuple):
    """What is known of a transition that waits."""

    source: int
    target: int
    motion: Motion
    """The target in the source's frame, as measured."""
    time: float
    """How long it took (s)."""
    steps: int
    """How many iterations it took."""


class Doubt:
    """What is kept while a re-localisation is doubted."""

    def __init__(self) -> None:
        whole = dict.fromkeys(("source", "target", "steps"), (np.int64, ()))
        self._waiting = Table(**whole, motion=(np.float64, (3,)), time=(np.float64, ()))
        self.reset()

    def reset(self) -> None:
        """Doubt nothing."""
        self.anchor = -1
        """The last experience that is sure; -1 while nothing is doubted."""
        self.since: Motion = (0.0, 0.0, 0.0)
        """The robot in its frame, by the odometer."""
        self.left_at, self.left_in = 0.0, 0
        """When the robot was last there: stamp (s) and iteration."""
        self.known = 0
        """How many experiences there were at the re-localisation."""
        self._waiting.clear()

    def begin(self, anchor: int, here: Motion, left_at: float, left_in: int, known: int) -> None:
        """The robot was re-localised: drop what waits, and doubt from here."""
        self.reset()
        self.anchor, self.since, self.known = anchor, here, known
        self.left_at, self.left_in = left_at, left_in

    def integrate(self, motion: Motion) -> None:
        """Path integration from the anchor."""
        if self.anchor >= 0:
            self.since = after(self.since, motion)

    def _anchor_at(self, experience: int, stamp: float, iteration: int) -> None:
        """The robot is where the odometer says in a new experience."""
        self.anchor, self.since = experience, (0.0, 0.0, 0.0)
        self.left_at, self.left_in = stamp, iteration

    def take(
        self, transition: Transition, stamp: float, iteration: int, needed: int, *, is_new: bool
    ) -> list[Transition]:
        """Take in a transition; which ones are to be learned now.

        Args:
            transition: From the experience before to that which the robot is in now.
            stamp: The time now (s).
            iteration: The iteration now.
            needed: How many confirmations end the doubt.
            is_new: Whether the robot's experience is new: then it hangs from the anchor, by the
                odometer.
        """
        if self.anchor < 0:
            return [transition]
        learned: list[Transition] = []
        if transition.source != self.anchor or not is_new:
            self.wait(transition)
        if is_new:
            here, time, steps = transition.target, stamp - self.left_at, iteration - self.left_in
            learned.append(Transition(self.anchor, here, self.since, time, steps))
            self._anchor_at(here, stamp, iteration)
        if self.confirmations >= needed:
            learned += self.end()
        return learned

    def wait(self, transition: Transition) -> None:
        """Let a transition wait."""
        self._waiting.append(**transition._asdict())

    @property
    def confirmations(self) -> int:
        """How many experiences were entered that had been known before the re-localisation."""
        targets = self._waiting.rows("target")
        return len(np.unique(targets[targets < self.known]))

    def end(self) -> list[Transition]:
        """Doubt no longer; what waited is returned."""
        columns = [self._waiting.rows(name).tolist() for name in Transition._fields]
        waiting = [
            Transition(source, target, motion_of(motion), time, steps)
            for source, target, motion, time, steps in zip(*columns, strict=True)
        ]
        self.reset()
        return waiting

    def state(self) -> dict[str, np.ndarray]:
        """Everything remembered, as arrays by name."""
        return {
            "doubt.counts": np.array((self.anchor, self.left_in, self.known), np.int64),
            "doubt.numbers": np.array((*self.since, self.left_at)),
        } | self._waiting.state("doubted")

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become what gave `state`."""
        self.anchor, self.left_in, self.known = state["doubt.counts"].tolist()
        x, y, heading, self.left_at = state["doubt.numbers"].tolist()
        self.since = x, y, heading
        self._waiting.restore("doubted", state)
