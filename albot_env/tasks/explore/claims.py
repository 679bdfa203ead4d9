"""Claims: actions that say "I have been here before".

A claim is one about readings. Where the mapper recognises places, the robot claims that it is where
its mapper's matched reading was taken; where it does not, only that it has been in this place
before. A claim of a matched reading is false where that was taken elsewhere (see
`albot_maps.same_place`), and right where it was taken here on an earlier visit. Of the present
visit it is true but worth nothing, and does not count. A claim without a reading is right on a
later visit, and false on the first. A visit to a room begins as the robot comes in from another
one. The first claim of a visit that counts is judged; claims within `SETTLED` of its beginning do
not count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from albot_core.kernels.compiled import kernel
from albot_env.tasks.core.actions import DeclaringActionConfig
from albot_maps.same_place import NO_BARRIERS, Barriers, is_same_place


@dataclass(frozen=True, kw_only=True)
class ClaimingActionConfig(DeclaringActionConfig):
    """Speed and turn rate, and a third number that claims to know the present place."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "claim")


class Claims(NamedTuple):
    """What robots claim, and what is needed to judge it; a row each."""

    claims: np.ndarray
    """(n,) bool: whether its action claims that it has been here before."""
    matched: np.ndarray
    """(n,) int64: the earlier reading that its mapper believes was taken here; -1 for none."""
    barriers: Barriers
    """What parts the places of all worlds."""
    worlds: np.ndarray
    """(n,) int64: the number of its world among those of the barriers."""
    points: np.ndarray
    """(n, readings, 2) float32: where each of its readings was truly taken (world frame, m). No
    columns where mappers recognise no places."""
    rooms: np.ndarray
    """(n, readings) int32: in which room, -1 between rooms."""
    visits: np.ndarray
    """(n, readings) int32: on which of its visits to rooms, counted from 1; 0 before the first."""
    visit: np.ndarray
    """(n,) int64: the number of the present visit."""
    room: np.ndarray
    """(n,) int64: the room that it is in, or was in last; -1 for none yet."""
    since: np.ndarray
    """(n,) float64: how far it had driven when the visit began (m)."""
    returned: np.ndarray
    """(n,) bool: whether it had been in that room before, and left it."""
    judged: np.ndarray
    """(n,) bool: whether it has claimed something on this visit."""
    recognized: np.ndarray
    """(n, most) bool: in which rooms it has claimed rightly."""
    counts: np.ndarray
    """(n, 3) int64: how often it came into a room again, claimed rightly, and falsely."""


SETTLED = 1.0
"""So far a robot drives into a room until claims count (m): about a doorway a mapper may notice a
little before or after that it is through."""
NOTHING, RIGHT, AGAIN, FALSE = 0, 1, 2, 3
"""What a step's claim was: none to be judged; right; right once more in the same room; false."""

_FIRST_ROOM = 512
"""Readings for which there is room at first; it doubles as they come to more."""


def no_claims(robots: int, matched: np.ndarray | None) -> Claims:
    """The claims of robots that have made none.

    Args:
        robots: How many.
        matched: The readings that their mappers match, (n,) int64: an array that is written over;
            None where the mappers recognise no places.
    """
    readings = 0 if matched is None else _FIRST_ROOM
    return Claims(
        claims=np.zeros(robots, np.bool_),
        matched=np.full(robots, -1) if matched is None else matched,
        barriers=NO_BARRIERS,
        worlds=np.zeros(robots, np.int64),
        points=np.zeros((robots, readings, 2), np.float32),
        rooms=np.zeros((robots, readings), np.int32),
        visits=np.zeros((robots, readings), np.int32),
        visit=np.zeros(robots, np.int64),
        room=np.full(robots, -1),
        since=np.zeros(robots),
        returned=np.zeros(robots, np.bool_),
        judged=np.zeros(robots, np.bool_),
        recognized=np.zeros((robots, 0), np.bool_),
        counts=np.zeros((robots, 3), np.int64),
    )


def with_room(claims: Claims, readings: int, rooms: int) -> Claims:
    """Claims with room for so many readings and rooms; the same ones where there is enough."""
    known, kept = claims.recognized, claims.points.shape[1]
    if known.shape[1] < rooms:
        more = np.zeros((len(known), rooms - known.shape[1]), np.bool_)
        claims = claims._replace(recognized=np.concatenate((known, more), axis=1))
    if 0 < kept < readings:
        columns = max(readings, 2 * kept) - kept
        claims = claims._replace(
            points=np.pad(claims.points, ((0, 0), (0, columns), (0, 0))),
            rooms=np.pad(claims.rooms, ((0, 0), (0, columns))),
            visits=np.pad(claims.visits, ((0, 0), (0, columns))),
        )
    return claims


@kernel()
def forget_claims(i: int, c: Claims) -> None:
    """Let robot i begin anew."""
    c.recognized[i] = False
    c.counts[i] = 0
    c.room[i] = -1
    c.visit[i] = 0
    c.returned[i] = c.judged[i] = False


@kernel()
def judge_claim(
    i: int, reading: int, driven: float, pose: np.ndarray, room: int, is_new: bool, c: Claims
) -> int:
    """Follow robot i to its latest reading, and judge its claim.

    Args:
        i: Which robot.
        reading: The number of the reading.
        driven: How far the robot has driven (m).
        pose: Where it truly is (3,) (world frame; m, rad).
        room: The room of its world that it is in, -1 between rooms.
        is_new: Whether it is in that room for the first time.
        c: What all robots claim.

    Returns:
        NOTHING, RIGHT, AGAIN or FALSE.
    """
    if room >= 0 and room != c.room[i]:
        c.returned[i] = not is_new
        c.room[i], c.judged[i], c.since[i] = room, False, driven
        c.visit[i] += 1
        c.counts[i, 0] += not is_new
    matches = c.points.shape[1] > 0
    if matches:
        c.points[i, reading, 0], c.points[i, reading, 1] = pose[0], pose[1]
        c.rooms[i, reading], c.visits[i, reading] = room, c.visit[i]
    if room < 0 or c.judged[i] or not c.claims[i] or driven - c.since[i] < SETTLED:
        return NOTHING
    is_true, has_returned = True, c.returned[i]
    if matches:
        is_true = _is_taken_here(i, pose, room, c)
        has_returned = has_returned and c.visits[i, c.matched[i]] != c.visit[i]
        if is_true and not has_returned:
            return NOTHING
    c.judged[i] = True
    if not (is_true and has_returned):
        c.counts[i, 2] += 1
        return FALSE
    c.counts[i, 1] += 1
    before = c.recognized[i, room]
    c.recognized[i, room] = True
    return AGAIN if before else RIGHT


@kernel()
def _is_taken_here(i: int, pose: np.ndarray, room: int, c: Claims) -> bool:
    """Whether the reading that robot i's mapper matches was taken at the present place."""
    matched = c.matched[i]
    if matched < 0:
        return False
    x, y = c.points[i, matched]
    there = c.rooms[i, matched]
    return is_same_place(pose[0], pose[1], room, x, y, there, c.worlds[i], c.barriers)
