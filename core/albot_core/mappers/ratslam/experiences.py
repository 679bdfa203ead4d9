"""The experience map: experiences, the transitions between them, and ways over them.

Equations (1) to (11), sections 4.1 and 4.2. An experience lasts while its view is seen and the
packet of the pose cells is in its zone. A transition holds where its target lies in its source's
frame as the odometer measured it, d_ij and θ_ij as x and y, φ_ij unwrapped, and the time it took.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Poses
from albot_core.kernels.compiled import kernel
from albot_core.mappers.ratslam.arrays import Table
from albot_core.mappers.ratslam.config import CorrectionConfig, ExperienceConfig, PoseCellConfig
from albot_core.mappers.ratslam.correction import correct_all_at_once, correct_link_by_link
from albot_core.mappers.ratslam.pose_cells import Packet
from albot_core.mappers.ratslam.winding import turns_of

FASTEST = 10.0
"""No transition counts as quicker than this (m/s): stamps may stand still or run backwards."""
_MOVED = 0.05
"""The map has changed when an experience moved so far (m)."""
_STIFF = 3.0
"""Iterations over which a transition is fully trusted; one of twice as many has half the rate."""
_NUMBER, _INT = (np.float64, ()), (np.int64, ())


class ExperienceMap:
    """Experiences and transitions.

    Args:
        config: The zones of influence.
        cells: The pose cells, for what the zones measure in them.
        correction: How the map is corrected.
    """

    def __init__(
        self, config: ExperienceConfig, cells: PoseCellConfig, correction: CorrectionConfig
    ) -> None:
        self._config, self._correction = config, correction
        self._shape = cells.columns, cells.rows, cells.headings
        self._zone = config.radius / cells.cell, config.turn / cells.cell_turn
        self.experiences = Table(
            pose=(np.float64, (3,)),  # In the map, the heading unwrapped (m, m, rad).
            shown=(np.float64, (3,)),  # The same when the map's version was last raised.
            cell=(np.float64, (3,)),  # (x', y', θ') of eq. (1), in cells.
            view=_INT,  # V of eq. (1).
            turn=_NUMBER,  # The robot's heading seen from the view (rad).
            reading=_INT,  # When it was new.
            way=_NUMBER,  # How far the robot had gone when it was last there (m).
            same_view=_INT,  # The experience before it with the same view, -1 for none.
            reached_by=_INT,  # The transition by which it was first reached.
            entry=_INT,  # First in the chain of its transitions' ends, see `ends`.
            time=_NUMBER,  # To home, the quickest way (s)…
            length=_NUMBER,  # …and how long that is (m)…
            onward=_INT,  # …and the next experience on it, -1 at home.
        )
        self.links = Table(
            source=_INT,
            target=_INT,
            motion=(np.float64, (3,)),  # d, θ and φ: the target in the source's frame.
            time=_NUMBER,  # How long it takes (s), the quickest that was driven.
            stiffness=_NUMBER,  # How much of the rate it has: less the longer it is.
            passed=_INT,  # How often it was.
            ends=(np.int64, (2,)),  # The next ends in the chains of source and of target.
        )
        self._last_of_view = Table(experience=_INT)

    def clear(self) -> None:
        """Forget everything."""
        for table in (self.experiences, self.links, self._last_of_view):
            table.clear()

    @property
    def count(self) -> int:
        """N_e: how many experiences there are."""
        return self.experiences.count

    @property
    def poses(self) -> Poses:
        """Where the experiences lie in the map, headings unwrapped (a view)."""
        return self.experiences.rows("pose")

    def active(self, view: int, packet: Packet) -> int:
        """The experience with the most energy; -1 where none has any (eq. 10)."""
        if view + 1 >= self._last_of_view.count:
            return -1
        return most_energetic(
            self._last_of_view["experience"][view + 1],
            self.experiences["same_view"],
            self.experiences["cell"],
            (packet.x, packet.y, packet.heading),
            self._shape,
            self._zone,
            self._config.either_zone,
        )

    def add(
        self, pose: tuple[float, float, float], packet: Packet, view: int, turn: float, reading: int
    ) -> int:
        """Make a new experience (eq. 11); returns its number."""
        heads = self._last_of_view
        while heads.count <= view + 1:
            heads.append(experience=-1)
        number = self.experiences.append(
            pose=pose,
            shown=pose,
            cell=(packet.x, packet.y, packet.heading),
            view=view,
            turn=turn,
            reading=reading,
            same_view=heads["experience"][view + 1],
            reached_by=-1,
            entry=-1,
            time=0.0 if self.count == 0 else math.inf,
            length=0.0 if self.count == 0 else math.inf,
            onward=-1,
        )
        heads["experience"][view + 1] = number
        return number

    def connect(
        self,
        source: int,
        target: int,
        motion: tuple[float, float, float],
        time: float,
        bias: float,
        steps: int,
    ) -> bool:
        """Learn a transition, or take the mean with what was measured on it before.

        Args:
            source: The experience that the robot comes from.
            target: The one that it is in now.
            motion: The target in the source's frame, as measured.
            time: How long it took (s).
            bias: The odometer's (rad/s), for the winding of loops.
            steps: How many iterations it took, from 1: the longer it is, the less it is trusted.

        Returns:
            Whether it is new.
        """
        links, experiences = self.links, self.experiences
        time = max(time, math.hypot(motion[0], motion[1]) / FASTEST)
        link = find_link(source, target, experiences["entry"], self._ends)
        is_new = link < 0
        if is_new:
            turns = 0
            if experiences["reached_by"][target] < 0 < target:
                experiences["reached_by"][target] = links.count
            else:
                turns = turns_of(source, target, motion, time, self._tree, bias)
            link = links.append(
                source=source,
                target=target,
                motion=(motion[0], motion[1], motion[2] + 2 * math.pi * turns),
                time=time,
                passed=1,
                stiffness=min(1.0, _STIFF / steps),
                ends=(experiences["entry"][source], experiences["entry"][target]),
            )
            experiences["entry"][source] = 2 * link
            experiences["entry"][target] = 2 * link + 1
        else:
            known = links["motion"][link]
            links["passed"][link] += 1
            off = np.asarray(motion) - known
            off[2] -= 2 * math.pi * round(off[2] / (2 * math.pi))
            known += off / links["passed"][link]
            links["time"][link] = min(links["time"][link], time)
        shorten(link, self._home_ways, self._graph, np.zeros(self.count, np.int64))
        return is_new

    def correct(self) -> bool:
        """Let the experiences move towards where the links say (eq. 12 to 14).

        Returns:
            Whether one has moved far enough for the map to be drawn anew.
        """
        links, config = self.links, self._correction
        arrays = links["source"], links["target"], links["motion"]
        for _ in range(config.passes):
            if config.form == "link_by_link":
                correct_link_by_link(
                    self.poses, arrays, links.count, config.rate, links["stiffness"]
                )
            else:
                changes = np.empty_like(self.poses)
                correct_all_at_once(self.poses, arrays, links.count, config.rate, changes)
        if not config.passes or not has_moved(self.poses, self.experiences.rows("shown"), _MOVED):
            return False
        self.experiences.rows("shown")[:] = self.poses
        return True

    def ways_to(
        self, goal: int
    ) -> tuple[Float64[np.ndarray, "all"], Float64[np.ndarray, "all"], Int64[np.ndarray, "all"]]:
        """The quickest ways from all experiences to one.

        Returns:
            Time (s), length (m) and the next experience on each, -1 at the goal and where no way
            is known.
        """
        times, lengths = np.full(self.count, np.inf), np.full(self.count, np.inf)
        onward = np.full(self.count, -1)
        times[goal] = lengths[goal] = 0.0
        queue = np.zeros(self.count, np.int64)
        spread_ways(goal, (times, lengths, onward), self._graph, queue)
        return times, lengths, onward

    def nearest(self, x: float, y: float) -> int:
        """The experience that lies nearest to a point of the map (m)."""
        return int(np.argmin(np.hypot(self.poses[:, 0] - x, self.poses[:, 1] - y)))

    def state(self) -> dict[str, np.ndarray]:
        """Everything remembered, as arrays by name."""
        return (
            self.experiences.state("experiences")
            | self.links.state("transitions")
            | self._last_of_view.state("last_of_view")
        )

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Become what gave `state`."""
        self.experiences.restore("experiences", state)
        self.links.restore("transitions", state)
        self._last_of_view.restore("last_of_view", state)

    @property
    def _ends(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.links["source"], self.links["target"], self.links["ends"]

    @property
    def _tree(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        links = self.links
        return self.experiences["reached_by"], links["source"], links["motion"], links["time"]

    @property
    def _graph(self) -> Graph:
        links = self.links
        return (*self._ends, links["time"], links["motion"], self.experiences["entry"])

    @property
    def _home_ways(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        table = self.experiences
        return table["time"], table["length"], table["onward"]


Graph = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Links' sources, targets, ends, times and motions; experiences' first ends."""
Ways = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Of each experience time (s) and length (m) of its way, and the next experience on it."""


@kernel()
def most_energetic(
    last: int,
    same_view: np.ndarray,
    cells: np.ndarray,
    packet: tuple[float, float, float],
    shape: tuple[int, int, int],
    zone: tuple[float, float],
    either: bool,
) -> int:
    """The experience of a view with the most energy, which is positive; -1 where there is none."""
    found, most = -1, 0.0
    i = last
    while i >= 0:  # Eq. (8): E_V is 1 for these, and 0 for all others.
        x = _apart(packet[0], cells[i, 0], shape[0])
        y = _apart(packet[1], cells[i, 1], shape[1])
        r = math.sqrt(x * x + y * y)  # Eq. (2).
        turn = _apart(packet[2], cells[i, 2], shape[2])  # Eq. (5).
        near = 0.0 if r > zone[0] else 1.0 - r / zone[0]  # Eq. (3), (4).
        aligned = 0.0 if turn > zone[1] else 1.0 - turn / zone[1]  # Eq. (6), (7).
        # Eq. (9), within the zone of all variables.
        energy = near + aligned if either or (near > 0.0 and aligned > 0.0) else 0.0
        if energy > most:
            found, most = i, energy
        i = same_view[i]
    return found


@kernel()
def _apart(one: float, other: float, length: int) -> float:
    """How far two places are apart along an axis that wraps round."""
    apart = abs(one - other)
    return min(apart, length - apart)


@kernel()
def find_link(
    source: int, target: int, entry: np.ndarray, ends: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> int:
    """The link from one experience to another; -1 where there is none."""
    sources, targets, following = ends
    end = entry[source]
    while end >= 0:
        link = end >> 1
        if sources[link] == source and targets[link] == target:
            return int(link)
        end = following[link, end & 1]
    return -1


@kernel()
def shorten(link: int, ways: Ways, graph: Graph, queue: np.ndarray) -> None:
    """Let ways lead over a link that is new or has become quicker."""
    sources, targets = graph[0], graph[1]
    i, j = sources[link], targets[link]
    if _shortens(j, i, link, ways, graph):
        spread_ways(j, ways, graph, queue)
    elif _shortens(i, j, link, ways, graph):
        spread_ways(i, ways, graph, queue)


@kernel()
def _shortens(i: int, j: int, link: int, ways: Ways, graph: Graph) -> bool:
    """Let the way of one experience lead over a link to another, if that is quicker."""
    times, lengths, onward = ways
    if not times[j] + graph[3][link] < times[i]:
        return False
    x, y = graph[4][link, 0], graph[4][link, 1]
    times[i] = times[j] + graph[3][link]
    lengths[i] = lengths[j] + math.sqrt(x * x + y * y)
    onward[i] = j
    return True


@kernel()
def spread_ways(start: int, ways: Ways, graph: Graph, queue: np.ndarray) -> None:
    """Let all ways that become quicker lead over an experience.

    Label correcting, first in first out. `queue` (experiences,) is zeros, and holds the next in the
    queue of each, plus one.
    """
    sources, targets, following, entry = graph[0], graph[1], graph[2], graph[5]
    first = last = start
    queue[start] = start + 1  # The last one in the queue names itself.
    while first >= 0:
        i = first
        end = entry[i]
        while end >= 0:
            link = end >> 1
            j = targets[link] if end & 1 == 0 else sources[link]
            if _shortens(j, i, link, ways, graph) and queue[j] == 0:
                queue[last] = j + 1
                queue[j] = j + 1
                last = j
            end = following[link, end & 1]
        first = queue[i] - 1 if i != last else -1
        queue[i] = 0


@kernel()
def has_moved(poses: np.ndarray, before: np.ndarray, far: float) -> bool:
    """Whether a pose has moved so far (m)."""
    for i in range(poses.shape[0]):
        x, y = poses[i, 0] - before[i, 0], poses[i, 1] - before[i, 1]
        if x * x + y * y > far * far:
            return True
    return False
