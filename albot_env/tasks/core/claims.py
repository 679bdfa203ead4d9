"""Claims: actions that mean "I have been here before".

If the mapper recognises places, the robot claims that its current position is where the mapper's
matched reading was taken. If not, it claims only that it has been in this place before. A claim
with a matched reading is false if that reading was taken elsewhere (see `albot_maps.same_place`),
and right if it was taken here on an earlier visit. If it was taken on the present visit, the
claim is true but worth nothing and does not count. A claim without a reading is right on a later
visit, and false on the first. The matched reading is that which the mapper had when the agent
decided, because this is what the agent saw; in the step that follows the mapper may think again,
or leave the place. A visit to a room begins when the robot comes in from another
room. The first claim of a visit that counts is judged; claims within the first `SETTLED` metres
of a visit do not count.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.kernels.compiled import kernel
from albot_env.sim.world_cache import WorldCache
from albot_env.tasks.core.row_arrays import Arrays, copied_rows, put_rows
from albot_maps import World
from albot_maps.same_place import NO_BARRIERS, Barriers, is_same_place, with_barriers


class Claims(NamedTuple):
    """The robots' claims and the data needed to judge them, one row per robot."""

    claims: np.ndarray
    """(n,) bool: whether the action claims that the robot has been here before."""
    matched: np.ndarray
    """(n,) int64: the earlier reading that the mapper matched with the place when the robot
    claimed, -1 for none; without a claim, of an earlier step."""
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
    before: np.ndarray
    """(n,) int64: number of readings before the episode's first."""
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
    """(n, 3) int64: number of re-entries of rooms, of right claims, and of false claims. The visit
    during which an episode begins counts if it began with a re-entry."""


_KEPT = (
    "claims", "before", "visit", "room", "since", "returned", "judged", "recognized", "counts",
)  # fmt: skip
"""The arrays of `Claims` with one value or row per robot that are the robot's own."""
_VISITED = "points", "rooms", "visits"
"""The arrays of `Claims` with one value per reading."""
SETTLED = 1.0
"""Distance driven in a room before claims count (m): a mapper may notice that it is through a
doorway a little before or after."""
NOTHING, RIGHT, AGAIN, FALSE = 0, 1, 2, 3
"""Results of a step's claim: none judged; right; right once more in the same room; false."""
_SIGNS = np.array((0, 1, 1, -1))
"""Whether these are right (1) or false (-1)."""

_FIRST_ROOM = 512
"""Initial number of readings that the arrays hold; it doubles when they are full."""


def no_claims(robots: int, *, matches: bool) -> Claims:
    """Return the claims of robots that have made none.

    Args:
        robots: Number of robots.
        matches: Whether the robots' mappers recognise places.
    """
    readings = _FIRST_ROOM if matches else 0
    return Claims(
        claims=np.zeros(robots, np.bool_),
        matched=np.full(robots, -1),
        barriers=NO_BARRIERS,
        worlds=np.zeros(robots, np.int64),
        points=np.zeros((robots, readings, 2), np.float32),
        rooms=np.zeros((robots, readings), np.int32),
        visits=np.zeros((robots, readings), np.int32),
        before=np.zeros(robots, np.int64),
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


class ReadingMatcher(Protocol):
    """What matches the present reading with earlier ones: a `MapperBatch` is one."""

    @property
    def recognises_places(self) -> bool:
        """Whether readings can be matched."""

    @property
    def matched_readings(self) -> Int64[np.ndarray, "robots"]:
        """Number of the matched reading of each robot, -1 for none; always the same array."""

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Bring `matched_readings` of some rows up to date."""


class ClaimJudge:
    """Judges the claims of a task's robots.

    The task calls `begin` for each episode, `hear` in each step before its readings, and the kernel
    `judge_claim` with `table`, once for each reading.

    Args:
        robots: Number of robots.
        mappers: Their mappers, or what stands for them; None without.
    """

    def __init__(self, robots: int, mappers: ReadingMatcher | None) -> None:
        self._mappers = mappers
        self._matches = mappers is not None and mappers.recognises_places
        self.table = no_claims(robots, matches=self._matches)
        """The claims of all robots; a new tuple whenever more readings or rooms need room."""
        self._readings = 0
        self._worlds = WorldCache(robots, self._add_barriers, self._forget_barriers)

    def begin(self, row: int, world: World) -> None:
        """Reset the claims of a robot whose next reading is its mapper's first."""
        self._reserve(row, world)
        table = self.table
        table.recognized[row], table.counts[row], table.room[row] = False, 0, -1
        table.before[row] = table.visit[row] = 0
        table.claims[row] = table.returned[row] = table.judged[row] = False

    def visited(self, row: int, readings: int) -> Arrays:
        """Return where a robot has been in its first readings (copies): see `begin_after`."""
        if not self._matches:
            readings = 0
        kept = copied_rows("claims", self.table, row, _KEPT)
        places = copied_rows("claims", self.table, row, _VISITED)
        return {**kept, **{name: array[:readings] for name, array in places.items()}}

    def begin_after(self, row: int, world: World, visited: Arrays, readings: int) -> None:
        """Begin an episode of a robot whose mapper remembers what it has seen before.

        Args:
            row: The robot.
            world: Its world.
            visited: What `visited` returned of the robot that made these readings.
            readings: Number of readings before the first of the episode.
        """
        self.set_state(row, world, visited)
        table = self.table
        table.before[row], table.recognized[row], table.counts[row] = readings, False, 0
        table.claims[row] = table.judged[row] = False

    def hear(self, claims: Bool[np.ndarray, "robots"], steps: Int64[np.ndarray, "robots"]) -> None:
        """Take the claims of a step that begins, `steps` after the episodes' beginnings."""
        table = self.table
        table.claims[:] = claims
        if self._matches:
            assert self._mappers is not None
            rows = np.flatnonzero(claims & ~table.judged)
            self._mappers.match_readings(rows)
            table.matched[rows] = self._mappers.matched_readings[rows]
            # A robot has no more readings than there were steps since the arrays had room.
            self._readings += 1
            if self._readings >= self.table.points.shape[1]:
                self._readings = int((self.table.before + steps).max()) + 2
                self.table = with_room(self.table, self._readings, 0)

    def outcomes(
        self,
        poses: Float64[np.ndarray, "robots 3"],
        rooms: Int64[np.ndarray, "robots"],
        driven: Float64[np.ndarray, "robots"],
    ) -> Int64[np.ndarray, "robots"]:
        """Return what a claim of each robot would be now, if it were the first of its visit.

        Args:
            poses: True poses (world frame; m, rad).
            rooms: Index of each robot's room in its world; -1 between rooms.
            driven: Path lengths so far (m).

        Returns:
            1 if it would be right, -1 if false, 0 if it would not count.
        """
        robots = len(poses)
        matched = np.full(robots, -1)
        if self._matches:
            assert self._mappers is not None
            self._mappers.match_readings(np.arange(robots))
            matched = self._mappers.matched_readings
        each = zip(range(robots), driven, poses, rooms, matched, strict=True)
        return _SIGNS[[claim_outcome(*of_robot, self.table) for of_robot in each]]

    @property
    def facts(self) -> dict[str, np.ndarray]:
        """The true values for `info`, one row per robot."""
        returns, right, false = self.table.counts.T
        return {"re_entries": returns, "right_claims": right, "false_claims": false}

    def state(self, row: int, steps: int) -> Arrays:
        """Return what the judgement of a robot's claims depends on (copies), after some steps."""
        return self.visited(row, int(self.table.before[row]) + steps + 1)

    def set_state(self, row: int, world: World, arrays: Arrays) -> None:
        """Give a robot in a world what `state` returned."""
        self._reserve(row, world)
        # Arrays come from tables that may have had room for larger worlds.
        self.table = with_room(self.table, 0, len(arrays["claims.recognized"]))
        if self._matches:
            readings = len(arrays["claims.points"]) + 1
            self.table = with_room(self.table, readings, 0)
            self._readings = max(self._readings, readings)
        put_rows("claims", self.table, row, arrays)

    def _reserve(self, row: int, world: World) -> None:
        """Make room for the claims of a robot in a world."""
        self.table = with_room(self.table, 0, len(world.rooms))
        if self._matches:
            for other, number in self._worlds.enter(row, world):
                self.table.worlds[other] = number

    def _add_barriers(self, world: World) -> int:
        """Add the barriers between one world's places; return the world's index."""
        barriers = with_barriers(self.table.barriers, world)
        self.table = self.table._replace(barriers=barriers)
        return len(barriers.spans) - 1

    def _forget_barriers(self) -> None:
        self.table = self.table._replace(barriers=NO_BARRIERS)


@kernel()
def judge_claim(
    i: int, step: int, driven: float, pose: np.ndarray, room: int, is_new: bool, c: Claims
) -> int:
    """Update robot i's visits with its latest reading, and judge its claim.

    Args:
        i: Index of the robot.
        step: Number of steps since the episode began.
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
    elif step == 0:  # After a journey the present visit can be claimed, so it counts too.
        c.counts[i, 0] += c.returned[i]
    matches, reading = c.points.shape[1] > 0, c.before[i] + step
    if matches:
        c.points[i, reading, 0], c.points[i, reading, 1] = pose[0], pose[1]
        c.rooms[i, reading], c.visits[i, reading] = room, c.visit[i]
    if c.judged[i] or not c.claims[i]:
        return NOTHING
    outcome = claim_outcome(i, driven, pose, room, c.matched[i], c)
    if outcome == NOTHING:
        return NOTHING
    c.judged[i] = True
    if outcome == FALSE:
        c.counts[i, 2] += 1
    else:
        c.counts[i, 1] += 1
        c.recognized[i, room] = True
    return outcome


@kernel()
def claim_outcome(
    i: int, driven: float, pose: np.ndarray, room: int, matched: int, c: Claims
) -> int:
    """Return what robot i's claim would be if it were the first of its visit; nothing changes.

    Args:
        i: Index of the robot.
        driven: Path length so far (m).
        pose: True pose (3,) (world frame; m, rad).
        room: Index of the robot's room in its world; -1 between rooms.
        matched: The earlier reading that the mapper matches with the place; -1 for none.
        c: The claims of all robots, with the latest reading.

    Returns:
        NOTHING, RIGHT, AGAIN or FALSE.
    """
    if room < 0 or driven - c.since[i] < SETTLED:
        return NOTHING
    is_true, has_returned = True, c.returned[i]
    if c.points.shape[1] > 0:
        is_true = _is_taken_here(i, pose, room, matched, c)
        has_returned = has_returned and c.visits[i, matched] != c.visit[i]
        if is_true and not has_returned:
            return NOTHING
    if not (is_true and has_returned):
        return FALSE
    return AGAIN if c.recognized[i, room] else RIGHT


@kernel()
def _is_taken_here(i: int, pose: np.ndarray, room: int, matched: int, c: Claims) -> bool:
    """Whether a reading of robot i was taken at the present place; -1 for no reading."""
    if matched < 0:
        return False
    x, y = c.points[i, matched]
    there = c.rooms[i, matched]
    return is_same_place(pose[0], pose[1], room, x, y, there, c.worlds[i], c.barriers)
