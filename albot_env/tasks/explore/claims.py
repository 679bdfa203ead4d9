"""Claims: actions that say "I have been here before"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.actions import DeclaringActionConfig


@dataclass(frozen=True, kw_only=True)
class ClaimingActionConfig(DeclaringActionConfig):
    """Speed and turn rate, and a third number that claims to know the present place."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "claim")


SETTLED = 1.0
"""So far a robot drives in a place until that is taken to be in the room where it is (m): about
a doorway the mapper may find the new place a little before or after."""
MOST = 1024
"""Places beyond so many are not kept account of; claims in them are false."""


class Claims(NamedTuple):
    """What robots claim, and what is needed to judge it; a row each."""

    claims: np.ndarray
    """(n,) bool: whether its action claims that it has been here before."""
    places: np.ndarray
    """(n,) int64: the place that its mapper believes to be in; -1 where it knows no places."""
    met_in: np.ndarray
    """(n, MOST) int64: the room in which it first was in each of these places; -1 for none yet."""
    place: np.ndarray
    """(n,) int64: the place that it was in before the last step."""
    since: np.ndarray
    """(n,) float64: how far it had driven when it came there (m)."""
    room: np.ndarray
    """(n,) int64: the room that it is in, or was in last; -1 for none yet."""
    returned: np.ndarray
    """(n,) bool: whether it had been in that room before, and left it."""
    judged: np.ndarray
    """(n,) bool: whether it has claimed something since it came in."""
    recognized: np.ndarray
    """(n, most) bool: in which rooms it has claimed rightly."""
    counts: np.ndarray
    """(n, 3) int64: how often it came into a room again, claimed rightly, and falsely."""


NOTHING, RIGHT, AGAIN, FALSE = 0, 1, 2, 3
"""What a step's claim was: none to be judged; right; right once more in the same room; false."""


@kernel()
def forget_claims(i: int, c: Claims) -> None:
    """Let robot i begin anew."""
    c.met_in[i] = -1
    c.recognized[i] = False
    c.counts[i] = 0
    c.place[i] = c.room[i] = -1
    c.since[i] = 0.0
    c.returned[i] = c.judged[i] = False


@kernel()
def judge_claim(i: int, room: int, is_new: bool, driven: float, c: Claims) -> int:
    """Follow robot i into the `room` of its world (-1 between rooms), and judge its claim.

    `is_new` says whether it is there for the first time, `driven` how far it has come (m).
    """
    place = c.places[i]
    if place != c.place[i]:
        c.place[i], c.since[i] = place, driven
    if room < 0:
        return NOTHING
    settled = 0 <= place < MOST and driven - c.since[i] >= SETTLED
    if settled and c.met_in[i, place] < 0:
        c.met_in[i, place] = room
    if room != c.room[i]:
        c.returned[i] = not is_new
        c.room[i], c.judged[i] = room, False
        c.counts[i, 0] += not is_new
    if c.judged[i] or not c.claims[i]:
        return NOTHING
    c.judged[i] = True
    known = place < 0 or (place < MOST and c.met_in[i, place] == room)
    if not (c.returned[i] and known):
        c.counts[i, 2] += 1
        return FALSE
    c.counts[i, 1] += 1
    before = c.recognized[i, room]
    c.recognized[i, room] = True
    return AGAIN if before else RIGHT
