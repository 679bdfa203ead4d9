"""Claims: actions that mean "I have been here before".

If the mapper recognises places, the robot claims that its current position is where the mapper's
matched reading was taken. If not, it claims only that it has been in this place before. A claim
with a matched reading is false if that reading was taken elsewhere (see `albot_maps.same_place`),
and right if it was taken here on an earlier visit. If it was taken on the present visit, the
claim is true but worth nothing and does not count. A claim without a reading is right on a later
visit, and false on the first. A visit to a room begins when the robot comes in from another
room. The first claim of a visit that counts is judged; claims within the first `SETTLED` metres
of a visit do not count.
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
    """Speed and turn rate, and a third number that claims that the present place is known."""

    names: ClassVar[tuple[str, ...]] = ("speed", "turn rate", "claim")


class Claims(NamedTuple):
    """The robots' claims and the data needed to judge them, one row per robot."""

    claims: np.ndarray
    """(n,) bool: whether the action claims that the robot has been here before."""
    matched: np.ndarray
    """(n,) int64: earlier reading that the mapper matches with this place; -1 for none."""
    barriers: Barriers
    """The barriers between the places of all worlds."""
    worlds: np.ndarray
    """(n,) int64: index of the robot's world in `barriers`."""
    points: np.ndarray
    """(n, readings, 2) float32: true position at each reading (world frame, m). No columns if the
    mappers do not recognise places."""
    rooms: np.ndarray
    """(n, readings) int32: room at each reading; -1 between rooms."""
    visits: np.ndarray
    """(n, readings) int32: number of the room visit at each reading, from 1; 0 before the first."""
    visit: np.ndarray
    """(n,) int64: number of the present visit."""
    room: np.ndarray
    """(n,) int64: the present or else the latest room; -1 before the first."""
    since: np.ndarray
    """(n,) float64: path length at the beginning of the visit (m)."""
    returned: np.ndarray
    """(n,) bool: whether the robot had been in that room before and left it."""
    judged: np.ndarray
    """(n,) bool: whether a claim was judged on this visit."""
    recognized: np.ndarray
    """(n, most) bool: rooms in which a claim was right."""
    counts: np.ndarray
    """(n, 3) int64: number of re-entries of rooms, of right claims, and of false claims."""


KEPT_CLAIMS = ("claims", "visit", "room", "since", "returned", "judged", "recognized", "counts")
"""The arrays of `Claims` with one value or row per robot that are the robot's own."""
SETTLED = 1.0
"""Distance driven in a room before claims count (m): a mapper may notice that it is through a
doorway a little before or after."""
NOTHING, RIGHT, AGAIN, FALSE = 0, 1, 2, 3
"""Results of a step's claim: none judged; right; right once more in the same room; false."""

_FIRST_ROOM = 512
"""Initial number of readings that the arrays hold; it doubles when they are full."""


def no_claims(robots: int, matched: np.ndarray | None) -> Claims:
    """Return the claims of robots that have made none.

    Args:
        robots: Number of robots.
        matched: The readings that the robots' mappers match, (n,) int64, an array that the mappers
            overwrite; None if they do not recognise places.
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
    """Return claims with room for so many readings and rooms; the same arrays if they suffice."""
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
    """Reset the claims of robot i."""
    c.recognized[i] = False
    c.counts[i] = 0
    c.room[i] = -1
    c.visit[i] = 0
    c.returned[i] = c.judged[i] = False


@kernel()
def judge_claim(
    i: int, reading: int, driven: float, pose: np.ndarray, room: int, is_new: bool, c: Claims
) -> int:
    """Update robot i's visits with its latest reading, and judge its claim.

    Args:
        i: Index of the robot.
        reading: Index of the reading.
        driven: Path length so far (m).
        pose: True pose (3,) (world frame; m, rad).
        room: Index of the robot's room in its world; -1 between rooms.
        is_new: Whether the robot is in that room for the first time.
        c: The claims of all robots.

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
