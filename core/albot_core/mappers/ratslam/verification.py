"""Loop-closure verification: a re-localisation is pending until known experiences confirm it.

A false re-localisation would leave a transition between two distant places, and the correction
would bend the map towards it for ever. So transitions to known experiences are pending, and
odometry continues from the last verified experience, the anchor. If the robot is re-localised again
before enough known experiences followed one another, the pending transitions are dropped. Then, and
when a new experience is made, the robot's poses in the meantime become those by odometry from the
anchor. This is our addition; the paper does not cover it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.motions import Motion, after, motion_of
from albot_core.mappers.schema import Field, Pack, Schema
from albot_core.mappers.stored import Stored


class Transition(NamedTuple):
    """A transition as it was measured."""

    source: int
    target: int
    motion: Motion
    """The target's pose in the source's frame."""
    time: float
    """Duration (s)."""
    variance: float
    """Variance of the motion beyond the odometer's, as a share of that of a pose by one scene."""
    steps: int
    """Number of iterations that it took."""


class Verification(Stored):
    """What is kept while a re-localisation is pending."""

    SCHEMA = Schema(
        Pack(
            "verification.counts",
            int,
            Field("anchor", at="anchor", least=-1, below="experiences"),
            Field("hypothesis", at="hypothesis", least=-1, below="experiences"),
            Field("left_in", at="left_in", least=0),
            Field("known", at="known", least=0, most="experiences"),
        ),
        Pack(
            "verification.numbers",
            float,
            Field("from_anchor", "3", at="from_anchor"),
            Field("from_hypothesis", "3", at="from_hypothesis"),
            Field("variance", at="variance"),
            Field("left_at", at="left_at"),
        ),
        parts=("_pending", "meanwhile"),
    )

    def __init__(self) -> None:
        self._pending = Table(
            "pending",
            Field("source", "", int, least=0, below="experiences"),
            Field("target", "", int, least=0, below="experiences"),
            Field("steps", "", int, least=1),
            Field("time", least=0),
            Field("variance", least=0),
            Field("motion", "3"),
        )
        self.meanwhile = Table(
            "meanwhile", Field("anchor", "", int, least=0, below="experiences"), Field("pose", "3")
        )
        """The robot's pose by odometry from the anchor, at every reading while pending."""
        self.reset()

    def reset(self) -> None:
        """Drop the re-localisation and all pending transitions."""
        self.anchor = -1
        """The last verified experience; -1 while nothing is pending."""
        self.from_anchor: Motion = (0.0, 0.0, 0.0)
        """The robot's pose in the anchor's frame, by odometry."""
        self.variance = 0.0
        """Variance of that pose, as a share of that of a pose by one scene."""
        self.left_at, self.left_in = 0.0, 0
        """When the robot was last at the anchor: stamp (s) and iteration."""
        self.hypothesis = -1
        """The known experience that was entered last while pending; -1 if none was."""
        self.from_hypothesis: Motion = (0.0, 0.0, 0.0)
        """The robot's pose in that experience's frame, by odometry since."""
        self.known = 0
        """Number of experiences at the re-localisation."""
        self._pending.clear()
        self.meanwhile.clear()

    def note(self) -> None:
        """Note the robot's pose by odometry from the anchor, at a reading while pending."""
        if self.anchor >= 0:
            self.meanwhile.append(anchor=self.anchor, pose=self.from_anchor)

    def begin(
        self,
        anchor: int,
        here: Motion,
        variance: float,
        left_at: float,
        left_in: int,
        known: int,
    ) -> None:
        """Begin to verify a re-localisation; pending transitions are dropped."""
        self.reset()
        self.anchor, self.from_anchor, self.variance, self.known = anchor, here, variance, known
        self.left_at, self.left_in = left_at, left_in

    def enter(self, experience: int, offset: Motion) -> None:
        """Note that a known experience is entered, with the robot at this pose in its frame."""
        if self.anchor >= 0:
            self.hypothesis, self.from_hypothesis = experience, offset

    def integrate(self, motion: Motion) -> None:
        """Integrate odometry from the anchor and from the experience entered last."""
        if self.anchor >= 0:
            self.from_anchor = after(self.from_anchor, motion)
            self.from_hypothesis = after(self.from_hypothesis, motion)

    def _anchor_at(self, experience: int, stamp: float, iteration: int) -> None:
        """Make a new experience the anchor, with the robot at its origin."""
        self.anchor, self.from_anchor, self.variance = experience, (0.0, 0.0, 0.0), 0.0
        self.left_at, self.left_in = stamp, iteration

    def process(
        self, transition: Transition, stamp: float, iteration: int, needed: int, *, is_new: bool
    ) -> list[Transition]:
        """Process a transition; return those that are to be learned now.

        Args:
            transition: From the last experience to the present one.
            stamp: The present time (s).
            iteration: The present iteration.
            needed: Number of confirmations that verify a re-localisation.
            is_new: Whether the present experience is new; if so, it is linked to the anchor by
                odometry.
        """
        if self.anchor < 0:
            return [transition]
        learned: list[Transition] = []
        if transition.source != self.anchor or not is_new:
            self.add_pending(transition)
        if is_new:
            here, time, steps = transition.target, stamp - self.left_at, iteration - self.left_in
            learned.append(
                Transition(self.anchor, here, self.from_anchor, time, self.variance, steps)
            )
            self._anchor_at(here, stamp, iteration)
        if self.confirmations >= needed:
            learned += self.accept()
        return learned

    def add_pending(self, transition: Transition) -> None:
        """Add a transition to the pending ones."""
        self._pending.append(**transition._asdict())

    @property
    def confirmations(self) -> int:
        """Number of experiences entered that were known before the re-localisation."""
        targets = self._pending.rows("target")
        return len(np.unique(targets[targets < self.known]))

    def accept(self) -> list[Transition]:
        """Accept the re-localisation; return the transitions that were pending."""
        columns = [self._pending.rows(name).tolist() for name in Transition._fields]
        pending = [
            Transition(source, target, motion_of(motion), time, variance, steps)
            for source, target, motion, time, variance, steps in zip(*columns, strict=True)
        ]
        self.reset()
        return pending
